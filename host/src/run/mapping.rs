//! The voxel map grows beside the core where there is a thread for it; the order of the scans, and so the map, stays.

use std::sync::mpsc::{self, SyncSender};
use std::thread::{self, JoinHandle};

use sdslam_core::{LabelledPoint, MapPose};

use super::voxel_map::VoxelMap;

/// Scans that may wait for the map: bounds the memory when the core is faster.
const WAITING: usize = 2;

/// A map in the making.
pub(super) enum Mapping {
    /// By the caller's thread.
    InTurns(VoxelMap),
    /// By a thread of its own, which gives the map back when there are no more scans.
    Beside {
        /// Points and the sensor's pose in the map.
        scans: SyncSender<(Vec<LabelledPoint>, MapPose)>,
        /// The thread.
        mapper: JoinHandle<VoxelMap>,
    },
}

impl Mapping {
    /// Begins with an empty map; with more than one thread it is made beside.
    pub(super) fn start(mut map: VoxelMap, threads: usize) -> Self {
        if threads < 2 {
            return Self::InTurns(map);
        }
        let (scans, waiting) = mpsc::sync_channel::<(Vec<LabelledPoint>, MapPose)>(WAITING);
        let mapper = thread::spawn(move || {
            for (points, map_from_sensor) in waiting {
                map.add(&points, &map_from_sensor);
            }
            map
        });
        Self::Beside { scans, mapper }
    }

    /// Adds a scan.
    pub(super) fn add(&mut self, points: Vec<LabelledPoint>, map_from_sensor: MapPose) {
        match self {
            Self::InTurns(map) => map.add(&points, &map_from_sensor),
            // Sending fails only after a panic of the mapper, which `finish` passes on.
            Self::Beside { scans, .. } => drop(scans.send((points, map_from_sensor))),
        }
    }

    /// The map, when all scans are in.
    pub(super) fn finish(self) -> VoxelMap {
        match self {
            Self::InTurns(map) => map,
            Self::Beside { scans, mapper } => {
                drop(scans);
                mapper.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            }
        }
    }
}
