//! The loop.

use sdslam_core::estimate::BufferUse;
use sdslam_core::{FrameEstimate, FrameStatus, LabelledPoint, LabelledScan, Stage, StageObserver};

use crate::any_odometry::AnyOdometry;
use crate::board::{Board, Fault, ScanHeader};
use crate::clock::scans_between;
use crate::saved::Session;
use crate::wire::Answer;

/// What the loop has seen so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Scans fetched.
    pub scans: u32,
    /// Scans that never came, by their sequence numbers.
    pub missed: u32,
    /// Estimates published.
    pub estimates: u32,
    /// Estimates that are a prediction: the scan could not be registered.
    pub predicted: u32,
    /// Faults reported to the board.
    pub faults: u32,
    /// Times that the loop went on from a saved state.
    pub resumed: u32,
    /// Longest time from a scan to its answer, by the board's clock \[us\].
    pub longest_us: u64,
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
/// `odometry` is a new one; where the board has a saved state, the loop goes on from that. `points` holds one scan. No
/// allocation, no panic; the cost of a scan is bounded by the capacities.
///
/// # Errors
/// Those of the board. A scan that is refused is no error but a [`Fault`].
pub fn run<B: Board>(
    board: &mut B,
    odometry: &mut impl AnyOdometry,
    points: &mut [LabelledPoint],
    totals: &mut Totals,
) -> Result<(), B::Error> {
    let mut session = totals.resume(board, odometry);
    while let Some(header) = board.next_scan(points)? {
        let arrival_us = board.now_us();
        let capacity = points.len();
        totals.fetched(header.points);
        totals.report_gaps(board, &mut session.last_sequence, &header, capacity);
        let (stamp_s, set_s) = session.clock.steady(&header, arrival_us);
        if let Some(by_s) = set_s {
            totals.report(board, Fault::ClockSet { by_s });
        }
        let points = points.get_mut(..header.points.min(capacity)).unwrap_or_default();
        let mut scan = LabelledScan { stamp_s, points };
        match odometry.process(&mut scan, &mut Stages(board)) {
            Ok(estimate) => {
                totals.published(&estimate);
                let estimate = FrameEstimate { stamp_s: header.stamp_s, ..estimate };
                let tracks = &mut odometry.tracks();
                board.publish(Answer { sequence: header.sequence, estimate, tracks, points: scan.points })?;
            }
            Err(error) => totals.report(board, Fault::Refused(error)),
        }
        totals.answered(board, arrival_us);
        totals.keep(board, odometry, &session);
    }
    Ok(())
}

/// Passes the stages on to the board.
struct Stages<'a, B>(&'a mut B);

impl<B: Board> StageObserver for Stages<'_, B> {
    fn finished(&mut self, stage: Stage) {
        self.0.stage_finished(stage);
    }
}

impl Totals {
    /// From the saved state, if there is one and it is intact.
    fn resume(&mut self, board: &mut impl Board, odometry: &mut impl AnyOdometry) -> Session {
        match board.saved_state().map(|saved| Session::restore(saved, odometry)) {
            None => Session::default(),
            Some(Ok(session)) => {
                self.resumed = self.resumed.saturating_add(1);
                session
            }
            Some(Err(error)) => {
                self.report(board, Fault::NotRestored(error));
                Session::default()
            }
        }
    }

    /// Saves the state, where the board wants it.
    fn keep(&mut self, board: &mut impl Board, odometry: &impl AnyOdometry, session: &Session) {
        match board.room_for_state().map(|room| session.save(odometry, room)) {
            None => {}
            Some(Ok(bytes)) => board.state_saved(bytes),
            Some(Err(error)) => self.report(board, Fault::NotSaved(error)),
        }
    }

    fn fetched(&mut self, points: usize) {
        self.scans = self.scans.saturating_add(1);
        self.high_water.points = self.high_water.points.max(points);
    }

    /// Scans that never came, and points that did not fit.
    fn report_gaps(
        &mut self,
        board: &mut impl Board,
        last_sequence: &mut Option<u32>,
        header: &ScanHeader,
        capacity: usize,
    ) {
        // A duplicate or a late scan is no gap, nor is a sender that counts anew.
        let scans = last_sequence.and_then(|last| scans_between(last, header.sequence)).unwrap_or(1);
        if scans > 0 {
            *last_sequence = Some(header.sequence);
        }
        if scans > 1 {
            let scans = scans as u32 - 1;
            self.missed = self.missed.saturating_add(scans);
            self.report(board, Fault::Missed { scans });
        }
        if header.points > capacity {
            self.report(board, Fault::PointsLost { received: header.points, capacity });
        }
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

    fn answered<B: Board>(&mut self, board: &mut B, arrival_us: u64) {
        board.alive();
        let took_us = board.now_us().saturating_sub(arrival_us);
        self.longest_us = self.longest_us.max(took_us);
        if took_us > B::DEADLINE_US {
            self.report(board, Fault::Late { took_us });
        }
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
