//! Scans that are not what they should be.

use sdslam_core::estimate::Fallback;
use sdslam_core::{Config, FrameEstimate, FrameStatus, LabelledPoint, SemanticClass};
use sdslam_tests::drive::{Drive, largest_difference, poses};
use sdslam_tests::odometry::{full_scan, process};
use sdslam_tests::world::unit;

use crate::{accurate, assert_close, drive, is_valid, with_replaced};

#[test]
fn an_empty_scan_is_predicted_and_the_next_one_registered() {
    let estimates = with_replaced(15..16, &[]).run(&mut accurate());
    for (k, estimate) in estimates.iter().enumerate() {
        let expected = match k {
            0 => FrameStatus::First,
            15 => FrameStatus::Predicted(Fallback::EmptyScan),
            _ => FrameStatus::Registered,
        };
        assert_eq!(estimate.status, expected, "frame {k}");
        assert!(is_valid(estimate));
    }
    let off = (0.1, 0.3);
    assert_close(&poses(&estimates), &drive().truth(), off.0, off.1);
    assert!(estimates[15].covariance[0][0] > 100.0 * estimates[14].covariance[0][0]);
}

#[test]
fn a_gap_of_empty_scans_is_predicted_and_the_drive_goes_on() {
    let estimates = with_replaced(12..20, &[]).run(&mut accurate());
    let registered = |e: &FrameEstimate| e.status == FrameStatus::Registered;
    assert!(!estimates[12..20].iter().any(registered));
    assert!(estimates[21..].iter().all(registered), "{:?}", estimates[21].status);
    assert_close(&poses(&estimates[22..]), &drive().truth()[22..], 0.05, 0.06);
}

#[test]
fn a_drive_may_begin_with_empty_scans() {
    let estimates = with_replaced(0..3, &[]).run(&mut accurate());
    assert_eq!(estimates[0].status, FrameStatus::First);
    let tail = &estimates[8..];
    assert!(tail.iter().all(|e| e.status == FrameStatus::Registered), "{:?}", tail[0].status);
}

/// A drive in which the scans of some frames show only one class: largest error \[m, deg\] while it lasts, and after.
fn errors_of_scans_of_one_class(config: Config, class: SemanticClass) -> [(f64, f64); 2] {
    let mut drive = Drive { frames: drive().frames[..20].to_vec() };
    drive.frames[8..14].iter_mut().for_each(|f| f.points.retain(|p| p.class == class));
    let estimates = drive.run(&mut full_scan(config));
    assert!(estimates.iter().all(is_valid), "{class:?}");
    let (found, truth) = (poses(&estimates), drive.truth());
    [8..14, 15..20].map(|frames| largest_difference(&found[frames.clone()], &truth[frames]))
}

#[test]
fn scans_of_one_class_are_survived() {
    use SemanticClass::{Bicyclist, Building, Car, Pole, Trunk, Vegetation};
    for class in [Building, Vegetation, Trunk, Pole, Car, Bicyclist] {
        let [during, after] = errors_of_scans_of_one_class(Config::accurate(), class);
        assert!(during.0 < 1.0 && during.1 < 3.0, "{class:?}: {during:?} off");
        assert!(after.0 < 0.03 && after.1 < 0.05, "{class:?}: {after:?} off afterwards");
        let [during, after] = errors_of_scans_of_one_class(Config::paper(), class);
        assert!(during.0 < 1.0 && during.1 < 4.0, "paper, {class:?}: {during:?} off");
        assert!(after.0 < 0.4 && after.1 < 0.8, "paper, {class:?}: {after:?} off afterwards");
    }
}

#[test]
fn ground_alone_does_not_mislead_the_paper_preset() {
    let [during, after] = errors_of_scans_of_one_class(Config::paper(), SemanticClass::Road);
    assert!(during.0 < 0.2 && during.1 < 1.0 && after.0 < 0.2, "{during:?}, {after:?} off");
}

#[test]
fn ground_alone_does_not_mislead_the_dense_registration() {
    for class in [SemanticClass::Road, SemanticClass::Sidewalk, SemanticClass::Terrain] {
        let [during, after] = errors_of_scans_of_one_class(Config::accurate(), class);
        assert!(during.0 < 0.3 && after.0 < 0.05 && after.1 < 0.1, "{class:?}: {during:?}, {after:?} off");
    }
}

