//! Every way in which a command can fail, and its exit code.

use crate::config::ConfigError;
use crate::dataset::DatasetError;
use crate::evaluate::EvaluateError;
use crate::run::RunError;
use crate::simulate::SimulateError;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CliError {
    /// Options that do not go together.
    #[error("{0}")]
    Usage(String),
    /// A drive or a trajectory cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The configuration is not valid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A run stopped.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Two things cannot be compared.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The simulation cannot be written.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// Nothing can be printed.
    #[error("cannot write to the standard output")]
    Stdout(#[source] std::io::Error),
}

impl CliError {
    /// The program's exit code for this error; `sdslam --help` lists them.
    pub fn exit_code(&self) -> u8 {
        const FAILED: u8 = 1;
        const USAGE: u8 = 2;
        const INPUT: u8 = 3;
        const OUTPUT: u8 = 4;
        const CONFIGURATION: u8 = 5;
        match self {
            Self::Usage(_)
            | Self::Run(RunError::Frames { .. })
            | Self::Evaluate(EvaluateError::Option { .. })
            | Self::Simulate(SimulateError::Parameter { .. }) => USAGE,
            Self::Dataset(_)
            | Self::Evaluate(_)
            | Self::Run(RunError::Dataset(_) | RunError::FirstScan(_) | RunError::SavedMap(_)) => INPUT,
            Self::Simulate(_) | Self::Run(RunError::Output(_)) | Self::Stdout(_) => OUTPUT,
            Self::Config(_) | Self::Run(RunError::Config(_) | RunError::Parameter(_)) => CONFIGURATION,
            Self::Run(
                RunError::Odometry { .. }
                | RunError::Memory { .. }
                | RunError::Graph(_)
                | RunError::Evaluate(_),
            ) => FAILED,
        }
    }
}
