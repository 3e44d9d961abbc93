//! Stages 1 to 3: label filter, cells, instances, landmarks.

use nalgebra::Vector3;
use sdslam_core::label_filter;
use sdslam_core::landmarks::{MotionState, layers};
use sdslam_core::scan_cells::ScanCells;
use sdslam_core::{LabelledPoint, SemanticClass};
use sdslam_tests::stages::{box_points, landmarks_of};
use sdslam_tests::world::unit;

use crate::filtered;

/// Points of all classes in a cube of 20 m.
fn cloud(seed: u64, count: u64) -> Vec<LabelledPoint> {
    let point = |i| {
        let at = [0, 1, 2].map(|k| (20.0 * unit(seed, i, k) - 10.0) as f32);
        LabelledPoint::new(at, SemanticClass::ALL[(unit(seed, i, 7) * 24.0) as usize])
    };
    (0..count).map(point).collect()
}

#[test]
fn a_cell_has_the_moments_of_its_points() {
    let mut points = cloud(1, 30_000);
    // A cluster far from the origin, where sums in single precision would be worst.
    points.extend((0..500).map(|i| {
        let at = [0, 1, 2].map(|k| (0.1 * unit(2, i, k)) as f32);
        LabelledPoint::new([80.0 + at[0], -50.0 + at[1], at[2]], SemanticClass::Pole)
    }));
    let (cells, counts) = filtered::<32768>(&mut points);
    assert_eq!(counts.over_capacity, 0);
    let mut members = vec![Vec::new(); cells.cells().len()];
    for point in points.iter().filter(|p| p.landmark != LabelledPoint::NO_LANDMARK) {
        assert_eq!(point.class, cells.cells()[point.landmark as usize].class);
        members[point.landmark as usize].push(Vector3::from(point.position).cast::<f64>());
    }
    for (cell, members) in cells.cells().iter().zip(&members) {
        let n = members.len() as f64;
        assert_eq!(cell.count() as usize, members.len());
        let mean = members.iter().sum::<Vector3<f64>>() / n;
        assert!((cell.mean().cast::<f64>() - mean).norm() < 2e-5);
        let spread = |p: &Vector3<f64>| (p - mean) * (p - mean).transpose();
        let covariance = members.iter().map(spread).sum::<nalgebra::Matrix3<f64>>() / n;
        assert!((cell.covariance().cast::<f64>() - covariance).amax() < 1e-6);
        let side = f64::from(label_filter::Config::DEFAULT.cell_side_m(cell.class));
        let farthest = members.iter().map(|p| (p - mean).amax()).fold(0.0, f64::max);
        assert!(farthest < side, "a cell is a cube of its side");
    }
}

#[test]
fn full_cells_refuse_new_places_and_still_fill_the_old() {
    let mut points = cloud(3, 5_000);
    let again: Vec<LabelledPoint> = points.clone();
    points.extend(again);
    let (cells, counts) = filtered::<256>(&mut points);
    assert_eq!(cells.cells().len(), 256);
    let kept: u32 = cells.cells().iter().map(|c| c.count()).sum();
    assert_eq!(kept, counts.ground + counts.pure_static + counts.unknown_motion);
    assert!(counts.over_capacity > 0 && kept + counts.over_capacity < counts.received);
    // The second copy of a point finds the cell of the first, or is refused as the first was.
    let (first, second) = points.split_at(5_000);
    assert!(first.iter().zip(second).all(|(a, b)| a.landmark == b.landmark));
}

#[test]
fn unsure_points_are_dropped_by_confidence() {
    let config = label_filter::Config {
        min_confidence: 128,
        min_ground_confidence: 200,
        ..label_filter::Config::DEFAULT
    };
    let counts_of = |config, class| {
        let sure = |confidence| LabelledPoint { confidence, ..LabelledPoint::new([10.0, 0.0, 0.0], class) };
        let mut points: Vec<LabelledPoint> = (0..=255).map(sure).collect();
        label_filter::filter(config, &mut points, &mut Box::new(ScanCells::<16>::new()))
    };
    let building = counts_of(&config, SemanticClass::Building);
    assert_eq!((building.unsure, building.pure_static), (128, 128));
    let road = counts_of(&config, SemanticClass::Road);
    assert_eq!((road.unsure, road.ground), (200, 56));
    // By default all that is needed is some confidence.
    let plant = counts_of(&label_filter::Config::DEFAULT, SemanticClass::Vegetation);
    assert_eq!((plant.unsure, plant.pure_static), (1, 255));
}

