//! Writes a drive in the layout of KITTI odometry and SemanticKITTI.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use sdslam_core::MapPose;

use super::{error::SimulateError, options::Options, scan::Scan};
use crate::dataset::trajectory::write_kitti;

/// The folders of a drive.
#[derive(Clone, Debug)]
pub struct Layout {
    sequence: PathBuf,
    poses: PathBuf,
    interval_s: f64,
}

impl Layout {
    /// Makes the folders; refuses those of another drive.
    pub fn create(out: &Path, options: &Options) -> Result<Self, SimulateError> {
        let sequence = out.join("sequences").join(&options.sequence);
        let poses = out.join("poses").join(format!("{}.txt", options.sequence));
        let layout = Self { sequence, poses, interval_s: options.interval_s };
        if layout.sequence.exists() && !options.overwrite {
            return Err(SimulateError::Exists { path: layout.sequence });
        }
        for folder in [layout.velodyne(), layout.labels(), out.join("poses")] {
            fs::create_dir_all(&folder).map_err(SimulateError::io(&folder))?;
        }
        refuse_leftovers(&layout.velodyne(), options.frames)?;
        refuse_leftovers(&layout.labels(), options.frames)?;
        Ok(layout)
    }

    fn velodyne(&self) -> PathBuf {
        self.sequence.join("velodyne")
    }

    fn labels(&self) -> PathBuf {
        self.sequence.join("labels")
    }

    /// Writes the two files of a scan.
    pub fn write_scan(&self, frame: usize, scan: &Scan) -> Result<(), SimulateError> {
        let points = self.velodyne().join(format!("{frame:06}.bin"));
        write(&points, bytemuck::cast_slice(&scan.points))?;
        let labels = self.labels().join(format!("{frame:06}.label"));
        write(&labels, bytemuck::cast_slice(&scan.labels))
    }

    /// Writes calibration, stamps and poses; after the scans, so that a drive that has them is whole.
    pub fn write_tables(&self, town_from_sensor: &[MapPose]) -> Result<(), SimulateError> {
        write(&self.sequence.join("calib.txt"), calibration().as_bytes())?;
        let stamps: String = (0..town_from_sensor.len()).fold(String::new(), |mut text, frame| {
            let _ = writeln!(text, "{:.6e}", frame as f64 * self.interval_s);
            text
        });
        write(&self.sequence.join("times.txt"), stamps.as_bytes())?;
        write(&self.poses, camera_poses(town_from_sensor).as_bytes())
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), SimulateError> {
    fs::write(path, bytes).map_err(SimulateError::io(path))
}

/// Scans of a longer drive would mix with this one.
fn refuse_leftovers(folder: &Path, frames: usize) -> Result<(), SimulateError> {
    for entry in fs::read_dir(folder).map_err(SimulateError::io(folder))? {
        let path = entry.map_err(SimulateError::io(folder))?.path();
        let number = path.file_stem().and_then(|stem| stem.to_str()?.parse::<usize>().ok());
        if number.is_none_or(|number| number >= frames) {
            return Err(SimulateError::Leftover { path, frames });
        }
    }
    Ok(())
}

/// Camera (x right, y down, z forward) from sensor (x forward, y left, z up).
pub fn camera_from_sensor() -> MapPose {
    let turn = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Isometry3::from_parts(Translation3::new(0.0, -0.08, -0.27), rotation)
}

fn calibration() -> String {
    let mut text = String::new();
    for (camera, shift) in [0.0, -384.0, 43.0, -340.0].into_iter().enumerate() {
        let _ = writeln!(text, "P{camera}: 720 0 610 {shift} 0 720 180 0 0 0 1 0");
    }
    let _ = write!(text, "Tr: {}", write_kitti(&[camera_from_sensor()]));
    text
}

/// Poses of the left camera in its first frame.
fn camera_poses(town_from_sensor: &[MapPose]) -> String {
    let camera_from_sensor = camera_from_sensor();
    let Some(first) = town_from_sensor.first() else { return String::new() };
    let pose = |pose: &MapPose| camera_from_sensor * first.inverse() * pose * camera_from_sensor.inverse();
    write_kitti(&town_from_sensor.iter().map(pose).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<f64> {
        text.split_whitespace().filter_map(|word| word.parse().ok()).collect()
    }

    #[test]
    fn first_pose_is_identity_and_a_step_ahead_is_along_z() {
        let start = Isometry3::new([5.0, 2.0, 1.0].into(), [0.0, 0.0, 0.7].into());
        let poses = [start, start * Translation3::new(2.0, 0.0, 0.0)];
        let rows = numbers(&camera_poses(&poses));
        let expected = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        for k in 0..12 {
            assert!((rows[k] - expected[k]).abs() < 1e-12);
            let ahead = if k == 11 { 2.0 } else { expected[k] };
            assert!((rows[12 + k] - ahead).abs() < 1e-12, "{k}: {}", rows[12 + k]);
        }
    }

    #[test]
    fn calibration_has_five_lines_of_twelve_numbers() {
        let text = calibration();
        assert_eq!(text.lines().count(), 5);
        assert!(text.lines().all(|line| numbers(line).len() == 12), "{text}");
    }
}
