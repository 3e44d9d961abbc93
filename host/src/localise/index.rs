//! The cells of a saved map by place.

use std::collections::BTreeMap;

use sdslam_core::MapPose;

use crate::loops::{PLACE_RANGE_M, Place};
use crate::semantic_map::StaticMap;

/// Side of a block \[m\].
const BLOCK_M: f64 = 20.0;

/// Which cells lie in which block, seen from above.
pub(super) struct MapIndex {
    blocks: BTreeMap<[i32; 2], Vec<u32>>,
}

impl MapIndex {
    pub(super) fn of(map: &StaticMap) -> Self {
        let mut blocks: BTreeMap<[i32; 2], Vec<u32>> = BTreeMap::new();
        for (index, cell) in (0..).zip(map.cells()) {
            blocks.entry(block(cell.position[0].into(), cell.position[1].into())).or_default().push(index);
        }
        Self { blocks }
    }

    /// The map around a pose, in its frame.
    pub(super) fn around(&self, map: &StaticMap, map_from_place: &MapPose) -> Place {
        let at = map_from_place.translation.vector;
        let [low, high] = [-PLACE_RANGE_M, PLACE_RANGE_M].map(|reach| block(at.x + reach, at.y + reach));
        let place_from_map = map_from_place.inverse();
        let mut place = Place::default();
        for x in low[0]..=high[0] {
            for (_, cells) in self.blocks.range([x, low[1]]..=[x, high[1]]) {
                for cell in cells.iter().map(|&index| &map.cells()[index as usize]) {
                    let position = place_from_map * nalgebra::Point3::from(cell.position.map(f64::from));
                    place.add(position.coords.into(), cell.class, cell.count);
                }
            }
        }
        place
    }
}

fn block(x: f64, y: f64) -> [i32; 2] {
    [x, y].map(|v| (v / BLOCK_M).floor() as i32)
}
