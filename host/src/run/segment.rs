//! A drive's classes by a network: label files, and pictures if wanted.
//!
//! Files in `OUT/NN/`:
//!
//! | file | content |
//! | --- | --- |
//! | `labels/NNNNNN.label` | SemanticKITTI id of every point, in the order of the scan |
//! | `range/NNNNNN.png` | the range image coloured by class |
//! | `birds_eye/NNNNNN.png` | the points from above coloured by class |
//! | `segment.log` | which network, and scans that have no labels because they cannot be read or segmented |

use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

use sdslam_core::SemanticClass;
use serde::Serialize;

use super::journal::Journal;
use super::output::OutputFolder;
use super::scans::{self, ScanFault};
use super::stopwatch::Milliseconds;
use super::summary::row;
use super::{RunError, frames_of};
use crate::dataset::Sequence;
use crate::segmentation::{Segmentation, SegmentationTimes, Segmenter, picture};

/// What to segment, and where the labels go.
#[derive(Clone, Debug)]
pub struct SegmentRequest {
    /// Folder with `sequences/`.
    pub dataset: PathBuf,
    /// Name of the sequence, e.g. `07`.
    pub sequence: String,
    /// First frame.
    pub first_frame: usize,
    /// End of the frames, itself not among them; all if none.
    pub end_frame: Option<usize>,
    /// Scans segmented at the same time; the labels are the same.
    pub threads: usize,
    /// Paint the scans.
    pub pictures: bool,
    /// Replace the files of an earlier run.
    pub overwrite: bool,
    /// The files go into the folder of the sequence's name in here.
    pub out: PathBuf,
}

/// What came out.
#[derive(Clone, Debug)]
pub struct SegmentSummary {
    /// Which network.
    pub classes: String,
    /// Frames asked for.
    pub frames: usize,
    /// Frames without labels, named in segment.log.
    pub skipped: usize,
    /// CPU time per scan; none where no scan was segmented.
    pub cpu_ms: Option<SegmentationMilliseconds>,
    /// Scans per second, reading and writing included.
    pub scans_per_s: f64,
    /// Points by class.
    pub points: [u64; SemanticClass::COUNT],
    /// Where the files are.
    pub folder: PathBuf,
}

/// A scan and its classes, or why there are none.
type Segmented = Result<(Vec<[f32; 4]>, Segmentation), ScanFault>;

/// Segments a drive; `progress` is told the frames done and their number.
pub fn segment(
    request: &SegmentRequest,
    segmenter: &Segmenter,
    mut progress: impl FnMut(usize, usize),
) -> Result<SegmentSummary, RunError> {
    let started = Instant::now();
    let sequence = Sequence::open_unlabelled(&request.dataset, &request.sequence)?;
    let frames = frames_of(&sequence, request.first_frame, request.end_frame)?;
    let folder = OutputFolder::create(&request.out.join(&request.sequence), request.overwrite)?;
    let files = Files::create(&folder, request.pictures)?;
    let mut journal = Journal::default();
    journal.note(format_args!("sequence {}: {segmenter}", request.sequence));
    let mut points = [0; SemanticClass::COUNT];
    let mut log = SegmentationLog::default();

    let segmented = |frame| (frame, segmented(&sequence, segmenter, frame));
    scans::in_order(frames.clone(), request.threads, segmented, |(frame, result)| {
        match result {
            Ok((scan, segmentation)) => {
                files.write(sequence.file_number(frame), &scan, &segmentation)?;
                segmentation.classes.iter().for_each(|&class| points[class as usize] += 1);
                log.extend(Some(segmentation.times));
            }
            Err(fault) => journal.fault(frame, &fault),
        }
        progress(frame + 1 - frames.start, frames.len());
        Ok::<_, RunError>(())
    })?;

    folder.write("segment.log", journal.to_text().as_bytes())?;
    Ok(SegmentSummary {
        classes: segmenter.to_string(),
        frames: frames.len(),
        skipped: frames.len() - log.scans(),
        cpu_ms: log.times(),
        scans_per_s: frames.len() as f64 / started.elapsed().as_secs_f64(),
        points,
        folder: folder.path().into(),
    })
}

fn segmented(sequence: &Sequence, segmenter: &Segmenter, frame: usize) -> Segmented {
    let points = sequence.read(frame)?.points;
    let segmentation = segmenter.segment(&points)?;
    Ok((points, segmentation))
}

/// Where the files of every scan go.
struct Files {
    labels: OutputFolder,
    /// Range images and views from above.
    pictures: Option<[OutputFolder; 2]>,
}

impl Files {
    fn create(folder: &OutputFolder, pictures: bool) -> Result<Self, RunError> {
        let labels = folder.subfolder("labels")?;
        let pictures =
            pictures.then(|| Ok::<_, RunError>([folder.subfolder("range")?, folder.subfolder("birds_eye")?]));
        Ok(Self { labels, pictures: pictures.transpose()? })
    }

    fn write(&self, number: usize, points: &[[f32; 4]], segmentation: &Segmentation) -> Result<(), RunError> {
        let labels = segmentation.raw_labels();
        self.labels.write(&format!("{number:06}.label"), bytemuck::cast_slice(&labels))?;
        if let Some([range, birds_eye]) = &self.pictures {
            let name = format!("{number:06}.png");
            range.write(&name, &picture::range_image(segmentation))?;
            birds_eye.write(&name, &picture::birds_eye(points, &segmentation.classes))?;
        }
        Ok(())
    }
}

/// CPU time of the segmentation per scan \[ms\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SegmentationMilliseconds {
    /// Points to image.
    pub projection: Milliseconds,
    /// Image to output tensor.
    pub network: Milliseconds,
    /// Output tensor to points.
    pub knn: Milliseconds,
}

impl SegmentationMilliseconds {
    pub(super) fn rows(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        row(f, "projection, CPU ms", self.projection)?;
        row(f, "network, CPU ms", self.network)?;
        row(f, "kNN, CPU ms", self.knn)
    }
}

/// Times of all scans that were segmented.
#[derive(Default)]
pub(super) struct SegmentationLog(Vec<SegmentationTimes>);

impl SegmentationLog {
    pub(super) fn extend(&mut self, times: Option<SegmentationTimes>) {
        self.0.extend(times);
    }

    fn scans(&self) -> usize {
        self.0.len()
    }

    /// None where no scan was segmented.
    pub(super) fn times(&self) -> Option<SegmentationMilliseconds> {
        let of = |time: fn(&SegmentationTimes) -> f32| {
            Milliseconds::of(&self.0.iter().map(time).collect::<Vec<_>>())
        };
        (!self.0.is_empty()).then(|| SegmentationMilliseconds {
            projection: of(|times| times.projection_ms),
            network: of(|times| times.network_ms),
            knn: of(|times| times.knn_ms),
        })
    }
}

impl fmt::Display for SegmentSummary {
    /// One row per result: description, value, unit.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        row(f, "classes", &self.classes)?;
        row(f, "frames", self.frames)?;
        if self.skipped > 0 {
            row(f, "without labels", format_args!("{} (see segment.log)", self.skipped))?;
        }
        if let Some(times) = &self.cpu_ms {
            times.rows(f)?;
        }
        row(f, "scans per second", format_args!("{:.1}", self.scans_per_s))?;
        let all: u64 = self.points.iter().sum();
        for (class, &points) in SemanticClass::ALL.iter().zip(&self.points).filter(|(_, points)| **points > 0)
        {
            let percent = 100.0 * points as f64 / all as f64;
            row(f, class.name(), format_args!("{percent:.2} % of the points"))?;
        }
        row(f, "files", self.folder.display())
    }
}
