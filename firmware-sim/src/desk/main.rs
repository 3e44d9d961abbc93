//! The on-vehicle loop on a desk: replays a recording or a drive, tells what it needs of memory and time, whether a drive
//! fits a memory profile, and what becomes of it when things go wrong.

mod board;
mod compare;
mod drive;
mod faults;
mod fit;
mod labels;
mod link;
mod replay;
mod report;
mod retained;
mod scenarios;
mod source;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};

use replay::Replay;
use source::Source;

/// Runs the on-vehicle loop on a desk.
///
/// Without a command: replays the recording that comes with the program.
#[derive(Parser)]
#[command(name = "sdslam-firmware-sim", version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Replay a recording or a drive: tables of memory and time, and the last pose.
    Replay {
        #[command(flatten)]
        input: Input,
        /// Memory profile.
        #[arg(long, default_value = "full")]
        profile: ProfileName,
        /// Write every answer to this file, as it goes over the wire.
        #[arg(long, value_name = "FILE")]
        answers: Option<PathBuf>,
        /// Time of the board from a scan to its answer [ms]; a scan that is fetched too late ends the replay.
        #[arg(long, value_name = "MS", default_value_t = 0)]
        busy_ms: u64,
    },
    /// Replay many times, each with faults of its own, and tell what was injected and what happened.
    Faults {
        #[command(flatten)]
        input: Input,
        /// Memory profile.
        #[arg(long, default_value = "full")]
        profile: ProfileName,
        /// How many times.
        #[arg(long, value_name = "N", default_value_t = 1000)]
        scenarios: u32,
        /// Everything random follows from this number.
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        /// Run scenario N alone, and tell what happened scan by scan.
        #[arg(long, value_name = "N", conflicts_with = "scenarios")]
        only: Option<u32>,
    },
    /// Tell whether a drive fits a memory profile: which buffer was full, when, by how much, and what the poses lost
    /// compared with the full profile.
    Fit {
        #[command(flatten)]
        input: Input,
        /// Memory profile.
        #[arg(long, default_value = "landmark")]
        profile: ProfileName,
    },
    /// Compare two files of answers; the exit code is 1 where one bit differs.
    Compare {
        /// Answers of one run.
        left: PathBuf,
        /// Answers of the other.
        right: PathBuf,
    },
    /// The exact bytes of every profile.
    Profiles,
}

/// What to replay. Default: the recording that comes with the program.
#[derive(clap::Args, Default)]
struct Input {
    /// A recording made by `sdslam run --record`, or, with --sequence, a folder in KITTI odometry layout.
    #[arg(value_name = "RECORDING | DATASET")]
    path: Option<PathBuf>,
    /// Replay DATASET/sequences/NN. Its points go in as they are: no elevation correction, no deskewing.
    #[arg(long, value_name = "NN", requires = "path")]
    sequence: Option<String>,
    /// Stop after this many scans.
    #[arg(long, value_name = "N")]
    scans: Option<usize>,
}

impl Input {
    fn open(self) -> anyhow::Result<Source> {
        let scans = self.scans.unwrap_or(usize::MAX);
        Source::open(self.path.as_deref(), self.sequence.as_deref(), scans)
    }
}

/// The memory profiles of `profile.rs`.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum ProfileName {
    /// Full scans of a 64-beam sensor, dense refinement.
    Full,
    /// Scans of at most 8192 points, landmarks only.
    Landmark,
}

/// Calls a function with the profile of a name as its type parameter.
macro_rules! with_profile {
    ($name:expr, $function:ident($($argument:expr),*)) => {
        match $name {
            $crate::ProfileName::Full => $function::<sdslam_firmware_sim::profile::FullScan>($($argument),*),
            $crate::ProfileName::Landmark => $function::<sdslam_firmware_sim::profile::LandmarkOnly>($($argument),*),
        }
    };
}

fn main() -> ExitCode {
    match execute(Cli::parse().command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn execute(command: Option<Command>) -> anyhow::Result<ExitCode> {
    use replay::replay;
    use report::profile_table;
    use scenarios::scenarios;

    let default =
        Command::Replay { input: Input::default(), profile: ProfileName::Full, answers: None, busy_ms: 0 };
    let mut ok = true;
    let text = match command.unwrap_or(default) {
        Command::Replay { input, profile, answers, busy_ms } => {
            let replayed: Replay = with_profile!(profile, replay(input.open()?, busy_ms * 1000))?;
            if let Some(file) = answers {
                replayed.write_answers(&file)?;
            }
            report::report(&replayed)
        }
        Command::Faults { input, profile, scenarios: runs, seed, only } => {
            let runs = only.map_or(0..runs, |run| run..run + 1);
            let table = with_profile!(profile, scenarios(input.open()?, runs, seed))?;
            ok = table.all_recovered();
            table.to_string()
        }
        Command::Fit { input, profile } => {
            let source = input.open()?;
            let full = replay::<sdslam_firmware_sim::profile::FullScan>(source.clone(), 0)?;
            fit::report(&with_profile!(profile, replay(source, 0))?, &full)
        }
        Command::Compare { left, right } => {
            let comparison = compare::compare(&left, &right)?;
            ok = comparison.equal;
            comparison.text
        }
        Command::Profiles => {
            [ProfileName::Full, ProfileName::Landmark].map(|p| with_profile!(p, profile_table())).join("\n")
        }
    };
    print!("{text}");
    Ok(if ok { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
