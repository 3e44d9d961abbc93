//! Why a saved map cannot be used.

use std::path::PathBuf;

/// A fault of a saved map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SavedMapError {
    /// It cannot be read.
    #[error("cannot read the map {}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is something else.
    #[error("{} is no map of sdslam; make one with `sdslam run --save-map`", .file.display())]
    Foreign {
        /// The file.
        file: PathBuf,
    },
    /// It was written by another version.
    #[error("the map {} has version {found}, this program reads {expected}; make it anew", .file.display())]
    Version {
        /// The file.
        file: PathBuf,
        /// Version that is read.
        expected: u32,
        /// Version found.
        found: u32,
    },
    /// It has not the length it should have.
    #[error("the map {} has {found} bytes, expected {expected}: it was cut short or added to", .file.display())]
    Truncated {
        /// The file.
        file: PathBuf,
        /// Bytes it should have.
        expected: u64,
        /// Bytes it has.
        found: u64,
    },
    /// Its content is not what was written.
    #[error("the map {} is damaged: {fault}", .file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        fault: &'static str,
    },
}
