//! Saving and restoring the range images.

use super::{HISTORY, Visibility};
use crate::snapshot::{Reader, SnapshotError, Writer};

impl<const COLUMNS: usize> Visibility<COLUMNS> {
    /// Writes the images held, newest first, each with its place.
    pub(crate) fn save(&self, writer: &mut Writer<'_>) -> Result<(), SnapshotError> {
        writer.put(&(self.order.len() as u32))?;
        for slot in &self.order {
            let Some(image) = self.images.get(*slot as usize) else { continue };
            writer.put(&(*slot, image.local_from_sensor))?;
            for range in image.ranges.as_flattened() {
                writer.put(&range.to_le_bytes())?;
            }
        }
        Ok(())
    }

    /// Reads what [`Self::save`] wrote into a history without images.
    pub(crate) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), SnapshotError> {
        let (count, mut taken): (u32, _) = (reader.take()?, [false; HISTORY]);
        for _ in 0..count {
            let (slot, local_from_sensor) = reader.take::<(u8, _)>()?;
            let (Some(image), Some(taken)) =
                (self.images.get_mut(slot as usize), taken.get_mut(slot as usize))
            else {
                return Err(SnapshotError::Content);
            };
            // Without gaps and without doubles, or the next images would overwrite each other.
            if core::mem::replace(taken, true) || u32::from(slot) >= count {
                return Err(SnapshotError::Content);
            }
            image.local_from_sensor = local_from_sensor;
            for range in image.ranges.as_flattened_mut() {
                *range = u16::from_le_bytes(reader.take()?);
            }
            self.order.push_back(slot).map_err(|_| SnapshotError::Content)?;
        }
        Ok(())
    }
}
