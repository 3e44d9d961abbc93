//! Errors of a trajectory: t_rel and r_rel by the KITTI odometry devkit's definition, ATE, RPE.

use std::fmt;

use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use sdslam_core::MapPose;
use serde::Serialize;

/// The devkit's segment lengths [m], and every how many frames a segment starts.
const DEVKIT: ([f64; 8], usize) = ([100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0], 10);
/// The same for drives that are not longer than the devkit's shortest segment.
const SHORT: ([f64; 8], usize) = ([10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0], 1);

/// Errors of an estimated trajectory. A value that the drive is too short for is none, so is one beyond all bounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrajectoryErrors {
    /// Poses compared: the first ones, up to the shorter trajectory.
    pub frames: usize,
    /// Poses in the ground truth.
    pub ground_truth_frames: usize,
    /// Length of the ground truth over the compared poses [m].
    pub path_length_m: f64,
    /// Whether the segments are the devkit's, 100 to 800 m from every 10th frame. Drives up to 100 m are measured
    /// over 10 to 80 m from every frame: such figures do not compare with published ones.
    pub devkit_lengths: bool,
    /// Segments compared.
    pub segments: usize,
    /// Translation error over the segment's length, mean of all segments [%].
    pub t_rel_percent: Option<f64>,
    /// Rotation error over the segment's length, mean of all segments [deg/100 m].
    pub r_rel_deg_per_100m: Option<f64>,
    /// The same per length of segment.
    pub per_length: Vec<LengthErrors>,
    /// Absolute trajectory error: RMS of the positions after the best rigid alignment, no scale [m].
    pub ate_m: Option<f64>,
    /// Relative pose error: RMS of the translation from one frame to the next [m].
    pub rpe_m: Option<f64>,
    /// RMS of the rotation from one frame to the next [deg].
    pub rpe_deg: Option<f64>,
}

/// Mean errors over the segments of one length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LengthErrors {
    /// The segments' length [m].
    pub length_m: f64,
    /// Segments compared.
    pub segments: usize,
    /// Translation error [%].
    pub t_rel_percent: f64,
    /// Rotation error [deg/100 m].
    pub r_rel_deg_per_100m: f64,
}

/// Compares an estimate with the ground truth, pose by pose; both in the same frame of the vehicle (camera poses, where
/// figures are to compare with KITTI's). The two may start at different poses.
pub fn trajectory_errors(ground_truth: &[MapPose], estimate: &[MapPose]) -> TrajectoryErrors {
    let matrices = |poses: &[MapPose]| poses.iter().map(|pose| pose.to_homogeneous()).collect::<Vec<_>>();
    matrix_errors(&matrices(ground_truth), &matrices(estimate))
}

/// [`trajectory_errors`] of matrices as they are in KITTI's files: like the devkit, it takes them at their word. Where the
/// rotations are not quite rotations (products of many single-precision ones), r_rel differs from that of the nearest
/// rotations, by up to 10 % for one published trajectory.
pub fn matrix_errors(ground_truth: &[Matrix4<f64>], estimate: &[Matrix4<f64>]) -> TrajectoryErrors {
    let frames = ground_truth.len().min(estimate.len());
    let (truth, estimate) = (&ground_truth[..frames], &estimate[..frames]);
    let distances_m = path_distances(truth);
    let path_length_m = distances_m.last().copied().unwrap_or(0.0);
    let devkit_lengths = path_length_m > DEVKIT.0[0];
    let (lengths_m, step) = if devkit_lengths { DEVKIT } else { SHORT };
    let per_length =
        lengths_m.map(|length_m| Segments::measure(truth, estimate, &distances_m, length_m, step));
    let total = per_length.iter().fold(Segments::default(), Segments::add);
    let rpe = frame_errors(truth, estimate);
    TrajectoryErrors {
        frames,
        ground_truth_frames: ground_truth.len(),
        path_length_m,
        devkit_lengths,
        segments: total.count,
        t_rel_percent: total.mean().map(|mean| mean.0).filter(|t_rel| t_rel.is_finite()),
        r_rel_deg_per_100m: total.mean().map(|mean| mean.1).filter(|r_rel| r_rel.is_finite()),
        per_length: per_length.iter().filter_map(Segments::report).collect(),
        ate_m: absolute_error(truth, estimate).filter(|ate| ate.is_finite()),
        rpe_m: rpe.map(|rpe| rpe.0).filter(|rpe| rpe.is_finite()),
        rpe_deg: rpe.map(|rpe| rpe.1).filter(|rpe| rpe.is_finite()),
    }
}

