//! Part of the map that bends as one piece: voxels by columns of the lattice, so that what lies near a place is found
//! without visiting the rest.

use std::collections::HashMap;

use rustc_hash::FxBuildHasher;

use super::{Key, Voxel};

/// Voxels along the side of a column.
const COLUMN: i32 = 32;

pub(super) type Voxels = HashMap<Key, Voxel, FxBuildHasher>;

/// Voxels that move with a keyframe.
pub(super) struct Submap {
    /// The keyframe.
    pub anchor: usize,
    columns: HashMap<[i32; 2], Voxels, FxBuildHasher>,
}

/// The column of a voxel.
pub(super) fn column_of(key: &Key) -> [i32; 2] {
    [key[0].div_euclid(COLUMN), key[1].div_euclid(COLUMN)]
}

impl Submap {
    pub(super) fn new(anchor: usize) -> Self {
        Self { anchor, columns: HashMap::default() }
    }

    pub(super) fn len(&self) -> usize {
        self.columns.values().map(Voxels::len).sum()
    }

    /// The voxels of a column, none if it is new.
    pub(super) fn column(&mut self, column: [i32; 2]) -> &mut Voxels {
        self.columns.entry(column).or_default()
    }

    /// The voxel at `key`, if it is there.
    pub(super) fn get_mut(&mut self, key: &Key) -> Option<&mut Voxel> {
        self.columns.get_mut(&column_of(key))?.get_mut(key)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&Key, &Voxel)> {
        self.columns.values().flatten()
    }

    /// The columns within `reach` voxels of `key`, seen from above.
    pub(super) fn near(&self, key: Key, reach: i32) -> impl Iterator<Item = (&Key, &Voxel)> {
        let columns = self.columns.iter().filter(move |(column, _)| is_near(column, key, reach));
        columns.flat_map(|(_, voxels)| voxels)
    }

    /// [`Self::near`], to change.
    pub(super) fn near_mut(&mut self, key: Key, reach: i32) -> impl Iterator<Item = (&Key, &mut Voxel)> {
        let columns = self.columns.iter_mut().filter(move |(column, _)| is_near(column, key, reach));
        columns.flat_map(|(_, voxels)| voxels)
    }

    pub(super) fn retain(&mut self, mut keep: impl FnMut(&Key, &Voxel) -> bool) {
        for voxels in self.columns.values_mut() {
            voxels.retain(|key, voxel| keep(key, voxel));
        }
    }

    /// Gives back the memory of voxels that are gone: a table keeps its size when it is emptied.
    pub(super) fn shrink(&mut self) {
        self.columns.retain(|_, voxels| !voxels.is_empty());
        self.columns.values_mut().for_each(Voxels::shrink_to_fit);
        self.columns.shrink_to_fit();
    }
}

fn is_near(column: &[i32; 2], key: Key, reach: i32) -> bool {
    (0..2).all(|i| {
        let low = column[i] * COLUMN;
        low <= key[i].saturating_add(reach) && low + COLUMN > key[i].saturating_sub(reach)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of 60 by 60 by 2 voxels around the origin.
    fn block() -> Submap {
        let mut submap = Submap::new(0);
        for (x, y, z) in (-30..30).flat_map(|x| (-30..30).flat_map(move |y| (0..2).map(move |z| (x, y, z)))) {
            let key = [x, y, z];
            submap.column(column_of(&key)).entry(key).or_default().count += 1;
        }
        submap
    }

    #[test]
    fn near_leaves_out_columns_and_nothing_within_reach() {
        let mut submap = block();
        let within = |key: &Key| (key[0] + 40).abs() <= 15 && (key[1] - 2).abs() <= 15;
        let all = submap.iter().filter(|(key, _)| within(key)).count();
        let near: Vec<Key> = submap.near([-40, 2, 0], 15).map(|(key, _)| *key).collect();
        assert_eq!(near.iter().filter(|key| within(key)).count(), all);
        assert_eq!(all, 6 * 31 * 2);
        assert!(near.iter().all(|key| key[0] < 0) && near.len() == submap.len() / 2, "{}", near.len());
        assert_eq!(submap.near_mut([-40, 2, 0], 15).count(), near.len());
    }

    #[test]
    fn what_is_given_away_takes_no_memory() {
        let mut submap = block();
        submap.retain(|key, _| *key == [5, 5, 1]);
        submap.shrink();
        assert_eq!((submap.len(), submap.columns.len()), (1, 1));
        let capacity: usize = submap.columns.values().map(Voxels::capacity).sum();
        assert!(capacity < 16, "{capacity}");
        assert_eq!(submap.get_mut(&[5, 5, 1]).map(|voxel| voxel.count), Some(1));
    }
}
