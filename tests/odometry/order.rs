//! Reset, and stamps that go back.

use sdslam_core::{FullScanOdometry, LabelledScan, OdometryError};
use sdslam_tests::odometry::process_fully;

use crate::{accurate, drive};

#[test]
fn a_reset_odometry_gives_the_bits_of_a_new_one() {
    let mut used = accurate();
    drive().run(&mut used);
    used.reset();
    assert_eq!((used.landmarks().len(), used.tracks().count()), (0, 0));
    let mut new = accurate();
    for frame in &drive().frames[5..20] {
        let [of_used, of_new] =
            [&mut used, &mut new].map(|odometry| process_fully(odometry, frame.stamp_s, &frame.points));
        assert_eq!(of_used, of_new);
    }
}

/// Offers a scan that must be refused.
fn refused(odometry: &mut FullScanOdometry, stamp_s: f64) -> OdometryError {
    let mut points = drive().frames[20].points.clone();
    odometry
        .process_scan(&mut LabelledScan { stamp_s, points: &mut points })
        .expect_err("a stamp out of order")
}

#[test]
fn a_stamp_that_goes_back_is_refused_and_changes_nothing() {
    let (mut disturbed, mut calm) = (accurate(), accurate());
    for (k, frame) in drive().frames[..12].iter().enumerate() {
        if let Some(before) = k.checked_sub(1) {
            let previous_s = drive().frames[before].stamp_s;
            for current_s in [previous_s, previous_s - 0.01, -1e300] {
                let expected = OdometryError::TimeWentBack { previous_s, current_s };
                assert_eq!(refused(&mut disturbed, current_s), expected);
            }
        }
        for stamp_s in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(refused(&mut disturbed, stamp_s), OdometryError::StampNotFinite);
        }
        let [a, b] =
            [&mut disturbed, &mut calm].map(|odometry| process_fully(odometry, frame.stamp_s, &frame.points));
        assert_eq!(a, b, "frame {k}");
    }
}

#[test]
fn errors_name_what_is_wrong() {
    let back = OdometryError::TimeWentBack { previous_s: 2.5, current_s: 1.5 }.to_string();
    assert!(back.contains("1.5") && back.contains("2.5"), "{back}");
    assert!(OdometryError::StampNotFinite.to_string().contains("finite"));
}