#[test]
fn the_covariance_of_ground_alone_tells_that_it_is_loose() {
    let mut drive = Drive { frames: drive().frames[..10].to_vec() };
    drive.frames[9].points.retain(|p| p.class == SemanticClass::Road);
    let estimates = drive.run(&mut accurate());
    let deviation_m = |e: &FrameEstimate| e.covariance[0][0].max(e.covariance[1][1]).sqrt();
    let (before, alone) = (deviation_m(&estimates[8]), deviation_m(&estimates[9]));
    assert!(before < 0.05 && alone > 0.2, "{before} m, then {alone} m");
}

#[test]
fn a_drive_of_one_class_relabelled_is_survived() {
    for class in [SemanticClass::Road, SemanticClass::Building, SemanticClass::Car, SemanticClass::Unlabelled]
    {
        let mut drive = drive().clone();
        drive.frames.iter_mut().flat_map(|f| &mut f.points).for_each(|p| p.class = class);
        let estimates = drive.run(&mut accurate());
        assert!(estimates.iter().all(is_valid), "{class:?}");
        if class == SemanticClass::Unlabelled {
            let empty = FrameStatus::Predicted(Fallback::EmptyScan);
            assert!(estimates[1..].iter().all(|e| e.status == empty));
        }
    }
}

#[test]
fn broken_points_are_counted_and_change_nothing() {
    let broken = [
        [f32::NAN, 1.0, 1.0],
        [1.0, f32::INFINITY, 1.0],
        [1.0, 1.0, f32::NEG_INFINITY],
        [f32::NAN; 3],
        [0.0; 3],
        [-0.0; 3],
        [0.1, 0.0, 0.0],
        [150.0, 0.0, 0.0],
    ];
    let mut damaged = drive().clone();
    for frame in &mut damaged.frames {
        for (k, position) in broken.into_iter().enumerate() {
            let class = [SemanticClass::Car, SemanticClass::Road, SemanticClass::Building][k % 3];
            frame.points.push(LabelledPoint::new(position, class));
        }
        frame.points.push(LabelledPoint::new([10.0, 0.0, 0.0], SemanticClass::Unlabelled));
        frame.points.push(LabelledPoint::new([10.0, 0.0, 0.0], SemanticClass::Outlier));
    }
    let (with, without) = (damaged.run(&mut accurate()), drive().run(&mut accurate()));
    for (with, without) in with.iter().zip(&without) {
        let (a, b) = (with.evidence.points, without.evidence.points);
        assert_eq!((a.not_finite, a.unlabelled), (b.not_finite + 4, b.unlabelled + 2));
        assert_eq!(a.out_of_range, b.out_of_range + 4);
        assert_eq!((a.ground, a.pure_static, a.unknown_motion), (b.ground, b.pure_static, b.unknown_motion));
    }
    assert_close(&poses(&with), &poses(&without), 0.005, 0.005);
}

#[test]
fn a_finite_point_beyond_the_range_is_not_called_infinite() {
    let far = LabelledPoint::new([1e20, 0.0, 0.0], SemanticClass::Building);
    let counts = process(&mut accurate(), 0.0, &[far]).evidence.points;
    assert_eq!((counts.out_of_range, counts.not_finite), (1, 0));
}

#[test]
fn a_scan_of_rubbish_is_not_registered() {
    let rubbish: Vec<LabelledPoint> = (0..20_000u64)
        .map(|i| {
            let at = [0, 1, 2].map(|k| (60.0 * unit(3, i, k) - 30.0) as f32);
            LabelledPoint::new(
                [at[0], at[1], 0.2 * at[2]],
                SemanticClass::ALL[i as usize % SemanticClass::COUNT],
            )
        })
        .collect();
    let estimates = with_replaced(15..16, &rubbish).run(&mut accurate());
    assert!(estimates.iter().all(is_valid));
    let (off_m, off_deg) = largest_difference(&poses(&estimates[17..]), &drive().truth()[17..]);
    assert!(off_m < 0.1 && off_deg < 0.2, "{off_m} m, {off_deg} deg off");
}
