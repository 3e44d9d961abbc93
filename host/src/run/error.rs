//! Why a run cannot start or go on.

use std::path::PathBuf;

use sdslam_core::{OdometryError, ParameterError};

use crate::config::ConfigError;
use crate::dataset::DatasetError;
use crate::evaluate::EvaluateError;
use crate::pose_graph::GraphError;
use crate::saved_map::SavedMapError;

/// Why a run stopped. Faults of single scans do not stop it: they are counted and written to run.log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The drive cannot be read.
    #[error("cannot read the drive")]
    Dataset(#[from] DatasetError),
    /// The first scan cannot be read: there is nothing to start from.
    #[error("cannot read the first scan of the run")]
    FirstScan(#[source] DatasetError),
    /// The range of frames does not lie in the drive.
    #[error("frames {first}..{end} are not in the drive, which has {available} frames (0..{available})")]
    Frames {
        /// First frame asked for.
        first: usize,
        /// End of the range, itself not in it.
        end: usize,
        /// Frames in the drive.
        available: usize,
    },
    /// The configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A parameter is outside its range.
    #[error("the configuration cannot be used")]
    Parameter(#[from] ParameterError),
    /// The core refused a scan.
    #[error("the odometry refused frame {frame}")]
    Odometry {
        /// Frame number in the drive.
        frame: usize,
        /// What it says.
        source: OdometryError,
    },
    /// The odometry's memory could not be set up.
    #[error("cannot set up the odometry of {bytes} bytes")]
    Memory {
        /// Its size.
        bytes: usize,
        /// What the system says, if it spoke.
        source: Option<std::io::Error>,
    },
    /// The pose graph cannot be built or solved.
    #[error("the pose graph failed")]
    Graph(#[from] GraphError),
    /// The saved map cannot be used.
    #[error(transparent)]
    SavedMap(#[from] SavedMapError),
    /// Results do not go together with what they are compared with.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// Something cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Why an output cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// There is something already.
    #[error("{} is not empty; give another --out, or --overwrite to replace the files of an earlier run", .path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// There is such a file already.
    #[error("{} is there already; give another path, or --overwrite to replace it", .path.display())]
    FileExists {
        /// The file.
        path: PathBuf,
    },
    /// The folder or file cannot be written.
    #[error("cannot write {}", .path.display())]
    Write {
        /// The folder or file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}
