//! Corrections of a raw scan, before anything else sees it. Elevation first: the spin is in the sensor's own geometry.

use nalgebra::{Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use sdslam_core::MapPose;

/// The HDL-64E of KITTI reports elevation angles that are too low by this much [deg].
pub const ELEVATION_CORRECTION_DEG: f64 = 0.205;

/// Poses per scan period in deskewing: at 30 m/s a point is off by less than 0.4 mm.
const DESKEW_STEPS: f64 = 4096.0;

/// Raises every point by `degrees` about the sensor, its range and azimuth kept.
///
/// [`ELEVATION_CORRECTION_DEG`] for scans of KITTI; other drives and simulated ones lack the defect.
pub fn correct_elevation(points: &mut [[f32; 4]], degrees: f64) {
    let sin_cos = degrees.to_radians().sin_cos();
    for point in points {
        let [x, y, z, _] = point.map(f64::from);
        let [x, y, z] = with_elevation_raised([x, y, z], sin_cos);
        *point = [x as f32, y as f32, z as f32, point[3]];
    }
}

/// [`correct_elevation`] of one point, in double precision, by [`ELEVATION_CORRECTION_DEG`].
pub fn with_corrected_elevation(point: [f64; 3]) -> [f64; 3] {
    with_elevation_raised(point, ELEVATION_CORRECTION_DEG.to_radians().sin_cos())
}

fn with_elevation_raised([x, y, z]: [f64; 3], (sin, cos): (f64, f64)) -> [f64; 3] {
    let horizontal = x.hypot(y);
    if horizontal == 0.0 {
        return [x, y, z];
    }
    // Rotation about p x z: the vertical plane through the point is kept.
    let shrink = cos - sin * z / horizontal;
    [x * shrink, y * shrink, z * cos + horizontal * sin]
}

/// When a point was measured, in scan periods from mid-scan (-0.5 to 0.5), from its azimuth.
///
/// The HDL-64E turns clockwise seen from above; a scan begins and ends at the rear.
pub fn time_in_scan(x: f32, y: f32) -> f64 {
    if x == 0.0 && y == 0.0 { 0.0 } else { f64::from(-y.atan2(x) / std::f32::consts::TAU) }
}

/// Moves every point to where the sensor would have seen it at mid-scan, were its surroundings at rest.
///
/// `sensor_motion_over_one_period` is the sensor's pose one period later in the sensor frame now (the last pose
/// increment); the velocity is taken as constant. Non-finite points stay as they are.
pub fn deskew(points: &mut [[f32; 4]], sensor_motion_over_one_period: &MapPose) {
    let twist = Twist::from_motion(sensor_motion_over_one_period);
    let step_time = |step: usize| step as f64 / DESKEW_STEPS - 0.5;
    let poses: Vec<_> = (0..=DESKEW_STEPS as usize).map(|step| twist.pose_at(step_time(step))).collect();
    for point in points {
        let time = time_in_scan(point[0], point[1]);
        if time != 0.0 && point[..3].iter().all(|v| v.is_finite()) {
            let [x, y, z] = [point[0], point[1], point[2]].map(f64::from);
            let pose = poses[((time + 0.5) * DESKEW_STEPS).round() as usize];
            let moved = pose * Point3::new(x, y, z);
            *point = [moved.x as f32, moved.y as f32, moved.z as f32, point[3]];
        }
    }
}

/// Constant velocity in the moving frame, per period.
struct Twist {
    rotation: Vector3<f64>,
    translation: Vector3<f64>,
}

impl Twist {
    fn from_motion(motion: &MapPose) -> Self {
        let rotation = motion.rotation.scaled_axis();
        // The Jacobian is invertible for every rotation below a full turn.
        let inverse = left_jacobian(&rotation).try_inverse().unwrap_or_else(Matrix3::identity);
        Self { rotation, translation: inverse * motion.translation.vector }
    }

    fn pose_at(&self, time: f64) -> MapPose {
        let rotation = self.rotation * time;
        let translation = left_jacobian(&rotation) * self.translation * time;
        MapPose::from_parts(Translation3::from(translation), UnitQuaternion::from_scaled_axis(rotation))
    }
}

/// Integral of the rotation `exp(s w)` over s from 0 to 1.
fn left_jacobian(w: &Vector3<f64>) -> Matrix3<f64> {
    let angle2 = w.norm_squared();
    let angle = angle2.sqrt();
    // Series near zero, where the closed forms lose their digits.
    let (a, b) = if angle < 1e-4 {
        (0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0)
    } else {
        ((1.0 - angle.cos()) / angle2, (angle - angle.sin()) / (angle2 * angle))
    };
    let k = w.cross_matrix();
    Matrix3::identity() + k * a + k * k * b
}
