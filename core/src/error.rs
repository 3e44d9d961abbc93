//! Errors: small, copyable, each naming the buffer or the parameter.

use core::fmt;

/// A parameter outside its range, found when a configuration is checked.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ParameterError {
    /// Stage and name, e.g. `precise_pose.max_iterations`.
    pub parameter: &'static str,
    /// What is allowed.
    pub expected: &'static str,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "parameter {} must be {}", self.parameter, self.expected)
    }
}

impl core::error::Error for ParameterError {}

/// All values lie within the bounds; NaN does not.
pub(crate) const fn all_within(values: &[f32], low: f32, high: f32) -> bool {
    let mut i = 0;
    while i < values.len() {
        if !(values[i] >= low && values[i] <= high) {
            return false;
        }
        i += 1;
    }
    true
}

/// Why a scan was refused. The state of the odometry is as before the call.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OdometryError {
    /// The scan's stamp [s] is not after the one before it.
    TimeWentBack {
        /// Stamp of the previous scan [s].
        previous_s: f64,
        /// Stamp of this scan [s].
        current_s: f64,
    },
    /// The scan's stamp is not a number.
    StampNotFinite,
}

impl fmt::Display for OdometryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TimeWentBack { previous_s, current_s } => {
                write!(f, "time stamp {current_s} s is not after the previous one, {previous_s} s")
            }
            Self::StampNotFinite => write!(f, "time stamp is not a finite number"),
        }
    }
}

impl core::error::Error for OdometryError {}
