//! The line between sensor and board: what arrives, and when.

use std::convert::Infallible;

use sdslam_firmware_sim::wire::{scan_bytes, write_scan};

use crate::source::RecordedScan;

/// Bytes that arrive together.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// When, by the board's clock \[us\].
    pub arrival_us: u64,
    /// What.
    pub bytes: Vec<u8>,
    /// The board loses its power before this delivery.
    pub power_cycle: Option<PowerCycle>,
}

/// What a loss of power leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerCycle {
    /// Nothing.
    Nothing,
    /// The last saved state.
    SavedState,
    /// The last saved state, with a bit flipped.
    DamagedState,
}

impl Delivery {
    /// A scan that arrives when it was taken.
    pub fn of(scan: &RecordedScan) -> Self {
        Self { arrival_us: (scan.stamp_s.max(0.0) * 1e6) as u64, bytes: encoded(scan), power_cycle: None }
    }
}

/// A scan as it goes over the wire.
pub fn encoded(scan: &RecordedScan) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(scan_bytes(scan.points.len()));
    let Ok(()) = write_scan(scan.sequence, scan.stamp_s, &scan.points, |piece| {
        bytes.extend_from_slice(piece);
        Ok::<_, Infallible>(())
    });
    bytes
}
