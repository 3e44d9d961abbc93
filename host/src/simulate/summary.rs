//! What a simulated drive contains.

use std::collections::BTreeMap;

use sdslam_core::MapPose;
use serde::Serialize;

use super::scan::Scan;

/// What a simulated drive contains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Number of scans.
    pub frames: usize,
    /// Length of the drive [m].
    pub length_m: f64,
    /// Highest less lowest sensor position [m].
    pub climb_m: f64,
    /// Mean number of points of a scan.
    pub points_per_scan: f64,
    /// Share of each SemanticKITTI id in all points, by id.
    pub classes: Vec<ClassShare>,
    /// Number of things that were seen moving.
    pub moving_objects: usize,
    /// Number of those by SemanticKITTI id, by id.
    pub moving_by_id: Vec<ObjectCount>,
}

/// Share of one class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassShare {
    /// SemanticKITTI id.
    pub id: u16,
    /// Share of all points, 0 to 1.
    pub share: f64,
}

/// Number of things of one class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ObjectCount {
    /// SemanticKITTI id.
    pub id: u16,
    /// How many.
    pub objects: usize,
}

/// Counts of one scan.
#[derive(Debug)]
pub struct ScanCounts {
    points: BTreeMap<u16, u64>,
    moving: BTreeMap<u16, u16>,
}

impl ScanCounts {
    /// Counts the points of a scan.
    pub fn of(scan: &Scan) -> Self {
        let mut points = BTreeMap::new();
        for label in &scan.labels {
            *points.entry(*label as u16).or_insert(0) += 1;
        }
        Self { points, moving: scan.moving.clone() }
    }
}

/// Counts of a drive.
#[derive(Debug, Default)]
pub struct Counts {
    points: BTreeMap<u16, u64>,
    moving: BTreeMap<u16, u16>,
}

impl Counts {
    /// Adds those of a scan; the order does not matter.
    pub fn add(&mut self, scan: ScanCounts) {
        for (id, count) in scan.points {
            *self.points.entry(id).or_insert(0) += count;
        }
        self.moving.extend(scan.moving);
    }

    fn moving_by_id(&self) -> Vec<ObjectCount> {
        let mut counts = BTreeMap::new();
        for id in self.moving.values() {
            *counts.entry(*id).or_insert(0) += 1;
        }
        counts.into_iter().map(|(id, objects)| ObjectCount { id, objects }).collect()
    }

    /// The summary of a drive with these poses.
    pub fn summary(&self, town_from_sensor: &[MapPose]) -> Summary {
        let all: u64 = self.points.values().sum();
        let share =
            |(id, count): (&u16, &u64)| ClassShare { id: *id, share: *count as f64 / all.max(1) as f64 };
        let step = |pair: &[MapPose]| (pair[1].translation.vector - pair[0].translation.vector).norm();
        let heights = town_from_sensor.iter().map(|pose| pose.translation.z);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
        Summary {
            frames: town_from_sensor.len(),
            length_m: town_from_sensor.windows(2).map(step).sum(),
            climb_m: high - low,
            points_per_scan: all as f64 / town_from_sensor.len().max(1) as f64,
            classes: self.points.iter().map(share).collect(),
            moving_objects: self.moving.len(),
            moving_by_id: self.moving_by_id(),
        }
    }
}
