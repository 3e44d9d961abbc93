//! The finished map: one list of cells in the map frame, and the files that hold it.

mod cloud;
mod grid;
mod picture;

use sdslam_core::SemanticClass;

use super::{Key, Voxel};
use crate::config::MapConfig;
pub use grid::ObstacleGrid;

/// Keyframes that must have seen through a voxel since its last hit before it is left out: leaves and fences are hit
/// again and again.
const MIN_SEEN_THROUGH: u16 = 3;

/// One voxel of the finished map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapCell {
    /// Mean of its points \[m\], map frame.
    pub position: [f32; 3],
    /// Commonest class.
    pub class: SemanticClass,
    /// Share of its points that have this class, 0..1.
    pub confidence: f32,
    /// Mean intensity of its points.
    pub intensity: f32,
    /// Number of its points.
    pub count: u32,
}

/// The static semantic map of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticMap {
    voxel_m: f64,
    /// In the order of their voxels.
    cells: Vec<MapCell>,
    /// Voxels left out because they were seen through.
    seen_through: usize,
}

impl StaticMap {
    pub(super) fn of<'a>(config: &MapConfig, voxels: impl Iterator<Item = (&'a Key, &'a Voxel)>) -> Self {
        let mut kept: Vec<_> = voxels.filter(|(_, voxel)| voxel.count >= config.min_points).collect();
        let all = kept.len();
        kept.retain(|(_, voxel)| voxel.seen_through < MIN_SEEN_THROUGH);
        kept.sort_unstable_by_key(|(key, _)| **key);
        let cells: Vec<MapCell> = kept.iter().map(|(key, voxel)| cell(key, voxel, config.voxel_m)).collect();
        Self { voxel_m: config.voxel_m, seen_through: all - cells.len(), cells }
    }

    /// A map of cells that were made elsewhere.
    pub(crate) fn from_cells(voxel_m: f64, cells: Vec<MapCell>) -> Self {
        Self { voxel_m, cells, seen_through: 0 }
    }

    /// Edge of a voxel \[m\].
    pub fn voxel_m(&self) -> f64 {
        self.voxel_m
    }

    /// All cells.
    pub fn cells(&self) -> &[MapCell] {
        &self.cells
    }

    /// Voxels that were left out because later scans saw through them.
    pub fn seen_through(&self) -> usize {
        self.seen_through
    }
}

fn cell(key: &Key, voxel: &Voxel, edge: f64) -> MapCell {
    let offset = voxel.mean_offset();
    let (class, confidence) = voxel.class();
    MapCell {
        position: std::array::from_fn(|i| (f64::from(key[i]) * edge + f64::from(offset[i])) as f32),
        class,
        confidence,
        intensity: voxel.intensity / voxel.count.max(1) as f32,
        count: voxel.count,
    }
}