/// Sums over segments; errors are per metre of the segment.
#[derive(Default)]
struct Segments {
    length_m: f64,
    count: usize,
    translation: f64,
    rotation_rad: f64,
}

impl Segments {
    fn measure(
        truth: &[Matrix4<f64>],
        estimate: &[Matrix4<f64>],
        distances_m: &[f64],
        length_m: f64,
        step: usize,
    ) -> Self {
        let mut sum = Self { length_m, ..Self::default() };
        for start in (0..truth.len()).step_by(step) {
            // The segment ends at the first frame that is farther along than its length.
            let end = distances_m.partition_point(|&d| d <= distances_m[start] + length_m);
            if end == truth.len() {
                break;
            }
            let error = relative_error(truth, estimate, start, end);
            sum.count += 1;
            sum.translation += position(&error).norm() / length_m;
            sum.rotation_rad += angle_rad(&error) / length_m;
        }
        sum
    }

    fn add(self, other: &Self) -> Self {
        Self {
            length_m: 0.0,
            count: self.count + other.count,
            translation: self.translation + other.translation,
            rotation_rad: self.rotation_rad + other.rotation_rad,
        }
    }

    /// t_rel [%] and r_rel [deg/100 m].
    fn mean(&self) -> Option<(f64, f64)> {
        let n = self.count as f64;
        (self.count > 0).then(|| (100.0 * self.translation / n, 100.0 * (self.rotation_rad / n).to_degrees()))
    }

    fn report(&self) -> Option<LengthErrors> {
        let (t_rel_percent, r_rel_deg_per_100m) = self.mean()?;
        Some(LengthErrors {
            length_m: self.length_m,
            segments: self.count,
            t_rel_percent,
            r_rel_deg_per_100m,
        })
    }
}

/// Distance driven up to each pose [m].
fn path_distances(poses: &[Matrix4<f64>]) -> Vec<f64> {
    let mut driven_m = 0.0;
    let mut previous = poses.first();
    let advance = |pose| {
        driven_m += previous.map_or(0.0, |from| (position(from) - position(pose)).norm());
        previous = Some(pose);
        driven_m
    };
    poses.iter().map(advance).collect()
}

fn position(pose: &Matrix4<f64>) -> Vector3<f64> {
    pose.fixed_view::<3, 1>(0, 3).into()
}

/// Angle of a rotation matrix [rad].
fn angle_rad(pose: &Matrix4<f64>) -> f64 {
    let cos = (pose.fixed_view::<3, 3>(0, 0).trace() - 1.0) / 2.0;
    cos.clamp(-1.0, 1.0).acos()
}

/// The same; keeps its digits at small angles.
fn small_angle_rad(pose: &Matrix4<f64>) -> f64 {
    let axis =
        Vector3::new(pose[(2, 1)] - pose[(1, 2)], pose[(0, 2)] - pose[(2, 0)], pose[(1, 0)] - pose[(0, 1)]);
    (axis.norm() / 2.0).atan2((pose.fixed_view::<3, 3>(0, 0).trace() - 1.0) / 2.0)
}

/// What is left of the true motion from frame i to frame j after undoing the estimated one.
fn relative_error(truth: &[Matrix4<f64>], estimate: &[Matrix4<f64>], i: usize, j: usize) -> Matrix4<f64> {
    inverse(&motion(estimate, i, j)) * motion(truth, i, j)
}

