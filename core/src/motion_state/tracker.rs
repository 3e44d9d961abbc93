//! Tracks: one Kalman filter per landmark that may move (sections 3.3.1 and 3.3.2), and their life cycle.

use heapless::{Vec, VecView};
use nalgebra::{Matrix2, Point3, Vector2, Vector3};

use super::recognition::{self, MotionCues};
use super::visibility::Visibility;
use super::{ClassConfig, Config, Rule};
use crate::estimation::kalman::PlanarMotion;
use crate::landmarks::{Landmark, MotionState, SAMPLES};
use crate::math;
use crate::pose::Pose;
use crate::scan::{MotionClass, SemanticClass};
use crate::total;

/// Frames between two snapshots of a track.
const SNAPSHOT_FRAMES: u32 = 5;

/// Where a landmark's surface was some frames ago, local frame.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Snapshot {
    /// Frames since.
    pub age: u32,
    /// Time since [s].
    pub age_s: f32,
    /// Points of the surface [m].
    pub samples: Vec<[f32; 3], SAMPLES>,
    /// Smallest and largest x and y [m].
    pub extent: [[f32; 2]; 2],
}

/// A landmark followed over time; local frame.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Track {
    /// Identity, never reused.
    pub id: u32,
    /// Class of its last landmark.
    pub class: SemanticClass,
    /// Family: landmarks of other families are never associated.
    pub family: SemanticClass,
    /// Motion state.
    pub state: MotionState,
    /// Filtered centre and velocity.
    pub motion: PlanarMotion,
    /// Height of the centre [m].
    pub height: f32,
    /// Landmarks associated so far.
    pub hits: u32,
    /// Frames since the last one.
    pub misses: u32,
    /// Landmark of this frame.
    pub landmark: Option<u16>,
    /// Frames without evidence of motion.
    pub calm: u32,
    /// Frames in a row with a believable shift.
    pub(super) alarms: u32,
    /// What spoke for or against motion last.
    pub cues: MotionCues,
    /// Turn rate [rad/s].
    pub(super) omega: f32,
    /// Two snapshots, the older first, five frames apart.
    pub(super) snapshots: [Option<Snapshot>; 2],
}

impl Track {
    /// Moves the origin of the local frame.
    pub fn shift(&mut self, by: &Vector3<f32>) {
        self.motion.state[0] -= by.x;
        self.motion.state[2] -= by.y;
        self.height -= by.z;
        for snapshot in self.snapshots.iter_mut().flatten() {
            for p in &mut snapshot.samples {
                *p = (Vector3::from(*p) - by).into();
            }
            for corner in &mut snapshot.extent {
                *corner = [corner[0] - by.x, corner[1] - by.y];
            }
        }
    }

    fn born(config: &Config, id: u32, landmark: &Landmark, centre: &Vector3<f32>, noise: f32) -> Self {
        Self {
            id,
            class: landmark.class,
            family: landmark.family,
            state: MotionState::Undecided,
            motion: PlanarMotion::new(centre.xy(), noise * noise, velocity_variance(config, landmark.family)),
            height: centre.z,
            hits: 1,
            misses: 0,
            landmark: None,
            calm: 0,
            alarms: 0,
            cues: MotionCues::default(),
            omega: 0.0,
            snapshots: [None, None],
        }
    }
}

/// The parameters of a family.
pub fn class_config(config: &Config, family: SemanticClass) -> &ClassConfig {
    use SemanticClass::*;
    match family {
        Car | Truck | OtherVehicle => &config.vehicle,
        _ => &config.person,
    }
}

fn velocity_variance(config: &Config, family: SemanticClass) -> f32 {
    // A newborn may move at any speed that the gate lets pass within a tenth of a second.
    let speed = class_config(config, family).gate_m / 0.1 / 3.0;
    speed * speed
}

/// Standard deviation of a centre [m].
fn centre_noise(config: &Config, landmark: &Landmark) -> f32 {
    let [x, y, _] = landmark.centre;
    config.centre_noise_m + config.centre_noise_per_range * math::sqrt(x * x + y * y)
}

/// Follows the landmarks of a scan: predict, associate, update, recognise; writes each landmark's state and track.
/// Gives the number of landmarks that found no free track.
pub fn update<const COLUMNS: usize>(
    config: &Config,
    tau: f32,
    local_from_sensor: &Pose,
    landmarks: &mut [Landmark],
    visibility: &Visibility<COLUMNS>,
    next_id: &mut u32,
    tracks: &mut VecView<Track>,
) -> u32 {
    for track in tracks.iter_mut() {
        let acceleration = class_config(config, track.family).acceleration;
        track.motion.predict(track.omega, tau, acceleration);
        track.landmark = None;
        track.misses += 1;
        for snapshot in track.snapshots.iter_mut().flatten() {
            snapshot.age += 1;
            snapshot.age_s += tau;
        }
    }
    associate(config, local_from_sensor, landmarks, tracks);
    let mut refused = 0;
    for index in 0..landmarks.len() {
        if landmarks.get(index).is_none_or(|l| l.class.motion() != MotionClass::UnknownMotion) {
            continue;
        }
        let found = tracks.iter().position(|t| t.landmark == Some(index as u16));
        let whole = whole_of(config, landmarks, index).filter(|_| found.is_none());
        let whole = whole.map(|whole| (whole.state, whole.track));
        let Some(landmark) = landmarks.get_mut(index) else { break };
        if let Some(whole) = whole {
            (landmark.state, landmark.track) = whole;
            continue;
        }
        let centre = (local_from_sensor * Point3::from(landmark.centre)).coords;
        let noise = centre_noise(config, landmark);
        let Some(slot) = found.or_else(|| open(config, landmark, &centre, noise, next_id, tracks)) else {
            refused += 1;
            continue;
        };
        let Some(track) = tracks.get_mut(slot) else { break };
        track.landmark = Some(index as u16);
        if found.is_some() {
            correct(config, track, landmark, &centre, noise, tau, local_from_sensor, visibility);
        } else {
            let evidence = MotionCues::of(config, track, &look(landmark, local_from_sensor), visibility);
            recognition::decide(config, track, &evidence);
        }
        remember(track, look(landmark, local_from_sensor));
        (landmark.state, landmark.track) = (track.state, Some(track.id));
    }
    // A track outlives as many misses as it had hits, up to the limit.
    tracks.retain(|t| t.misses <= t.hits.min(config.max_misses));
    refused
}

