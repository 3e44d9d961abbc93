//! The results of a run in numbers: metrics.json and the table at the end.

use std::fmt;
use std::path::PathBuf;

use sdslam_core::Stage;
use serde::Serialize;

use super::motion::MovingLandmarks;
use super::segment::SegmentationMilliseconds;
use super::stopwatch::Milliseconds;
use super::tally::{Named, Tally};
use crate::config::Preset;
use crate::evaluate::TrajectoryErrors;
use crate::loops::LoopCounts;

/// What a run came to.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Name of the sequence.
    pub sequence: String,
    /// Frames processed.
    pub frames: usize,
    /// Frames whose pose is only predicted.
    pub lost: u64,
    /// Scans that could not be read, counted among the lost ones.
    pub unreadable_scans: u64,
    /// Time stamps that were replaced.
    pub replaced_stamps: u64,
    /// Errors of the corrected trajectory against the ground truth, if there is one.
    pub trajectory: Option<TrajectoryErrors>,
    /// The same before any correction by loops.
    pub trajectory_odometry: Option<TrajectoryErrors>,
    /// What became of the proposed loops.
    pub loops: LoopCounts,
    /// Wall time of the core per scan.
    pub core_ms: Milliseconds,
    /// CPU time of the core per scan.
    pub core_cpu_ms: Milliseconds,
    /// CPU time of the back end per scan: loops, pose graph and map.
    pub back_end_cpu_ms: Milliseconds,
    /// The most memory the process has held so far \[KiB\]; none where the system does not tell.
    pub peak_memory_kib: Option<u64>,
    /// Where the classes come from.
    pub classes: String,
    /// CPU time of the segmentation per scan, if there was one.
    pub segmentation_cpu_ms: Option<SegmentationMilliseconds>,
    /// Scans per second of the whole run, reading and writing included.
    pub scans_per_s: f64,
    /// Tracks recognised as dynamic.
    pub dynamic: u64,
    /// Tracks recognised as semi-static and never as dynamic.
    pub semi_static: u64,
    /// Recognised motion against the input's moving ids, if it has any.
    pub moving: Option<MovingScore>,
    /// Voxels in the map.
    pub voxels: usize,
    /// Edge of a voxel \[m\].
    pub voxel_m: f64,
    /// Where the files are.
    pub folder: PathBuf,
}

/// Recognised motion against the moving ids (252..259) of the input's labels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MovingScore {
    /// Landmarks, counted once per frame.
    pub landmarks: MovingLandmarks,
    /// Share of the moving landmarks that was found, of those decided on, 0..1.
    pub recall: Option<f64>,
    /// Share of the recognised landmarks that moves, 0..1.
    pub precision: Option<f64>,
    /// Intersection over union of the moving points, 0..1.
    pub points_iou: f64,
}

/// metrics.json.
#[derive(Serialize)]
pub(super) struct Metrics<'a> {
    pub version: &'static str,
    pub sequence: &'a str,
    pub preset: Preset,
    pub first_frame: usize,
    pub end_frame: usize,
    pub frames: usize,
    pub lost: u64,
    /// Null without ground truth.
    pub trajectory: Option<&'a TrajectoryErrors>,
    /// Before any correction by loops.
    pub trajectory_odometry: Option<&'a TrajectoryErrors>,
    pub loops: LoopCounts,
    /// Null where the input's labels hold no moving ids.
    pub moving: Option<&'a MovingScore>,
    pub tracks_dynamic: u64,
    pub tracks_semi_static: u64,
    pub map_voxels: usize,
    /// The core has no memory but this, however long the drive.
    pub core_memory_bytes: usize,
    pub core_ms: Milliseconds,
    pub core_cpu_ms: Milliseconds,
    pub back_end_cpu_ms: Milliseconds,
    pub peak_memory_kib: Option<u64>,
    pub core_ms_per_stage: Named<Milliseconds, { Stage::ALL.len() }>,
    pub classes: &'a str,
    /// Null where the classes come from label files.
    pub segmentation_cpu_ms: Option<&'a SegmentationMilliseconds>,
    pub scans_per_s: f64,
    pub counts: &'a Tally,
}

