//! A power cycle: what is restored goes on with the bits of what never stopped; what is damaged is refused.

use sdslam_core::snapshot::{SnapshotError, VERSION};
use sdslam_core::{Config, FullScanOdometry};
use sdslam_tests::drive::Drive;
use sdslam_tests::odometry::{Answer, TinyOdometry, full_scan, on_heap, process_fully};

const FRAMES: usize = 20;

fn run(odometry: &mut FullScanOdometry, drive: &Drive, frames: std::ops::Range<usize>) -> Vec<Answer> {
    drive.frames[frames].iter().map(|f| process_fully(odometry, f.stamp_s, &f.points)).collect()
}

fn saved(odometry: &FullScanOdometry) -> Vec<u8> {
    let mut buffer = vec![0; size_of::<FullScanOdometry>()];
    let bytes = odometry.save(&mut buffer).expect("a buffer as large as the odometry suffices");
    buffer.truncate(bytes);
    buffer
}

/// The text of the numbers shows every bit.
fn assert_same_bits(a: &[Answer], b: &[Answer]) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
    }
}

#[test]
fn the_restored_goes_on_with_the_same_bits() {
    // 300 m: the anchor moves, and the submap forgets.
    let mut drive = Drive::down_the_street(FRAMES, 30.0);
    drive.frames[11].points.clear();
    for config in [Config::accurate(), Config::paper()] {
        // Right at the start, after the first scan, in the middle, after a scan that was not registered.
        for stop in [0, 1, 7, 12] {
            let mut odometry = full_scan(config);
            run(&mut odometry, &drive, 0..stop);
            let snapshot = saved(&odometry);
            let without = run(&mut odometry, &drive, stop..FRAMES);
            // Into memory that was used for something else, with another configuration.
            let mut other = full_scan(Config::paper());
            run(&mut other, &drive, 3..9);
            other.restore(&snapshot).expect("a good snapshot");
            assert_same_bits(&run(&mut other, &drive, stop..FRAMES), &without);
            assert_eq!(saved(&other), saved(&odometry), "the state at the end is the same");
        }
    }
}

#[test]
fn what_is_damaged_or_foreign_is_refused_and_changes_nothing() {
    let drive = Drive::down_the_street(FRAMES, 8.0);
    let mut odometry = full_scan(Config::accurate());
    run(&mut odometry, &drive, 0..6);
    let good = saved(&odometry);
    run(&mut odometry, &drive, 6..8);
    let before = saved(&odometry);
    let mut refused = |bytes: &[u8], error| {
        assert_eq!(odometry.restore(bytes), Err(error));
        assert!(saved(&odometry) == before, "the state is as before: {error}");
    };
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    refused(&[], SnapshotError::NotASnapshot);
    refused(&flipped(0), SnapshotError::NotASnapshot);
    refused(&flipped(4), SnapshotError::Checksum);
    refused(&flipped(good.len() / 2), SnapshotError::Checksum);
    refused(&flipped(good.len() - 1), SnapshotError::Checksum);
    refused(&good[..good.len() - 1], SnapshotError::NotASnapshot);
    refused(&with_checksum(flipped(4)), SnapshotError::Version { found: VERSION ^ 0x10 });
    refused(&with_checksum(flipped(6)), SnapshotError::OtherProfile);
    let mut small: Box<TinyOdometry> = on_heap(Config::accurate());
    assert_eq!(small.restore(&good), Err(SnapshotError::OtherProfile));
}

#[test]
fn a_buffer_that_is_too_small_is_refused() {
    let drive = Drive::down_the_street(3, 8.0);
    let mut odometry = full_scan(Config::accurate());
    run(&mut odometry, &drive, 0..3);
    let bytes = saved(&odometry).len();
    for short in [0, 10, 50, bytes / 2, bytes - 1] {
        assert_eq!(odometry.save(&mut vec![0; short]), Err(SnapshotError::BufferFull));
    }
    assert_eq!(odometry.save(&mut vec![0; bytes]), Ok(bytes));
}

/// The checksum mended, as somebody would who knows the format.
fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 4;
    let checksum = crc32fast::hash(&bytes[..end]);
    bytes[end..].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

#[test]
fn content_that_cannot_be_leaves_a_fresh_odometry() {
    let drive = Drive::down_the_street(4, 8.0);
    let mut odometry = full_scan(Config::accurate());
    let fresh = run(&mut odometry, &drive, 0..4);
    let good = saved(&odometry);
    for missing in [1, 1000, good.len() / 2] {
        let mut bytes = good[..good.len() - missing].to_vec();
        let content_bytes = (bytes.len() - 38 - 4) as u32;
        bytes[34..38].copy_from_slice(&content_bytes.to_le_bytes());
        assert_eq!(odometry.restore(&with_checksum(bytes)), Err(SnapshotError::Content));
        assert_same_bits(&run(&mut odometry, &drive, 0..4), &fresh);
    }
}
