//! Strict reading of text files of numbers.

use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use sdslam_core::MapPose;

use super::DatasetError;

/// Largest entry of `R^T R - I` that rounding in a text file explains.
const MAX_SKEW: f64 = 1e-2;

/// The whole file as text; other bytes than UTF-8 are replaced, and so refused where a number is expected.
pub fn read(path: &Path) -> Result<String, DatasetError> {
    let bytes = std::fs::read(path).map_err(DatasetError::read(path))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The lines with something on them, numbered from 1. `#` starts a comment line.
pub fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let used = |line: &str| !line.is_empty() && !line.starts_with('#');
    text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())).filter(move |(_, line)| used(line))
}

/// Exactly `N` finite numbers, separated by white space or commas.
pub fn numbers<const N: usize>(line: &str) -> Result<[f64; N], String> {
    let mut out = [0.0; N];
    let mut count = 0;
    for word in line.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty()) {
        let value: f64 = word.parse().map_err(|_| format!("{word:?} is not a number"))?;
        if !value.is_finite() {
            return Err(format!("{word:?} is not a finite number"));
        }
        if let Some(slot) = out.get_mut(count) {
            *slot = value;
        }
        count += 1;
    }
    if count == N { Ok(out) } else { Err(format!("found {count} numbers, expected {N}")) }
}

/// A rigid transform from the upper 3x4 part of its matrix, row by row.
pub fn rigid_transform(line: &str) -> Result<MapPose, String> {
    let m = numbers::<12>(line)?;
    let matrix = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let skew = (matrix.transpose() * matrix - Matrix3::identity()).abs().max();
    // Entries first: huge ones would overflow to NaN, which compares as anything.
    let bounded = matrix.iter().all(|entry| entry.abs() < 2.0);
    if !bounded || skew > MAX_SKEW || matrix.determinant() < 0.0 {
        return Err("the first three columns of the 3x4 matrix are not a rotation".into());
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&nearest_rotation(&matrix));
    Ok(MapPose::from_parts(Translation3::from(Vector3::new(m[3], m[7], m[11])), rotation))
}

/// Files hold rotations rounded to some digits: one Newton step towards the polar factor squares the error.
fn nearest_rotation(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    let mut r = *matrix;
    for _ in 0..3 {
        r = r * (Matrix3::identity() * 3.0 - r.transpose() * r) * 0.5;
    }
    Rotation3::from_matrix_unchecked(r)
}
