//! Snapshots: the state of an odometry in the caller's memory, for a power cycle. See
//! [`Odometry::save`](crate::Odometry::save) and [`Odometry::restore`](crate::Odometry::restore).
//!
//! All numbers little-endian: [`MAGIC`], [`VERSION`] as u16, the seven capacities of the profile as u32, the bytes of the
//! content as u32, the content in postcard's encoding, CRC-32 of everything before. What lives only within a scan (cells,
//! instances, pairs) is not part of it.

use core::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Begins every snapshot.
pub const MAGIC: [u8; 4] = *b"SDSN";
/// Version of the content; another one is refused. Raised with every change of the state.
pub const VERSION: u16 = 3;
/// Bytes before the content.
const HEADER_BYTES: usize = 4 + 2 + 7 * 4 + 4;
const CHECKSUM_BYTES: usize = 4;

/// Why a snapshot cannot be saved or restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SnapshotError {
    /// The buffer is too small; one as large as the odometry always suffices.
    BufferFull,
    /// No snapshot begins here, or part of it is missing.
    NotASnapshot,
    /// It was saved by a program whose state looks different.
    Version {
        /// Its version.
        found: u16,
    },
    /// It was saved in another memory profile.
    OtherProfile,
    /// It does not match its checksum: it was damaged.
    Checksum,
    /// It holds what cannot be, though its checksum is right. The odometry was reset.
    Content,
}

impl fmt::Display for SnapshotError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BufferFull => write!(f, "the buffer is too small for the snapshot"),
            Self::NotASnapshot => write!(f, "no whole snapshot"),
            Self::Version { found } => {
                write!(f, "snapshot in version {found}, this program restores version {VERSION}")
            }
            Self::OtherProfile => write!(f, "snapshot of another memory profile"),
            Self::Checksum => write!(f, "the snapshot does not match its checksum"),
            Self::Content => write!(f, "the snapshot holds what cannot be"),
        }
    }
}

impl core::error::Error for SnapshotError {}

/// Writes one value behind the other.
pub(crate) struct Writer<'a> {
    buffer: &'a mut [u8],
    used: usize,
}

impl<'a> Writer<'a> {
    /// Leaves room for the header.
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, used: HEADER_BYTES }
    }

    pub fn put(&mut self, value: &impl Serialize) -> Result<(), SnapshotError> {
        let rest = self.buffer.get_mut(self.used..).ok_or(SnapshotError::BufferFull)?;
        self.used += postcard::to_slice(value, rest).map_err(|_| SnapshotError::BufferFull)?.len();
        Ok(())
    }

    pub fn put_all<T: Serialize>(&mut self, values: &[T]) -> Result<(), SnapshotError> {
        self.put(&(values.len() as u32))?;
        values.iter().try_for_each(|value| self.put(value))
    }

    /// Header and checksum; gives the bytes in all.
    pub fn finish(self, profile: [u32; 7]) -> Result<usize, SnapshotError> {
        let content_bytes = (self.used - HEADER_BYTES) as u32;
        let numbers = profile.into_iter().chain([content_bytes]).flat_map(u32::to_le_bytes);
        let header = MAGIC.into_iter().chain(VERSION.to_le_bytes()).chain(numbers);
        self.buffer.iter_mut().zip(header).for_each(|(to, from)| *to = from);
        let checksum = crc32fast::hash(self.buffer.get(..self.used).unwrap_or_default());
        let rest = self.buffer.get_mut(self.used..).unwrap_or_default();
        let place = rest.first_chunk_mut::<CHECKSUM_BYTES>().ok_or(SnapshotError::BufferFull)?;
        *place = checksum.to_le_bytes();
        Ok(self.used + CHECKSUM_BYTES)
    }
}

/// Reads what a [`Writer`] wrote.
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Checks everything that can be checked before anything is restored.
    pub fn new(bytes: &'a [u8], profile: [u32; 7]) -> Result<Self, SnapshotError> {
        let (header, rest) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or(SnapshotError::NotASnapshot)?;
        let (magic, header_rest) = header.split_first_chunk().ok_or(SnapshotError::NotASnapshot)?;
        let (version, numbers) = header_rest.split_first_chunk().ok_or(SnapshotError::NotASnapshot)?;
        if *magic != MAGIC {
            return Err(SnapshotError::NotASnapshot);
        }
        let mut numbers = numbers.as_chunks().0.iter().map(|n| u32::from_le_bytes(*n));
        // All of them are read, also behind one that differs.
        let same_profile = profile.into_iter().fold(true, |same, p| (numbers.next() == Some(p)) & same);
        let content_bytes = numbers.next().unwrap_or(0) as usize;
        let (content, checksum) = rest.split_at_checked(content_bytes).ok_or(SnapshotError::NotASnapshot)?;
        let checksum = checksum.first_chunk().ok_or(SnapshotError::NotASnapshot)?;
        let covered = bytes.get(..HEADER_BYTES + content_bytes).unwrap_or_default();
        if crc32fast::hash(covered) != u32::from_le_bytes(*checksum) {
            return Err(SnapshotError::Checksum);
        }
        let found = u16::from_le_bytes(*version);
        if found != VERSION {
            return Err(SnapshotError::Version { found });
        }
        if !same_profile {
            return Err(SnapshotError::OtherProfile);
        }
        Ok(Self { rest: content })
    }

    pub fn take<T: DeserializeOwned>(&mut self) -> Result<T, SnapshotError> {
        let (value, rest) = postcard::take_from_bytes(self.rest).map_err(|_| SnapshotError::Content)?;
        self.rest = rest;
        Ok(value)
    }

    /// Appends what [`Writer::put_all`] wrote, one value at a time: nothing large passes through the stack.
    pub fn take_all<T: DeserializeOwned>(
        &mut self,
        values: &mut heapless::VecView<T>,
    ) -> Result<(), SnapshotError> {
        let count: u32 = self.take()?;
        for _ in 0..count {
            values.push(self.take()?).map_err(|_| SnapshotError::Content)?;
        }
        Ok(())
    }

    /// Nothing is left.
    pub fn finish(self) -> Result<(), SnapshotError> {
        if self.rest.is_empty() { Ok(()) } else { Err(SnapshotError::Content) }
    }
}