/// The larger landmark of the same family, earlier in the list, that a small one beside it is a fragment of.
fn whole_of<'a>(config: &Config, landmarks: &'a [Landmark], index: usize) -> Option<&'a Landmark> {
    let part = landmarks.get(index)?;
    let gate = class_config(config, part.family).gate_m;
    landmarks.iter().take(index).find(|whole| {
        let apart = (Vector3::from(whole.centre) - Vector3::from(part.centre)).norm_squared();
        whole.family == part.family && whole.point_count > 3 * part.point_count && apart < gate * gate
    })
}

/// Mutual nearest neighbours of the same family within the gate (section 3.3.3).
fn associate(config: &Config, local_from_sensor: &Pose, landmarks: &[Landmark], tracks: &mut VecView<Track>) {
    let movable = |l: &Landmark| l.class.motion() == MotionClass::UnknownMotion;
    let centre = |l: &Landmark| (local_from_sensor * Point3::from(l.centre)).coords.xy();
    let nearest_track = |l: &Landmark, tracks: &VecView<Track>| {
        let at = centre(l);
        let of_family = tracks.iter().enumerate().filter(|(_, t)| t.family == l.family);
        of_family
            .map(|(i, t)| (i, (t.motion.position() - at).norm_squared()))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    };
    for i in 0..tracks.len() {
        let Some(track) = tracks.get(i) else { break };
        let at = track.motion.position();
        let of_family = landmarks.iter().enumerate().filter(|(_, l)| movable(l) && l.family == track.family);
        let distance2 = |(k, l)| (k, l, (centre(l) - at).norm_squared());
        let nearest = of_family.map(distance2).min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((k, landmark, distance2)) = nearest else { continue };
        let gate = class_config(config, track.family).gate_m;
        let mutual = nearest_track(landmark, tracks).is_some_and(|(t, _)| t == i);
        if let Some(track) = tracks.get_mut(i).filter(|_| mutual && distance2 < gate * gate) {
            track.landmark = Some(k as u16);
        }
    }
}

fn open(
    config: &Config,
    landmark: &Landmark,
    centre: &Vector3<f32>,
    noise: f32,
    next_id: &mut u32,
    tracks: &mut VecView<Track>,
) -> Option<usize> {
    tracks.push(Track::born(config, *next_id, landmark, centre, noise)).ok()?;
    *next_id += 1;
    Some(tracks.len() - 1)
}

#[allow(clippy::too_many_arguments, reason = "one step of the filter, everything it takes")]
fn correct<const COLUMNS: usize>(
    config: &Config,
    track: &mut Track,
    landmark: &Landmark,
    centre: &Vector3<f32>,
    noise: f32,
    tau: f32,
    local_from_sensor: &Pose,
    visibility: &Visibility<COLUMNS>,
) {
    let before = track.motion;
    track.motion.update(centre.xy(), &(Matrix2::identity() * (noise * noise)));
    track.omega = turn_rate(&before.velocity(), &track.motion.velocity(), track.omega, tau);
    (track.class, track.height) = (landmark.class, centre.z);
    (track.hits, track.misses) = (track.hits + 1, 0);
    let evidence = match config.rule {
        Rule::Paper => MotionCues::differences(&before, &track.motion, tau),
        Rule::Evidence => MotionCues::of(config, track, &look(landmark, local_from_sensor), visibility),
    };
    recognition::decide(config, track, &evidence);
}

/// Turn rate [rad/s] from the change of heading, smoothed; zero for slow things, whose heading means nothing.
fn turn_rate(before: &Vector2<f32>, after: &Vector2<f32>, omega: f32, tau: f32) -> f32 {
    if before.norm_squared() < 4.0 || after.norm_squared() < 4.0 || tau <= 0.0 {
        return 0.0;
    }
    let cross = before.x * after.y - before.y * after.x;
    let turned = math::atan2(cross, before.dot(after)) / tau;
    (0.8 * omega + 0.2 * turned).clamp(-0.6, 0.6)
}

/// The landmark's surface in the local frame.
fn look(landmark: &Landmark, local_from_sensor: &Pose) -> Snapshot {
    let moved = |p: &[f32; 3]| -> [f32; 3] { (local_from_sensor * Point3::from(*p)).coords.into() };
    let mut extent = [[f32::INFINITY; 2], [f32::NEG_INFINITY; 2]];
    for p in landmark.outline.iter().flatten().flatten().map(moved) {
        for k in 0..2 {
            extent[0][k] = extent[0][k].min(p[k]);
            extent[1][k] = extent[1][k].max(p[k]);
        }
    }
    Snapshot { age: 0, age_s: 0.0, samples: total::collect(landmark.samples.iter().map(moved)), extent }
}

fn remember(track: &mut Track, now: Snapshot) {
    let [older, newer] = &mut track.snapshots;
    match newer {
        Some(s) if s.age < SNAPSHOT_FRAMES => {}
        _ => {
            *older = newer.take();
            *newer = Some(now);
        }
    }
}
