//! Saving and restoring the state.

use super::Odometry;
use crate::snapshot::{Reader, SnapshotError, Writer};

impl<
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
    const RANGE_COLUMNS: usize,
> Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS, RANGE_COLUMNS>
{
    /// The capacities that a snapshot is bound to.
    const CAPACITIES: [u32; 7] = [
        CELLS as u32,
        INSTANCES as u32,
        LANDMARKS as u32,
        TRACKS as u32,
        VOXEL_SETS as u32,
        MAP_LANDMARKS as u32,
        RANGE_COLUMNS as u32,
    ];

    /// Writes the state, configuration included, to the beginning of `buffer`; gives its bytes. A buffer as large as the
    /// odometry always suffices; a state after few scans needs much less.
    ///
    /// # Errors
    /// [`SnapshotError::BufferFull`]; the buffer then holds nothing that could be restored.
    pub fn save(&self, buffer: &mut [u8]) -> Result<usize, SnapshotError> {
        let mut writer = Writer::new(buffer);
        writer.put(&self.config)?;
        writer.put(&(self.frame, self.stamp_s, self.next_track, self.evicted_landmarks))?;
        writer.put(&self.motion)?;
        writer.put_all(&self.landmarks)?;
        writer.put_all(&self.tracks)?;
        writer.put_all(&self.map_landmarks)?;
        self.calibration.corrections().iter().try_for_each(|correction| writer.put(correction))?;
        self.visibility.save(&mut writer)?;
        self.voxels.save(&mut writer)?;
        writer.finish(Self::CAPACITIES)
    }

    /// Takes over the state of a snapshot: the next scan gives the same bits as if the odometry had never stopped.
    ///
    /// # Errors
    /// A snapshot that is damaged, of another version or of another profile is refused, the state then is as before the
    /// call. After [`SnapshotError::Content`] it is that of [`Self::reset`].
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let reader = Reader::new(snapshot, Self::CAPACITIES)?;
        self.reset();
        let restored = self.take_over(reader);
        if restored.is_err() {
            self.reset();
        }
        restored
    }

    fn take_over(&mut self, mut reader: Reader<'_>) -> Result<(), SnapshotError> {
        let config: crate::Config = reader.take()?;
        config.check().map_err(|_| SnapshotError::Content)?;
        (self.frame, self.stamp_s, self.next_track, self.evicted_landmarks) = reader.take()?;
        self.motion = reader.take()?;
        reader.take_all(&mut self.landmarks)?;
        reader.take_all(&mut self.tracks)?;
        reader.take_all(&mut self.map_landmarks)?;
        for correction in self.calibration.corrections_mut() {
            *correction = reader.take()?;
        }
        self.visibility.restore(&mut reader)?;
        self.voxels.restore(&mut reader)?;
        reader.finish()?;
        self.config = config;
        Ok(())
    }
}
