//! What the core recognised as moving: landmarks.csv, motion/NNNNNN.label and how it compares with labelled motion.

use std::collections::{BTreeMap, HashMap};

use sdslam_core::{LabelledPoint, Landmark, MapPose, MotionClass, MotionState, TrackReport};
use serde::Serialize;

use crate::dataset::labels;

/// First line of landmarks.csv.
pub(super) const CSV_HEADER: &str = "frame,track,class,state,x,y,z,vx,vy\n";

/// One line of landmarks.csv per landmark: centre \[m\] and velocity \[m/s\] in the map frame. Landmarks of classes that
/// never move have no track.
pub(super) fn csv_rows(
    frame: usize,
    landmarks: &[Landmark],
    tracks: &[TrackReport],
    pose: &MapPose,
) -> String {
    let velocities: HashMap<u32, [f32; 2]> = tracks.iter().map(|t| (t.id, t.velocity)).collect();
    let mut rows = String::new();
    for landmark in landmarks {
        let centre = in_map(pose, landmark.centre);
        let track = landmark.track.map_or_else(String::new, |id| id.to_string());
        let velocity = landmark.track.and_then(|id| velocities.get(&id).copied()).unwrap_or_default();
        let (class, state) = (landmark.class.name(), state_name(landmark.state));
        let [x, y, z] = centre;
        let [vx, vy] = velocity;
        let row = format!("{frame},{track},{class},{state},{x:.3},{y:.3},{z:.3},{vx:.3},{vy:.3}\n");
        rows.push_str(&row);
    }
    rows
}

/// A point of the sensor frame in the map.
pub(super) fn in_map(map_from_sensor: &MapPose, point: [f32; 3]) -> [f64; 3] {
    (map_from_sensor * nalgebra::Point3::from(point.map(f64::from))).coords.into()
}

fn state_name(state: MotionState) -> &'static str {
    match state {
        MotionState::PureStatic => "pure-static",
        MotionState::SemiStatic => "semi-static",
        MotionState::Dynamic => "dynamic",
        MotionState::Undecided => "undecided",
    }
}

/// The input's label of every point, with the moving id (252..259) where a point that may move belongs to a landmark
/// recognised as dynamic and the static one elsewhere. The instance half is kept.
pub(super) fn motion_labels(raw: &[u32], points: &[LabelledPoint], landmarks: &[Landmark]) -> Vec<u32> {
    let label = |(&raw, point): (&u32, &LabelledPoint)| {
        if point.class.motion() != MotionClass::UnknownMotion {
            return raw;
        }
        let landmark = landmarks.get(usize::from(point.landmark));
        let moves = landmark.is_some_and(|landmark| landmark.state == MotionState::Dynamic);
        if moves { labels::moving_id(raw) } else { labels::static_id(raw) }
    };
    raw.iter().zip(points).map(label).collect()
}

/// Landmarks that move by the input's labels (more than half of their points carry 252..259), one count per frame in
/// which a landmark is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MovingLandmarks {
    /// Moving and recognised as dynamic.
    pub found: u64,
    /// Moving, taken for standing still.
    pub missed: u64,
    /// Moving, not seen long enough to be decided on.
    pub undecided: u64,
    /// Recognised as dynamic, not moving.
    pub false_alarms: u64,
}

impl MovingLandmarks {
    /// Adds the landmarks of one frame.
    pub(super) fn add(&mut self, raw: &[u32], points: &[LabelledPoint], landmarks: &[Landmark]) {
        let mut moving_points = vec![(0u32, 0u32); landmarks.len()];
        for (&raw, point) in raw.iter().zip(points) {
            if let Some((moving, all)) = moving_points.get_mut(usize::from(point.landmark)) {
                *moving += u32::from(labels::is_moving(raw));
                *all += 1;
            }
        }
        for (landmark, (moving, all)) in landmarks.iter().zip(moving_points) {
            match (2 * moving > all, landmark.state) {
                (true, MotionState::Dynamic) => self.found += 1,
                (true, MotionState::Undecided) => self.undecided += 1,
                (true, _) => self.missed += 1,
                (false, MotionState::Dynamic) => self.false_alarms += 1,
                (false, _) => (),
            }
        }
    }

    /// Share of the moving landmarks that was found, of those decided on, 0..1.
    pub fn recall(&self) -> Option<f64> {
        share(self.found, self.missed)
    }

    /// Share of the landmarks recognised as dynamic that moves, 0..1.
    pub fn precision(&self) -> Option<f64> {
        share(self.found, self.false_alarms)
    }
}

fn share(hits: u64, others: u64) -> Option<f64> {
    let all = hits + others;
    (all > 0).then(|| hits as f64 / all as f64)
}

/// All tracks of a run and where those recognised as dynamic went.
#[derive(Default)]
pub(super) struct Movers {
    /// Per track: whether it was ever recognised as dynamic or else as semi-static.
    states: BTreeMap<u32, MotionState>,
    /// Per track: map positions \[m\] while recognised as dynamic.
    paths: BTreeMap<u32, Vec<[f64; 2]>>,
}

impl Movers {
    pub(super) fn add(&mut self, landmarks: &[Landmark], pose: &MapPose) {
        for landmark in landmarks {
            let Some(track) = landmark.track else { continue };
            let known = self.states.entry(track).or_insert(MotionState::Undecided);
            match landmark.state {
                MotionState::Dynamic => {
                    *known = MotionState::Dynamic;
                    let [x, y, _] = in_map(pose, landmark.centre);
                    self.paths.entry(track).or_default().push([x, y]);
                }
                MotionState::SemiStatic if *known != MotionState::Dynamic => *known = MotionState::SemiStatic,
                _ => (),
            }
        }
    }

    /// Tracks that were recognised as `state` (dynamic goes before semi-static).
    pub(super) fn count(&self, state: MotionState) -> u64 {
        self.states.values().filter(|&&known| known == state).count() as u64
    }

    pub(super) fn paths(&self) -> impl Iterator<Item = &[[f64; 2]]> {
        self.paths.values().map(Vec::as_slice)
    }
}
