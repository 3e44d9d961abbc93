//! `Odometry::process_scan` as its caller meets it: relations that must hold for any scene, and input that is not a scene.

mod bad_scans;
mod full_buffers;
mod order;
mod relations;

use std::sync::OnceLock;

use sdslam_core::{Config, FrameEstimate, FullScanOdometry, LabelledPoint, MapPose};
use sdslam_tests::drive::{Drive, largest_difference, poses};
use sdslam_tests::odometry::full_scan;

const FRAMES: usize = 30;

/// One winding drive for all tests.
fn drive() -> &'static Drive {
    static DRIVE: OnceLock<Drive> = OnceLock::new();
    DRIVE.get_or_init(|| Drive::down_the_street(FRAMES, 8.0))
}

fn accurate() -> Box<FullScanOdometry> {
    full_scan(Config::accurate())
}

fn run(drive: &Drive) -> Vec<MapPose> {
    poses(&drive.run(&mut accurate()))
}

fn assert_close(a: &[MapPose], b: &[MapPose], position_m: f64, angle_deg: f64) {
    let (position, angle) = largest_difference(a, b);
    assert!(position < position_m && angle < angle_deg, "{position:.4} m and {angle:.4} deg apart");
}

fn is_valid(estimate: &FrameEstimate) -> bool {
    let t = estimate.map_from_sensor.translation.vector;
    let q = estimate.map_from_sensor.rotation;
    let covariance = estimate.covariance;
    t.iter().all(|v| v.is_finite())
        && (q.norm() - 1.0).abs() < 1e-4
        && covariance.iter().flatten().all(|v| v.is_finite())
        && (0..6).all(|i| covariance[i][i] > 0.0)
}

/// The drive with the scans of some frames replaced.
fn with_replaced(frames: std::ops::Range<usize>, points: &[LabelledPoint]) -> Drive {
    let mut replaced = drive().clone();
    replaced.frames[frames].iter_mut().for_each(|f| f.points = points.to_vec());
    replaced
}
