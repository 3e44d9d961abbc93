//! The loop.

use sdslam_core::estimate::BufferUse;
use sdslam_core::{FrameEstimate, FrameStatus, LabelledPoint, LabelledScan, Odometry};

use crate::board::{Board, Fault};

/// What the loop has seen so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Scans fetched.
    pub scans: u32,
    /// Estimates published.
    pub estimates: u32,
    /// Estimates that are a prediction: the scan could not be registered.
    pub predicted: u32,
    /// Faults reported to the board.
    pub faults: u32,
    /// Most that was ever used of each buffer.
    pub high_water: HighWater,
}

/// Most that was ever used of each buffer, and most that ever did not fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HighWater {
    /// Points of a scan, those that did not fit included.
    pub points: usize,
    /// Each field on its own: they need not be of the same scan.
    pub buffers: BufferUse,
}

/// Registers every scan of the board until it has no more. `totals` is right at any time, also after an error.
///
/// `points` holds one scan. No allocation, no panic; the cost of a scan is bounded by the capacities.
///
/// # Errors
/// Those of the board. A scan that is refused is no error but a [`Fault`].
pub fn run<
    B: Board,
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
>(
    board: &mut B,
    odometry: &mut Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS>,
    points: &mut [LabelledPoint],
    totals: &mut Totals,
) -> Result<(), B::Error> {
    while let Some(header) = board.next_scan(points)? {
        totals.fetched(header.points);
        let capacity = points.len();
        if header.points > capacity {
            totals.report(board, Fault::PointsLost { received: header.points, capacity });
        }
        let points = points.get_mut(..header.points.min(capacity)).unwrap_or_default();
        match odometry.process_scan(&mut LabelledScan { stamp_s: header.stamp_s, points }) {
            Ok(estimate) => {
                board.publish(&estimate)?;
                totals.published(&estimate);
            }
            Err(error) => totals.report(board, Fault::Refused(error)),
        }
    }
    Ok(())
}

impl Totals {
    fn fetched(&mut self, points: usize) {
        self.scans = self.scans.saturating_add(1);
        self.high_water.points = self.high_water.points.max(points);
    }

    fn report(&mut self, board: &mut impl Board, fault: Fault) {
        self.faults = self.faults.saturating_add(1);
        board.fault(fault);
    }

    fn published(&mut self, estimate: &FrameEstimate) {
        self.estimates = self.estimates.saturating_add(1);
        if matches!(estimate.status, FrameStatus::Predicted(_)) {
            self.predicted = self.predicted.saturating_add(1);
        }
        self.high_water.buffers = larger(&self.high_water.buffers, &estimate.evidence.buffers);
    }
}

fn larger(a: &BufferUse, b: &BufferUse) -> BufferUse {
    BufferUse {
        cells: a.cells.max(b.cells),
        cells_refused: a.cells_refused.max(b.cells_refused),
        landmarks: a.landmarks.max(b.landmarks),
        landmarks_refused: a.landmarks_refused.max(b.landmarks_refused),
        tracks: a.tracks.max(b.tracks),
        tracks_refused: a.tracks_refused.max(b.tracks_refused),
        voxels: a.voxels.max(b.voxels),
        voxels_evicted: a.voxels_evicted.max(b.voxels_evicted),
        submap_landmarks: a.submap_landmarks.max(b.submap_landmarks),
        submap_landmarks_evicted: a.submap_landmarks_evicted.max(b.submap_landmarks_evicted),
    }
}
