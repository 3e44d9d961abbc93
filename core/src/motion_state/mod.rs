//! Stage 5, section 3.3: motion states of landmarks whose class may move.
//!
//! One Kalman filter per landmark, fed with centres in the local map frame (eq. 3 and 4); mutual nearest neighbours of
//! the same family; and a recognition rule: the paper's eq. 5, or, by default, one that also asks whether the space
//! was seen to be free.

pub mod recognition;
pub mod tracker;
pub mod visibility;

use crate::error::{self, ParameterError};

/// Parameters of one group of classes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ClassConfig {
    /// Largest distance between a prediction and its landmark [m].
    pub gate_m: f32,
    /// Standard deviation of the acceleration [m/s2].
    pub acceleration: f32,
    /// `v_max` of eq. 5 [m/s].
    pub max_velocity_difference: f32,
    /// `d_max` of eq. 5 [m].
    pub max_position_difference_m: f32,
    /// Share of a landmark in space known to be free that proves motion.
    pub free_share: f32,
    /// Share in free space that makes a shift believable.
    pub free_support: f32,
    /// Speed of a shift of the landmark as a whole that speaks for motion [m/s].
    pub shift_speed: f32,
    /// Length of such a shift [m].
    pub shift_m: f32,
    /// Filtered speed that makes a shift believable where nothing is known of free space [m/s].
    pub min_speed: f32,
    /// The same in standard deviations.
    pub min_significance: f32,
    /// A shift is believable only where less than this share of the landmark stands where something stood before.
    pub max_stayed: f32,
    /// Frames in a row with a believable shift that prove motion; those supported by free space count twice.
    pub alarm_frames: u32,
}

impl ClassConfig {
    const fn is_valid(&self) -> bool {
        let values = [
            self.acceleration,
            self.max_velocity_difference,
            self.max_position_difference_m,
            self.free_share,
            self.free_support,
            self.shift_speed,
            self.shift_m,
            self.min_speed,
            self.min_significance,
            self.max_stayed,
        ];
        error::all_within(&values, 0.0, 1000.0)
    }
}

/// Rule that tells dynamic from semi-static landmarks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Rule {
    /// Eq. 5: differences of position and velocity between two frames.
    Paper,
    /// Free space and displacement over up to a second.
    Evidence,
}

/// Parameters of the motion states.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Recognition rule.
    pub rule: Rule,
    /// Standard deviation of a centre's position near the sensor [m].
    pub centre_noise_m: f32,
    /// Its growth with range.
    pub centre_noise_per_range: f32,
    /// Frames that a track survives without its landmark.
    pub max_misses: u32,
    /// Landmarks seen before a track is called semi-static; twice as many while it shifts without proof of motion.
    pub min_hits: u32,
    /// Frames without evidence of motion before a dynamic track is called semi-static again.
    pub calm_frames: u32,
    /// A landmark whose ends moved less than this [m] is at rest,
    pub rest_m: f32,
    /// over at least this many frames (at most 5).
    pub rest_frames: u32,
    /// Space counts as free when the sensor saw this much farther [m].
    pub free_margin_m: f32,
    /// Persons, bicyclists, motorcyclists, bicycles, motorcycles.
    pub person: ClassConfig,
    /// Cars, trucks, other vehicles.
    pub vehicle: ClassConfig,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        rule: Rule::Evidence,
        centre_noise_m: 0.15,
        centre_noise_per_range: 0.005,
        max_misses: 8,
        min_hits: 5,
        calm_frames: 5,
        rest_m: 0.2,
        rest_frames: 2,
        free_margin_m: 0.4,
        person: ClassConfig {
            gate_m: 1.2,
            acceleration: 2.0,
            max_velocity_difference: 0.8,
            max_position_difference_m: 0.25,
            free_share: 0.3,
            free_support: 0.05,
            shift_speed: 0.5,
            shift_m: 0.3,
            min_speed: 0.5,
            min_significance: 0.8,
            max_stayed: 0.4,
            alarm_frames: 2,
        },
        vehicle: ClassConfig {
            gate_m: 2.8,
            acceleration: 3.0,
            max_velocity_difference: 1.5,
            max_position_difference_m: 0.4,
            free_share: 0.25,
            free_support: 0.06,
            shift_speed: 0.8,
            shift_m: 0.6,
            min_speed: 2.5,
            min_significance: 2.5,
            max_stayed: 0.05,
            alarm_frames: 3,
        },
    };

    /// Nothing but the paper.
    pub const PAPER: Self = Self { rule: Rule::Paper, ..Self::DEFAULT };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if !(self.centre_noise_m > 0.0) {
            return Err(ParameterError { parameter: "motion_state.centre_noise_m", expected: "positive" });
        }
        if !error::all_within(&[self.centre_noise_per_range, self.free_margin_m, self.rest_m], 0.0, 100.0) {
            let parameter = "motion_state.centre_noise_per_range, free_margin_m and rest_m";
            return Err(ParameterError { parameter, expected: "0 to 100" });
        }
        if !self.person.is_valid() || !self.vehicle.is_valid() {
            return Err(ParameterError {
                parameter: "motion_state.person and vehicle",
                expected: "0 to 1000 each",
            });
        }
        if !(self.person.gate_m > 0.0 && self.vehicle.gate_m > 0.0) {
            return Err(ParameterError { parameter: "motion_state.*.gate_m", expected: "positive" });
        }
        Ok(())
    }
}
