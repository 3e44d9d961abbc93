//! A board on a desk: scans from files, estimates to memory. Stricter than a device: it refuses an estimate that no
//! scan has asked for.

use std::time::Instant;

use anyhow::{Context, ensure};
use sdslam_core::{FrameEstimate, LabelledPoint};
use sdslam_firmware_sim::{Board, Fault, ScanHeader};

use crate::drive::Drive;

/// A board that replays a drive.
pub struct DeskBoard {
    drive: Drive,
    next: usize,
    /// When the scan was handed to the loop; none once its estimate is there.
    fetched_at: Option<Instant>,
    /// From the scan to its estimate \[ms\].
    pub times_ms: Vec<f64>,
    /// The estimate of the last scan.
    pub last: Option<FrameEstimate>,
}

impl DeskBoard {
    /// Begins with the first scan of the drive.
    pub fn new(drive: Drive) -> Self {
        Self { drive, next: 0, fetched_at: None, times_ms: Vec::new(), last: None }
    }
}

impl Board for DeskBoard {
    type Error = anyhow::Error;

    fn next_scan(&mut self, points: &mut [LabelledPoint]) -> anyhow::Result<Option<ScanHeader>> {
        let header = self.drive.read(self.next, points)?;
        self.next += 1;
        self.fetched_at = Some(Instant::now());
        Ok(header)
    }

    fn publish(&mut self, estimate: &FrameEstimate) -> anyhow::Result<()> {
        let fetched_at =
            self.fetched_at.take().context("an estimate was published twice, or without a scan")?;
        self.times_ms.push(fetched_at.elapsed().as_secs_f64() * 1e3);
        let in_order = self.last.is_none_or(|last| last.stamp_s < estimate.stamp_s);
        ensure!(in_order, "the estimate of {} s is older than the one before it", estimate.stamp_s);
        self.last = Some(*estimate);
        Ok(())
    }

    fn fault(&mut self, fault: Fault) {
        eprintln!("scan {}: {fault}", self.next.saturating_sub(1));
    }
}
