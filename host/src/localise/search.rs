//! Finding the vehicle in the map, at first or after it was lost.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};
use sdslam_core::capacity::{FullScanFeatureExtractor, HostLoopDetector};
use sdslam_core::loop_closure::KEYPOINT_CLASSES;
use sdslam_core::{LabelledPoint, MapPose};

use super::Start;
use crate::config::HostConfig;
use crate::heap::on_heap;
use crate::run::RunError;
use crate::saved_map::SavedMap;

/// Features are gathered over this path \[m\],
const WINDOW_M: f64 = 4.0;
/// and over so many scans at most.
const WINDOW_SCANS: usize = 10;
/// Two finds agree when the odometry between them predicts the second this well \[m\], \[rad\].
const AGREE_M: f64 = 0.25;
const AGREE_RAD: f64 = 0.015;
/// A find that waits for a second one is forgotten after this path \[m\].
const WAITS_M: f64 = 20.0;
/// The path between two finds: the second must be evidence of its own \[m\].
const APART_M: f64 = 0.5;
/// Refinements per scan at most.
const PROPOSALS: usize = 2;

/// The search, from scan to scan.
pub(super) struct Search {
    /// The pose that was given, moved on by the odometry: pose in the map and by the odometry.
    near: Option<(MapPose, Option<MapPose>)>,
    /// Points that make features, with the pose by the odometry.
    window: VecDeque<(Vec<LabelledPoint>, MapPose)>,
    extractor: Box<FullScanFeatureExtractor>,
    /// The last find: pose in the map and by the odometry.
    waiting: Option<(MapPose, MapPose)>,
}

impl Search {
    pub(super) fn new(saved: &SavedMap, start: Start) -> Result<Self, RunError> {
        Ok(Self {
            near: match start {
                Start::Global => None,
                Start::Near { position, yaw } => Some((on_the_map(saved, position, yaw), None)),
            },
            window: VecDeque::new(),
            extractor: on_heap(|| Ok::<_, RunError>(FullScanFeatureExtractor::new()))?,
            waiting: None,
        })
    }

    /// Forgets what was seen; a pose that was given counts only at the start.
    pub(super) fn clear(&mut self) {
        self.window.clear();
        (self.near, self.waiting) = (None, None);
    }

    /// Poses in the map where the vehicle may be.
    pub(super) fn proposals(
        &mut self,
        config: &HostConfig,
        detector: &mut HostLoopDetector,
        saved: &SavedMap,
        points: &[LabelledPoint],
        odometry: &MapPose,
    ) -> Vec<MapPose> {
        if let Some((map_from_start, start)) = &mut self.near {
            let start = *start.get_or_insert(*odometry);
            return vec![*map_from_start * start.inv_mul(odometry)];
        }
        self.see(points, odometry);
        let loop_closure = &config.core.loop_closure;
        let Some((_, first)) = self.window.front() else { return Vec::new() };
        let window_from_sensor = first.inv_mul(odometry);
        self.extractor.clear();
        for (points, pose) in &self.window {
            self.extractor.add(loop_closure, points, &first.inv_mul(pose).cast());
        }
        let features = self.extractor.finish(loop_closure);
        let candidates = detector.query(&features, None);
        let pose = |candidate: &sdslam_core::loop_closure::LoopCandidate| {
            let place = saved.places.get(candidate.place as usize)?;
            Some(place.map_from_place * candidate.old_from_new.cast::<f64>() * window_from_sensor)
        };
        candidates.iter().filter_map(pose).take(PROPOSALS).collect()
    }

    /// A find; whether it agrees with one before.
    pub(super) fn confirm(&mut self, map_from_sensor: &MapPose, odometry: &MapPose) -> bool {
        let Some((earlier, earlier_odometry)) = self.waiting else {
            self.waiting = Some((*map_from_sensor, *odometry));
            return false;
        };
        let step = earlier_odometry.inv_mul(odometry);
        let path_m = step.translation.vector.norm();
        let off = (earlier * step).inv_mul(map_from_sensor);
        let agrees = off.translation.vector.norm() <= AGREE_M && off.rotation.angle() <= AGREE_RAD;
        if !agrees || path_m > WAITS_M {
            self.waiting = Some((*map_from_sensor, *odometry));
        }
        agrees && (APART_M..=WAITS_M).contains(&path_m)
    }

    fn see(&mut self, points: &[LabelledPoint], odometry: &MapPose) {
        let makes_features = |point: &&LabelledPoint| KEYPOINT_CLASSES.contains(&point.class);
        self.window.push_back((points.iter().filter(makes_features).copied().collect(), *odometry));
        let is_past = |(_, pose): &(Vec<LabelledPoint>, MapPose)| {
            pose.inv_mul(odometry).translation.vector.norm() > WINDOW_M
        };
        while self.window.len() > WINDOW_SCANS || self.window.front().is_some_and(is_past) {
            self.window.pop_front();
        }
    }
}

/// A pose on the ground of the map: height and slope of the nearest place.
fn on_the_map(saved: &SavedMap, [x, y]: [f64; 2], yaw: f64) -> MapPose {
    let away = |pose: &MapPose| (pose.translation.x - x).hypot(pose.translation.y - y);
    let poses = saved.places.iter().map(|place| place.map_from_place);
    let nearest = poses.min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or_else(MapPose::identity);
    // The least turn that lays the vertical axis of a level pose on that of the place.
    let up = nearest.rotation * Vector3::z();
    let tilt = UnitQuaternion::rotation_between(&Vector3::z(), &up).unwrap_or_default();
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    MapPose::from_parts(Vector3::new(x, y, nearest.translation.z).into(), tilt * heading)
}
