//! A run: one drive through the core, its results into a folder.
//!
//! Files in `OUT/NN/`, each of which appears whole or not at all:
//!
//! | file | content |
//! | --- | --- |
//! | `poses_kitti.txt` | one pose a frame, corrected by loops, camera frame, 12 numbers a line |
//! | `poses_odometry.txt` | the same before any correction |
//! | `poses_tum.txt` | `stamp x y z qx qy qz qw` of the sensor in the map, corrected by loops \[s, m\] |
//! | `loops.csv` | proposed loops: frames, pose of the new sensor in the old one, evidence, accepted or why not |
//! | `graph.g2o` | keyframes, odometry and accepted loops |
//! | `metrics.json` | errors against the ground truth, counts, times, memory |
//! | `landmarks.csv` | landmarks of every frame: centre \[m\] and velocity \[m/s\] in the map |
//! | `motion/NNNNNN.label` | the input's labels with 252..259 where a landmark was recognised as dynamic |
//! | `map.ply`, `map.pcd` | static semantic voxel map: position, colour, class, confidence, intensity, count |
//! | `map.png` | the map from above |
//! | `grid.pgm`, `grid.yaml` | obstacles and free ground from above, as ROS' map_server reads them |
//! | `trajectory.svg` | the drive from above |
//! | `config.toml` | the configuration that was used |
//! | `run.log` | what happened: fallbacks, drops, warnings |
//! | `ms.txt`, `cpu_ms.txt` | wall and CPU time of the core per frame \[ms\] |
//! | `back_end_cpu_ms.txt` | CPU time of the back end (loops, graph, map) per frame \[ms\] |
//!
//! The map frame is the sensor frame of the first scan. `landmarks.csv` and `trajectory.svg` are in the frame of the odometry. Only `metrics.json`, `ms.txt`, `cpu_ms.txt` and `back_end_cpu_ms.txt` hold times of this machine:
//! the others are the same, byte for byte, from run to run and for any number of threads.
//!
//! Classes come from label files or from a segmentation network ([`ClassSource`]); run.log says which.
//!
//! A scan that is missing, cannot be read or has nothing to segment becomes an empty one at its stamp, so its pose is the
//! prediction and every frame keeps its line; its `motion` file is left out. A stamp that does not go forward is replaced by
//! the one before plus 0.1 s. Both are counted and logged. The first scan must be usable.

mod error;
mod journal;
mod localise;
mod memory;
mod motion;
mod output;
mod picture;
mod record;
mod recording;
mod scans;
mod segment;
mod stopwatch;
mod summary;
mod tally;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sdslam_core::{FrameEstimate, FullScanOdometry, LabelledScan, MapPose};

use crate::config::HostConfig;
use crate::dataset::{self, DatasetError, Sequence};
use crate::heap::on_heap;
use crate::loops::{BackEnd, BackEndScan, Beside};
use crate::saved_map::SavedMap;
use crate::segmentation::Segmenter;
pub use error::{OutputError, RunError};
pub use localise::{LocaliseRequest, LocaliseSummary, localise};
pub use motion::MovingLandmarks;
use output::OutputFolder;
use record::Recorder;
use recording::Recording;
pub use scans::ScanFault;
use scans::{ScanSource, Stamps};
pub use segment::{SegmentRequest, SegmentSummary, segment};
pub use stopwatch::Milliseconds;
use stopwatch::Stopwatch;
pub use summary::{MovingScore, Summary};

/// What to run on, and where the results go.
#[derive(Clone, Debug)]
pub struct Request {
    /// Folder with `sequences/` and, if there is ground truth, `poses/`.
    pub dataset: PathBuf,
    /// Name of the sequence, e.g. `07`.
    pub sequence: String,
    /// Where the class of every point comes from.
    pub classes: ClassSource,
    /// First frame of the run.
    pub first_frame: usize,
    /// End of the frames, itself not in the run; all if none.
    pub end_frame: Option<usize>,
    /// Every parameter.
    pub config: HostConfig,
    /// 1: one thing after the other; more: the others read and segment later scans, and the map grows meanwhile. The
    /// results are the same.
    pub threads: usize,
    /// Where the map is saved for later drives, if it is.
    pub save_map: Option<PathBuf>,
    /// Replace the files of an earlier run.
    pub overwrite: bool,
    /// Write every scan to this file too, as the core gets it, for replays by the firmware.
    pub record: Option<PathBuf>,
    /// The results go into the folder of the sequence's name in here.
    pub out: PathBuf,
}

/// Where the class of every point comes from.
#[derive(Clone, Debug)]
pub enum ClassSource {
    /// SemanticKITTI label files in this folder within the sequence.
    Labels(String),
    /// A segmentation network.
    Network(Arc<Segmenter>),
}