fn motion(poses: &[Matrix4<f64>], i: usize, j: usize) -> Matrix4<f64> {
    inverse(&poses[i]) * poses[j]
}

/// Matrices that are rigid within rounding have an inverse.
fn inverse(pose: &Matrix4<f64>) -> Matrix4<f64> {
    pose.try_inverse().unwrap_or_else(Matrix4::identity)
}

/// RPE over one frame [m], [deg].
fn frame_errors(truth: &[Matrix4<f64>], estimate: &[Matrix4<f64>]) -> Option<(f64, f64)> {
    let pairs = truth.len().checked_sub(1).filter(|&pairs| pairs > 0)?;
    let errors = (0..pairs).map(|i| relative_error(truth, estimate, i, i + 1));
    let (t2, r2) = errors.fold((0.0, 0.0), |(t2, r2), error| {
        (t2 + position(&error).norm_squared(), r2 + small_angle_rad(&error).powi(2))
    });
    let rms = |sum: f64| (sum / pairs as f64).sqrt();
    Some((rms(t2), rms(r2).to_degrees()))
}

/// ATE after rigid alignment [m].
fn absolute_error(truth: &[Matrix4<f64>], estimate: &[Matrix4<f64>]) -> Option<f64> {
    let truth_from_estimate = align(truth, estimate)?;
    let residuals = truth.iter().zip(estimate).map(|(truth, estimate)| {
        (truth_from_estimate * Point3::from(position(estimate))).coords - position(truth)
    });
    Some((residuals.map(|r| r.norm_squared()).sum::<f64>() / truth.len() as f64).sqrt())
}

/// The rigid transform that brings the estimated positions closest to the true ones (Umeyama, without scale).
fn align(truth: &[Matrix4<f64>], estimate: &[Matrix4<f64>]) -> Option<MapPose> {
    let centre =
        |poses: &[Matrix4<f64>]| poses.iter().map(position).sum::<Vector3<f64>>() / poses.len() as f64;
    let (truth_centre, estimate_centre) = (centre(truth), centre(estimate));
    let mut covariance = Matrix3::zeros();
    for (truth, estimate) in truth.iter().zip(estimate) {
        covariance += (position(truth) - truth_centre) * (position(estimate) - estimate_centre).transpose();
    }
    if truth.is_empty() || !covariance.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let svd = covariance.try_svd(true, true, f64::EPSILON, 1000)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    // Of the two solutions the one that does not mirror.
    let sign = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * sign * v_t));
    let translation = truth_centre - rotation * estimate_centre;
    Some(MapPose::from_parts(Translation3::from(translation), rotation))
}

impl fmt::Display for TrajectoryErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames =
            format!("{} of {} frames, {:.1} m", self.frames, self.ground_truth_frames, self.path_length_m);
        writeln!(f, "compared        {frames}")?;
        let lengths =
            if self.devkit_lengths { "100..800 m" } else { "10..80 m, not the devkit's: short drive" };
        writeln!(f, "segments        {} of {lengths}", self.segments)?;
        row(f, "t_rel", self.t_rel_percent, "%")?;
        row(f, "r_rel", self.r_rel_deg_per_100m, "deg/100 m")?;
        row(f, "ATE (aligned)", self.ate_m, "m")?;
        row(f, "RPE translation", self.rpe_m, "m/frame")?;
        row(f, "RPE rotation", self.rpe_deg, "deg/frame")?;
        for at in &self.per_length {
            let (t, r) = (at.t_rel_percent, at.r_rel_deg_per_100m);
            writeln!(f, "  {:4} m  {t:8.4} %  {r:8.4} deg/100 m  {:5} segments", at.length_m, at.segments)?;
        }
        Ok(())
    }
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, value: Option<f64>, unit: &str) -> fmt::Result {
    match value {
        Some(value) => writeln!(f, "{name:15} {value:.4} {unit}"),
        None => writeln!(f, "{name:15} -"),
    }
}
