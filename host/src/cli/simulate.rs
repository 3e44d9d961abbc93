//! `sdslam simulate`.

use std::path::{Path, PathBuf};

use super::progress::Progress;
use super::{CliError, print};
use crate::simulate::{self, Options, Summary, Traffic};

/// Simulate a drive through a procedural town, seen by an HDL-64E.
///
/// Writes KITTI odometry layout with exact SemanticKITTI labels, moving ids and poses to
/// DIR/sequences/NN and DIR/poses/NN.txt. The same seed gives the same files, whatever the number of threads. The
/// scans lack the elevation defect of KITTI's: run on them with --no-elevation-correction.
///
/// Example: sdslam simulate --out town --seed 7 --frames 300
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Where the drive goes.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Everything random follows from this number.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of scans. Default: that of the preset.
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// Name of the sequence. Default: that of the preset.
    #[arg(long, value_name = "NN")]
    sequence: Option<String>,
    /// The town and the way through it.
    #[arg(long, value_name = "PRESET", default_value = "demo")]
    preset: Drive,
    /// How much traffic there is. Default: that of the preset.
    #[arg(long, value_name = "TRAFFIC")]
    traffic: Option<TrafficArg>,
    /// Speed on a straight street [m/s], 1 to 20. Default: that of the preset.
    #[arg(long, value_name = "M/S")]
    speed: Option<f64>,
    /// Azimuth columns of a turn of the sensor, 64 to 8192; fewer make smaller and quicker scans.
    #[arg(long, value_name = "N")]
    columns: Option<usize>,
    /// Threads; 0 for as many as the machine has.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Replace a drive of the same name in DIR.
    #[arg(long)]
    overwrite: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Drive {
    /// 26 s through traffic: over a hill and once round a block.
    Demo,
    /// 120 s through a larger town, with several loops.
    Town,
    /// 12 scans a second apart; sensor, streets, buildings, plants and traffic are drawn from wide ranges. For
    /// training networks: see host/model.
    Random,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum TrafficArg {
    /// Nothing moves.
    None,
    /// An ordinary street.
    Normal,
    /// Rush hour: two to three times as much.
    Heavy,
}

impl Args {
    pub(super) fn execute(&self) -> Result<(), CliError> {
        let progress = Progress::new("simulate");
        let options = self.options();
        let summary = simulate::simulate(&options, &self.out, &mut |done, all| progress.show(done, all))?;
        drop(progress);
        print(table(&summary, &self.out.join("sequences").join(&options.sequence)))
    }

    fn options(&self) -> Options {
        let mut options = match self.preset {
            Drive::Demo => Options::demo(),
            Drive::Town => Options::town(),
            Drive::Random => Options::randomised(self.seed),
        };
        options.seed = self.seed;
        options.threads = self.threads;
        options.overwrite = self.overwrite;
        options.traffic = match self.traffic {
            None => options.traffic,
            Some(TrafficArg::None) => Traffic::None,
            Some(TrafficArg::Normal) => Traffic::Normal,
            Some(TrafficArg::Heavy) => Traffic::Heavy,
        };
        options.frames = self.frames.unwrap_or(options.frames);
        options.sequence = self.sequence.clone().unwrap_or(options.sequence);
        options.sensor.columns = self.columns.unwrap_or(options.sensor.columns);
        if let Some(speed_mps) = self.speed {
            options.speed_mps = speed_mps;
            options.start_speed_mps = options.start_speed_mps.min(speed_mps);
        }
        options
    }
}

/// One row per figure: description, value, unit.
fn table(summary: &Summary, folder: &Path) -> String {
    let Summary { frames, length_m, climb_m, points_per_scan, moving_objects, .. } = summary;
    format!(
        "frames                 {frames}\n\
         length, climb          {length_m:.1} m, {climb_m:.1} m\n\
         points per scan        {points_per_scan:.0}\n\
         moving objects seen    {moving_objects}\n\
         files                  {}\n",
        folder.display()
    )
}
