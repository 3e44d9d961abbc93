//! The wire format: what is written is read, however it comes in pieces; what is damaged is left out and nothing else.

use std::convert::Infallible;

use proptest::prelude::*;
use sdslam_core::{LabelledPoint, SemanticClass};
use sdslam_firmware_sim::ScanHeader;
use sdslam_firmware_sim::wire::{
    BLOCK_POINTS, HEADER_BYTES, Received, ScanReader, WireError, read_answer, scan_bytes, write_scan,
};

/// Any bits, NaN included, and any class.
fn point() -> impl Strategy<Value = LabelledPoint> {
    (any::<[u32; 3]>(), 0..SemanticClass::COUNT, any::<u8>()).prop_map(|(bits, class, confidence)| {
        let position = bits.map(f32::from_bits);
        LabelledPoint { confidence, ..LabelledPoint::new(position, SemanticClass::ALL[class]) }
    })
}

/// Now and then of more than one block.
fn scan() -> impl Strategy<Value = (u32, f64, Vec<LabelledPoint>)> {
    let size = prop_oneof![9 => 0..40usize, 1 => BLOCK_POINTS - 1..2 * BLOCK_POINTS + 2];
    (any::<u32>(), any::<f64>(), size.prop_flat_map(|size| prop::collection::vec(point(), size)))
}

fn encoded(sequence: u32, stamp_s: f64, points: &[LabelledPoint]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let Ok(()) = write_scan(sequence, stamp_s, points, |piece| {
        bytes.extend_from_slice(piece);
        Ok::<_, Infallible>(())
    });
    assert_eq!(bytes.len(), scan_bytes(points.len()));
    bytes
}

fn bits(points: &[LabelledPoint]) -> Vec<([u32; 3], SemanticClass, u8)> {
    points.iter().map(|p| (p.position.map(f32::to_bits), p.class, p.confidence)).collect()
}

const BLANK: LabelledPoint = LabelledPoint::new([0.0; 3], SemanticClass::Unlabelled);

/// A whole scan, or what was wrong.
type Found = Result<(u32, u64, Vec<([u32; 3], SemanticClass, u8)>), WireError>;

/// Reads a stream in pieces of these lengths, again and again.
fn read(bytes: &[u8], pieces: &[usize]) -> Vec<Found> {
    let mut reader = ScanReader::new();
    let mut points = vec![BLANK; 3 * BLOCK_POINTS];
    let (mut found, mut rest) = (Vec::new(), bytes);
    for length in pieces.iter().cycle() {
        if rest.is_empty() {
            break;
        }
        let mut piece = &rest[..(*length).min(rest.len())];
        rest = &rest[piece.len()..];
        while !piece.is_empty() {
            let (used, received) = reader.read(piece, &mut points);
            assert!(used > 0, "the reader goes on");
            piece = &piece[used..];
            found.extend(received.map(|received| match received {
                Received::Scan(ScanHeader { sequence, stamp_s, points: count }) => {
                    Ok((sequence, stamp_s.to_bits(), bits(&points[..count])))
                }
                Received::Damaged(error) => Err(error),
            }));
        }
    }
    found
}

