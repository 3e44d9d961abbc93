//! What outlives a loss of power: what the loop knows of the clocks, and the odometry's snapshot.
//!
//! [`MAGIC`], the loop's own state in postcard's encoding and zeros behind it, CRC-32 of these [`CONTENT_BYTES`]; then the
//! snapshot ([`sdslam_core::snapshot`]), which has a checksum of its own.

use sdslam_core::snapshot::SnapshotError;
use serde::{Deserialize, Serialize};

use crate::any_odometry::AnyOdometry;
use crate::clock::{ClockState, SensorClock};
use crate::wire::CHECKSUM_BYTES;

/// Begins every saved state; the last letter is its version.
const MAGIC: [u8; 4] = *b"SDV2";
/// Magic, and room for the largest [`Head`].
const CONTENT_BYTES: usize = 4 + 8 + 9 + 14 + 6;
/// Bytes before the odometry's snapshot: memory for these and for an odometry always suffices for a saved state.
pub const SAVED_HEAD_BYTES: usize = CONTENT_BYTES + CHECKSUM_BYTES;

/// What the loop knows besides the odometry.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Session {
    pub clock: SensorClock,
    pub last_sequence: Option<u32>,
}

#[derive(Serialize, Deserialize)]
struct Head {
    clock: ClockState,
    last_sequence: Option<u32>,
}

impl Session {
    /// Writes itself and the odometry to the beginning of `room`; gives the bytes.
    pub fn save(&self, odometry: &impl AnyOdometry, room: &mut [u8]) -> Result<usize, SnapshotError> {
        let (content, rest) =
            room.split_first_chunk_mut::<CONTENT_BYTES>().ok_or(SnapshotError::BufferFull)?;
        let (checksum, rest) =
            rest.split_first_chunk_mut::<CHECKSUM_BYTES>().ok_or(SnapshotError::BufferFull)?;
        *content = [0; CONTENT_BYTES];
        let (magic, state) = content.split_first_chunk_mut().ok_or(SnapshotError::BufferFull)?;
        *magic = MAGIC;
        let head = Head { clock: self.clock.state(), last_sequence: self.last_sequence };
        postcard::to_slice(&head, state).map_err(|_| SnapshotError::BufferFull)?;
        *checksum = crc32fast::hash(content).to_le_bytes();
        Ok(SAVED_HEAD_BYTES + odometry.save(rest)?)
    }

    /// What [`Self::save`] wrote, the odometry's part taken over. On failure the odometry is as before, or reset.
    pub fn restore(saved: &[u8], odometry: &mut impl AnyOdometry) -> Result<Self, SnapshotError> {
        let (content, rest) =
            saved.split_first_chunk::<CONTENT_BYTES>().ok_or(SnapshotError::NotASnapshot)?;
        let (checksum, snapshot) = rest.split_first_chunk().ok_or(SnapshotError::NotASnapshot)?;
        let state = content.strip_prefix(&MAGIC).ok_or(SnapshotError::NotASnapshot)?;
        if crc32fast::hash(content) != u32::from_le_bytes(*checksum) {
            return Err(SnapshotError::Checksum);
        }
        let head: Head = postcard::take_from_bytes(state).map_err(|_| SnapshotError::Content)?.0;
        odometry.restore(snapshot)?;
        Ok(Self { clock: SensorClock::resumed(head.clock), last_sequence: head.last_sequence })
    }
}
