//! A map kept for later drives: the static semantic map, and the places that a vehicle finds itself by.
//!
//! The file: 8 bytes `SDSLMAP` and a newline, version (u32), length of the content (u64) and its CRC-32 (u32), all
//! little-endian, then the content in postcard's encoding. A file that is cut short, damaged, of another version or of another
//! program is refused.

mod content;
mod error;

use std::path::Path;

use sdslam_core::MapPose;
use sdslam_core::loop_closure::Features;

use crate::semantic_map::StaticMap;
use content::Content;
pub use error::SavedMapError;

const MAGIC: &[u8; 8] = b"SDSLMAP\n";
/// Raised with every change of the content.
const VERSION: u32 = 1;
const HEADER: usize = 24;

/// Places nearer to a kept one than this, with the same heading, are not kept \[m\].
const PLACE_SPACING_M: f64 = 1.5;
/// Headings that differ by less are the same \[rad\].
const SAME_HEADING_RAD: f64 = 0.5;

/// A place that a vehicle can find itself by.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedPlace {
    /// Its pose in the map.
    pub map_from_place: MapPose,
    /// Its features.
    pub features: Features,
}

/// Map and places.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedMap {
    /// Static semantic map.
    pub map: StaticMap,
    /// Places, in the order of the drive.
    pub places: Vec<SavedPlace>,
}

impl SavedMap {
    /// A map with the places of a drive; of places that were visited again only the first is kept, so that the file
    /// grows with the area.
    pub fn new(map: StaticMap, visited: impl IntoIterator<Item = SavedPlace>) -> Self {
        let mut places: Vec<SavedPlace> = Vec::new();
        for mut place in visited {
            // Poses of the core have the precision of single floats.
            place.map_from_place.rotation.renormalize();
            let is_known = |known: &SavedPlace| {
                let off = known.map_from_place.inv_mul(&place.map_from_place);
                off.translation.vector.norm() < PLACE_SPACING_M && off.rotation.angle() < SAME_HEADING_RAD
            };
            if !places.iter().any(is_known) {
                places.push(place);
            }
        }
        Self { map, places }
    }

    /// The file's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let content = Content::of(self).encode();
        let mut bytes = Vec::with_capacity(HEADER + content.len());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((content.len() as u64).to_le_bytes());
        bytes.extend(crc32fast::hash(&content).to_le_bytes());
        bytes.extend(content);
        bytes
    }

    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read or is no intact map of this version; the message says which.
    pub fn load(file: &Path) -> Result<Self, SavedMapError> {
        let bytes =
            std::fs::read(file).map_err(|source| SavedMapError::Unreadable { file: file.into(), source })?;
        Self::parse(&bytes, file)
    }

    /// Like [`Self::load`] with the bytes at hand; `file` is for messages.
    pub fn parse(bytes: &[u8], file: &Path) -> Result<Self, SavedMapError> {
        let file = || file.to_path_buf();
        if !bytes.starts_with(MAGIC) {
            return Err(SavedMapError::Foreign { file: file() });
        }
        let Some((header, content)) = bytes.split_at_checked(HEADER) else {
            return Err(SavedMapError::Truncated {
                file: file(),
                expected: HEADER as u64,
                found: bytes.len() as u64,
            });
        };
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        let (version, checksum) = (word(8), word(20));
        let length = u64::from(word(12)) | u64::from(word(16)) << 32;
        if version != VERSION {
            return Err(SavedMapError::Version { file: file(), expected: VERSION, found: version });
        }
        if content.len() as u64 != length {
            let (expected, found) = (length.saturating_add(HEADER as u64), bytes.len() as u64);
            return Err(SavedMapError::Truncated { file: file(), expected, found });
        }
        if crc32fast::hash(content) != checksum {
            return Err(SavedMapError::Damaged { file: file(), fault: "its checksum is wrong" });
        }
        Content::decode(content)
            .and_then(Content::into_map)
            .map_err(|fault| SavedMapError::Damaged { file: file(), fault })
    }
}

#[cfg(test)]
mod tests;
