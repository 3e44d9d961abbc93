//! Section 3.3.3: dynamic or semi-static.

use super::tracker::{Snapshot, Track, class_config};
use super::visibility::{Seen, Visibility};
use super::{Config, Rule};
use crate::estimation::kalman::PlanarMotion;
use crate::landmarks::MotionState;
use crate::math;

/// What speaks for motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MotionCues {
    /// Share of the surface that stands where the sensor looked through less than a second ago.
    pub appeared: f32,
    /// Share of the former surface that the sensor now looks through.
    pub left: f32,
    /// Share of the surface that stands where the sensor saw something most of a second ago.
    pub stayed: f32,
    /// Speed at which both ends of the landmark shift the same way [m/s]; a changed view moves one end only.
    pub shift_speed: f32,
    /// Length of that shift [m].
    pub shift_m: f32,
    /// Both ends of the landmark have stayed where they were for the last frames.
    pub at_rest: bool,
    /// Filtered speed [m/s].
    pub speed: f32,
    /// Filtered speed in its standard deviations.
    pub significance: f32,
    /// Eq. 5: difference of velocity between two frames [m/s].
    pub velocity_difference: f32,
    /// Eq. 5: difference of position between two frames [m].
    pub position_difference_m: f32,
}

/// Ages [frames] of the images that are asked whether a place was free.
const LOOK_BACK: [usize; 2] = [3, 8];

impl MotionCues {
    /// Eq. 5's discrepancies: of velocity, and of position beyond where a thing at rest would be.
    pub fn differences(before: &PlanarMotion, after: &PlanarMotion, tau: f32) -> Self {
        let velocity = (after.velocity() - before.velocity()).norm();
        // `before` is the prediction: its position minus the motion is where the centre was a frame ago.
        let position = (after.position() - (before.position() - before.velocity() * tau)).norm();
        Self { velocity_difference: velocity, position_difference_m: position, ..Self::default() }
    }

    /// Free space and displacement.
    pub fn of<const COLUMNS: usize>(
        config: &Config,
        track: &Track,
        now: &Snapshot,
        visibility: &Visibility<COLUMNS>,
    ) -> Self {
        let margin = config.free_margin_m;
        let share = |what, age, places: &[[f32; 3]]| visibility.share(what, age, places, margin);
        let (speed, significance) = track.motion.speed();
        let mut evidence = Self {
            appeared: LOOK_BACK
                .map(|age| share(Seen::Free, age, &now.samples))
                .into_iter()
                .fold(0.0, f32::max),
            stayed: share(Seen::Occupied, LOOK_BACK[1], &now.samples),
            speed,
            significance,
            ..Self::default()
        };
        for past in track.snapshots.iter().flatten() {
            evidence.left = evidence.left.max(share(Seen::Free, 0, &past.samples));
        }
        if let Some(past) = track.snapshots.iter().flatten().next().filter(|p| p.age > 0) {
            let shift = [0, 1].map(|k| {
                common_shift(past.extent[0][k], past.extent[1][k], now.extent[0][k], now.extent[1][k])
            });
            evidence.shift_m = math::sqrt(shift[0] * shift[0] + shift[1] * shift[1]);
            evidence.shift_speed = evidence.shift_m / past.age_s.max(1e-3);
        }
        if let Some(past) = track.snapshots.iter().flatten().last().filter(|p| p.age >= config.rest_frames) {
            let ends = past.extent.iter().flatten().zip(now.extent.iter().flatten());
            evidence.at_rest = ends.map(|(a, b)| math::abs(a - b)).fold(0.0, f32::max) < config.rest_m;
        }
        evidence
    }
}

/// How far an interval moved as a whole: zero when its ends moved apart or together.
fn common_shift(min_before: f32, max_before: f32, min_now: f32, max_now: f32) -> f32 {
    let (low, high) = (min_now - min_before, max_now - max_before);
    if low * high <= 0.0 {
        0.0
    } else if math::abs(low) < math::abs(high) {
        low
    } else {
        high
    }
}

/// Updates the state of a track.
pub fn decide(config: &Config, track: &mut Track, evidence: &MotionCues) {
    let class = class_config(config, track.family);
    let (moves, suspect) = match config.rule {
        Rule::Paper => {
            let differs = evidence.velocity_difference >= class.max_velocity_difference
                || evidence.position_difference_m >= class.max_position_difference_m;
            (differs, false)
        }
        Rule::Evidence => {
            let free = evidence.appeared.max(evidence.left);
            let shifted = evidence.shift_speed > class.shift_speed;
            let supported = free >= class.free_support && evidence.shift_m > 0.6 * class.shift_m;
            // Where something stood before, a shift is no proof: more or another part of it is seen now.
            let fast = evidence.speed > class.min_speed
                && evidence.significance > class.min_significance
                && evidence.stayed < class.max_stayed;
            let weak = shifted && (supported || (fast && evidence.shift_m > class.shift_m));
            track.alarms = if weak { track.alarms + if supported { 2 } else { 1 } } else { 0 };
            // A shift may be an accident of the view; one that lasts is not.
            let freed = free >= class.free_share && free > evidence.stayed;
            (!evidence.at_rest && freed || track.alarms >= class.alarm_frames, shifted && !evidence.at_rest)
        }
    };
    track.cues = *evidence;
    track.calm = match moves {
        true => 0,
        false => track.calm + if evidence.at_rest { 2 } else { 1 },
    };
    let calm_needed = if config.rule == Rule::Paper { 1 } else { config.calm_frames };
    // What shifts without proof of motion is watched for longer before it may hold the pose.
    let hits_needed = config.min_hits * if suspect { 2 } else { 1 };
    track.state = match track.state {
        _ if moves => MotionState::Dynamic,
        MotionState::Dynamic if track.calm < calm_needed => MotionState::Dynamic,
        _ if track.hits >= hits_needed => MotionState::SemiStatic,
        _ => MotionState::Undecided,
    };
}
