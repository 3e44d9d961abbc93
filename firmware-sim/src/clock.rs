//! The sensor's clock, against the board's and against the count of the scans.
//!
//! Any of the three may mislead: the sensor's clock may be set, scans may come late and bunched, and a sensor may pause or
//! start counting anew. Where the sensor's clock disagrees with both others, it was set.

use serde::{Deserialize, Serialize};

use crate::board::ScanHeader;

/// Two clocks agree about the time between two scans when they differ by no more than this \[s\].
const AGREE_S: f64 = 0.05;
/// A scan comes later than its stamp says by no more than this \[s\].
const LATE_S: f64 = 0.25;
/// A scan that was sent this many scans ago may still come; a number from farther back is that of a sender that counts anew.
const LATE_SCANS: i32 = 8;
/// After a loss of power the board's clock knows nothing of the time before. The others are believed about it up to this \[s\];
const LONGEST_OFF_S: f64 = 10.0;
/// otherwise it counts as that between two scans \[s\]: who stood still goes on at his place.
const UNKNOWN_OFF_S: f64 = 0.1;

/// Turns the stamps of a clock that may be set into stamps that only know the time passed.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensorClock {
    /// Added to every stamp \[s\].
    offset_s: f64,
    /// Time from one scan to the next \[s\], once there were two.
    period_s: Option<f64>,
    last: Option<Seen>,
}

/// What of a clock outlives a loss of power.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct ClockState {
    offset_s: f64,
    period_s: Option<f64>,
    last: Option<(u32, f64)>,
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    sequence: u32,
    stamp_s: f64,
    /// By the board's clock; `None` when that has started anew since.
    arrival_us: Option<u64>,
}

/// By how many scans `sequence` is newer than `last`; 0 or less for one that comes twice or late, `None` when the sender
/// counts anew. Numbers wrap.
pub(crate) fn scans_between(last: u32, sequence: u32) -> Option<i32> {
    let scans = sequence.wrapping_sub(last) as i32;
    (scans >= -LATE_SCANS).then_some(scans)
}

impl SensorClock {
    /// The stamp to use for a scan that arrived at `arrival_us`, and how far the clock was set since the last one \[s\].
    /// Until it is set, stamps come back as they are, bit for bit. A scan that is not newer than the last one gets a stamp that
    /// is not either.
    pub fn steady(&mut self, scan: &ScanHeader, arrival_us: u64) -> (f64, Option<f64>) {
        // What is no number is the odometry's to refuse.
        if !scan.stamp_s.is_finite() {
            return (scan.stamp_s, None);
        }
        let mut set_s = None;
        if let Some(last) = self.last {
            let scans = scans_between(last.sequence, scan.sequence);
            if scans.is_some_and(|scans| scans <= 0) {
                return (self.shifted(scan.stamp_s.min(last.stamp_s)), None);
            }
            let step = last.step_to(scan.stamp_s, arrival_us, scans.zip(self.period_s));
            set_s = step.set_by_s();
            match (set_s, scans) {
                (Some(by_s), _) => self.offset_s -= by_s,
                (None, Some(scans)) => self.period_s = Some(step.by_sensor_s / f64::from(scans)),
                (None, None) => {}
            }
        }
        self.last =
            Some(Seen { sequence: scan.sequence, stamp_s: scan.stamp_s, arrival_us: Some(arrival_us) });
        (self.shifted(scan.stamp_s), set_s)
    }

    fn shifted(&self, stamp_s: f64) -> f64 {
        if self.offset_s == 0.0 { stamp_s } else { stamp_s + self.offset_s }
    }

    pub(crate) fn state(&self) -> ClockState {
        let last = self.last.map(|last| (last.sequence, last.stamp_s));
        ClockState { offset_s: self.offset_s, period_s: self.period_s, last }
    }

    /// The clock that had this state before the power was lost.
    pub(crate) fn resumed(state: ClockState) -> Self {
        let last = state.last.map(|(sequence, stamp_s)| Seen { sequence, stamp_s, arrival_us: None });
        Self { offset_s: state.offset_s, period_s: state.period_s, last }
    }
}

/// The time from one scan to a newer one \[s\], by three clocks.
struct Step {
    by_sensor_s: f64,
    by_board_s: Option<f64>,
    by_count_s: Option<f64>,
}

impl Seen {
    fn step_to(&self, stamp_s: f64, arrival_us: u64, scans_and_period: Option<(i32, f64)>) -> Step {
        let passed_s = |before_us: u64| arrival_us.saturating_sub(before_us) as f64 * 1e-6;
        Step {
            by_sensor_s: stamp_s - self.stamp_s,
            by_board_s: self.arrival_us.map(passed_s),
            by_count_s: scans_and_period.map(|(scans, period_s)| f64::from(scans) * period_s),
        }
    }
}

impl Step {
    /// How far the sensor's clock was set on the way \[s\].
    fn set_by_s(&self) -> Option<f64> {
        let by_s = self.by_sensor_s;
        let agrees = |other_s: f64, within_s: f64| (by_s - other_s).abs() <= within_s;
        let believed = match (self.by_board_s, self.by_count_s) {
            (_, Some(count_s)) if agrees(count_s, AGREE_S) => true,
            (Some(board_s), Some(_)) => agrees(board_s, AGREE_S),
            (Some(board_s), None) => agrees(board_s, LATE_S),
            (None, _) => by_s <= LONGEST_OFF_S,
        };
        (!(believed && by_s > 0.0)).then(|| by_s - self.without_sensor_s())
    }

    /// The count is steadier than the arrival, unless the sensor has paused.
    fn without_sensor_s(&self) -> f64 {
        match (self.by_board_s, self.by_count_s) {
            (Some(board_s), Some(count_s)) if (board_s - count_s).abs() <= LATE_S => count_s,
            (Some(board_s), _) => board_s,
            (None, Some(count_s)) if count_s <= LONGEST_OFF_S => count_s,
            (None, _) => UNKNOWN_OFF_S,
        }
    }
}
