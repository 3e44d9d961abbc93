//! Where the vehicle is and how it moves.

use nalgebra::Translation3;

use crate::estimate::FrameStatus;
use crate::pose::{self, MapPose, Pose, compose};

/// Where the vehicle is and how it moved. The local frame is the map frame moved to the anchor.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct EgoMotion {
    pub local_from_sensor: Pose,
    /// Motion of the last frame, and the time it took [s].
    pub previous_from_current: Pose,
    pub period_s: f64,
    /// Position of the local frame's origin in the map [m].
    pub anchor_m: [f64; 3],
    /// Pose of the last registered frame, local frame, and the time since [s]: the speed after a gap.
    pub registered: Pose,
    pub unregistered_s: f64,
    /// Path driven [m].
    pub path_m: f32,
    /// Frames in a row that were not registered, or not yet: the search widens.
    pub lost: u32,
    /// Frames in a row whose points did not fit the submap.
    pub misfits: u32,
    /// A frame was registered in the submap since it was started.
    pub confirmed: bool,
}

impl EgoMotion {
    /// At the origin, the speed unknown.
    pub const START: Self = Self {
        local_from_sensor: pose::IDENTITY,
        previous_from_current: pose::IDENTITY,
        period_s: 0.0,
        anchor_m: [0.0; 3],
        registered: pose::IDENTITY,
        unregistered_s: 0.0,
        path_m: 0.0,
        lost: 1,
        misfits: 0,
        confirmed: false,
    };

    /// The motion expected over `period_s`, at constant velocity.
    pub fn predict(&self, period_s: f64) -> Pose {
        if self.period_s <= 0.0 {
            return self.previous_from_current;
        }
        let ratio = (period_s / self.period_s) as f32;
        pose::exp(&(pose::log(&self.previous_from_current) * ratio.clamp(0.0, 10.0)))
    }

    /// Takes the new pose over. The motion is that since the last registered frame: a step from a predicted pose to a
    /// registered one is a correction, not a motion.
    pub fn advance(&mut self, local_from_sensor: &Pose, period_s: f64, status: FrameStatus) {
        if status != FrameStatus::First {
            let step = compose(&self.local_from_sensor.inverse(), local_from_sensor);
            self.path_m += step.translation.vector.norm();
            self.unregistered_s += period_s;
            if status == FrameStatus::Registered {
                let since = compose(&self.registered.inverse(), local_from_sensor);
                let share = (period_s / self.unregistered_s) as f32;
                self.previous_from_current =
                    if share < 1.0 { pose::exp(&(pose::log(&since) * share)) } else { since };
                (self.lost, self.confirmed) = (0, true);
            } else {
                self.previous_from_current = step;
                self.lost += 1;
            }
            self.period_s = period_s;
        }
        self.local_from_sensor = *local_from_sensor;
        if !matches!(status, FrameStatus::Predicted(_)) {
            (self.registered, self.unregistered_s) = (*local_from_sensor, 0.0);
        }
    }

    /// Pose in the map.
    pub fn map_from_sensor(&self) -> MapPose {
        let local: MapPose = self.local_from_sensor.cast();
        let [x, y, z] = self.anchor_m;
        Translation3::new(x, y, z) * local
    }
}
