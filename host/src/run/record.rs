//! Keeps what a run gives, frame by frame, and writes it.

use std::ops::Range;
use std::time::Instant;

use sdslam_core::{
    FrameEstimate, FrameStatus, FullScanOdometry, LabelledPoint, MapPose, MotionState, TrackReport,
};

use super::journal::Journal;
use super::memory;
use super::motion::{self, Movers, MovingLandmarks};
use super::output::{OutputFolder, PendingFile};
use super::picture::Picture;
use super::scans::{InputScan, ScanFault};
use super::segment::SegmentationLog;
use super::stopwatch::{FrameTimes, Times};
use super::summary::{Metrics, MovingScore, Summary};
use super::tally::{self, Tally};
use super::{ClassSource, Request, RunError};
use crate::config::HostConfig;
use crate::dataset::{Sequence, labels, trajectory};
use crate::evaluate::{self, LabelConfusion, TrajectoryErrors};
use crate::loops::BackEndResult;

/// Everything that is kept until the end of the run.
pub(super) struct Recorder {
    folder: OutputFolder,
    motion_folder: OutputFolder,
    landmarks_csv: PendingFile,
    config: HostConfig,
    classes: ClassSource,
    frames: Range<usize>,
    started: Instant,
    /// Ground truth in the camera frame, from the first frame of the run on.
    ground_truth: Option<Vec<MapPose>>,
    stamps_s: Vec<f64>,
    map_from_sensor: Vec<MapPose>,
    times: Times,
    segmentation: SegmentationLog,
    tally: Tally,
    movers: Movers,
    moving_landmarks: MovingLandmarks,
    moving_points: LabelConfusion,
    /// Whether the input's labels tell what moves.
    motion_is_labelled: bool,
    journal: Journal,
}

impl Recorder {
    pub(super) fn new(
        request: &Request,
        sequence: &Sequence,
        frames: Range<usize>,
        ground_truth: Option<Vec<MapPose>>,
        folder: OutputFolder,
    ) -> Result<Self, RunError> {
        let mut landmarks_csv = folder.begin("landmarks.csv")?;
        landmarks_csv.append(motion::CSV_HEADER.as_bytes())?;
        let mut recorder = Self {
            motion_folder: folder.subfolder("motion")?,
            folder,
            landmarks_csv,
            config: request.config.clone(),
            classes: request.classes.clone(),
            started: Instant::now(),
            ground_truth,
            stamps_s: Vec::new(),
            map_from_sensor: Vec::new(),
            times: Times::default(),
            segmentation: SegmentationLog::default(),
            tally: Tally::default(),
            movers: Movers::default(),
            moving_landmarks: MovingLandmarks::default(),
            moving_points: LabelConfusion::default(),
            motion_is_labelled: false,
            journal: Journal::default(),
            frames,
        };
        recorder.open_journal(request, sequence);
        Ok(recorder)
    }

    fn open_journal(&mut self, request: &Request, sequence: &Sequence) {
        let (name, Range { start, end }) = (&request.sequence, &self.frames);
        let preset = self.config.preset;
        let version = env!("CARGO_PKG_VERSION");
        self.journal
            .note(format_args!("sdslam {version}: sequence {name}, frames {start}..{end}, {preset} preset"));
        self.journal.note(format_args!("classes: {}", request.classes));
        if !sequence.has_times() {
            self.journal.note("times.txt is missing: scans are taken to be 0.1 s apart");
        }
        let end = self.frames.end;
        if let Some(poses) = &mut self.ground_truth {
            let available = poses.len();
            poses.truncate(end);
            poses.drain(..self.frames.start.min(poses.len()));
            if available < end {
                self.journal.note(format_args!(
                    "ground truth ends at frame {available}: later frames are not evaluated"
                ));
            }
        }
    }

    /// A scan could not be read or segmented.
    pub(super) fn unreadable(&mut self, frame: usize, fault: &ScanFault) {
        self.tally.unreadable_scans += 1;
        self.journal.fault(frame, fault);
    }

    /// A time stamp was replaced for the reason given, if any.
    pub(super) fn replaced_stamp(&mut self, frame: usize, reason: Option<String>) {
        if let Some(reason) = reason {
            self.tally.replaced_stamps += 1;
            self.journal.event(frame, reason);
        }
    }

