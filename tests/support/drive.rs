//! Drives: scans with stamps and true poses, and what the odometry makes of them.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use sdslam_core::{FrameEstimate, FullScanOdometry, LabelledPoint, MapPose};

use crate::odometry::process;
use crate::street;
use crate::world::{Lidar, Solid, World, sin_cos};

/// Time between two scans \[s\].
pub const PERIOD_S: f64 = 0.1;

/// Height of the sensor above the ground \[m\].
pub const SENSOR_HEIGHT_M: f64 = 1.73;

/// A scan and the truth about it.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Stamp \[s\].
    pub stamp_s: f64,
    /// Pose of the sensor.
    pub world_from_sensor: MapPose,
    /// Points.
    pub points: Vec<LabelledPoint>,
}

/// A sequence of scans.
#[derive(Clone, Debug)]
pub struct Drive {
    /// The scans.
    pub frames: Vec<Frame>,
}

/// A pose on the street, looking along it turned by `yaw` \[rad\].
pub fn pose_on_street(x: f64, y: f64, yaw: f64) -> MapPose {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    MapPose::from_parts(Vector3::new(x, y, SENSOR_HEIGHT_M).into(), rotation)
}

impl Drive {
    /// Scans of a world from the given poses.
    pub fn record(world: &World, lidar: &Lidar, poses: &[MapPose]) -> Self {
        let frame = |(k, pose): (usize, &MapPose)| {
            let stamp_s = k as f64 * PERIOD_S;
            let points = world.scan(lidar, pose, stamp_s, k as u64);
            Frame { stamp_s, world_from_sensor: *pose, points }
        };
        Self { frames: poses.iter().enumerate().map(frame).collect() }
    }

    /// A winding drive down the street at `speed_mps`, past parked cars, an oncoming car and a bicyclist.
    pub fn down_the_street(frames: usize, speed_mps: f64) -> Self {
        let length_m = frames as f64 * PERIOD_S * speed_mps;
        let mut world = street::street(length_m, 7);
        world.solids.extend(traffic());
        let pose = |k: usize| {
            let x = k as f64 * PERIOD_S * speed_mps;
            // The sine's slope is the heading.
            let [sin, cos] = sin_cos(x / 8.0);
            pose_on_street(x, -1.2 + 0.5 * sin, 0.0625 * cos)
        };
        let poses: Vec<MapPose> = (0..frames).map(pose).collect();
        Self::record(&world, &Lidar::default(), &poses)
    }

    /// The same drive with every point moved in the sensor frame.
    pub fn with_points_moved(&self, move_point: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        let mut moved = self.clone();
        for point in moved.frames.iter_mut().flat_map(|f| &mut f.points) {
            point.position = move_point(point.position);
        }
        moved
    }

    /// What the odometry makes of it.
    pub fn run(&self, odometry: &mut FullScanOdometry) -> Vec<FrameEstimate> {
        self.frames.iter().map(|f| process(odometry, f.stamp_s, &f.points)).collect()
    }

    /// The true poses, seen from the first.
    pub fn truth(&self) -> Vec<MapPose> {
        let first = self.frames[0].world_from_sensor;
        self.frames.iter().map(|f| first.inv_mul(&f.world_from_sensor)).collect()
    }
}

/// What moves on the street of [`Drive::down_the_street`]: an oncoming car, one ahead, and a bicyclist.
pub fn traffic() -> [Solid; 3] {
    [street::car([45.0, 1.0], -7.0), street::car([14.0, -1.2], 8.0), street::bicyclist([10.0, 2.25], 4.0)]
}

/// Largest distance of positions \[m\] and largest angle \[deg\] between two rows of poses.
pub fn largest_difference(a: &[MapPose], b: &[MapPose]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let difference = a.iter().zip(b).map(|(a, b)| {
        let apart = a.inv_mul(b);
        (apart.translation.vector.norm(), apart.rotation.angle().to_degrees())
    });
    difference.fold((0.0, 0.0), |worst, d| (worst.0.max(d.0), worst.1.max(d.1)))
}

/// The poses of estimates.
pub fn poses(estimates: &[FrameEstimate]) -> Vec<MapPose> {
    estimates.iter().map(|e| e.map_from_sensor).collect()
}

/// A point of the sensor frame turned by a pose.
pub fn turned(pose: &MapPose, p: [f32; 3]) -> [f32; 3] {
    let moved = pose * Point3::from(p.map(f64::from));
    [moved.x as f32, moved.y as f32, moved.z as f32]
}
