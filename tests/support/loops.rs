//! Loop detection in the tests' world: extractors and detectors on the heap, streets with keyframes.

use nalgebra::Vector3;
use sdslam_core::loop_closure::{Config, FeatureExtractor, Features, LoopDetector};
use sdslam_core::{LabelledPoint, MapPose, Pose, pose};

use crate::drive::pose_on_street;
use crate::world::{Lidar, World};

/// A detector that holds more places than the tests make.
pub type Detector = LoopDetector<128, 16384>;

/// Builds something large on a thread with a large stack, and moves it to the heap.
pub fn on_heap<T: Send + 'static>(build: impl FnOnce() -> T + Send + 'static) -> Box<T> {
    let builder = std::thread::Builder::new().stack_size(4 * size_of::<T>() + (1 << 20));
    builder.spawn(move || Box::new(build())).expect("a thread starts").join().expect("it is built")
}

/// A detector with these parameters.
pub fn detector<const PLACES: usize, const BUCKETS: usize>(
    config: Config,
) -> Box<LoopDetector<PLACES, BUCKETS>> {
    on_heap(move || LoopDetector::new(config).expect("the configuration is valid"))
}

/// The features of one scan, with the default parameters.
pub fn features_of(points: &[LabelledPoint]) -> Features {
    let mut extractor = on_heap(FeatureExtractor::<4096>::new);
    extractor.add(&Config::DEFAULT, points, &pose::IDENTITY);
    extractor.finish(&Config::DEFAULT)
}

/// A keyframe: where it is, and its scan.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// Stamp \[s\].
    pub stamp_s: f64,
    /// Pose of the sensor.
    pub world_from_sensor: MapPose,
    /// Points.
    pub points: Vec<LabelledPoint>,
}

/// Keyframes every 4 m along a lane of a street, from `first_x` on; `direction` is 1 or -1. Scans are sparse.
pub fn drive_lane(world: &World, xs: &[f64], y: f64, direction: f64, first_stamp_s: f64) -> Vec<Keyframe> {
    let yaw = if direction > 0.0 { 0.0 } else { std::f64::consts::PI };
    let lidar = Lidar { beams: 32, columns: 900, noise_m: 0.015 };
    let keyframe = |(k, x): (usize, &f64)| {
        let world_from_sensor = pose_on_street(*x, y, yaw);
        let stamp_s = first_stamp_s + k as f64;
        let points = world.scan(&lidar, &world_from_sensor, 0.0, stamp_s.to_bits());
        Keyframe { stamp_s, world_from_sensor, points }
    };
    xs.iter().enumerate().map(keyframe).collect()
}

/// How far a transform is from the truth: \[m\] and \[deg\].
pub fn error_of(old: &MapPose, new: &MapPose, old_from_new: &Pose) -> (f64, f64) {
    let wrong = old.inv_mul(new).inverse() * old_from_new.cast::<f64>();
    (wrong.translation.vector.norm(), wrong.rotation.angle().to_degrees())
}

/// The yaw of a rotation \[deg\].
pub fn yaw_deg(pose: &Pose) -> f32 {
    let forward = pose.rotation * Vector3::x();
    forward.y.atan2(forward.x).to_degrees()
}
