//! Why two things cannot be compared.

use std::path::PathBuf;

use crate::dataset::DatasetError;

/// Why an evaluation was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// An input cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// One trajectory has time stamps, the other has none.
    #[error(
        "{ground_truth} and {estimate} are of different formats: convert one, both have to be KITTI (12 numbers a line) \
         or TUM (8)"
    )]
    MixedFormats {
        /// The reference file.
        ground_truth: PathBuf,
        /// The file to be judged.
        estimate: PathBuf,
    },
    /// No pose of one trajectory belongs to one of the other.
    #[error("no pose of {estimate} is within {max_difference_s} s of one of {ground_truth}")]
    NothingAssociated {
        /// The reference file.
        ground_truth: PathBuf,
        /// The file to be judged.
        estimate: PathBuf,
        /// Largest difference of time stamps allowed [s].
        max_difference_s: f64,
    },
    /// A folder without a `.label` file.
    #[error("no .label file in {path}")]
    NoLabels {
        /// The folder.
        path: PathBuf,
    },
    /// Labels that are not of the same points.
    #[error("{labels} labels cannot be compared with {ground_truth} of the ground truth{}", in_file(file))]
    LabelCounts {
        /// The file of the labels to be judged, where they come from one.
        file: Option<PathBuf>,
        /// Labels in the ground truth.
        ground_truth: usize,
        /// Labels to be judged.
        labels: usize,
    },
    /// Not one pose a scan.
    #[error("{poses} poses for {frames} frames (of {all} in the drive): one pose a frame is needed")]
    PoseCount {
        /// Poses given.
        poses: usize,
        /// Frames asked for.
        frames: usize,
        /// Frames in the drive.
        all: usize,
    },
    /// An option outside its range.
    #[error("{option} must be {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What is allowed.
        expected: &'static str,
    },
    /// The frames make no map to speak of.
    #[error(
        "no place in the map has enough points within {radius_m} m: {frames} scans were used, and a local map takes at \
         least half a window of {window} frames"
    )]
    EmptyMap {
        /// Scans used.
        frames: usize,
        /// Frames a local map.
        window: usize,
        /// Radius of a neighbourhood [m].
        radius_m: f64,
    },
}

fn in_file(file: &Option<PathBuf>) -> String {
    file.as_ref().map(|path| format!(": {}", path.display())).unwrap_or_default()
}
