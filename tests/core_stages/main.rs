//! The stages of the core, each for itself: what it promises, and its limits.

mod motion_states;
mod points_to_landmarks;
mod registration;
mod submap;

use nalgebra::Vector6;
use sdslam_core::estimate::PointCounts;
use sdslam_core::label_filter;
use sdslam_core::pose::{self, Pose};
use sdslam_core::scan_cells::ScanCells;
use sdslam_core::{Config, LabelledPoint};

/// The cells of a scan, by the default label filter.
fn filtered<const CELLS: usize>(points: &mut [LabelledPoint]) -> (Box<ScanCells<CELLS>>, PointCounts) {
    let mut cells = Box::new(ScanCells::new());
    let counts = label_filter::filter(&label_filter::Config::DEFAULT, points, &mut cells);
    (cells, counts)
}

/// A motion in the plane [m, m, rad].
fn planar(x: f32, y: f32, yaw: f32) -> Pose {
    pose::exp(&Vector6::new(x, y, 0.0, 0.0, 0.0, yaw))
}

#[test]
fn a_wrong_parameter_is_named() {
    type Spoil = fn(&mut Config);
    let wrong: [(&str, Spoil); 12] = [
        ("label_filter.min_range_m", |c| c.label_filter.min_range_m = 0.0),
        ("label_filter.max_range_m", |c| c.label_filter.max_range_m = 1.0),
        ("label_filter.small_cell_m", |c| c.label_filter.small_cell_m = f32::NAN),
        ("instances.radius_per_range", |c| c.instances.radius_per_range = -0.1),
        ("instances.*.radius_m", |c| c.instances.car.radius_m = 0.0),
        ("instances.*.min_points", |c| c.instances.fence.min_points = 0),
        ("preliminary_pose.enough_quadrants", |c| c.preliminary_pose.enough_quadrants = 5),
        ("motion_state", |c| c.motion_state.vehicle.gate_m = f32::NAN),
        ("precise_pose.horizontal", |c| c.precise_pose.dense.enabled = false),
        ("precise_pose.voxels.voxel_m", |c| c.precise_pose.voxels.voxel_m = 0.01),
        ("precise_pose.dense.max_iterations", |c| c.precise_pose.dense.max_iterations = 0),
        ("swarm.particles", |c| c.precise_pose.hulls.swarm.particles = 65),
    ];
    for (name, spoil) in wrong {
        let mut config = Config::accurate();
        spoil(&mut config);
        let error = config.check().expect_err(name);
        assert!(error.parameter.contains(name), "{error} should name {name}");
        assert!(error.to_string().contains(error.expected));
    }
    assert_eq!((Config::accurate().check(), Config::paper().check()), (Ok(()), Ok(())));
    assert_eq!(Config::default(), Config::accurate());
}
