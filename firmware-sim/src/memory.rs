//! What a profile costs: the exact bytes of each part of an odometry.

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
use sdslam_core::{Landmark, Odometry};

/// A part of an odometry's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// What lies there.
    pub name: &'static str,
    /// How many of them fit.
    pub capacity: usize,
    /// Bytes in all.
    pub bytes: usize,
}

/// The parts of an odometry of this profile. The last one is what remains (configuration, pose, alignment): together
/// they are `size_of` the odometry. The points of a scan are the caller's and not among them.
pub const fn parts<
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
    const RANGE_COLUMNS: usize,
>() -> [Part; 11] {
    let mut parts = [
        Part { name: "scan cells", capacity: CELLS, bytes: size_of::<ScanCells<CELLS>>() },
        Part { name: "registered points", capacity: CELLS, bytes: CELLS * size_of::<SourcePoint>() },
        Part { name: "instances", capacity: INSTANCES, bytes: size_of::<Instances<CELLS, INSTANCES>>() },
        Part { name: "landmarks", capacity: LANDMARKS, bytes: 2 * LANDMARKS * size_of::<Landmark>() },
        Part { name: "landmark pairs", capacity: LANDMARKS, bytes: LANDMARKS * size_of::<Candidate>() },
        Part { name: "hull pairs", capacity: PAIRS, bytes: PAIRS * size_of::<HullPair>() },
        Part { name: "tracks", capacity: TRACKS, bytes: TRACKS * size_of::<Track>() },
        Part { name: "range images", capacity: HISTORY, bytes: size_of::<Visibility<RANGE_COLUMNS>>() },
        Part { name: "submap voxels", capacity: VOXEL_SETS * WAYS, bytes: size_of::<VoxelMap<VOXEL_SETS>>() },
        Part {
            name: "submap landmarks",
            capacity: MAP_LANDMARKS,
            bytes: MAP_LANDMARKS * size_of::<MapLandmark>(),
        },
        Part {
            name: "everything else",
            capacity: 1,
            bytes: size_of::<
                Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS, RANGE_COLUMNS>,
            >(),
        },
    ];
    let mut index = 0;
    while index + 1 < parts.len() {
        parts[parts.len() - 1].bytes -= parts[index].bytes;
        index += 1;
    }
    parts
}
