//! An odometry of any profile.

use sdslam_core::capacity::PAIRS;
use sdslam_core::instances::Instances;
use sdslam_core::motion_state::tracker::Track;
use sdslam_core::motion_state::visibility::{HISTORY, Visibility};
use sdslam_core::precise_pose::dense::SourcePoint;
use sdslam_core::precise_pose::landmark_map::MapLandmark;
use sdslam_core::precise_pose::voxel_map::{VoxelMap, WAYS};
use sdslam_core::preliminary_pose::hull_registration::HullPair;
use sdslam_core::preliminary_pose::pairing::Candidate;
use sdslam_core::scan_cells::ScanCells;
use sdslam_core::snapshot::SnapshotError;
use sdslam_core::{
    Config, FrameEstimate, LabelledScan, Landmark, Odometry, OdometryError, ParameterError, StageObserver,
    TrackReport,
};

use crate::memory::{ODOMETRY_PARTS, Part};

/// An odometry of any profile: the only place that spells out the capacities.
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

    /// [`Odometry::save`].
    ///
    /// # Errors
    /// [`SnapshotError::BufferFull`].
    fn save(&self, buffer: &mut [u8]) -> Result<usize, SnapshotError>;

    /// [`Odometry::restore`].
    ///
    /// # Errors
    /// A snapshot that is damaged, of another version or of another profile.
    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError>;

    /// The parts of its memory. The last one is what remains (configuration, pose, alignment): together they are
    /// `size_of` the odometry. The points of a scan are the caller's and not among them.
    fn parts() -> [Part; ODOMETRY_PARTS];
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

    fn save(&self, buffer: &mut [u8]) -> Result<usize, SnapshotError> {
        Self::save(self, buffer)
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        Self::restore(self, snapshot)
    }

    fn parts() -> [Part; ODOMETRY_PARTS] {
        let part = |name, capacity, bytes| Part { name, capacity, bytes };
        let mut parts = [
            part("scan cells", CELLS, size_of::<ScanCells<CELLS>>()),
            part("registered points", CELLS, CELLS * size_of::<SourcePoint>()),
            part("instances", INSTANCES, size_of::<Instances<CELLS, INSTANCES>>()),
            part("landmarks", LANDMARKS, 2 * LANDMARKS * size_of::<Landmark>()),
            part("landmark pairs", LANDMARKS, LANDMARKS * size_of::<Candidate>()),
            part("hull pairs", PAIRS, PAIRS * size_of::<HullPair>()),
            part("tracks", TRACKS, TRACKS * size_of::<Track>()),
            part("range images", HISTORY, size_of::<Visibility<RANGE_COLUMNS>>()),
            part("submap voxels", VOXEL_SETS * WAYS, size_of::<VoxelMap<VOXEL_SETS>>()),
            part("submap landmarks", MAP_LANDMARKS, MAP_LANDMARKS * size_of::<MapLandmark>()),
            part("everything else", 1, size_of::<Self>()),
        ];
        let [named @ .., rest] = &mut parts;
        rest.bytes -= named.iter().map(|part| part.bytes).sum::<usize>();
        parts
    }
}
