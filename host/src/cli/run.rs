//! `sdslam run`.

use std::path::PathBuf;

use super::classes::ClassArgs;
use super::frames::FrameRange;
use super::progress::Progress;
use super::segment::ThreadArgs;
use super::{CliError, print};
use crate::config::{HostConfig, Preset};
use crate::run::{self, Request, Summary};

/// Run the SLAM on a drive.
///
/// Reads DATASET/sequences/NN and writes to OUT/NN: poses_kitti.txt (camera frame), poses_tum.txt (sensor frame),
/// poses_odometry.txt, loops.csv, graph.g2o, metrics.json, landmarks.csv, motion/NNNNNN.label, map.ply, map.pcd, map.png,
/// grid.pgm, grid.yaml, trajectory.svg, config.toml, run.log, ms.txt, cpu_ms.txt and
/// back_end_cpu_ms.txt. A table of the results is printed at the end.
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
    #[command(flatten)]
    classes: ClassArgs,
    /// Where the results go: into the folder OUT/NN.
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    options: Options,
    /// Frames to run on, from A up to but without B; A.. and ..B leave the other end open. Default: all.
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Save the map here for `sdslam localize`.
    #[arg(long, value_name = "FILE")]
    save_map: Option<PathBuf>,
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
    /// Close no loops: the trajectory is the odometry's, and the map with it.
    #[arg(long)]
    no_loop_closure: bool,
}

impl Options {
    /// The configuration with what was typed on top.
    pub(super) fn config(&self) -> Result<HostConfig, CliError> {
        let mut config = match &self.config {
            Some(file) => HostConfig::load(file, self.preset)?,
            None => HostConfig::of_preset(self.preset.unwrap_or_default()),
        };
        if self.no_elevation_correction {
            config.input.elevation_correction_deg = 0.0;
        }
        config.input.deskew |= self.deskew;
        config.loops.enabled &= !self.no_loop_closure;
        Ok(config)
    }
}

impl Args {
    pub(super) fn execute(self) -> Result<(), CliError> {
        let summary = run_with_progress(&self.request()?)?;
        print(summary.to_string())
    }

    fn request(self) -> Result<Request, CliError> {
        let frames = self.frames.unwrap_or(FrameRange { first: 0, end: None });
        let classes = self.classes.source(&self.dataset, &self.sequence)?;
        Ok(Request {
            config: self.options.config()?,
            dataset: self.dataset,
            sequence: self.sequence,
            classes,
            first_frame: frames.first,
            end_frame: frames.end,
            threads: self.threads.count(),
            save_map: self.save_map,
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
