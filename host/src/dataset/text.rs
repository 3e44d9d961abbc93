//! Strict reading of text files of numbers.

use std::path::Path;

use nalgebra::{Matrix3, Matrix3x4, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3};
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

/// The matrix whose upper 3x4 part is in the line, row by row. Its rotation may be off by rounding.
pub fn rigid_matrix(line: &str) -> Result<Matrix4<f64>, String> {
    let mut matrix = Matrix4::identity();
    matrix.fixed_view_mut::<3, 4>(0, 0).copy_from(&Matrix3x4::from_row_slice(&numbers::<12>(line)?));
    let rotation = matrix.fixed_view::<3, 3>(0, 0);
    let skew = (rotation.transpose() * rotation - Matrix3::identity()).abs().max();
    // Entries first: huge ones would overflow to NaN, which compares as anything.
    let bounded = rotation.iter().all(|entry| entry.abs() < 2.0);
    if !bounded || skew > MAX_SKEW || rotation.determinant() < 0.0 {
        return Err("the first three columns of the 3x4 matrix are not a rotation".into());
    }
    Ok(matrix)
}

/// The rigid transform nearest to the matrix in the line.
pub fn rigid_transform(line: &str) -> Result<MapPose, String> {
    let matrix = rigid_matrix(line)?;
    let rotation = nearest_rotation(matrix.fixed_view::<3, 3>(0, 0).into());
    let translation: Vector3<f64> = matrix.fixed_view::<3, 1>(0, 3).into();
    Ok(MapPose::from_parts(Translation3::from(translation), UnitQuaternion::from_rotation_matrix(&rotation)))
}

/// Files hold rotations rounded to some digits. Every Newton step towards the polar factor squares the error.
fn nearest_rotation(mut r: Matrix3<f64>) -> Rotation3<f64> {
    for _ in 0..3 {
        r = r * (Matrix3::identity() * 3.0 - r.transpose() * r) * 0.5;
    }
    Rotation3::from_matrix_unchecked(r)
}
