//! The sensor's clock against the board's.

/// Scans may come late, and bunched; where both clocks disagree by more than this between two scans \[s\], the sensor's was
/// set. Set back by less, the odometry refuses scans until the stamps have caught up.
const TOLERANCE_S: f64 = 0.25;

/// Turns the stamps of a clock that may be set into stamps that only know the time passed.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensorClock {
    /// Added to every stamp \[s\].
    offset_s: f64,
    last: Option<Seen>,
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    stamp_s: f64,
    arrival_us: u64,
}

impl SensorClock {
    /// The stamp to use for a scan that arrived at `arrival_us`, and how far the clock was set since the last one \[s\].
    /// Until it is set, stamps come back as they are, bit for bit.
    pub fn steady(&mut self, stamp_s: f64, arrival_us: u64) -> (f64, Option<f64>) {
        // What is no number is the odometry's to refuse.
        if !stamp_s.is_finite() {
            return (stamp_s, None);
        }
        let mut set_s = None;
        if let Some(last) = self.last {
            let passed_s = arrival_us.saturating_sub(last.arrival_us) as f64 * 1e-6;
            let by_s = (stamp_s - last.stamp_s) - passed_s;
            if !(-TOLERANCE_S..=TOLERANCE_S).contains(&by_s) {
                self.offset_s -= by_s;
                set_s = Some(by_s);
            }
        }
        self.last = Some(Seen { stamp_s, arrival_us });
        (if self.offset_s == 0.0 { stamp_s } else { stamp_s + self.offset_s }, set_s)
    }
}
