//! Memory profiles: what a board's memory holds, stated once for the desk and for the board.

use sdslam_core::capacity::{FULL_SCAN_POINTS, LANDMARK_POINTS, LandmarkOdometry};
use sdslam_core::optimise::pso;
use sdslam_core::{Config, FullScanOdometry, LabelledPoint};

pub use crate::any_odometry::AnyOdometry;
pub use crate::loops::{AnyLoops, LoopTable, LoopUse, NoLoops};

/// A memory profile. State your own like those below; the desk then tells its bytes and whether a drive fits it.
pub trait Profile {
    /// The odometry, with its capacities.
    type Odometry: AnyOdometry;
    /// The loop table, with its capacities, or [`NoLoops`].
    type Loops: AnyLoops;
    /// Points of a scan that the caller holds.
    const POINTS: usize;
    /// The parameters that go with it.
    const CONFIG: Config;

    /// Bytes in all: the odometry, the points of a scan and the loop table.
    const BYTES: usize =
        size_of::<Self::Odometry>() + Self::POINTS * size_of::<LabelledPoint>() + size_of::<Self::Loops>();
}

/// Full scans of a 64-beam sensor, the dense refinement, loops to the last half kilometre: 16 MiB at most.
pub struct FullScan;

impl Profile for FullScan {
    type Odometry = FullScanOdometry;
    type Loops = LoopTable<256, 32_768, 4096>;
    const POINTS: usize = FULL_SCAN_POINTS;
    const CONFIG: Config = Config::accurate();
}

const _: () = assert!(FullScan::BYTES <= 16 << 20, "the full-scan profile must fit 16 MiB");

/// Scans of at most 8192 points, landmarks only, no loops: 1 MiB at most.
pub struct LandmarkOnly;

impl Profile for LandmarkOnly {
    type Odometry = LandmarkOdometry;
    type Loops = NoLoops;
    const POINTS: usize = LANDMARK_POINTS;
    /// The paper's stages, on larger cells: 8192 sparse points fill twice as many of the usual ones as the profile has. With a
    /// small swarm: the paper's takes up to 145 ms a scan on a Cortex-M7 at 480 MHz.
    const CONFIG: Config = {
        let mut config = Config::paper();
        config.preliminary_pose.hulls.swarm = pso::Config::SMALL;
        config.precise_pose.hulls.swarm = pso::Config::SMALL;
        (config.label_filter.ground_cell_m, config.label_filter.large_cell_m) = (2.0, 0.8);
        (config.label_filter.small_cell_m, config.label_filter.movable_cell_m) = (0.25, 0.3);
        config
    };
}

const _: () = assert!(LandmarkOnly::BYTES <= 1 << 20, "the landmark profile must fit 1 MiB");
