//! Scans in the order of the drive, the next one read while the core works on this one.

use std::ops::Range;
use std::sync::mpsc;

use sdslam_core::{LabelledPoint, SemanticClass};

use super::RunError;
use crate::config::InputConfig;
use crate::dataset::{self, DatasetError, RawScan, Sequence, labels};

/// Time between two scans of a sensor that turns ten times a second \[s\].
pub(super) const PERIOD_S: f64 = 0.1;

/// Scans read ahead at most: bounds the memory when reading is faster than the core.
const READ_AHEAD: usize = 2;

/// One scan as it goes into the pipeline.
pub(super) struct InputScan {
    /// Frame number in the drive.
    pub frame: usize,
    /// Number in the names of its files.
    pub file_number: usize,
    /// Points, elevation corrected.
    pub points: Vec<[f32; 4]>,
    /// Raw label of every point.
    pub labels: Vec<u32>,
    /// Class of every point.
    pub classes: Vec<SemanticClass>,
    /// Why the scan could not be read; it is empty then.
    pub fault: Option<DatasetError>,
}

impl InputScan {
    fn read(sequence: &Sequence, frame: usize, config: &InputConfig) -> Self {
        let (raw, fault) = match sequence.read(frame) {
            Ok(raw) => (raw, None),
            Err(fault) => (RawScan::default(), Some(fault)),
        };
        let mut points = raw.points;
        if config.elevation_correction_deg != 0.0 {
            dataset::correct_elevation(&mut points, config.elevation_correction_deg);
        }
        let labels = raw.labels.unwrap_or_else(|| vec![0; points.len()]);
        let classes = labels.iter().map(|&raw| labels::class_of(raw)).collect();
        Self { frame, file_number: sequence.file_number(frame), points, labels, classes, fault }
    }

    /// Intensity of every point.
    pub(super) fn intensities(&self) -> Vec<f32> {
        self.points.iter().map(|point| point[3]).collect()
    }

    /// What the core takes: position and class of every point, in the order of the file.
    pub(super) fn labelled_points(&self) -> Vec<LabelledPoint> {
        let position = |p: &[f32; 4]| [p[0], p[1], p[2]];
        let pairs = self.points.iter().zip(&self.classes);
        pairs.map(|(point, &class)| LabelledPoint::new(position(point), class)).collect()
    }
}

/// Calls `work` on every scan of `frames` in order. With more than one thread, a second one reads ahead; the scans are
/// the same.
pub(super) fn for_each_scan(
    sequence: &Sequence,
    frames: Range<usize>,
    config: &InputConfig,
    threads: usize,
    work: impl FnMut(InputScan) -> Result<(), RunError>,
) -> Result<(), RunError> {
    let mut scans = frames.map(|frame| InputScan::read(sequence, frame, config));
    if threads < 2 {
        return scans.try_for_each(work);
    }
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::sync_channel(READ_AHEAD);
        // Sending fails once the receiver is gone, which is how a failed run stops the reader.
        scope.spawn(move || scans.all(|scan| sender.send(scan).is_ok()));
        receiver.into_iter().try_for_each(work)
    })
}

/// Time stamps that only go forward.
#[derive(Default)]
pub(super) struct Stamps {
    previous_s: Option<f64>,
}

impl Stamps {
    /// The stamp to use for the next scan, and what was wrong with the one in the file.
    pub(super) fn next(&mut self, in_file_s: f64) -> (f64, Option<String>) {
        let earliest_s = self.previous_s.unwrap_or(f64::NEG_INFINITY);
        let usable = in_file_s.is_finite() && in_file_s > earliest_s;
        let stamp_s = match self.previous_s {
            _ if usable => in_file_s,
            Some(previous_s) => previous_s + PERIOD_S,
            None => 0.0,
        };
        self.previous_s = Some(stamp_s);
        let fault = format!("time stamp {in_file_s} s is not after the one before it; {stamp_s} s is used");
        (stamp_s, (!usable).then_some(fault))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_that_go_back_or_stand_still_are_replaced() {
        let mut stamps = Stamps::default();
        let given = [0.0, 0.1, 0.05, 0.3, 0.3, f64::NAN, 0.6];
        let used: Vec<f64> = given.iter().map(|&s| stamps.next(s).0).collect();
        assert!(used.windows(2).all(|pair| pair[0] < pair[1]), "{used:?}");
        assert_eq!((used[0], used[1], used[3], used[6]), (0.0, 0.1, 0.3, 0.6));
    }

    #[test]
    fn a_replaced_stamp_is_reported_with_both_values() {
        let mut stamps = Stamps::default();
        assert_eq!(stamps.next(2.0), (2.0, None));
        let (stamp_s, fault) = stamps.next(1.5);
        assert_eq!(stamp_s, 2.1);
        assert!(fault.is_some_and(|text| text.contains("1.5 s") && text.contains("2.1 s")));
    }
}
