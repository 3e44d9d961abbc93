//! Why a drive could not be simulated.

use std::{io, path::PathBuf};

/// Why a drive could not be simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// An option outside its range.
    #[error("option {parameter} of the simulation must be {expected}")]
    Parameter {
        /// Name of the option.
        parameter: &'static str,
        /// What is allowed.
        expected: &'static str,
    },
    /// The sequence folder exists already.
    #[error("{} exists already: choose another folder or sequence, or allow overwriting", path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// The sequence folder holds more scans than would be replaced.
    #[error("{} is no scan of this drive of {frames} frames: remove it, or choose another folder", path.display())]
    Leftover {
        /// The file that would be left over.
        path: PathBuf,
        /// Number of frames of the drive.
        frames: usize,
    },
    /// A file could not be written, or a folder not made or read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl SimulateError {
    /// Names the file of a system error.
    pub(super) fn io(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }
}
