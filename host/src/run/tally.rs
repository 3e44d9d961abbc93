//! Sums over a run of what the core reports per frame.

use std::collections::BTreeMap;

use sdslam_core::FrameStatus;
use sdslam_core::estimate::{BufferUse, FrameEstimate, PointCounts};
use serde::{Serialize, Serializer};

/// A number of the evidence and its name.
type Number<T> = (&'static str, fn(&T) -> u32);

/// How each count of the label filter is called, and where it is.
const POINTS: [Number<PointCounts>; 9] = [
    ("received", |c| c.received),
    ("not_finite", |c| c.not_finite),
    ("out_of_range", |c| c.out_of_range),
    ("unlabelled", |c| c.unlabelled),
    ("unsure", |c| c.unsure),
    ("over_capacity", |c| c.over_capacity),
    ("ground", |c| c.ground),
    ("pure_static", |c| c.pure_static),
    ("unknown_motion", |c| c.unknown_motion),
];

/// How full each buffer is.
const BUFFERS: [Number<BufferUse>; 5] = [
    ("cells", |b| b.cells),
    ("landmarks", |b| b.landmarks),
    ("tracks", |b| b.tracks),
    ("voxels", |b| b.voxels),
    ("submap_landmarks", |b| b.submap_landmarks),
];

/// What did not fit, for run.log.
pub(super) const REFUSED: [Number<FrameEstimate>; 6] = [
    ("points over the capacity of a scan, dropped", |e| e.evidence.points.over_capacity),
    ("points without a free scan cell, dropped", |e| e.evidence.buffers.cells_refused),
    ("instances without a free landmark, dropped", |e| e.evidence.buffers.landmarks_refused),
    ("landmarks without a free track", |e| e.evidence.buffers.tracks_refused),
    ("submap voxels replaced within the window", |e| e.evidence.buffers.voxels_evicted),
    ("submap landmarks dropped within the window", |e| e.evidence.buffers.submap_landmarks_evicted),
];

/// Counts of the whole run.
#[derive(Default, Serialize)]
pub(super) struct Tally {
    /// Frames that started a map.
    first: u64,
    /// Frames registered against the submap.
    registered: u64,
    /// Frames whose pose is the prediction, by reason.
    predicted: BTreeMap<&'static str, u64>,
    /// Scans that could not be read: the core was given an empty one.
    pub unreadable_scans: u64,
    /// Time stamps that were not after the one before.
    pub replaced_stamps: u64,
    /// Points by what the label filter did with them, summed.
    points: Named<u64, { POINTS.len() }>,
    /// Largest use of each buffer in any frame.
    buffers_peak: Named<u32, { BUFFERS.len() }>,
}

impl Tally {
    pub(super) fn add(&mut self, estimate: &FrameEstimate) {
        match estimate.status {
            FrameStatus::First => self.first += 1,
            FrameStatus::Registered => self.registered += 1,
            FrameStatus::Predicted(fallback) => *self.predicted.entry(fallback.reason()).or_default() += 1,
        }
        for (sum, (name, count)) in self.points.0.iter_mut().zip(POINTS) {
            *sum = (name, sum.1 + u64::from(count(&estimate.evidence.points)));
        }
        for (peak, (name, used)) in self.buffers_peak.0.iter_mut().zip(BUFFERS) {
            *peak = (name, peak.1.max(used(&estimate.evidence.buffers)));
        }
    }

    /// Frames that could not be registered.
    pub(super) fn lost(&self) -> u64 {
        self.predicted.values().sum()
    }
}

/// Values with names, kept in order.
pub(super) struct Named<T, const N: usize>(pub [(&'static str, T); N]);

impl<T: Copy + Default, const N: usize> Default for Named<T, N> {
    fn default() -> Self {
        Self([("", T::default()); N])
    }
}

impl<T: Serialize, const N: usize> Serialize for Named<T, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}
