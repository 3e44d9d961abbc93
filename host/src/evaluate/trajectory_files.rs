//! Trajectory files against each other.

use std::path::Path;

use sdslam_core::MapPose;

use super::{EvaluateError, TrajectoryErrors, matrix_errors, trajectory_errors};
use crate::dataset::trajectory::{self, Trajectory};

/// Poses of two TUM files belong together when their stamps differ by no more than this [s].
pub const MAX_STAMP_DIFFERENCE_S: f64 = 0.01;

/// Compares two files, both KITTI (line by line) or both TUM (by time stamp).
pub fn trajectory_files(ground_truth: &Path, estimate: &Path) -> Result<TrajectoryErrors, EvaluateError> {
    match (trajectory::read(ground_truth)?, trajectory::read(estimate)?) {
        (Trajectory::Kitti(truth), Trajectory::Kitti(poses)) => Ok(matrix_errors(&truth, &poses)),
        (Trajectory::Tum(truth), Trajectory::Tum(poses)) => {
            let (ground_truth_frames, pairs) =
                (truth.len(), associate(&truth, &poses, MAX_STAMP_DIFFERENCE_S));
            if pairs.is_empty() {
                return Err(EvaluateError::NothingAssociated {
                    ground_truth: ground_truth.into(),
                    estimate: estimate.into(),
                    max_difference_s: MAX_STAMP_DIFFERENCE_S,
                });
            }
            let (truth, poses): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
            Ok(TrajectoryErrors { ground_truth_frames, ..trajectory_errors(&truth, &poses) })
        }
        _ => {
            Err(EvaluateError::MixedFormats { ground_truth: ground_truth.into(), estimate: estimate.into() })
        }
    }
}

/// Pairs the poses of two stamped trajectories: each of the shorter one with the nearest in time of the longer one, where
/// that is near enough. The pairs are in order of time, ground truth first.
pub fn associate(
    ground_truth: &[(f64, MapPose)],
    estimate: &[(f64, MapPose)],
    max_difference_s: f64,
) -> Vec<(MapPose, MapPose)> {
    if estimate.len() > ground_truth.len() {
        let swapped = associate(estimate, ground_truth, max_difference_s);
        return swapped.into_iter().map(|(estimate, truth)| (truth, estimate)).collect();
    }
    let (long, short) = (in_order(ground_truth), in_order(estimate));
    let near = |(stamp_s, pose): &(f64, MapPose)| {
        let (nearest_s, partner) = nearest(&long, *stamp_s)?;
        ((nearest_s - stamp_s).abs() <= max_difference_s).then_some((*partner, *pose))
    };
    short.iter().filter_map(near).collect()
}

fn in_order(trajectory: &[(f64, MapPose)]) -> Vec<(f64, MapPose)> {
    let mut sorted = trajectory.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    sorted
}

fn nearest(sorted: &[(f64, MapPose)], stamp_s: f64) -> Option<&(f64, MapPose)> {
    let after = sorted.partition_point(|at| at.0 < stamp_s);
    let candidates = &sorted[after.saturating_sub(1)..(after + 1).min(sorted.len())];
    candidates.iter().min_by(|a, b| (a.0 - stamp_s).abs().total_cmp(&(b.0 - stamp_s).abs()))
}
