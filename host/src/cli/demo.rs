//! `sdslam demo`.

use std::path::PathBuf;

use super::progress::Progress;
use super::run::run_with_progress;
use super::{CliError, print};
use crate::config::HostConfig;
use crate::run::{Request, Summary};
use crate::simulate::{self, Options};

/// Simulate a short drive and run the SLAM on it.
///
/// Needs nothing but this program. The drive goes through traffic, over a hill and round a block; at the end a table
/// tells how well the pose, the moving landmarks and the map came out. Takes less than two minutes on two cores.
///
/// Writes the drive to DIR/drive and the results to DIR/results.
///
/// Example: sdslam demo --out demo
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Where the drive and the results go.
    #[arg(long, value_name = "DIR", default_value = "sdslam-demo")]
    out: PathBuf,
    /// The town and its traffic follow from this number.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of scans, 0.1 s apart; the loop closes with the default only.
    #[arg(long, value_name = "N", default_value_t = Options::demo().frames)]
    frames: usize,
    /// Azimuth columns of a turn of the sensor, 64 to 8192; fewer make it quicker and less exact.
    #[arg(long, value_name = "N", default_value_t = Options::demo().sensor.columns)]
    columns: usize,
    /// Replace the files of an earlier demo.
    #[arg(long)]
    overwrite: bool,
}

impl Args {
    pub(super) fn execute(&self) -> Result<(), CliError> {
        let drive = self.simulate()?;
        let summary = run_with_progress(&self.request(drive))?;
        print(format!("{summary}{}", pictures(&summary)))
    }

    /// Writes the drive; gives the name of its sequence.
    fn simulate(&self) -> Result<String, CliError> {
        let mut options = Options::demo();
        options.seed = self.seed;
        options.frames = self.frames;
        options.sensor.columns = self.columns;
        options.overwrite = self.overwrite;
        let progress = Progress::new("simulate");
        simulate::simulate(&options, &self.out.join("drive"), &mut |done, all| progress.show(done, all))?;
        Ok(options.sequence)
    }

    fn request(&self, sequence: String) -> Request {
        let mut config = HostConfig::default();
        // The simulated sensor is calibrated.
        config.input.elevation_correction_deg = 0.0;
        Request {
            dataset: self.out.join("drive"),
            sequence,
            labels: None,
            first_frame: 0,
            end_frame: None,
            config,
            threads: 2,
            save_map: None,
            overwrite: self.overwrite,
            record: None,
            out: self.out.join("results"),
        }
    }
}

/// Where to look.
fn pictures(summary: &Summary) -> String {
    let folder = &summary.folder;
    format!(
        "\nThe drive from above: {} (any browser)\nThe map: {} (CloudCompare, MeshLab, Open3D)\n",
        folder.join("trajectory.svg").display(),
        folder.join("map.ply").display()
    )
}