proptest! {
    #[test]
    fn scans_come_back_bit_for_bit_in_any_pieces(
        scans in prop::collection::vec(scan(), 1..5),
        pieces in prop::collection::vec(1usize..50, 1..5),
    ) {
        let bytes: Vec<u8> = scans.iter().flat_map(|(n, s, p)| encoded(*n, *s, p)).collect();
        let expected: Vec<Found> = scans.iter().map(|(n, s, p)| Ok((*n, s.to_bits(), bits(p)))).collect();
        prop_assert_eq!(read(&bytes, &pieces), expected);
    }

    #[test]
    fn good_scans_survive_garbage(
        before in prop::collection::vec(any::<u8>(), 0..200), scans in prop::collection::vec(scan(), 1..4),
        between in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let mut bytes = before;
        for (n, s, p) in &scans {
            bytes.extend(encoded(*n, *s, p));
            bytes.extend(&between);
        }
        let good: Vec<Found> = read(&bytes, &[37]).into_iter().filter(Result::is_ok).collect();
        let expected: Vec<Found> = scans.iter().map(|(n, s, p)| Ok((*n, s.to_bits(), bits(p)))).collect();
        prop_assert_eq!(good, expected);
    }

    #[test]
    fn a_flipped_bit_is_found_and_costs_one_scan(
        first in scan(), second in scan(), third in scan(), at in any::<prop::sample::Index>(), bit in 0u8..8,
    ) {
        let damaged = {
            let mut bytes = encoded(first.0, first.1, &first.2);
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
            bytes
        };
        let mut bytes = damaged;
        for (n, s, p) in [&second, &third] {
            bytes.extend(encoded(*n, *s, p));
        }
        let good: Vec<Found> = read(&bytes, &[4096]).into_iter().filter(Result::is_ok).collect();
        let expected: Vec<Found> =
            [second, third].iter().map(|(n, s, p)| Ok((*n, s.to_bits(), bits(p)))).collect();
        prop_assert_eq!(good, expected);
    }

    #[test]
    fn a_truncated_scan_costs_at_most_the_next_one(first in scan(), rest in prop::collection::vec(scan(), 12),
        at in any::<prop::sample::Index>(),
    ) {
        let mut bytes = encoded(first.0, first.1, &first.2);
        bytes.truncate(at.index(bytes.len()));
        let rest: Vec<_> = rest.into_iter().map(|(n, s, mut p)| {
            p.resize(BLOCK_POINTS, BLANK);
            (n, s, p)
        }).collect();
        for (n, s, p) in &rest {
            bytes.extend(encoded(*n, *s, p));
        }
        let good = read(&bytes, &[4096]).into_iter().filter(Result::is_ok).count();
        prop_assert!(good >= rest.len() - 1, "{} of {}", good, rest.len());
    }

    #[test]
    fn a_truncated_scan_of_many_blocks_costs_no_more(
        first in (2000..5000usize, any::<prop::sample::Index>()), rest in prop::collection::vec(1100..1500usize, 3),
        pieces in prop::collection::vec(1usize..3000, 1..5),
    ) {
        let block = |sequence: usize, size| encoded(sequence as u32, 0.5, &vec![BLANK; size]);
        let mut bytes = block(0, first.0);
        bytes.truncate(first.1.index(bytes.len()));
        for (index, size) in rest.iter().enumerate() {
            bytes.extend(block(index + 1, *size));
        }
        let good = read(&bytes, &pieces).into_iter().flatten().map(|(sequence, ..)| sequence);
        // The end of the first is missing, the beginning of the second was taken for it.
        prop_assert!(good.collect::<Vec<_>>().ends_with(&[2, 3]));
    }

    #[test]
    fn no_bytes_harm_the_readers(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read(&bytes, &[7]);
        let _ = read_answer(&bytes);
    }
}

#[test]
fn points_beyond_the_buffer_are_counted_and_left_out() {
    let points = vec![LabelledPoint::new([1.0, 2.0, 3.0], SemanticClass::Road); 10];
    let mut buffer = [BLANK; 4];
    let bytes = encoded(3, 0.5, &points);
    let (used, received) = ScanReader::new().read(&bytes, &mut buffer);
    assert_eq!(used, bytes.len());
    assert_eq!(received, Some(Received::Scan(ScanHeader { sequence: 3, stamp_s: 0.5, points: 10 })));
    assert_eq!(buffer.map(|p| p.class), [SemanticClass::Road; 4]);
}

#[test]
fn another_version_and_an_impossible_length_are_named() {
    let good = encoded(1, 0.0, &[BLANK]);
    let found = |bytes: &[u8]| read(bytes, &[4096]).into_iter().find_map(Result::err);
    let with_header = |change: &dyn Fn(&mut [u8; HEADER_BYTES])| {
        let mut bytes = good.clone();
        let header = bytes.first_chunk_mut().expect("a header");
        change(header);
        let checksum = crc32fast::hash(&header[..16]);
        header[16..].copy_from_slice(&checksum.to_le_bytes());
        bytes
    };
    assert_eq!(found(&with_header(&|_| ())), None);
    assert_eq!(found(&with_header(&|header| header[4] = 9)), Some(WireError::Version { found: 9 }));
    let long = with_header(&|header| header[12..16].copy_from_slice(&[0xFF; 4]));
    assert_eq!(found(&long), Some(WireError::Length { found: u32::MAX }));
}
