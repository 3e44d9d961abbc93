//! The header of a message.

use super::WireError;

/// Begins every message.
pub const SYNC: [u8; 4] = [0xD5, b'S', b'D', 0x2A];
/// Version of the format.
pub const VERSION: u8 = 3;
/// Bytes of a header.
pub const HEADER_BYTES: usize = 20;

/// What a message holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A labelled scan.
    Scan = 1,
    /// The answer to one.
    Answer = 2,
}

/// The header of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// What the content is.
    pub kind: Kind,
    /// Counts the messages of a sender.
    pub sequence: u32,
    /// Bytes of the content.
    pub content_bytes: u32,
}

impl Header {
    /// As it goes over the wire.
    pub fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let [s0, s1, s2, s3] = self.sequence.to_le_bytes();
        let [l0, l1, l2, l3] = self.content_bytes.to_le_bytes();
        let [y0, y1, y2, y3] = SYNC;
        let head = [y0, y1, y2, y3, VERSION, self.kind as u8, 0, 0, s0, s1, s2, s3, l0, l1, l2, l3];
        let mut bytes = [0; HEADER_BYTES];
        for (to, from) in bytes.iter_mut().zip(head.into_iter().chain(crc32fast::hash(&head).to_le_bytes())) {
            *to = from;
        }
        bytes
    }

    /// `Ok(None)` where no header begins.
    ///
    /// # Errors
    /// A header that is whole but of another version.
    pub fn from_bytes(bytes: &[u8; HEADER_BYTES]) -> Result<Option<Self>, WireError> {
        let [y0, y1, y2, y3, version, kind, _, _, s0, s1, s2, s3, l0, l1, l2, l3, c0, c1, c2, c3] = *bytes;
        let (head, _) = bytes.split_first_chunk::<16>().unwrap_or((&[0; 16], &[]));
        if [y0, y1, y2, y3] != SYNC || crc32fast::hash(head) != u32::from_le_bytes([c0, c1, c2, c3]) {
            return Ok(None);
        }
        if version != VERSION {
            return Err(WireError::Version { found: version });
        }
        let kind = match kind {
            1 => Kind::Scan,
            2 => Kind::Answer,
            _ => return Ok(None),
        };
        let sequence = u32::from_le_bytes([s0, s1, s2, s3]);
        Ok(Some(Self { kind, sequence, content_bytes: u32::from_le_bytes([l0, l1, l2, l3]) }))
    }
}
