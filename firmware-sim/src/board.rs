//! What the loop asks of a board.

use core::fmt;

use sdslam_core::snapshot::SnapshotError;
use sdslam_core::{LabelledPoint, OdometryError, Stage};

use crate::wire::Answer;

/// A scan that a board has delivered.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScanHeader {
    /// Counts the scans of the sender, from any number on; the loop reports what is missing.
    pub sequence: u32,
    /// Time of the scan \[s\], on the sensor's clock.
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

    /// Time from a scan to its answer \[us\] above which [`Fault::Late`] is reported: by then the next scan is there.
    const DEADLINE_US: u64 = 100_000;

    /// Waits for the next scan and writes its points to the beginning of `points`. `None` ends the loop; a board in a
    /// vehicle never says so.
    fn next_scan(&mut self, points: &mut [LabelledPoint]) -> Result<Option<ScanHeader>, Self::Error>;

    /// The board's own clock \[us\], which never goes back and is never set. Tells a gap between scans from a sensor's clock
    /// that was set.
    fn now_us(&mut self) -> u64;

    /// Hands on the answer to the last scan. Called once for every scan that is not refused.
    fn publish(&mut self, answer: Answer<'_>) -> Result<(), Self::Error>;

    /// The loop is alive: called once a scan, when it is answered or refused. For the watchdog.
    fn alive(&mut self);

    /// Is told what was wrong with the last scan; the loop goes on.
    fn fault(&mut self, fault: Fault);

    /// The last state that was saved before the board lost its power, if there is one: asked for once, before the first scan.
    /// The loop goes on from it when it is intact, and starts anew when it is not.
    fn saved_state(&mut self) -> Option<&[u8]> {
        None
    }

    /// Memory that outlives a loss of power, when the state is to be saved now: asked for behind every scan. As many bytes as
    /// the odometry has and [`SAVED_HEAD_BYTES`](crate::SAVED_HEAD_BYTES) always suffice. Not where the last saved state
    /// lies: the power may go while this one is written.
    fn room_for_state(&mut self) -> Option<&mut [u8]> {
        None
    }

    /// The state was saved in the first `bytes` of what [`Self::room_for_state`] gave.
    fn state_saved(&mut self, bytes: usize) {
        let _ = bytes;
    }

    /// A stage of the odometry is done. For measuring.
    fn stage_finished(&mut self, stage: Stage) {
        let _ = stage;
    }
}

/// What can be wrong with a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    /// Scans between the last one and this one never came.
    Missed {
        /// How many.
        scans: u32,
    },
    /// The sensor's clock was set: the loop goes by the board's clock for this step.
    ClockSet {
        /// How far it went, compared with the board's clock \[s\].
        by_s: f64,
    },
    /// The saved state is damaged, or of another program: the loop starts anew.
    NotRestored(SnapshotError),
    /// The state does not fit the board's memory for it.
    NotSaved(SnapshotError),
    /// The answer came later than [`Board::DEADLINE_US`].
    Late {
        /// Time from the scan to its answer \[us\].
        took_us: u64,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => write!(f, "scan refused: {error}"),
            Self::PointsLost { received, capacity } => {
                write!(f, "scan of {received} points cut to the {capacity} that the buffer holds")
            }
            Self::Missed { scans } => write!(f, "{scans} scans before this one never came"),
            Self::ClockSet { by_s } => write!(f, "the sensor's clock was set by {by_s:.3} s"),
            Self::NotRestored(error) => write!(f, "started anew: {error}"),
            Self::NotSaved(error) => write!(f, "state not saved: {error}"),
            Self::Late { took_us } => write!(f, "answered after {took_us} us, past the deadline"),
        }
    }
}
