//! Stage 4, section 3.2: preliminary pose in the plane (x, y, yaw), scan to scan, from convex hulls.

pub mod hull_registration;
pub mod pairing;

use heapless::VecView;

use crate::error::ParameterError;
use crate::estimate::{HullEvidence, LandmarkInput};
use crate::landmarks::{Landmark, MotionState};
use crate::pose::{PlanarPose, Pose};
use crate::scan::MotionClass;
use hull_registration::HullPair;
use pairing::Candidate;

/// Parameters of the preliminary pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Pure static landmarks are enough from this number on.
    pub enough_pairs: u32,
    /// And when they lie in this many of the four quadrants around the sensor.
    pub enough_quadrants: u32,
    /// Pairing of landmarks (section 3.2.1).
    pub pairing: pairing::Config,
    /// Hulls and swarm (sections 3.2.2 to 3.2.4).
    pub hulls: hull_registration::Config,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        enough_pairs: 12,
        enough_quadrants: 3,
        pairing: pairing::Config::DEFAULT,
        hulls: hull_registration::Config::DEFAULT,
    };

    /// Nothing but the paper.
    pub const PAPER: Self =
        Self { pairing: pairing::Config::PAPER, hulls: hull_registration::Config::PAPER, ..Self::DEFAULT };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if self.enough_quadrants > 4 {
            return Err(ParameterError {
                parameter: "preliminary_pose.enough_quadrants",
                expected: "0 to 4",
            });
        }
        match self.pairing.check() {
            Ok(()) => self.hulls.check(),
            Err(error) => Err(error),
        }
    }
}

/// Refines the predicted motion between two scans by their landmarks: gives `previous_from_current`.
///
/// `pairs` and `candidates` are scratch. With no pair at all the prediction comes back.
#[allow(clippy::too_many_arguments, reason = "scratch memory is the caller's")]
pub fn estimate(
    config: &Config,
    seed: u64,
    previous: &[Landmark],
    current: &[Landmark],
    predicted_previous_from_current: &Pose,
    candidates: &mut VecView<Candidate>,
    pairs: &mut VecView<HullPair>,
) -> (Pose, HullEvidence) {
    let input =
        if pure_static_suffice(config, current) { LandmarkInput::PureStatic } else { LandmarkInput::All };
    let usable = |l: &Landmark| match input {
        LandmarkInput::PureStatic => l.class.motion() == MotionClass::PureStatic,
        // A landmark already recognised as dynamic carries its state over in its track.
        _ => l.state != MotionState::Dynamic,
    };
    pairing::pair(
        &config.pairing,
        previous.iter(),
        current,
        predicted_previous_from_current,
        usable,
        candidates,
    );
    hull_registration::pair_hulls(
        &config.hulls,
        |i| previous.get(i),
        current,
        predicted_previous_from_current,
        candidates,
        pairs,
    );
    let start = PlanarPose::from_pose(predicted_previous_from_current);
    let (planar, mut evidence) = hull_registration::register(&config.hulls, seed, start, pairs);
    evidence.input = if pairs.is_empty() { LandmarkInput::None } else { input };
    (with_planar(predicted_previous_from_current, &start, &planar), evidence)
}

/// A pose with its horizontal part replaced.
pub fn with_planar(pose: &Pose, from: &PlanarPose, to: &PlanarPose) -> Pose {
    let turn = crate::pose::exp_so3(nalgebra::Vector3::new(0.0, 0.0, to.yaw - from.yaw));
    let rotation = nalgebra::UnitQuaternion::new_normalize((turn * pose.rotation).into_inner());
    Pose::from_parts(nalgebra::Vector3::new(to.x, to.y, pose.translation.z).into(), rotation)
}

/// Section 3.2: pure static landmarks alone are used when they are adequate; not when they are scarce, crowded into one
/// part of the view, or outnumbered.
fn pure_static_suffice(config: &Config, landmarks: &[Landmark]) -> bool {
    let (mut pure, mut other, mut quadrants) = (0u32, 0u32, [false; 4]);
    for landmark in landmarks {
        if landmark.class.motion() == MotionClass::PureStatic {
            pure += 1;
            let quadrant = usize::from(landmark.centre[0] < 0.0) * 2 + usize::from(landmark.centre[1] < 0.0);
            quadrants[quadrant & 3] = true;
        } else {
            other += 1;
        }
    }
    let spread = quadrants.iter().filter(|q| **q).count() as u32;
    pure >= config.enough_pairs && spread >= config.enough_quadrants && pure >= other
}