impl Default for ClassSource {
    fn default() -> Self {
        Self::Labels("labels".into())
    }
}

impl ClassSource {
    fn open(&self, dataset: &Path, sequence: &str) -> Result<Sequence, DatasetError> {
        match self {
            Self::Labels(folder) => Sequence::open(dataset, sequence, Some(folder)),
            Self::Network(_) => Sequence::open_unlabelled(dataset, sequence),
        }
    }

    fn segmenter(&self) -> Option<&Segmenter> {
        match self {
            Self::Labels(_) => None,
            Self::Network(segmenter) => Some(segmenter),
        }
    }
}

impl std::fmt::Display for ClassSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Labels(folder) => write!(f, "label files in the folder {folder}"),
            Self::Network(segmenter) => segmenter.fmt(f),
        }
    }
}

/// The frames from `first` up to `end` (all that follow if none), if the drive has them.
fn frames_of(sequence: &Sequence, first: usize, end: Option<usize>) -> Result<Range<usize>, RunError> {
    let available = sequence.len();
    let end = end.unwrap_or(available);
    if first < end && end <= available {
        Ok(first..end)
    } else {
        Err(RunError::Frames { first, end, available })
    }
}

/// Runs the SLAM on a drive; `progress` is told the frames done and their number.
pub fn run(request: &Request, mut progress: impl FnMut(usize, usize)) -> Result<Summary, RunError> {
    let config = &request.config;
    let sequence = request.classes.open(&request.dataset, &request.sequence)?;
    let frames = frames_of(&sequence, request.first_frame, request.end_frame)?;
    let ground_truth = sequence.ground_truth()?;
    let source =
        ScanSource { sequence: &sequence, config: &config.input, segmenter: request.classes.segmenter() };
    // Without the first scan there is nothing to start from, and nothing is written.
    source.try_scan(frames.start).map_err(RunError::FirstScan)?;
    let core = config.core;
    let mut odometry = on_heap(move || FullScanOdometry::new(core))?;
    let folder = OutputFolder::create(&request.out.join(&request.sequence), request.overwrite)?;
    let map_file =
        request.save_map.as_deref().map(|path| output::begin_file(path, request.overwrite)).transpose()?;
    let mut recorder = Recorder::new(request, &sequence, frames.clone(), ground_truth, folder)?;
    let mut back_end = Beside::start(Box::new(BackEnd::new(config)?), request.threads);
    let mut recording = request.record.as_deref().map(Recording::create).transpose()?;
    let mut stamps = Stamps::default();
    let mut recent = RecentMotion::default();

    let prepare = |frame| source.scan(frame);
    scans::in_order(frames.clone(), request.threads, prepare, |mut scan| {
        if let Some(fault) = scan.fault.take() {
            recorder.unreadable(scan.frame, &fault);
        }
        let (stamp_s, replaced) = stamps.next(sequence.stamp_s(scan.frame));
        recorder.replaced_stamp(scan.frame, replaced);

        if config.input.deskew {
            dataset::deskew(&mut scan.points, &recent.per_period());
        }
        let mut points = scan.labelled_points();
        if let Some(recording) = &mut recording {
            recording.add(stamp_s, &points)?;
        }

        let mut stopwatch = Stopwatch::start();
        let mut labelled = LabelledScan { stamp_s, points: &mut points };
        let estimate = odometry
            .process_scan_observed(&mut labelled, &mut stopwatch)
            .map_err(|source| RunError::Odometry { frame: scan.frame, source })?;
        recorder.time(&stopwatch.stop());

        recent.push(&estimate);
        recorder.record(&scan, &points, &estimate, &odometry)?;
        back_end.add(BackEndScan { intensities: scan.intensities(), points, estimate })?;
        progress(scan.frame + 1 - frames.start, frames.len());
        Ok::<_, RunError>(())
    })?;

    recording.map_or(Ok(()), Recording::finish)?;
    let (result, back_end_cpu_ms) = back_end.finish()?;
    recorder.time_of_back_end(back_end_cpu_ms);
    let summary = recorder.finish(&sequence, &result)?;
    if let Some(mut file) = map_file {
        file.append(&SavedMap::new(result.map, result.places).to_bytes())?;
        file.finish()?;
    }
    Ok(summary)
}

/// The last step of the vehicle, for undoing its motion during a scan.
#[derive(Default)]
struct RecentMotion {
    previous: Option<FrameEstimate>,
    per_period: MapPose,
}

impl RecentMotion {
    fn push(&mut self, estimate: &FrameEstimate) {
        if let Some(previous) = &self.previous {
            self.per_period = previous.map_from_sensor.inv_mul(&estimate.map_from_sensor);
        }
        self.previous = Some(*estimate);
    }

    /// Pose of the sensor one period later in the sensor frame.
    fn per_period(&self) -> MapPose {
        self.per_period
    }
}
