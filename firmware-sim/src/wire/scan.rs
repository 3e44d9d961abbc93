//! Scans: written by a host or a sensor, read in the vehicle as the bytes come in.

use crc32fast::Hasher;
use sdslam_core::{LabelledPoint, SemanticClass};

use super::{CHECKSUM_BYTES, HEADER_BYTES, Header, Kind, SYNC, WireError};
use crate::board::ScanHeader;

/// Bytes of a point.
pub const POINT_BYTES: usize = 14;
/// Bytes of the stamp and of the number of points.
const PREFIX_BYTES: usize = 12;
/// Most points of a scan: a header that asks for more is not believed.
const MAX_POINTS: usize = 1 << 20;

/// Points of a block, behind which there is a checksum.
pub const BLOCK_POINTS: usize = 1024;

/// Bytes of the message of a scan.
pub const fn scan_bytes(points: usize) -> usize {
    HEADER_BYTES + content_bytes(points) + CHECKSUM_BYTES
}

/// The checksum of the last block is that behind the content.
const fn content_bytes(points: usize) -> usize {
    let checksums = points.saturating_sub(1) / BLOCK_POINTS;
    PREFIX_BYTES + points * POINT_BYTES + checksums * CHECKSUM_BYTES
}

/// Writes a scan piece by piece to `sink`.
///
/// # Errors
/// Those of the sink.
pub fn write_scan<E>(
    sequence: u32,
    stamp_s: f64,
    points: &[LabelledPoint],
    mut sink: impl FnMut(&[u8]) -> Result<(), E>,
) -> Result<(), E> {
    let content_bytes = content_bytes(points.len()) as u32;
    sink(&Header { kind: Kind::Scan, sequence, content_bytes }.to_bytes())?;
    let mut checksum = Hasher::new();
    for bytes in [&stamp_s.to_le_bytes()[..], &(points.len() as u32).to_le_bytes()] {
        checksum.update(bytes);
        sink(bytes)?;
    }
    // A scan without points is one block without points.
    for block in points.chunks(BLOCK_POINTS).chain(points.is_empty().then_some(points)) {
        for point in block {
            let bytes = point_to_bytes(point);
            checksum.update(&bytes);
            sink(&bytes)?;
        }
        sink(&checksum.clone().finalize().to_le_bytes())?;
    }
    Ok(())
}

fn point_to_bytes(point: &LabelledPoint) -> [u8; POINT_BYTES] {
    let [[a, b, c, d], [e, f, g, h], [i, j, k, l]] = point.position.map(f32::to_le_bytes);
    [a, b, c, d, e, f, g, h, i, j, k, l, point.class as u8, point.confidence]
}

/// A class that is not known counts as unlabelled.
fn point_from_bytes(bytes: &[u8; POINT_BYTES]) -> LabelledPoint {
    let [a, b, c, d, e, f, g, h, i, j, k, l, class, confidence] = *bytes;
    let position = [[a, b, c, d], [e, f, g, h], [i, j, k, l]].map(f32::from_le_bytes);
    let class = SemanticClass::ALL.get(usize::from(class)).copied().unwrap_or(SemanticClass::Unlabelled);
    LabelledPoint { confidence, ..LabelledPoint::new(position, class) }
}

/// What the reader has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Received {
    /// A whole scan; its points lie at the beginning of the buffer.
    Scan(ScanHeader),
    /// A message that is left out.
    Damaged(WireError),
}

enum State {
    Header,
    Prefix,
    Points,
    Checksum,
    /// The content of a message that is not for this reader: bytes left.
    Skip(usize),
}

/// Reads scans as their bytes come in, in pieces of any size. Holds no message: points go straight to the caller's
/// buffer, so a scan costs no memory twice.
pub struct ScanReader {
    state: State,
    part: [u8; HEADER_BYTES],
    have: usize,
    header: ScanHeader,
    content_bytes: usize,
    next_point: usize,
    /// The point behind the last one of the block at hand.
    block_end: usize,
    checksum: Hasher,
    skipped: u32,
}

impl ScanReader {
    /// Waits for a message.
    pub fn new() -> Self {
        Self {
            state: State::Header,
            part: [0; HEADER_BYTES],
            have: 0,
            header: ScanHeader { sequence: 0, stamp_s: 0.0, points: 0 },
            content_bytes: 0,
            next_point: 0,
            block_end: 0,
            checksum: Hasher::new(),
            skipped: 0,
        }
    }

    /// Bytes so far that belong to no message.
    pub fn skipped(&self) -> u32 {
        self.skipped
    }

    /// Takes bytes until something is found or they are used up; gives how many it took. `points` must be the same buffer
    /// until a scan is whole; points beyond its end are counted and left out.
    pub fn read(&mut self, bytes: &[u8], points: &mut [LabelledPoint]) -> (usize, Option<Received>) {
        let mut rest = bytes;
        let mut found = None;
        while found.is_none() && !rest.is_empty() {
            found = match self.state {
                State::Header => self.read_header(&mut rest),
                State::Prefix => self.read_prefix(&mut rest),
                State::Points => self.read_points(&mut rest, points),
                State::Checksum => self.read_checksum(&mut rest),
                State::Skip(left) => self.skip(&mut rest, left),
            };
        }
        (bytes.len() - rest.len(), found)
    }

