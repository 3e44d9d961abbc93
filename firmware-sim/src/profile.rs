//! Memory profiles: what a board's odometry holds, stated once for the desk and for the board.

use sdslam_core::capacity::{FULL_SCAN_POINTS, LANDMARK_POINTS, LandmarkOdometry};
use sdslam_core::{
    Config, FrameEstimate, FullScanOdometry, LabelledPoint, LabelledScan, Odometry, OdometryError,
    ParameterError, StageObserver, TrackReport,
};

use crate::memory::{self, Part};

/// An odometry of any profile.
pub trait AnyOdometry: Sized {
    /// [`Odometry::new`].
    ///
    /// # Errors
    /// A parameter that is out of range.
    fn create(config: Config) -> Result<Self, ParameterError>;

    /// [`Odometry::restart`].
    ///
    /// # Errors
    /// A parameter that is out of range.
    fn restart(&mut self, config: Config) -> Result<(), ParameterError>;

    /// [`Odometry::process_scan_observed`].
    ///
    /// # Errors
    /// A stamp that is not after the one before.
    fn process(
        &mut self,
        scan: &mut LabelledScan<'_>,
        observer: &mut impl StageObserver,
    ) -> Result<FrameEstimate, OdometryError>;

    /// [`Odometry::tracks`].
    fn tracks(&self) -> impl Iterator<Item = TrackReport>;

    /// [`memory::parts`].
    fn parts() -> [Part; 11];
}

impl<
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
    const RANGE_COLUMNS: usize,
> AnyOdometry for Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS, RANGE_COLUMNS>
{
    fn create(config: Config) -> Result<Self, ParameterError> {
        Self::new(config)
    }

    fn restart(&mut self, config: Config) -> Result<(), ParameterError> {
        Self::restart(self, config)
    }

    fn process(
        &mut self,
        scan: &mut LabelledScan<'_>,
        observer: &mut impl StageObserver,
    ) -> Result<FrameEstimate, OdometryError> {
        self.process_scan_observed(scan, observer)
    }

    fn tracks(&self) -> impl Iterator<Item = TrackReport> {
        Self::tracks(self)
    }

    fn parts() -> [Part; 11] {
        memory::parts::<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS, RANGE_COLUMNS>()
    }
}

/// A memory profile. State your own like those below; the desk then tells its bytes and whether a drive fits it.
pub trait Profile {
    /// The odometry, with its capacities.
    type Odometry: AnyOdometry;
    /// Points of a scan that the caller holds.
    const POINTS: usize;
    /// The parameters that go with it.
    const CONFIG: Config;

    /// Bytes in all: the odometry and the points of a scan.
    const BYTES: usize = size_of::<Self::Odometry>() + Self::POINTS * size_of::<LabelledPoint>();
}

/// Full scans of a 64-beam sensor, the dense refinement: 16 MiB at most.
pub struct FullScan;

impl Profile for FullScan {
    type Odometry = FullScanOdometry;
    const POINTS: usize = FULL_SCAN_POINTS;
    const CONFIG: Config = Config::accurate();
}

/// Scans of at most 8192 points, landmarks only: 1 MiB at most.
pub struct LandmarkOnly;

impl Profile for LandmarkOnly {
    type Odometry = LandmarkOdometry;
    const POINTS: usize = LANDMARK_POINTS;
    /// The paper's stages, on larger cells: 8192 sparse points fill twice as many of the usual ones as the profile has.
    const CONFIG: Config = {
        let mut config = Config::paper();
        (config.label_filter.ground_cell_m, config.label_filter.large_cell_m) = (2.0, 0.8);
        (config.label_filter.small_cell_m, config.label_filter.movable_cell_m) = (0.25, 0.3);
        config
    };
}
