//! More than fits.

use sdslam_core::estimate::BufferUse;
use sdslam_core::{Config, FrameEstimate, LabelledPoint, LabelledScan, Odometry, SemanticClass};
use sdslam_tests::drive::poses;
use sdslam_tests::odometry::{TinyOdometry, on_heap};

use crate::{accurate, assert_close, drive, is_valid, with_replaced};

#[test]
fn full_buffers_are_named_and_the_next_scan_is_processed() {
    for config in [Config::accurate(), Config::paper()] {
        let mut tiny: Box<TinyOdometry> = on_heap(config);
        let mut worst = BufferUse::default();
        for frame in &drive().frames {
            let mut points = frame.points.clone();
            let scan = &mut LabelledScan { stamp_s: frame.stamp_s, points: &mut points };
            let estimate = tiny.process_scan(scan).expect("the stamp is in order");
            assert!(is_valid(&estimate), "{estimate:?}");
            let b = estimate.evidence.buffers;
            assert!(b.cells <= 2048 && b.landmarks <= 12 && b.tracks <= 2 && b.submap_landmarks <= 4);
            assert!(b.voxels <= 32);
            assert_eq!(b.cells_refused, estimate.evidence.points.over_capacity);
            worst.cells_refused += b.cells_refused;
            worst.landmarks_refused += b.landmarks_refused;
            worst.tracks_refused += b.tracks_refused;
            worst.voxels_evicted = worst.voxels_evicted.max(b.voxels_evicted);
            worst.submap_landmarks_evicted = worst.submap_landmarks_evicted.max(b.submap_landmarks_evicted);
            assert_eq!(b.landmarks as usize, tiny.landmarks().len());
            assert!(points.iter().all(|p| p.landmark == LabelledPoint::NO_LANDMARK || p.landmark < 12));
        }
        assert!(
            worst.cells_refused > 0 && worst.landmarks_refused > 0 && worst.tracks_refused > 0,
            "{worst:?}"
        );
        let (dense, hulls) = (worst.voxels_evicted > 0, worst.submap_landmarks_evicted > 0);
        assert_eq!((dense, hulls), (config.precise_pose.dense.enabled, config.precise_pose.horizontal));
    }
}

#[test]
fn a_profile_that_is_a_little_too_small_still_follows_the_drive() {
    // Cells, tracks and landmarks run over; what is kept is enough.
    let mut small: Box<Odometry<4096, 64, 32, 4, 2048, 32>> = on_heap(Config::accurate());
    let estimates: Vec<FrameEstimate> = drive()
        .frames
        .iter()
        .map(|frame| {
            let mut points = frame.points.clone();
            small
                .process_scan(&mut LabelledScan { stamp_s: frame.stamp_s, points: &mut points })
                .expect("in order")
        })
        .collect();
    let refused = |f: fn(&FrameEstimate) -> u32| estimates.iter().map(f).max();
    assert!(refused(|e| e.evidence.buffers.cells_refused) > Some(0));
    assert!(refused(|e| e.evidence.buffers.tracks_refused) > Some(0));
    assert!(refused(|e| e.evidence.buffers.landmarks_refused) > Some(0));
    assert_close(&poses(&estimates), &drive().truth(), 0.1, 0.1);
}

#[test]
fn one_over_full_scan_leaves_no_trace() {
    // Every point in a cell of its own: more cells than the full profile has.
    let crowd: Vec<LabelledPoint> = (0..60_000u32)
        .map(|i| {
            let at = [i % 200, i / 200 % 200, i / 40_000].map(|k| k as f32);
            LabelledPoint::new(
                [0.5 * at[0] - 50.0, 0.5 * at[1] - 50.0, at[2] - 1.0],
                SemanticClass::Vegetation,
            )
        })
        .collect();
    let estimates = with_replaced(15..16, &crowd).run(&mut accurate());
    let over = estimates[15].evidence;
    assert_eq!(over.buffers.cells, 32_768);
    assert!(over.points.over_capacity > 0 && over.buffers.cells_refused == over.points.over_capacity);
    assert!(estimates[16..].iter().all(|e| e.evidence.points.over_capacity == 0));
    assert_close(&poses(&estimates[17..]), &drive().truth()[17..], 0.1, 0.1);
}
