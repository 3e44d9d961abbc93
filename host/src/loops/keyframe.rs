//! When a keyframe is made, and how far the odometry between two of them is to be trusted.

use nalgebra::{Matrix6, Vector6};
use sdslam_core::{FrameEstimate, MapPose};

/// Turn that makes a keyframe before the path does \[rad\].
const KEYFRAME_TURN_RAD: f64 = 0.25;
/// What the covariance of a registration does not know: drift per keyframe, standard deviations \[m\] and \[rad\]
/// (measured along simulated drives).
const DRIFT_M: f64 = 0.004;
const DRIFT_RAD: f64 = 0.000_15;

/// A node of the graph.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Keyframe {
    /// Frame of the run.
    pub frame: usize,
    /// Stamp of its scan \[s\].
    pub stamp_s: f64,
    /// Its pose by the odometry.
    pub odometry: MapPose,
    /// Path driven until then \[m\].
    pub path_m: f64,
}

impl Keyframe {
    /// The vehicle has gone on far enough for the next one.
    pub(crate) fn is_left_behind(&self, odometry: &MapPose, spacing_m: f64) -> bool {
        let moved = self.odometry.inv_mul(odometry);
        moved.translation.vector.norm() >= spacing_m || moved.rotation.angle() >= KEYFRAME_TURN_RAD
    }
}

/// Covariance of the odometry since the last keyframe, sensor frame: that of its frames, summed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OdometryError {
    covariance: Matrix6<f64>,
}

impl OdometryError {
    /// Nothing but the drift of one step.
    pub(crate) fn start() -> Self {
        let (p, r) = (DRIFT_M * DRIFT_M, DRIFT_RAD * DRIFT_RAD);
        Self { covariance: Matrix6::from_diagonal(&Vector6::new(p, p, p, r, r, r)) }
    }

    pub(crate) fn add(&mut self, estimate: &FrameEstimate) {
        self.covariance += covariance_of(&estimate.covariance);
    }

    pub(crate) fn information(&self) -> Option<Matrix6<f64>> {
        self.covariance.cholesky().map(|cholesky| cholesky.inverse())
    }
}

/// A covariance of the core in double precision, exactly symmetric.
pub(crate) fn covariance_of(core: &[[f32; 6]; 6]) -> Matrix6<f64> {
    Matrix6::from_fn(|row, column| f64::from(core[row][column] + core[column][row]) / 2.0)
}