    /// Collects `N` bytes; `None` until they are there.
    fn collect<const N: usize>(&mut self, rest: &mut &[u8]) -> Option<[u8; N]> {
        for to in self.part.iter_mut().take(N).skip(self.have) {
            let Some((byte, after)) = rest.split_first() else { break };
            *to = *byte;
            self.have += 1;
            *rest = after;
        }
        if self.have < N {
            return None;
        }
        self.have = 0;
        self.part.first_chunk().copied()
    }

    fn read_header(&mut self, rest: &mut &[u8]) -> Option<Received> {
        if self.have == 0 {
            let garbage = garbage(rest);
            *rest = rest.get(garbage..).unwrap_or_default();
            self.skipped = self.skipped.saturating_add(garbage as u32);
        }
        let head = self.collect::<HEADER_BYTES>(rest)?;
        let error = match Header::from_bytes(&head) {
            Ok(Some(header)) => match self.begin(&header) {
                Ok(()) => return None,
                Err(error) => Some(error),
            },
            Ok(None) => None,
            Err(error) => Some(error),
        };
        // No message begins here: the next may begin behind the first byte.
        let (_, behind) = head.split_first().unwrap_or((&0, &[]));
        let behind = behind.get(garbage(behind)..).unwrap_or_default();
        for (to, from) in self.part.iter_mut().zip(behind) {
            *to = *from;
        }
        self.have = behind.len();
        self.skipped = self.skipped.saturating_add((HEADER_BYTES - behind.len()) as u32);
        error.map(Received::Damaged)
    }

    fn begin(&mut self, header: &Header) -> Result<(), WireError> {
        let bytes = header.content_bytes as usize;
        if bytes > content_bytes(MAX_POINTS) || (header.kind == Kind::Scan && bytes < PREFIX_BYTES) {
            return Err(WireError::Length { found: header.content_bytes });
        }
        if header.kind != Kind::Scan {
            self.state = State::Skip(bytes.saturating_add(CHECKSUM_BYTES));
            return Ok(());
        }
        self.header = ScanHeader { sequence: header.sequence, stamp_s: 0.0, points: 0 };
        self.content_bytes = bytes;
        self.next_point = 0;
        self.checksum = Hasher::new();
        self.state = State::Prefix;
        Ok(())
    }

    fn read_prefix(&mut self, rest: &mut &[u8]) -> Option<Received> {
        let prefix = self.collect::<PREFIX_BYTES>(rest)?;
        self.checksum.update(&prefix);
        let [a, b, c, d, e, f, g, h, n0, n1, n2, n3] = prefix;
        self.header.stamp_s = f64::from_le_bytes([a, b, c, d, e, f, g, h]);
        self.header.points = u32::from_le_bytes([n0, n1, n2, n3]) as usize;
        // The number is not vouched for yet, but the length of the content says the same.
        if self.header.points > MAX_POINTS || content_bytes(self.header.points) != self.content_bytes {
            return Some(self.damaged());
        }
        self.begin_block();
        None
    }

    fn begin_block(&mut self) {
        self.block_end = self.next_point.saturating_add(BLOCK_POINTS).min(self.header.points);
        self.state = if self.block_end > self.next_point { State::Points } else { State::Checksum };
    }

    fn read_points(&mut self, rest: &mut &[u8], points: &mut [LabelledPoint]) -> Option<Received> {
        // The rest of a point whose beginning came before.
        if self.have > 0 {
            let bytes = self.collect::<POINT_BYTES>(rest)?;
            self.take_points(&[bytes], points);
        }
        let wanted = self.block_end.saturating_sub(self.next_point);
        let (whole, _) = rest.as_chunks::<POINT_BYTES>();
        let whole = whole.get(..wanted).unwrap_or(whole);
        *rest = rest.get(whole.len() * POINT_BYTES..).unwrap_or_default();
        self.take_points(whole, points);
        if wanted == whole.len() {
            self.state = State::Checksum;
        } else {
            // The beginning of a point: its rest comes later.
            let whole: Option<[u8; POINT_BYTES]> = self.collect(rest);
            debug_assert!(whole.is_none());
        }
        None
    }

    fn take_points(&mut self, from: &[[u8; POINT_BYTES]], points: &mut [LabelledPoint]) {
        self.checksum.update(from.as_flattened());
        let to = points.get_mut(self.next_point..).unwrap_or_default();
        for (to, from) in to.iter_mut().zip(from) {
            *to = point_from_bytes(from);
        }
        self.next_point = self.next_point.saturating_add(from.len());
    }

    fn read_checksum(&mut self, rest: &mut &[u8]) -> Option<Received> {
        let found = u32::from_le_bytes(self.collect::<CHECKSUM_BYTES>(rest)?);
        if found != self.checksum.clone().finalize() {
            return Some(self.damaged());
        }
        if self.next_point < self.header.points {
            self.begin_block();
            return None;
        }
        self.state = State::Header;
        Some(Received::Scan(self.header))
    }

    fn damaged(&mut self) -> Received {
        self.state = State::Header;
        Received::Damaged(WireError::Checksum { sequence: self.header.sequence })
    }

    fn skip(&mut self, rest: &mut &[u8], left: usize) -> Option<Received> {
        let now = left.min(rest.len());
        *rest = rest.get(now..).unwrap_or_default();
        self.state = if now < left { State::Skip(left - now) } else { State::Header };
        None
    }
}

/// Bytes before the first with which a message may begin.
fn garbage(bytes: &[u8]) -> usize {
    let [sync, ..] = SYNC;
    bytes.iter().position(|byte| *byte == sync).unwrap_or(bytes.len())
}

impl Default for ScanReader {
    fn default() -> Self {
        Self::new()
    }
}
