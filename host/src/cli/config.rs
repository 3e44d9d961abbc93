//! `sdslam config`.

use super::{CliError, print};
use crate::config::{HostConfig, Preset};

/// Print the configuration: every parameter with its unit, meaning and default.
///
/// The output is a file for `sdslam run --config`. Such a file may hold any part of it: what it leaves out comes from
/// the preset.
///
/// Example: sdslam config > my.toml
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Values to print: `accurate` (the default of a run) or `paper` (nothing but the paper).
    #[arg(long, value_name = "PRESET", default_value = "accurate")]
    preset: Preset,
}

impl Args {
    pub(super) fn execute(&self) -> Result<(), CliError> {
        print(HostConfig::of_preset(self.preset).render())
    }
}
