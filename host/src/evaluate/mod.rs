//! How good a result is: trajectories against ground truth, labels against labels, and maps without any reference.
//!
//! The measures are the usual ones, so that figures compare with those of others: t_rel and r_rel of the KITTI
//! odometry devkit, ATE and RPE as evo has them, the IoU of semantic-kitti-api, and the mean map entropy.

mod error;
mod grid;
mod labels;
mod map_entropy;
mod trajectory;
mod trajectory_files;

pub use error::EvaluateError;
pub use labels::{ClassIou, LabelConfusion, LabelErrors, label_folders};
pub use map_entropy::{MapEntropy, MapEntropyOptions, map_entropy, map_from_sensor};
pub use trajectory::{LengthErrors, TrajectoryErrors, matrix_errors, trajectory_errors};
pub use trajectory_files::{MAX_STAMP_DIFFERENCE_S, associate, trajectory_files};
