//! The stages of the core, each for itself: what it promises, and its limits.

mod configuration;
mod motion_states;
mod points_to_landmarks;
mod registration;
mod submap;

use nalgebra::Vector6;
use sdslam_core::LabelledPoint;
use sdslam_core::estimate::PointCounts;
use sdslam_core::label_filter;
use sdslam_core::pose::{self, Pose};
use sdslam_core::scan_cells::ScanCells;

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
