//! The first stages of the core, run for their result: points to landmarks.

use sdslam_core::capacity::FULL_SCAN_POINTS;
use sdslam_core::instances::{self, Instances};
use sdslam_core::label_filter;
use sdslam_core::landmarks::{self, Landmark};
use sdslam_core::pose;
use sdslam_core::scan_cells::ScanCells;
use sdslam_core::{LabelledPoint, SemanticClass};

const CELLS: usize = 8192;
const INSTANCES: usize = 512;
const LANDMARKS: usize = 64;

/// Landmarks of a scan, by the label filter, DBSCAN and extraction with their defaults.
pub fn landmarks_of(points: &[LabelledPoint]) -> Vec<Landmark> {
    assert!(points.len() <= FULL_SCAN_POINTS);
    let mut cells = Box::new(ScanCells::<CELLS>::new());
    let counts = label_filter::filter(&label_filter::Config::DEFAULT, &mut points.to_vec(), &mut cells);
    assert_eq!(counts.over_capacity, 0, "the scan is too large for this helper");
    let config = instances::Config::DEFAULT;
    let mut found = Box::new(Instances::<CELLS, INSTANCES>::new());
    found.find(&config, &mut cells, &pose::IDENTITY);
    let mut order = heapless::Vec::<u16, INSTANCES>::new();
    let mut result = heapless::Vec::<Landmark, LANDMARKS>::new();
    let refused = landmarks::extract(&config, found.all_mut(), cells.cells_mut(), &mut order, &mut result);
    assert_eq!(refused, 0, "too many landmarks for this helper");
    result.to_vec()
}

/// Points on the sides and the top of a box: centre, half lengths, and points per metre.
pub fn box_points(
    centre: [f32; 3],
    half_m: [f32; 3],
    per_m: f32,
    class: SemanticClass,
) -> Vec<LabelledPoint> {
    let mut points = Vec::new();
    let steps = half_m.map(|h| (2.0 * h * per_m).ceil().max(1.0) as i32);
    for i in 0..=steps[0] {
        for j in 0..=steps[1] {
            for k in 0..=steps[2] {
                let on_surface = i == 0 || i == steps[0] || j == 0 || j == steps[1] || k == steps[2];
                if on_surface {
                    let share =
                        [i as f32 / steps[0] as f32, j as f32 / steps[1] as f32, k as f32 / steps[2] as f32];
                    let position = [0, 1, 2].map(|d| centre[d] + half_m[d] * (2.0 * share[d] - 1.0));
                    points.push(LabelledPoint::new(position, class));
                }
            }
        }
    }
    points
}
