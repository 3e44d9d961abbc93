//! A drive in a saved map.
//!
//! Files in `OUT/NN/`: `poses_tum.txt` (pose of the sensor in the map, one line per frame that has one),
//! `localisation.csv` (status and evidence of every frame), `metrics.json`, `config.toml`, `run.log`.

use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

use sdslam_core::{FullScanOdometry, LabelledScan, MapPose};
use serde::Serialize;

use super::journal::Journal;
use super::output::OutputFolder;
use super::scans::{self, InputScan, Stamps};
use super::stopwatch::Milliseconds;
use super::{RecentMotion, Request, RunError};
use crate::dataset::{self, Sequence, trajectory};
use crate::heap::on_heap;
use crate::localise::{Localisation, LocalisationStatus, Localiser, Start};
use crate::saved_map::SavedMap;

const CSV_HEADER: &str = "frame,stamp,status,fit,overlap\n";

/// What to localise, and in which map.
#[derive(Clone, Debug)]
pub struct LocaliseRequest {
    /// The drive, the parameters and where the results go; the drive's own map is not made.
    pub drive: Request,
    /// The saved map.
    pub map: PathBuf,
    /// Where to begin.
    pub start: Start,
}

/// What a localisation came to.
#[derive(Clone, Debug, Serialize)]
pub struct LocaliseSummary {
    /// Name of the sequence.
    pub sequence: String,
    /// Frames processed.
    pub frames: usize,
    /// Frames until the vehicle was found for the first time; none if it never was.
    pub found_after: Option<usize>,
    /// Frames registered in the map.
    pub tracked: usize,
    /// Frames carried on by the odometry.
    pub predicted: usize,
    /// Frames without a pose.
    pub searching: usize,
    /// Wall time of the localisation per scan, without the odometry.
    pub localise_ms: Milliseconds,
    /// Where the files are.
    #[serde(skip)]
    pub folder: PathBuf,
}

impl fmt::Display for LocaliseSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut row = |what: &str, value: &dyn fmt::Display| writeln!(f, "{what:<22} {value}");
        row("sequence", &self.sequence)?;
        row("frames", &self.frames)?;
        match self.found_after {
            Some(frames) => row("found after", &format_args!("{frames} frames"))?,
            None => row("found", &"never")?,
        }
        let Self { tracked, predicted, searching, .. } = self;
        row("tracked", &format_args!("{tracked}; {predicted} predicted, {searching} searching"))?;
        row("localisation, ms", &self.localise_ms)?;
        row("files", &self.folder.display())
    }
}

/// Localises a drive; `progress` is told the frames done and their number.
pub fn localise(
    request: &LocaliseRequest,
    mut progress: impl FnMut(usize, usize),
) -> Result<LocaliseSummary, RunError> {
    let drive = &request.drive;
    let config = &drive.config;
    let saved = SavedMap::load(&request.map)?;
    let sequence = Sequence::open(&drive.dataset, &drive.sequence, drive.labels.as_deref())?;
    let frames = drive.frames(&sequence)?;
    sequence.read(frames.start).map_err(RunError::FirstScan)?;
    let core = config.core;
    let mut odometry = on_heap(move || FullScanOdometry::new(core))?;
    let folder = OutputFolder::create(&drive.out.join(&drive.sequence), drive.overwrite)?;
    let mut localiser = Localiser::new(saved, config, request.start)?;
    let mut log = Log::new(drive);
    let (mut stamps, mut recent) = (Stamps::default(), RecentMotion::default());

    scans::for_each_scan(&sequence, frames.clone(), &config.input, drive.threads, |mut scan: InputScan| {
        if let Some(fault) = scan.fault.take() {
            log.journal.fault(scan.frame, &fault);
        }
        let (stamp_s, replaced) = stamps.next(sequence.stamp_s(scan.frame));
        if let Some(reason) = replaced {
            log.journal.event(scan.frame, reason);
        }
        if config.input.deskew {
            dataset::deskew(&mut scan.points, &recent.per_period());
        }
        let mut points = scan.labelled_points();
        let mut labelled = LabelledScan { stamp_s, points: &mut points };
        let estimate = odometry
            .process_scan(&mut labelled)
            .map_err(|source| RunError::Odometry { frame: scan.frame, source })?;
        recent.push(&estimate);
        let started = Instant::now();
        let found = localiser.add(&points, &estimate.map_from_sensor);
        log.add(scan.frame, stamp_s, &found, started.elapsed().as_secs_f32() * 1e3);
        progress(scan.frame + 1 - frames.start, frames.len());
        Ok(())
    })?;
    log.finish(drive, &folder)
}

/// What is kept until the end.
struct Log {
    journal: Journal,
    csv: String,
    stamps_s: Vec<f64>,
    poses: Vec<MapPose>,
    ms: Vec<f32>,
    found_after: Option<usize>,
    counts: [usize; 3],
    last: LocalisationStatus,
}

impl Log {
    fn new(drive: &Request) -> Self {
        let mut journal = Journal::default();
        journal.note(format_args!("sdslam {}: sequence {}", env!("CARGO_PKG_VERSION"), drive.sequence));
        Self {
            journal,
            csv: CSV_HEADER.into(),
            stamps_s: Vec::new(),
            poses: Vec::new(),
            ms: Vec::new(),
            found_after: None,
            counts: [0; 3],
            last: LocalisationStatus::Searching,
        }
    }

    fn add(&mut self, frame: usize, stamp_s: f64, found: &Localisation, ms: f32) {
        let Localisation { status, map_from_sensor, fit, overlap } = *found;
        self.csv += &format!("{frame},{stamp_s:.6},{},{fit:.4},{overlap:.4}\n", status.name());
        if status != self.last {
            self.journal.event(frame, status.name());
            self.last = status;
        }
        self.counts[status as usize] += 1;
        self.ms.push(ms);
        if let Some(pose) = map_from_sensor {
            self.found_after.get_or_insert(self.ms.len());
            self.stamps_s.push(stamp_s);
            self.poses.push(pose);
        }
    }

    fn finish(self, drive: &Request, folder: &OutputFolder) -> Result<LocaliseSummary, RunError> {
        let [searching, tracked, predicted] = self.counts;
        let summary = LocaliseSummary {
            sequence: drive.sequence.clone(),
            frames: self.ms.len(),
            found_after: self.found_after,
            tracked,
            predicted,
            searching,
            localise_ms: Milliseconds::of(&self.ms),
            folder: folder.path().into(),
        };
        folder.write("poses_tum.txt", trajectory::write_tum(&self.stamps_s, &self.poses).as_bytes())?;
        folder.write("localisation.csv", self.csv.as_bytes())?;
        folder.write("config.toml", drive.config.render().as_bytes())?;
        folder.write("run.log", self.journal.to_text().as_bytes())?;
        let metrics = serde_json::to_string_pretty(&summary)
            .expect("a struct of numbers and names always has a JSON form");
        folder.write("metrics.json", (metrics + "\n").as_bytes())?;
        Ok(summary)
    }
}