impl Metrics<'_> {
    pub(super) fn to_json(&self) -> String {
        let json =
            serde_json::to_string_pretty(self).expect("structs of numbers and names always have a JSON form");
        json + "\n"
    }
}

impl fmt::Display for Summary {
    /// One row per result: description, value, unit.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        row(f, "sequence", &self.sequence)?;
        row(f, "frames", self.frames)?;
        row(f, "lost", self.lost_text())?;
        if self.replaced_stamps > 0 {
            row(f, "time stamps replaced", format_args!("{} (see run.log)", self.replaced_stamps))?;
        }
        self.rows_of_trajectory(f)?;
        row(f, "loops", format_args!("{} accepted, {} proposed", self.loops.accepted, self.loops.proposed))?;
        row(f, "classes", &self.classes)?;
        if let Some(times) = &self.segmentation_cpu_ms {
            times.rows(f)?;
        }
        row(f, "core, ms per scan", self.core_ms)?;
        row(f, "core, CPU ms per scan", self.core_cpu_ms)?;
        row(f, "back end, CPU ms", self.back_end_cpu_ms)?;
        if let Some(kib) = self.peak_memory_kib {
            row(f, "peak memory", format_args!("{} MiB", kib >> 10))?;
        }
        row(f, "scans per second", format_args!("{:.1}", self.scans_per_s))?;
        row(f, "tracks", format_args!("{} dynamic, {} semi-static", self.dynamic, self.semi_static))?;
        if let Some(moving) = &self.moving {
            moving.rows(f)?;
        }
        row(f, "map", format_args!("{} voxels of {} m", self.voxels, self.voxel_m))?;
        row(f, "files", self.folder.display())
    }
}

impl Summary {
    fn lost_text(&self) -> String {
        match self.unreadable_scans {
            0 => self.lost.to_string(),
            unreadable => {
                format!("{}, of which {unreadable} scans could not be read (see run.log)", self.lost)
            }
        }
    }

    fn rows_of_trajectory(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(errors) = &self.trajectory else {
            return row(f, "ground truth", "none");
        };
        let segments = if errors.devkit_lengths { "100..800 m" } else { "10..80 m: the drive is short" };
        match (errors.t_rel_percent, errors.r_rel_deg_per_100m) {
            (Some(t), Some(r)) => {
                row(f, "t_rel, r_rel", format_args!("{t:.4} %, {r:.4} deg/100 m (segments of {segments})"))?;
            }
            _ => row(f, "t_rel, r_rel", "none: the drive is shorter than 10 m")?,
        }
        let before = self.trajectory_odometry.as_ref().and_then(|errors| errors.ate_m);
        match (errors.ate_m, before) {
            (Some(ate_m), Some(before_m)) if self.loops.accepted > 0 => {
                row(f, "ATE", format_args!("{ate_m:.3} m; before the loops {before_m:.3} m"))
            }
            (Some(ate_m), _) => row(f, "ATE", format_args!("{ate_m:.3} m")),
            (None, _) => Ok(()),
        }
    }
}

impl MovingScore {
    fn rows(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MovingLandmarks { found, missed, undecided, false_alarms } = self.landmarks;
        let counts =
            format_args!("{found} found, {missed} missed, {undecided} undecided, {false_alarms} false");
        row(f, "moving landmarks", counts)?;
        let percent = |share: Option<f64>| share.map_or("-".into(), |s| format!("{:.1} %", 100.0 * s));
        let (recall, precision) = (percent(self.recall), percent(self.precision));
        row(f, "  recall, precision", format_args!("{recall}, {precision}"))?;
        row(f, "  IoU of moving points", percent(Some(self.points_iou)))
    }
}

pub(super) fn row(f: &mut fmt::Formatter<'_>, description: &str, value: impl fmt::Display) -> fmt::Result {
    writeln!(f, "{description:<22} {value}")
}
