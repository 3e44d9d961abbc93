//! Scans: written by a host or a sensor, read in the vehicle as the bytes come in.

use crc::{Digest, Table};
use sdslam_core::{LabelledPoint, SemanticClass};

use super::{CHECKSUM, CHECKSUM_BYTES, HEADER_BYTES, Header, Kind, WireError};
use crate::board::ScanHeader;

/// Bytes of a point.
pub const POINT_BYTES: usize = 14;
/// Bytes of the stamp and of the number of points.
const PREFIX_BYTES: usize = 12;
/// Most points of a scan: a header that asks for more is not believed.
const MAX_POINTS: usize = 1 << 20;

/// Bytes of the message of a scan.
pub const fn scan_bytes(points: usize) -> usize {
    HEADER_BYTES + PREFIX_BYTES + points * POINT_BYTES + CHECKSUM_BYTES
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
    let content_bytes = (PREFIX_BYTES + points.len() * POINT_BYTES) as u32;
    sink(&Header { kind: Kind::Scan, sequence, content_bytes }.to_bytes())?;
    let mut checksum = CHECKSUM.digest();
    let mut put = |bytes: &[u8]| {
        checksum.update(bytes);
        sink(bytes)
    };
    put(&stamp_s.to_le_bytes())?;
    put(&(points.len() as u32).to_le_bytes())?;
    for point in points {
        put(&point_to_bytes(point))?;
    }
    sink(&checksum.finalize().to_le_bytes())
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
    next_point: usize,
    checksum: Digest<'static, u32, Table<1>>,
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
            next_point: 0,
            checksum: CHECKSUM.digest(),
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
        let head = self.collect::<HEADER_BYTES>(rest)?;
        let error = match Header::from_bytes(&head) {
            Ok(Some(header)) => match self.begin(&header) {
                Ok(()) => return None,
                Err(error) => Some(error),
            },
            Ok(None) => None,
            Err(error) => Some(error),
        };
        // No message begins here: the next may begin one byte later.
        for (to, from) in self.part.iter_mut().zip(head.iter().skip(1)) {
            *to = *from;
        }
        self.have = HEADER_BYTES - 1;
        self.skipped = self.skipped.saturating_add(1);
        error.map(Received::Damaged)
    }

    fn begin(&mut self, header: &Header) -> Result<(), WireError> {
        let bytes = header.content_bytes as usize;
        if header.kind != Kind::Scan {
            self.state = State::Skip(bytes.saturating_add(CHECKSUM_BYTES));
            return Ok(());
        }
        let points = bytes.checked_sub(PREFIX_BYTES).filter(|b| b.is_multiple_of(POINT_BYTES));
        let points = points.map(|b| b / POINT_BYTES).filter(|n| *n <= MAX_POINTS);
        let Some(points) = points else { return Err(WireError::Length { found: header.content_bytes }) };
        self.header = ScanHeader { sequence: header.sequence, stamp_s: 0.0, points };
        self.next_point = 0;
        self.checksum = CHECKSUM.digest();
        self.state = State::Prefix;
        Ok(())
    }

    fn read_prefix(&mut self, rest: &mut &[u8]) -> Option<Received> {
        let prefix = self.collect::<PREFIX_BYTES>(rest)?;
        self.checksum.update(&prefix);
        let [a, b, c, d, e, f, g, h, n0, n1, n2, n3] = prefix;
        self.header.stamp_s = f64::from_le_bytes([a, b, c, d, e, f, g, h]);
        // The number of points is there to be read by people and tools; the length of the content says the same.
        let agrees = u32::from_le_bytes([n0, n1, n2, n3]) as usize == self.header.points;
        if !agrees {
            self.state = State::Header;
            return Some(Received::Damaged(WireError::Checksum { sequence: self.header.sequence }));
        }
        self.state = if self.header.points > 0 { State::Points } else { State::Checksum };
        None
    }

    fn read_points(&mut self, rest: &mut &[u8], points: &mut [LabelledPoint]) -> Option<Received> {
        // The rest of a point whose beginning came before.
        if self.have > 0 {
            let bytes = self.collect::<POINT_BYTES>(rest)?;
            self.take_points(&[bytes], points);
        }
        let wanted = self.header.points.saturating_sub(self.next_point);
        let (whole, _) = rest.as_chunks::<POINT_BYTES>();
        let whole = whole.get(..wanted).unwrap_or(whole);
        *rest = rest.get(whole.len() * POINT_BYTES..).unwrap_or_default();
        self.take_points(whole, points);
        if self.next_point >= self.header.points {
            self.state = State::Checksum;
        } else if let Some(bytes) = self.collect::<POINT_BYTES>(rest) {
            self.take_points(&[bytes], points);
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
        self.state = State::Header;
        let expected = core::mem::replace(&mut self.checksum, CHECKSUM.digest()).finalize();
        Some(match found == expected {
            true => Received::Scan(self.header),
            false => Received::Damaged(WireError::Checksum { sequence: self.header.sequence }),
        })
    }

    fn skip(&mut self, rest: &mut &[u8], left: usize) -> Option<Received> {
        let now = left.min(rest.len());
        *rest = rest.get(now..).unwrap_or_default();
        self.state = if now < left { State::Skip(left - now) } else { State::Header };
        None
    }
}

impl Default for ScanReader {
    fn default() -> Self {
        Self::new()
    }
}