    pub(super) fn time(&mut self, frame: &FrameTimes) {
        self.times.push(frame);
    }

    /// CPU time of the back end per frame \[ms\].
    pub(super) fn time_of_back_end(&mut self, cpu_ms: Vec<f32>) {
        self.times.set_back_end(cpu_ms);
    }

    /// Keeps the results of one frame.
    pub(super) fn record(
        &mut self,
        scan: &InputScan,
        points: &[LabelledPoint],
        estimate: &FrameEstimate,
        odometry: &FullScanOdometry,
    ) -> Result<(), RunError> {
        let (landmarks, pose) = (odometry.landmarks(), &estimate.map_from_sensor);
        self.stamps_s.push(estimate.stamp_s);
        self.map_from_sensor.push(*pose);
        self.tally.add(estimate);
        self.segmentation.extend(scan.segmentation);
        self.log(scan.frame, estimate);

        let tracks: Vec<TrackReport> = odometry.tracks().collect();
        self.landmarks_csv.append(motion::csv_rows(scan.frame, landmarks, &tracks, pose).as_bytes())?;
        self.movers.add(landmarks, pose);
        if !points.is_empty() {
            let recognised = motion::motion_labels(&scan.labels, points, landmarks);
            self.motion_folder
                .write(&format!("{:06}.label", scan.file_number), bytemuck::cast_slice(&recognised))?;
            self.motion_is_labelled |= scan.labels.iter().any(|&raw| labels::is_moving(raw));
            self.moving_landmarks.add(&scan.labels, points, landmarks);
            self.moving_points.add(&scan.labels, &recognised)?;
        }
        Ok(())
    }

    fn log(&mut self, frame: usize, estimate: &FrameEstimate) {
        if let FrameStatus::Predicted(fallback) = estimate.status {
            self.journal.event(frame, format_args!("pose predicted: {}", fallback.reason()));
        }
        self.journal.count(frame, "points not finite, dropped", estimate.evidence.points.not_finite.into());
        for (what, count) in tally::REFUSED {
            self.journal.count(frame, what, count(estimate).into());
        }
    }

    /// Evaluates and writes everything that is not written yet.
    pub(super) fn finish(self, sequence: &Sequence, result: &BackEndResult) -> Result<Summary, RunError> {
        let camera_from_sensor = sequence.camera_from_sensor();
        let to_camera = |poses: &[MapPose]| -> Vec<MapPose> {
            let in_camera = |pose: &MapPose| camera_from_sensor * pose * camera_from_sensor.inverse();
            poses.iter().map(in_camera).collect()
        };
        let (corrected, odometry) = (to_camera(&result.map_from_sensor), to_camera(&self.map_from_sensor));
        let folder = &self.folder;
        folder.write("poses_kitti.txt", trajectory::write_kitti(&corrected).as_bytes())?;
        folder.write("poses_odometry.txt", trajectory::write_kitti(&odometry).as_bytes())?;
        let tum = trajectory::write_tum(&self.stamps_s, &result.map_from_sensor);
        folder.write("poses_tum.txt", tum.as_bytes())?;
        self.write_map(result)?;
        folder.write("trajectory.svg", self.picture(sequence).as_bytes())?;
        folder.write("config.toml", self.config.render().as_bytes())?;
        folder.write("run.log", self.journal.to_text().as_bytes())?;
        folder.write("ms.txt", self.times.lines().as_bytes())?;
        folder.write("cpu_ms.txt", self.times.cpu_lines().as_bytes())?;
        folder.write("back_end_cpu_ms.txt", self.times.back_end_lines().as_bytes())?;
        let errors = [self.errors(&corrected), self.errors(&odometry)];
        let summary = self.summary(sequence, errors, result);
        folder.write("metrics.json", self.metrics(&summary).as_bytes())?;
        self.landmarks_csv.finish()?;
        Ok(summary)
    }

    fn write_map(&self, result: &BackEndResult) -> Result<(), RunError> {
        let folder = &self.folder;
        folder.write("loops.csv", result.loops_csv.as_bytes())?;
        folder.write("graph.g2o", result.graph_g2o.as_bytes())?;
        folder.write("map.ply", &result.map.to_ply())?;
        folder.write("map.pcd", &result.map.to_pcd())?;
        folder.write("map.png", &result.map.to_png())?;
        let grid = result.map.obstacle_grid();
        folder.write("grid.pgm", &grid.to_pgm())?;
        folder.write("grid.yaml", grid.to_yaml("grid.pgm").as_bytes())?;
        Ok(())
    }

