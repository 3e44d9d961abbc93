//! What goes over the wire: labelled scans in, answers out.
//!
//! One message, all numbers little-endian:
//!
//! | bytes | content |
//! | --- | --- |
//! | 4 | [`SYNC`] |
//! | 1 | [`VERSION`] |
//! | 1 | kind: 1 scan, 2 answer |
//! | 2 | zero |
//! | 4 | sequence number, counts messages of a sender |
//! | 4 | bytes of the content |
//! | 4 | CRC-32 of the 16 bytes before |
//! | n | content |
//! | 4 | CRC-32 of the content |
//!
//! A scan's content is its stamp \[s\] as f64, the number of points as u32, and [`POINT_BYTES`] for each point: x, y, z
//! \[m\] as f32, the class, its confidence. Between every two blocks of [`BLOCK_POINTS`] there is the checksum of stamp, number
//! and all points before it: a message without its end swallows a block's bytes of what comes next and no more, however
//! long it was to be. An answer's content is the estimate and the tracks, each in postcard's encoding. The header has a checksum of
//! its own, so that a damaged length does not swallow good messages; after garbage the reader goes on at the next header that
//! is whole.

mod answer;
mod header;
mod scan;

use core::fmt;

pub use answer::{Answer, AnswerRecord, read_answer, write_answer};
pub use header::{HEADER_BYTES, Header, Kind, SYNC, VERSION};
pub use scan::{BLOCK_POINTS, POINT_BYTES, Received, ScanReader, scan_bytes, write_scan};

/// Bytes of the checksum behind a content.
pub const CHECKSUM_BYTES: usize = 4;

/// What is wrong with a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WireError {
    /// The content does not match its checksum: it was damaged on the way, or part of it is missing.
    Checksum {
        /// Sequence number of the message.
        sequence: u32,
    },
    /// The sender writes another version of the format.
    Version {
        /// Its version.
        found: u8,
    },
    /// The length in the header does not go with the content.
    Length {
        /// Bytes of the content, by the header.
        found: u32,
    },
    /// A value that the receiver does not know, in a content whose checksum is right.
    Content {
        /// Sequence number of the message.
        sequence: u32,
    },
    /// The caller's buffer is too small for the message.
    BufferFull,
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Checksum { sequence } => write!(f, "message {sequence} does not match its checksum"),
            Self::Version { found } => {
                write!(f, "message in version {found} of the format, this program reads version {VERSION}")
            }
            Self::Length { found } => write!(f, "message of {found} bytes, which its content cannot have"),
            Self::Content { sequence } => write!(f, "message {sequence} holds a value that is not known"),
            Self::BufferFull => write!(f, "the buffer is too small for the message"),
        }
    }
}

impl core::error::Error for WireError {}
