//! What the loop asks of a board.

use core::fmt;

use sdslam_core::{FrameEstimate, LabelledPoint, OdometryError};

/// A scan that a board has delivered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanHeader {
    /// Time of the scan \[s\], on a clock that does not go back.
    pub stamp_s: f64,
    /// Points of the scan. When there are more than the buffer holds, it holds the first ones and the others are lost.
    pub points: usize,
}

/// The hardware around the odometry.
///
/// An error ends the loop: what can be survived, such as a scan garbled on the wire, a board counts and leaves out.
pub trait Board {
    /// Why the board cannot go on.
    type Error;

    /// Waits for the next scan and writes its points to the beginning of `points`. `None` ends the loop; a board in a
    /// vehicle never says so.
    fn next_scan(&mut self, points: &mut [LabelledPoint]) -> Result<Option<ScanHeader>, Self::Error>;

    /// Hands on the estimate of the last scan. Called once for every scan that is not refused.
    fn publish(&mut self, estimate: &FrameEstimate) -> Result<(), Self::Error>;

    /// Is told what was wrong with the last scan; the loop goes on.
    fn fault(&mut self, fault: Fault);
}

/// What can be wrong with a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The odometry refused the scan: there is no estimate for it, and the next scan is treated as if it had not been.
    Refused(OdometryError),
    /// The scan was larger than the buffer: it was processed without the points that did not fit.
    PointsLost {
        /// Points of the scan.
        received: usize,
        /// Points that the buffer holds.
        capacity: usize,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => write!(f, "scan refused: {error}"),
            Self::PointsLost { received, capacity } => {
                write!(f, "scan of {received} points cut to the {capacity} that the buffer holds")
            }
        }
    }
}
