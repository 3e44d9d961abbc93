//! Scans in the order of the drive; later ones are read, and segmented, while the core works on this one.

use std::ops::Range;
use std::sync::mpsc;

use sdslam_core::{LabelledPoint, SemanticClass};

use crate::config::InputConfig;
use crate::dataset::{self, DatasetError, RawScan, Sequence, labels};
use crate::segmentation::{SegmentationError, SegmentationTimes, Segmenter};

/// Time between two scans of a sensor that turns ten times a second \[s\].
pub(super) const PERIOD_S: f64 = 0.1;

/// Scans that wait per thread: bounds the memory when preparing is faster than the core.
const WAITING: usize = 1;

/// Why a scan is of no use.
#[derive(Debug, thiserror::Error)]
pub enum ScanFault {
    /// It cannot be read.
    #[error(transparent)]
    Unreadable(#[from] DatasetError),
    /// It cannot be segmented.
    #[error("cannot segment the scan")]
    Unsegmented(#[from] SegmentationError),
}

/// One scan as it goes into the pipeline.
#[derive(Default)]
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
    /// Confidence of every class, 255 = certain.
    pub confidences: Vec<u8>,
    /// What the segmentation took, where there was one.
    pub segmentation: Option<SegmentationTimes>,
    /// Why the scan is of no use; it is empty then.
    pub fault: Option<ScanFault>,
}

/// Where scans and their classes come from.
#[derive(Clone, Copy)]
pub(super) struct ScanSource<'a> {
    pub sequence: &'a Sequence,
    pub config: &'a InputConfig,
    /// None: classes are those of the label files.
    pub segmenter: Option<&'a Segmenter>,
}

impl ScanSource<'_> {
    /// The scan of a frame; an empty one with the reason where there is none.
    pub(super) fn scan(&self, frame: usize) -> InputScan {
        let scan = self.try_scan(frame);
        let scan = scan.unwrap_or_else(|fault| InputScan { fault: Some(fault), ..InputScan::default() });
        InputScan { frame, file_number: self.sequence.file_number(frame), ..scan }
    }

    /// The scan of a frame.
    pub(super) fn try_scan(&self, frame: usize) -> Result<InputScan, ScanFault> {
        let raw = self.sequence.read(frame)?;
        let mut scan = match self.segmenter {
            // An empty scan is no fault of the network's; the core says what it is.
            Some(segmenter) if !raw.points.is_empty() => segmented(segmenter, &raw.points)?,
            _ => labelled(&raw),
        };
        scan.points = raw.points;
        if self.config.elevation_correction_deg != 0.0 {
            dataset::correct_elevation(&mut scan.points, self.config.elevation_correction_deg);
        }
        Ok(scan)
    }
}

fn labelled(raw: &RawScan) -> InputScan {
    let labels = raw.labels.clone().unwrap_or_else(|| vec![0; raw.points.len()]);
    let classes = labels.iter().map(|&raw| labels::class_of(raw)).collect();
    let confidences = vec![u8::MAX; labels.len()];
    InputScan { labels, classes, confidences, ..InputScan::default() }
}

fn segmented(segmenter: &Segmenter, points: &[[f32; 4]]) -> Result<InputScan, SegmentationError> {
    let segmentation = segmenter.segment(points)?;
    Ok(InputScan {
        labels: segmentation.raw_labels(),
        classes: segmentation.classes,
        confidences: segmentation.confidences,
        segmentation: Some(segmentation.times),
        ..InputScan::default()
    })
}

impl InputScan {
    /// Intensity of every point.
    pub(super) fn intensities(&self) -> Vec<f32> {
        self.points.iter().map(|point| point[3]).collect()
    }

    /// What the core takes: position and class of every point, in the order of the file.
    pub(super) fn labelled_points(&self) -> Vec<LabelledPoint> {
        let classes = self.classes.iter().zip(&self.confidences);
        let points = self.points.iter().zip(classes);
        points
            .map(|(&[x, y, z, _], (&class, &confidence))| LabelledPoint {
                confidence,
                ..LabelledPoint::new([x, y, z], class)
            })
            .collect()
    }
}

/// Calls `work` on what `prepare` makes of every frame, in order. With more than one thread, that many prepare later frames
/// in turns, for the caller's mostly waits for them; the results are the same.
pub(super) fn in_order<T: Send, E>(
    frames: Range<usize>,
    threads: usize,
    prepare: impl Fn(usize) -> T + Sync,
    work: impl FnMut(T) -> Result<(), E>,
) -> Result<(), E> {
    if threads < 2 {
        return frames.map(prepare).try_for_each(work);
    }
    let workers = threads.min(frames.len().max(1));
    let prepare = &prepare;
    std::thread::scope(|scope| {
        let start = |worker: usize| {
            let (sender, receiver) = mpsc::sync_channel(WAITING);
            let mut turns = frames.clone().skip(worker).step_by(workers);
            // Sending fails once the receivers are gone, which is how a failed run stops the workers.
            scope.spawn(move || turns.all(|frame| sender.send(prepare(frame)).is_ok()));
            receiver
        };
        let receivers: Vec<_> = (0..workers).map(start).collect();
        // The first worker in turn that has nothing left has done the last frame.
        let mut results = receivers.iter().cycle().map_while(|receiver| receiver.recv().ok());
        results.try_for_each(work)
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
    fn frames_come_in_order_from_any_number_of_threads_and_a_failure_ends_them() {
        for threads in [1, 2, 3, 8, 40] {
            let mut seen = Vec::new();
            let slow_first = |frame: usize| {
                std::thread::sleep(std::time::Duration::from_micros(300 * (frame as u64 % 3)));
                frame * frame
            };
            let work = |square| {
                seen.push(square);
                if square == 400 { Err("enough") } else { Ok(()) }
            };
            assert_eq!(in_order(3..31, threads, slow_first, work), Err("enough"));
            assert_eq!(seen, (3..21).map(|frame| frame * frame).collect::<Vec<_>>(), "{threads} threads");
            seen.clear();
            let keep = |frame| {
                seen.push(frame);
                Ok::<_, ()>(())
            };
            assert_eq!(in_order(0..7, threads, |frame| frame, keep), Ok(()));
            assert_eq!(seen, [0, 1, 2, 3, 4, 5, 6], "{threads} threads");
        }
    }

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
