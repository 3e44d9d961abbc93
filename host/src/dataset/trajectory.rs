//! Trajectory files: KITTI (a line is the upper 3x4 part of a pose's matrix, row by row) and TUM
//! (`stamp tx ty tz qx qy qz qw`). Lines that are empty or begin with `#` are skipped; everything else must be right.

use std::fmt::Write;
use std::path::Path;

use nalgebra::{Matrix4, Quaternion, Translation3, UnitQuaternion};
use sdslam_core::MapPose;

use super::{DatasetError, text};

/// How far a quaternion's norm may be from one: files hold it rounded to a few digits.
const MAX_NORM_ERROR: f64 = 0.02;

/// A trajectory as its file holds it.
#[derive(Debug, Clone, PartialEq)]
pub enum Trajectory {
    /// KITTI: one matrix a frame, its rotation as good as the file's digits.
    Kitti(Vec<Matrix4<f64>>),
    /// TUM: time stamp [s] and pose.
    Tum(Vec<(f64, MapPose)>),
}

/// Reads either format; the number of columns in the first line tells which.
pub fn read(path: &Path) -> Result<Trajectory, DatasetError> {
    let text = text::read(path)?;
    match text::lines(&text).next() {
        Some((_, line)) if text::numbers::<8>(line).is_ok() => {
            parse(path, &text, tum_line).map(Trajectory::Tum)
        }
        _ => parse(path, &text, text::rigid_matrix).map(Trajectory::Kitti),
    }
}

/// Reads a KITTI file: one pose a line, the rotation nearest to the matrix.
pub fn read_kitti(path: &Path) -> Result<Vec<MapPose>, DatasetError> {
    parse(path, &text::read(path)?, text::rigid_transform)
}

/// Reads a TUM file: time stamp [s] and pose a line, in the order of the file.
pub fn read_tum(path: &Path) -> Result<Vec<(f64, MapPose)>, DatasetError> {
    parse(path, &text::read(path)?, tum_line)
}

fn parse<T>(path: &Path, text: &str, one: fn(&str) -> Result<T, String>) -> Result<Vec<T>, DatasetError> {
    let at = |line, problem| DatasetError::Malformed { path: path.into(), line, problem };
    text::lines(text).map(|(line, words)| one(words).map_err(|problem| at(line, problem))).collect()
}

fn tum_line(line: &str) -> Result<(f64, MapPose), String> {
    let [stamp_s, tx, ty, tz, qx, qy, qz, qw] = text::numbers::<8>(line)?;
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    if (quaternion.norm() - 1.0).abs() > MAX_NORM_ERROR {
        return Err(format!("the quaternion (last four numbers) has norm {:.3}, not 1", quaternion.norm()));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    Ok((stamp_s, MapPose::from_parts(Translation3::new(tx, ty, tz), rotation)))
}

/// The text of a KITTI file.
pub fn write_kitti(poses: &[MapPose]) -> String {
    let mut out = String::new();
    for pose in poses {
        let matrix = pose.to_homogeneous();
        let entries = (0..12).map(|i| format!("{:.12e}", matrix[(i / 4, i % 4)]));
        out.push_str(&entries.collect::<Vec<_>>().join(" "));
        out.push('\n');
    }
    out
}

/// The text of a TUM file: one line for each stamp [s] and pose, up to the shorter of the two.
pub fn write_tum(stamps_s: &[f64], poses: &[MapPose]) -> String {
    let mut out = String::new();
    for (stamp_s, pose) in stamps_s.iter().zip(poses) {
        let (t, q) = (pose.translation, pose.rotation);
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{stamp_s:.9} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
            t.x, t.y, t.z, q.i, q.j, q.k, q.w
        );
    }
    out
}
