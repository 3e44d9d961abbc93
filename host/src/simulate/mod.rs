//! A procedural town, seen by an HDL-64E on a drive through it, in the layout of KITTI odometry and SemanticKITTI.
//!
//! Everything follows from one seed, and the files do not depend on the number of threads. Plan, ground, houses,
//! kerbsides and traffic are drawn first; then each ray of each scan is cast, with random numbers of its own.
//!
//! [`Options::demo`] and [`Options::town`] are fixed worlds to try the SLAM on; [`Options::randomised`] draws sensor, town
//! and traffic from wide ranges, to train networks on.
//!
//! Scans are instantaneous at their stamps, as after motion compensation, and without KITTI's error of the vertical
//! angle: run the odometry on them without its correction.

mod barriers;
mod bodies;
mod clutter;
mod country;
mod curved;
mod drive;
mod error;
mod facade;
mod fleet;
mod grid;
mod ground;
mod houses;
mod kerbside;
mod layout;
mod open_blocks;
mod options;
mod path;
mod plan;
mod plants;
mod random;
mod randomise;
mod relief;
mod scan;
mod scene;
mod sensor;
mod shape;
mod style;
mod summary;
mod town;
mod traffic;

use std::{
    path::Path,
    sync::{
        atomic::{AtomicUsize, Ordering},
        mpsc::{self, Sender},
    },
    thread,
};

use sdslam_core::MapPose;

pub use error::SimulateError;
pub use options::{Flaws, Options, Route, SensorOptions, TownOptions, Traffic};
pub use summary::{ClassShare, ObjectCount, Summary};

use drive::Drive;
use layout::Layout;
use scan::Scanner;
use summary::{Counts, ScanCounts};
use town::Town;
use traffic::Crowd;

/// Simulates a drive and writes it below `out`: `sequences/NN/{velodyne,labels}/NNNNNN.{bin,label}`,
/// `sequences/NN/{calib,times}.txt` and `poses/NN.txt` (left camera, the first pose is the identity).
///
/// `progress` is told the number of scans written and of all scans, after each scan.
pub fn simulate(
    options: &Options,
    out: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Summary, SimulateError> {
    options.check()?;
    let layout = Layout::create(out, options)?;
    let town = Town::build(options.seed, &options.town);
    let drive = Drive::plan(options, &town.plan);
    let crowd = Crowd::draw(options, &town, &drive);
    let poses: Vec<MapPose> = (0..options.frames)
        .map(|frame| drive.town_from_sensor(town.scene.ground(), frame as f64 * options.interval_s))
        .collect();
    let scanner = Scanner::new(options, &town, &crowd);
    let counts = write_scans(options.threads, &layout, &scanner, &poses, progress)?;
    layout.write_tables(&poses)?;
    Ok(counts.summary(&poses))
}

/// Scans and writes all frames; each thread takes the next one that is left.
fn write_scans(
    threads: usize,
    layout: &Layout,
    scanner: &Scanner,
    poses: &[MapPose],
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Counts, SimulateError> {
    let threads = match threads {
        0 => thread::available_parallelism().map_or(1, usize::from),
        n => n,
    };
    let next = AtomicUsize::new(0);
    let mut counts = Counts::default();
    thread::scope(|scope| {
        let (sender, results) = mpsc::channel();
        for _ in 0..threads.min(poses.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || work(layout, scanner, poses, next, &sender));
        }
        drop(sender);
        for (done, result) in results.iter().enumerate() {
            // Returning drops the receiver, which stops the threads.
            counts.add(result?);
            progress(done + 1, poses.len());
        }
        Ok(counts)
    })
}

fn work(
    layout: &Layout,
    scanner: &Scanner,
    poses: &[MapPose],
    next: &AtomicUsize,
    results: &Sender<Result<ScanCounts, SimulateError>>,
) {
    loop {
        let frame = next.fetch_add(1, Ordering::Relaxed);
        let Some(pose) = poses.get(frame) else { return };
        let scan = scanner.scan(frame, pose);
        let result = layout.write_scan(frame, &scan).map(|()| ScanCounts::of(&scan));
        if results.send(result).is_err() {
            return;
        }
    }
}
