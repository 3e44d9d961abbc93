//! Saving and restoring the submap's voxels.

use super::{Voxel, VoxelMap};
use crate::snapshot::{Reader, SnapshotError, Writer};

impl<const SETS: usize> VoxelMap<SETS> {
    /// Writes the voxels in use, bucket by bucket: which of its places are taken, then their keys and voxels.
    pub(crate) fn save(&self, writer: &mut Writer<'_>) -> Result<(), SnapshotError> {
        writer.put(&(self.anchor, self.used, self.evicted))?;
        for (keys, voxels) in self.keys.iter().zip(&self.voxels) {
            let taken =
                keys.iter().enumerate().fold(0u8, |bits, (way, key)| bits | u8::from(*key != 0) << way);
            writer.put(&taken)?;
            for (key, voxel) in keys.iter().zip(voxels).filter(|(key, _)| **key != 0) {
                writer.put(&(key.to_le_bytes(), voxel))?;
            }
        }
        Ok(())
    }

    /// Reads what [`Self::save`] wrote into an empty map.
    pub(crate) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), SnapshotError> {
        (self.anchor, self.used, self.evicted) = reader.take()?;
        for (keys, voxels) in self.keys.iter_mut().zip(&mut self.voxels) {
            let taken: u8 = reader.take()?;
            for (way, (key, voxel)) in keys.iter_mut().zip(voxels).enumerate() {
                if taken >> way & 1 == 1 {
                    let (bytes, kept): (_, Voxel) = reader.take()?;
                    (*key, *voxel) = (u64::from_le_bytes(bytes), kept);
                }
            }
        }
        Ok(())
    }
}
