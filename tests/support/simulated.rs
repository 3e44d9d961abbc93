//! Short drives through the simulated town of `sdslam simulate`.

use nalgebra::Isometry3;
use sdslam::dataset::{Sequence, labels};
use sdslam::simulate::{Options, SensorOptions, simulate};
use sdslam_core::{LabelledPoint, MapPose};

use crate::drive::{Drive, Frame};

/// A simulated drive, and which of its points move.
pub struct Simulated {
    /// The scans.
    pub drive: Drive,
    /// For every point of every scan: it moves.
    pub moving: Vec<Vec<bool>>,
}

/// Options of a drive that is quick to simulate: fewer columns than the real sensor.
pub fn options(frames: usize) -> Options {
    Options { frames, sensor: SensorOptions { columns: 720, ..SensorOptions::default() }, ..Options::demo() }
}

/// Simulates a drive and reads it back.
pub fn simulated(options: &Options) -> Simulated {
    let folder = tempfile::tempdir().expect("a temporary folder");
    simulate(options, folder.path(), &mut |_, _| {}).expect("the drive is simulated");
    let sequence = Sequence::open(folder.path(), &options.sequence, None).expect("the layout is KITTI's");
    let poses = sequence.ground_truth().expect("poses are readable").expect("poses are written");
    let camera_from_sensor = sequence.camera_from_sensor();
    let (mut frames, mut moving) = (Vec::new(), Vec::new());
    for (k, pose) in poses.iter().enumerate() {
        let scan = sequence.read(k).expect("the scan is readable");
        let raw = scan.labels.expect("labels are written");
        let points = scan.points.iter().zip(&raw);
        frames.push(Frame {
            stamp_s: sequence.stamp_s(k),
            world_from_sensor: in_sensor_frame(pose, &camera_from_sensor),
            points: points
                .map(|(p, l)| LabelledPoint::new([p[0], p[1], p[2]], labels::class_of(*l)))
                .collect(),
        });
        moving.push(raw.iter().map(|l| labels::is_moving(*l)).collect());
    }
    Simulated { drive: Drive { frames }, moving }
}

/// A pose of the camera seen from its first pose, as a pose of the sensor seen from its first pose.
fn in_sensor_frame(camera: &MapPose, camera_from_sensor: &Isometry3<f64>) -> MapPose {
    camera_from_sensor.inverse() * camera * camera_from_sensor
}
