//! Stage 6, section 3.4: precise pose, scan to local submap, without dynamic landmarks.
//!
//! Horizontal by hulls and swarm (3.4.1), vertical from the ground (3.4.2), then, not in the paper, the dense refinement
//! that also carries roll.

pub mod dense;
pub mod landmark_map;
pub mod vertical;
pub mod voxel_map;

use crate::error::ParameterError;
use crate::preliminary_pose::{hull_registration, pairing};

/// Parameters of the precise pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Register hulls against the submap (section 3.4.1).
    pub horizontal: bool,
    /// Pairing with the landmarks of the submap.
    pub pairing: pairing::Config,
    /// Hulls and swarm.
    pub hulls: hull_registration::Config,
    /// Vertical pose.
    pub vertical: vertical::Config,
    /// Dense refinement.
    pub dense: dense::Config,
    /// Voxels of the submap.
    pub voxels: voxel_map::Config,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        horizontal: false,
        pairing: pairing::Config::DEFAULT,
        hulls: hull_registration::Config::DEFAULT,
        vertical: vertical::Config::DEFAULT,
        dense: dense::Config::DEFAULT,
        voxels: voxel_map::Config::DEFAULT,
    };

    /// Nothing but the paper.
    pub const PAPER: Self = Self {
        horizontal: true,
        pairing: pairing::Config::PAPER,
        hulls: hull_registration::Config::PAPER,
        dense: dense::Config { enabled: false, ..dense::Config::DEFAULT },
        ..Self::DEFAULT
    };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if !self.horizontal && !self.dense.enabled {
            return Err(ParameterError {
                parameter: "precise_pose.horizontal",
                expected: "on when dense.enabled is off",
            });
        }
        if let Err(error) = self.hulls.check() {
            return Err(error);
        }
        if let Err(error) = self.pairing.check() {
            return Err(error);
        }
        if let Err(error) = self.vertical.check() {
            return Err(error);
        }
        if let Err(error) = self.voxels.check() {
            return Err(error);
        }
        self.dense.check()
    }
}
