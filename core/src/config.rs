//! All parameters: one table per stage, checked once.

use crate::error::ParameterError;
use crate::{
    calibration, instances, label_filter, loop_closure, motion_state, precise_pose, preliminary_pose,
};

/// All parameters, one table per stage.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Label filter (section 3.1.2).
    pub label_filter: label_filter::Config,
    /// Calibration of the elevations.
    pub calibration: calibration::Config,
    /// Instances (section 3.1.2).
    pub instances: instances::Config,
    /// Preliminary pose (section 3.2).
    pub preliminary_pose: preliminary_pose::Config,
    /// Motion states (section 3.3).
    pub motion_state: motion_state::Config,
    /// Precise pose (section 3.4).
    pub precise_pose: precise_pose::Config,
    /// Loop closure (section 3.5).
    pub loop_closure: loop_closure::Config,
}

impl Config {
    /// The default: the paper's stages, its weak spots mended, and the dense refinement.
    pub const fn accurate() -> Self {
        Self {
            label_filter: label_filter::Config::DEFAULT,
            calibration: calibration::Config::DEFAULT,
            instances: instances::Config::DEFAULT,
            preliminary_pose: preliminary_pose::Config::DEFAULT,
            motion_state: motion_state::Config::DEFAULT,
            precise_pose: precise_pose::Config::DEFAULT,
            loop_closure: loop_closure::Config::DEFAULT,
        }
    }

    /// Nothing but the paper.
    pub const fn paper() -> Self {
        Self {
            label_filter: label_filter::Config::DEFAULT,
            calibration: calibration::Config::PAPER,
            instances: instances::Config::PAPER,
            preliminary_pose: preliminary_pose::Config::PAPER,
            motion_state: motion_state::Config::PAPER,
            precise_pose: precise_pose::Config::PAPER,
            loop_closure: loop_closure::Config::PAPER,
        }
    }

    /// Checks every parameter; names the first that is out of range.
    pub const fn check(&self) -> Result<(), ParameterError> {
        if let Err(error) = self.label_filter.check() {
            return Err(error);
        }
        if let Err(error) = self.calibration.check() {
            return Err(error);
        }
        if let Err(error) = self.instances.check() {
            return Err(error);
        }
        if let Err(error) = self.preliminary_pose.check() {
            return Err(error);
        }
        if let Err(error) = self.motion_state.check() {
            return Err(error);
        }
        if let Err(error) = self.precise_pose.check() {
            return Err(error);
        }
        self.loop_closure.check()
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::accurate()
    }
}