    /// Against the ground truth, as far as it reaches.
    fn errors(&self, camera_poses: &[MapPose]) -> Option<TrajectoryErrors> {
        let truth = self.ground_truth.as_ref().filter(|poses| poses.len() > 1)?;
        Some(evaluate::trajectory_errors(truth, &camera_poses[..truth.len()]))
    }

    fn picture(&self, sequence: &Sequence) -> String {
        let from_above = |pose: &MapPose| [pose.translation.x, pose.translation.y];
        let camera_from_sensor = sequence.camera_from_sensor();
        let ground_truth: Option<Vec<_>> = self.ground_truth.as_ref().map(|poses| {
            let world_from_sensor = |camera: &MapPose| camera * camera_from_sensor;
            let Some(start) = poses.first().map(world_from_sensor) else { return Vec::new() };
            poses.iter().map(|camera| from_above(&start.inv_mul(&world_from_sensor(camera)))).collect()
        });
        let estimate: Vec<_> = self.map_from_sensor.iter().map(from_above).collect();
        let title =
            format!("Sequence {}, frames {}..{}", sequence.name(), self.frames.start, self.frames.end);
        Picture {
            title: &title,
            estimate: &estimate,
            ground_truth: ground_truth.as_deref().filter(|path| !path.is_empty()),
            movers: &self.movers,
        }
        .to_svg()
    }

    fn summary(
        &self,
        sequence: &Sequence,
        [trajectory, trajectory_odometry]: [Option<TrajectoryErrors>; 2],
        result: &BackEndResult,
    ) -> Summary {
        Summary {
            sequence: sequence.name().into(),
            frames: self.frames.len(),
            lost: self.tally.lost(),
            unreadable_scans: self.tally.unreadable_scans,
            replaced_stamps: self.tally.replaced_stamps,
            trajectory,
            trajectory_odometry,
            loops: result.counts,
            core_ms: self.times.total(),
            core_cpu_ms: self.times.cpu(),
            back_end_cpu_ms: self.times.back_end(),
            peak_memory_kib: memory::peak_kib(),
            classes: self.classes.to_string(),
            segmentation_cpu_ms: self.segmentation.times(),
            scans_per_s: self.frames.len() as f64 / self.started.elapsed().as_secs_f64(),
            dynamic: self.movers.count(MotionState::Dynamic),
            semi_static: self.movers.count(MotionState::SemiStatic),
            moving: self.motion_is_labelled.then(|| self.moving_score()),
            voxels: result.map.cells().len(),
            voxel_m: self.config.map.voxel_m,
            folder: self.folder.path().into(),
        }
    }

    fn moving_score(&self) -> MovingScore {
        MovingScore {
            landmarks: self.moving_landmarks,
            recall: self.moving_landmarks.recall(),
            precision: self.moving_landmarks.precision(),
            points_iou: self.moving_points.errors().moving_iou,
        }
    }

    fn metrics(&self, summary: &Summary) -> String {
        Metrics {
            version: env!("CARGO_PKG_VERSION"),
            sequence: &summary.sequence,
            preset: self.config.preset,
            first_frame: self.frames.start,
            end_frame: self.frames.end,
            frames: summary.frames,
            lost: summary.lost,
            trajectory: summary.trajectory.as_ref(),
            trajectory_odometry: summary.trajectory_odometry.as_ref(),
            loops: summary.loops,
            moving: summary.moving.as_ref(),
            tracks_dynamic: summary.dynamic,
            tracks_semi_static: summary.semi_static,
            map_voxels: summary.voxels,
            core_memory_bytes: size_of::<FullScanOdometry>(),
            core_ms: summary.core_ms,
            core_cpu_ms: summary.core_cpu_ms,
            back_end_cpu_ms: summary.back_end_cpu_ms,
            peak_memory_kib: summary.peak_memory_kib,
            core_ms_per_stage: self.times.stages(),
            classes: &summary.classes,
            segmentation_cpu_ms: summary.segmentation_cpu_ms.as_ref(),
            scans_per_s: summary.scans_per_s,
            counts: &self.tally,
        }
        .to_json()
    }
}
