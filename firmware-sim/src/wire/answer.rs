//! Answers: what the vehicle publishes.

use sdslam_core::{FrameEstimate, LabelledPoint, TrackReport};
use serde::de::DeserializeOwned;

use super::{CHECKSUM_BYTES, HEADER_BYTES, Header, Kind, WireError};

/// The answer to one scan.
pub struct Answer<'a> {
    /// Number of the scan, counted by its sender.
    pub sequence: u32,
    /// Pose and evidence; its stamp is that of the sensor's clock.
    pub estimate: FrameEstimate,
    /// Living tracks.
    pub tracks: &'a mut dyn Iterator<Item = TrackReport>,
    /// The scan's points with their landmarks. They do not go over the wire, a checksum of their landmarks does.
    pub points: &'a [LabelledPoint],
}

/// An answer as it came over the wire.
#[derive(Clone, Copy, Debug)]
pub struct AnswerRecord<'a> {
    /// Number of the scan.
    pub sequence: u32,
    /// Pose and evidence.
    pub estimate: FrameEstimate,
    /// CRC-32C of the landmark of every point.
    pub landmarks_checksum: u32,
    tracks: &'a [u8],
}

/// Writes an answer to the beginning of `buffer`; gives its bytes. A few hundred bytes and about 70 for each track.
///
/// # Errors
/// [`WireError::BufferFull`].
pub fn write_answer(answer: Answer<'_>, buffer: &mut [u8]) -> Result<usize, WireError> {
    let landmarks_checksum = landmarks_checksum(answer.points);
    let content = buffer.get_mut(HEADER_BYTES..).ok_or(WireError::BufferFull)?;
    let room = content.len();
    let mut rest = put(content, &answer.estimate)?;
    rest = put(rest, &landmarks_checksum)?;
    for track in answer.tracks {
        rest = put(rest, &track)?;
    }
    let content_bytes = room - rest.len();
    let checksum = crc32fast::hash(content.get(..content_bytes).unwrap_or_default());
    copy(&checksum.to_le_bytes(), content.get_mut(content_bytes..).unwrap_or_default())?;
    let header =
        Header { kind: Kind::Answer, sequence: answer.sequence, content_bytes: content_bytes as u32 };
    copy(&header.to_bytes(), buffer)?;
    Ok(HEADER_BYTES + content_bytes + CHECKSUM_BYTES)
}

fn put<'a>(buffer: &'a mut [u8], value: &impl serde::Serialize) -> Result<&'a mut [u8], WireError> {
    let used = postcard::to_slice(value, buffer).map_err(|_| WireError::BufferFull)?.len();
    buffer.get_mut(used..).ok_or(WireError::BufferFull)
}

fn copy(from: &[u8], to: &mut [u8]) -> Result<(), WireError> {
    if to.len() < from.len() {
        return Err(WireError::BufferFull);
    }
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
    Ok(())
}

fn landmarks_checksum(points: &[LabelledPoint]) -> u32 {
    let mut checksum = crc32fast::Hasher::new();
    // Many at once: a call of two bytes costs more than their checksum.
    let mut bytes = [[0; 2]; 64];
    for points in points.chunks(bytes.len()) {
        for (to, point) in bytes.iter_mut().zip(points) {
            *to = point.landmark.to_le_bytes();
        }
        checksum.update(bytes.get(..points.len()).unwrap_or_default().as_flattened());
    }
    checksum.finalize()
}

/// The answer at the beginning of `bytes`, and what lies behind it. `None` at the end.
///
/// # Errors
/// Bytes that are no whole answer.
pub fn read_answer(bytes: &[u8]) -> Result<Option<(AnswerRecord<'_>, &[u8])>, WireError> {
    if bytes.is_empty() {
        return Ok(None);
    }
    let (head, rest) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or(WireError::Length { found: 0 })?;
    let header = Header::from_bytes(head)?.filter(|h| h.kind == Kind::Answer);
    let Some(Header { sequence, content_bytes, .. }) = header else {
        return Err(WireError::Content { sequence: 0 });
    };
    let short = WireError::Length { found: content_bytes };
    let (content, rest) = rest.split_at_checked(content_bytes as usize).ok_or(short)?;
    let (checksum, rest) = rest.split_first_chunk::<CHECKSUM_BYTES>().ok_or(short)?;
    if u32::from_le_bytes(*checksum) != crc32fast::hash(content) {
        return Err(WireError::Checksum { sequence });
    }
    let (estimate, content) = take(content, sequence)?;
    let (landmarks_checksum, tracks) = take(content, sequence)?;
    Ok(Some((AnswerRecord { sequence, estimate, landmarks_checksum, tracks }, rest)))
}

fn take<T: DeserializeOwned>(bytes: &[u8], sequence: u32) -> Result<(T, &[u8]), WireError> {
    postcard::take_from_bytes(bytes).map_err(|_| WireError::Content { sequence })
}

impl AnswerRecord<'_> {
    /// Living tracks.
    pub fn tracks(&self) -> impl Iterator<Item = Result<TrackReport, WireError>> {
        let (mut rest, sequence) = (self.tracks, self.sequence);
        core::iter::from_fn(move || {
            if rest.is_empty() {
                return None;
            }
            let taken = take(rest, sequence);
            rest = taken.as_ref().map_or(&[], |(_, after)| *after);
            Some(taken.map(|(track, _)| track))
        })
    }
}