#[test]
fn range_limits_are_inclusive() {
    let config =
        label_filter::Config { min_range_m: 4.0, max_range_m: 64.0, ..label_filter::Config::DEFAULT };
    let at = |x| LabelledPoint::new([x, 0.0, 0.0], SemanticClass::Building);
    let mut points = [3.999, 4.0, 64.0, 64.01, -4.0, -65.0].map(at);
    let mut cells = Box::new(ScanCells::<16>::new());
    let counts = label_filter::filter(&config, &mut points, &mut cells);
    assert_eq!((counts.out_of_range, counts.pure_static), (3, 3));
}
#[test]
fn separate_things_become_separate_landmarks() {
    let mut points = box_points([10.0, 4.0, -0.7], [2.0, 0.8, 0.7], 8.0, SemanticClass::Car);
    points.extend(box_points([10.0, -4.0, -0.7], [2.0, 0.8, 0.7], 8.0, SemanticClass::Car));
    points.extend(box_points([15.0, 0.0, 0.5], [0.1, 0.1, 1.5], 20.0, SemanticClass::Pole));
    points.push(LabelledPoint::new([-20.0, 0.0, 0.0], SemanticClass::Pole));
    let found = landmarks_of(&points);
    let classes: Vec<SemanticClass> = found.iter().map(|l| l.class).collect();
    assert_eq!(
        classes,
        [SemanticClass::Car, SemanticClass::Car, SemanticClass::Pole],
        "noise is no landmark"
    );
    for (landmark, centre) in found.iter().zip([[10.0, 4.0], [10.0, -4.0], [15.0, 0.0]]) {
        // Which of the equal cars comes first is not promised.
        let off = (landmark.centre[0] - centre[0]).abs() + (landmark.centre[1].abs() - centre[1].abs()).abs();
        assert!(off < 0.05, "{:?}", landmark.centre);
        assert!((0..3).all(|k| landmark.min[k] < landmark.centre[k] && landmark.centre[k] < landmark.max[k]));
    }
    assert_eq!(found[2].state, MotionState::PureStatic);
    assert_eq!(found[0].state, MotionState::Undecided);
}

#[test]
fn the_majority_names_an_instance_of_confused_labels() {
    let mut points = box_points([10.0, 4.0, -0.7], [2.0, 0.8, 0.7], 8.0, SemanticClass::Truck);
    points.iter_mut().step_by(3).for_each(|p| p.class = SemanticClass::Car);
    let found = landmarks_of(&points);
    assert_eq!((found.len(), found[0].class, found[0].family), (1, SemanticClass::Truck, SemanticClass::Car));
    assert_eq!(found[0].point_count as usize, points.len());
}

#[test]
fn a_long_facade_is_cut_into_tiles() {
    let facade = box_points([0.0, 12.0, 2.0], [30.0, 0.2, 3.0], 4.0, SemanticClass::Building);
    let found = landmarks_of(&facade);
    assert!((7..=10).contains(&found.len()), "60 m in tiles of 8 m: {}", found.len());
    assert!(found.iter().all(|l| l.max[0] - l.min[0] <= 8.0));
    assert_eq!(found.iter().map(|l| l.point_count as usize).sum::<usize>(), facade.len());
}

#[test]
fn layers_part_a_landmark_by_height() {
    // A tree: a thin stem below a wide crown.
    let mut points = box_points([10.0, 2.0, 0.0], [0.3, 0.3, 1.0], 8.0, SemanticClass::Vegetation);
    points.extend(box_points([10.0, 2.0, 2.0], [1.5, 1.5, 1.0], 6.0, SemanticClass::Vegetation));
    let tree = landmarks_of(&points).into_iter().max_by_key(|l| l.point_count).expect("a tree");
    let area = |hull: &[[f32; 2]]| sdslam_core::geometry::polygon::area(hull);
    let all = layers(&tree, 100.0);
    assert!(all.upper.is_empty() && area(&all.lower) > 5.0, "everything is below a high split");
    let none = layers(&tree, -100.0);
    assert!(none.lower.is_empty() && area(&none.upper) > 5.0);
}
