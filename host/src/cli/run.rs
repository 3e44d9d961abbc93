//! `sdslam run`.

use std::path::PathBuf;

use super::frames::FrameRange;
use super::progress::Progress;
use super::segment::{NetworkArgs, ThreadArgs};
use super::{CliError, print};
use crate::config::{HostConfig, Preset};
use crate::run::{self, ClassSource, Request, Summary};

/// Run the SLAM on a drive.
///
/// Reads DATASET/sequences/NN and writes to OUT/NN: poses_kitti.txt (camera frame), poses_tum.txt (sensor frame),
/// metrics.json, landmarks.csv, motion/NNNNNN.label, map.ply, trajectory.svg, config.toml, run.log, ms.txt and cpu_ms.txt. A table
/// of the results is printed at the end.
///
/// Every point needs a class. It comes from label files with --labels; from a network with --model or --segment; else from
/// the folder labels of the sequence, or, where there is none, from the network that is part of this program. The table
/// and run.log say which.
///
/// A scan that is missing or broken in the middle of a drive does not stop the run: its pose is predicted, and run.log
/// names it.
///
/// Example: sdslam run --dataset ~/kitti --sequence 07 --out results
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder with sequences/ and, for ground truth, poses/.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Name of the sequence, e.g. 07.
    #[arg(long, value_name = "NN")]
    sequence: String,
    /// Folder of the label files within the sequence.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["model", "segment"])]
    labels: Option<String>,
    #[command(flatten)]
    network: NetworkArgs,
    /// Segment the scans even where there are labels.
    #[arg(long)]
    segment: bool,
    /// Where the results go: into the folder OUT/NN.
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    options: Options,
    /// Frames to run on, from A up to but without B; A.. and ..B leave the other end open. Default: all.
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Replace the files of an earlier run in OUT/NN. Nothing else is deleted.
    #[arg(long)]
    overwrite: bool,
    /// Also record every scan as the core gets it, for sdslam-firmware-sim and boards; replaces the file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// How to run.
#[derive(Debug, Default, clap::Args)]
pub(super) struct Options {
    /// `accurate` (the paper and a dense 6-DoF refinement) or `paper` (nothing but the paper). Default: what --config
    /// names, else accurate.
    #[arg(long, value_name = "PRESET")]
    preset: Option<Preset>,
    /// Parameters that differ from the preset, as `sdslam config` prints them.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Leave the points as they are. Default: +0.205 deg of elevation, which mends KITTI's HDL-64E; simulated scans
    /// do not need it.
    #[arg(long)]
    no_elevation_correction: bool,
    /// Undo the vehicle's motion during a turn of the sensor (constant velocity). For KITTI raw drives; the scans of the
    /// odometry benchmark are compensated already.
    #[arg(long)]
    deskew: bool,
}

impl Options {
    /// The configuration with what was typed on top.
    fn config(&self) -> Result<HostConfig, CliError> {
        let mut config = match &self.config {
            Some(file) => HostConfig::load(file, self.preset)?,
            None => HostConfig::of_preset(self.preset.unwrap_or_default()),
        };
        if self.no_elevation_correction {
            config.input.elevation_correction_deg = 0.0;
        }
        config.input.deskew |= self.deskew;
        Ok(config)
    }
}

impl Args {
    pub(super) fn execute(self) -> Result<(), CliError> {
        let summary = run_with_progress(&self.request()?)?;
        print(summary.to_string())
    }

    fn classes(&self) -> Result<ClassSource, CliError> {
        let model = self.network.model.as_deref();
        let labels = self.labels.as_deref().unwrap_or("labels");
        let there = self.dataset.join("sequences").join(&self.sequence).join("labels").is_dir();
        let from_labels = self.labels.is_some() || (model.is_none() && !self.segment && there);
        Ok(if from_labels {
            ClassSource::Labels(labels.into())
        } else {
            ClassSource::Network(NetworkArgs::load(model)?)
        })
    }

    fn request(self) -> Result<Request, CliError> {
        let frames = self.frames.unwrap_or(FrameRange { first: 0, end: None });
        let classes = self.classes()?;
        Ok(Request {
            config: self.options.config()?,
            dataset: self.dataset,
            sequence: self.sequence,
            classes,
            first_frame: frames.first,
            end_frame: frames.end,
            threads: self.threads.count(),
            overwrite: self.overwrite,
            record: self.record,
            out: self.out,
        })
    }
}

/// A run with a bar.
pub(super) fn run_with_progress(request: &Request) -> Result<Summary, CliError> {
    let progress = Progress::new("slam");
    Ok(run::run(request, |done, all| progress.show(done, all))?)
}
