//! `sdslam localize`.

use std::path::PathBuf;
use std::str::FromStr;

use super::frames::FrameRange;
use super::progress::Progress;
use super::run::Options;
use super::{CliError, print};
use crate::localise::Start;
use crate::run::{self, LocaliseRequest, Request};

/// Find a vehicle in a saved map and follow it there.
///
/// Reads a map that `sdslam run --save-map` wrote and the drive DATASET/sequences/NN, and writes to OUT/NN: poses_tum.txt
/// (pose of the sensor in the map, for every frame that has one), localisation.csv (status of every frame),
/// metrics.json, config.toml and run.log. The map is not changed.
///
/// Example: sdslam localize --map town.map --dataset ~/kitti --sequence 07 --out results
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The saved map.
    #[arg(long, value_name = "FILE")]
    map: PathBuf,
    /// Folder with sequences/.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Name of the sequence, e.g. 07.
    #[arg(long, value_name = "NN")]
    sequence: String,
    /// Folder of the label files within the sequence.
    #[arg(long, value_name = "FOLDER", default_value = "labels")]
    labels: String,
    /// Where the vehicle is at first: `global` (anywhere in the map) or X,Y,YAW in the map [m, m, deg], good to about
    /// a metre and 5 deg.
    #[arg(long, value_name = "POSE", default_value = "global", allow_hyphen_values = true)]
    initial_pose: InitialPose,
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
}

/// Where to begin, as it is typed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct InitialPose(Start);

impl FromStr for InitialPose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "global" {
            return Ok(Self(Start::Global));
        }
        let numbers: Result<Vec<f64>, _> =
            text.split(',').map(|number| number.trim().parse::<f64>()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, yaw_deg]) if [x, y, yaw_deg].iter().all(|v| v.is_finite()) => {
                Ok(Self(Start::Near { position: [x, y], yaw: yaw_deg.to_radians() }))
            }
            _ => Err(format!("'{text}' is neither global nor X,Y,YAW")),
        }
    }
}

impl Args {
    pub(super) fn execute(self) -> Result<(), CliError> {
        let progress = Progress::new("localize");
        let request = self.request()?;
        let summary = run::localise(&request, |done, all| progress.show(done, all))?;
        drop(progress);
        print(summary.to_string())
    }

    fn request(self) -> Result<LocaliseRequest, CliError> {
        let frames = self.frames.unwrap_or(FrameRange { first: 0, end: None });
        let drive = Request {
            record: None,
            config: self.options.config()?,
            dataset: self.dataset,
            sequence: self.sequence,
            labels: Some(self.labels),
            first_frame: frames.first,
            end_frame: frames.end,
            threads: 2,
            save_map: None,
            overwrite: self.overwrite,
            out: self.out,
        };
        Ok(LocaliseRequest { drive, map: self.map, start: self.initial_pose.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_as_they_are_typed() {
        assert_eq!("global".parse(), Ok(InitialPose(Start::Global)));
        let near = Start::Near { position: [1.5, -2.0], yaw: std::f64::consts::FRAC_PI_2 };
        assert_eq!("1.5,-2,90".parse(), Ok(InitialPose(near)));
        for wrong in ["", "here", "1,2", "1,2,3,4", "1,2,nan"] {
            assert!(wrong.parse::<InitialPose>().is_err(), "{wrong}");
        }
    }
}
