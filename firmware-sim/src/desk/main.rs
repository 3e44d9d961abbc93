//! The on-vehicle loop on a desk: replays a labelled drive in KITTI odometry layout, prints what it needs of memory and
//! time, and where it ended.

mod board;
mod drive;
mod labels;
mod report;

use std::path::Path;
use std::process::ExitCode;
use std::thread;

use anyhow::{Context, anyhow, ensure};
use sdslam_core::capacity::FULL_SCAN_POINTS;
use sdslam_core::{Config, FullScanOdometry, LabelledPoint, SemanticClass};
use sdslam_firmware_sim::{Totals, run};

use board::DeskBoard;
use drive::Drive;

const USAGE: &str = "\
Replays a labelled drive through the loop that runs in the vehicle; prints memory, time and the last pose.

usage: sdslam-firmware-sim DATASET SEQUENCE

  DATASET   folder with sequences/SEQUENCE/{velodyne/NNNNNN.bin,labels/NNNNNN.label,times.txt}
  SEQUENCE  name of the drive, e.g. 07

The points go in as they are: no elevation correction, no deskewing.
";

/// The odometry is built on the stack before it moves to the heap.
const STACK_BYTES: usize = 4 * size_of::<FullScanOdometry>() + (4 << 20);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--help" | "-h"] => print!("{USAGE}"),
        [dataset, sequence] => {
            if let Err(error) = replay(dataset, sequence) {
                eprintln!("error: {error:#}");
                return ExitCode::FAILURE;
            }
        }
        _ => {
            eprint!("{USAGE}");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

fn replay(dataset: &str, sequence: &str) -> anyhow::Result<()> {
    let drive = Drive::open(&Path::new(dataset).join("sequences").join(sequence))?;
    let work = thread::Builder::new().stack_size(STACK_BYTES).spawn(move || replay_drive(drive));
    let end = work.context("failed to start a thread")?.join();
    print!("{}", end.map_err(|_| anyhow!("the loop panicked"))??);
    Ok(())
}

/// Runs the drive; gives the report.
fn replay_drive(drive: Drive) -> anyhow::Result<String> {
    let mut odometry = Box::new(FullScanOdometry::new(Config::accurate())?);
    let mut points = vec![LabelledPoint::new([0.0; 3], SemanticClass::Unlabelled); FULL_SCAN_POINTS];
    let mut board = DeskBoard::new(drive);
    let mut totals = Totals::default();
    run(&mut board, &mut odometry, &mut points, &mut totals)
        .with_context(|| format!("failed after {} scans", totals.scans))?;
    ensure!(totals.estimates > 0, "no scan gave an estimate");
    Ok(report::report(&odometry, points.len(), &totals, &board))
}
