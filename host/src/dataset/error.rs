//! What can be wrong with a drive on disk.

use std::io;
use std::path::{Path, PathBuf};

/// Why a drive or one of its files could not be read; every kind names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A folder or file of the layout is not there.
    #[error("{what} not found: {path}; {hint}")]
    Missing {
        /// What was looked for.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// What to do about it.
        hint: &'static str,
    },
    /// The data set has no such sequence.
    #[error("sequence {sequence} not found: {path}; {available}")]
    SequenceNotFound {
        /// The name asked for.
        sequence: String,
        /// Where it was looked for.
        path: PathBuf,
        /// The sequences that exist, in words.
        available: String,
    },
    /// The velodyne folder holds no numbered `.bin` file.
    #[error("no scans (NNNNNN.bin) in {path}")]
    NoScans {
        /// The velodyne folder.
        path: PathBuf,
    },
    /// A scan between the first and the last is not there. The rest of the drive can still be read.
    #[error("scan {path} is missing")]
    MissingFrame {
        /// The file that should be there.
        path: PathBuf,
    },
    /// A scan's size is no whole number of points.
    #[error(
        "{path} has {bytes} bytes, which is no multiple of 16 (x y z remission as float32): cut off or not a scan"
    )]
    ScanSize {
        /// The scan.
        path: PathBuf,
        /// Its size.
        bytes: usize,
    },
    /// A label file's size is no whole number of labels.
    #[error(
        "{path} has {bytes} bytes, which is no multiple of 4 (uint32 a point): cut off or not a label file"
    )]
    LabelSize {
        /// The label file.
        path: PathBuf,
        /// Its size.
        bytes: usize,
    },
    /// A label file belongs to another scan.
    #[error("{path} has {labels} labels, but its scan has {points} points")]
    LabelCount {
        /// The label file.
        path: PathBuf,
        /// Labels found.
        labels: usize,
        /// Points in the scan.
        points: usize,
    },
    /// The drive's time stamps end too early.
    #[error("{path} has {stamps} time stamps, but the scans go up to number {last} (line {} is theirs)", last + 1)]
    TimesTooShort {
        /// times.txt.
        path: PathBuf,
        /// Lines found.
        stamps: usize,
        /// Number of the last scan file.
        last: usize,
    },
    /// A text file holds something else than it should.
    #[error("{path}, line {line}: {problem}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What was found and what is expected.
        problem: String,
    },
    /// The operating system's word.
    #[error("cannot read {path}")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

impl DatasetError {
    pub(crate) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Read { path: path.into(), source }
    }
}
