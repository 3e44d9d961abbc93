//! `sdslam evaluate`.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use clap::ArgGroup;
use sdslam_core::MapPose;
use serde::Serialize;

use super::frames::FrameRange;
use super::{CliError, print};
use crate::dataset::Sequence;
use crate::dataset::trajectory::{self, Trajectory};
use crate::evaluate::{self, MapEntropyOptions};

const EXAMPLES: &str = "\
Examples:
  sdslam evaluate --ground-truth ~/kitti/poses/07.txt --estimate results/07/poses_kitti.txt
  sdslam evaluate --labels-truth ~/kitti/sequences/07/labels --labels-estimate results/07/motion
  sdslam evaluate --map-entropy --dataset ~/kitti --sequence 07 --poses results/07/poses_kitti.txt";

/// Measure a result: a trajectory, labels, or the map.
///
/// Trajectories: t_rel [%] and r_rel [deg/100 m] by the KITTI odometry devkit's definition, ATE [m] after rigid alignment
/// and RPE, as evo has them. Files are KITTI (12 numbers a line, camera frame) or TUM (8, paired by time stamp); the
/// content tells which. Drives up to 100 m are measured over segments of 10 to 80 m, and the table says so.
///
/// Labels: IoU of the classes and of the moving points, as semantic-kitti-api counts them.
///
/// Map entropy: how thin the surfaces are in the map that the scans make with the given poses; lower is better. It needs
/// no truth.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
#[command(group = ArgGroup::new("what").required(true).args(["estimate", "labels_estimate", "map_entropy"]))]
pub(super) struct Args {
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Trajectory to compare.
    #[arg(long, value_name = "FILE", requires = "ground_truth", help_heading = "Trajectories")]
    estimate: Option<PathBuf>,
    /// True trajectory, in the same format.
    #[arg(long, value_name = "FILE", requires = "estimate", help_heading = "Trajectories")]
    ground_truth: Option<PathBuf>,
    /// Folder of the .label files to compare.
    #[arg(long, value_name = "DIR", requires = "labels_truth", help_heading = "Labels")]
    labels_estimate: Option<PathBuf>,
    /// Folder of the true .label files of the same names.
    #[arg(long, value_name = "DIR", requires = "labels_estimate", help_heading = "Labels")]
    labels_truth: Option<PathBuf>,
    /// Measure the map that the scans of a drive make.
    #[arg(long, requires_all = ["dataset", "sequence", "poses"], help_heading = "Map entropy")]
    map_entropy: bool,
    #[command(flatten)]
    map: MapArgs,
}

/// Which drive makes the map, and how it is measured.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Map entropy")]
struct MapArgs {
    /// Folder with sequences/.
    #[arg(long, value_name = "DIR", requires = "map_entropy")]
    dataset: Option<PathBuf>,
    /// Name of the sequence, e.g. 07.
    #[arg(long, value_name = "NN", requires = "map_entropy")]
    sequence: Option<String>,
    /// Poses, one a frame of the drive or of --frames: KITTI (camera frame) or TUM (sensor frame).
    #[arg(long, value_name = "FILE", requires = "map_entropy")]
    poses: Option<PathBuf>,
    /// Folder of the labels within the sequence, which tell what can move and is left out.
    #[arg(long, value_name = "FOLDER", default_value = "labels")]
    labels: String,
    /// Frames to use, from A up to but without B. Default: all.
    #[arg(long, value_name = "A..B", requires = "map_entropy")]
    frames: Option<FrameRange>,
    /// Frames in a local map.
    #[arg(long, value_name = "N", default_value_t = 50)]
    window: usize,
    /// Radius of a neighbourhood [m].
    #[arg(long, value_name = "M", default_value_t = 0.3)]
    radius: f64,
    /// Points farther from the sensor are left out [m].
    #[arg(long, value_name = "M", default_value_t = 35.0)]
    max_range: f64,
    /// Leave the points as they are (default: +0.205 deg of elevation, for KITTI).
    #[arg(long, requires = "map_entropy")]
    no_elevation_correction: bool,
}

impl Args {
    pub(super) fn execute(&self) -> Result<(), CliError> {
        if let (Some(truth), Some(estimate)) = (&self.ground_truth, &self.estimate) {
            self.show(&evaluate::trajectory_files(truth, estimate)?)
        } else if let (Some(truth), Some(estimate)) = (&self.labels_truth, &self.labels_estimate) {
            self.show(&evaluate::label_folders(truth, estimate)?)
        } else if let (Some(dataset), Some(sequence), Some(poses)) =
            (&self.map.dataset, &self.map.sequence, &self.map.poses)
        {
            let sequence = Sequence::open(dataset, sequence, Some(&self.map.labels))?;
            let poses = sensor_poses(poses, &sequence)?;
            self.show(&evaluate::map_entropy(&sequence, &poses, &self.map.options())?)
        } else {
            Err(CliError::Usage("nothing to compare; see sdslam evaluate --help".into()))
        }
    }

    fn show(&self, result: &(impl Display + Serialize)) -> Result<(), CliError> {
        if self.json {
            let json = serde_json::to_string_pretty(result);
            print(json.expect("structs of numbers and names always have a JSON form") + "\n")
        } else {
            print(result.to_string())
        }
    }
}

impl MapArgs {
    fn options(&self) -> MapEntropyOptions {
        MapEntropyOptions {
            radius_m: self.radius,
            max_range_m: self.max_range,
            window: self.window,
            frames: self.frames.map(|frames| frames.first..frames.end.unwrap_or(usize::MAX)),
            correct_elevation: !self.no_elevation_correction,
        }
    }
}

/// Poses of the sensor: KITTI files hold those of the camera.
fn sensor_poses(file: &Path, sequence: &Sequence) -> Result<Vec<MapPose>, CliError> {
    Ok(match trajectory::read(file)? {
        Trajectory::Kitti(_) => {
            evaluate::map_from_sensor(&trajectory::read_kitti(file)?, &sequence.camera_from_sensor())
        }
        Trajectory::Tum(poses) => poses.into_iter().map(|(_, pose)| pose).collect(),
    })
}
