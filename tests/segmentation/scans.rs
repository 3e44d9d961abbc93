//! Whole scans through small networks.

use sdslam::segmentation::SegmentationError;
use sdslam_core::SemanticClass;

use crate::support::{scan, segmenter};

#[test]
fn every_point_gets_a_class_and_a_confidence_in_the_order_of_the_scan() {
    let segmenter = segmenter("salsanext");
    let scan = scan();
    let found = segmenter.segment(&scan).expect("classes");
    assert_eq!((found.classes.len(), found.confidences.len()), (scan.len(), scan.len()));
    let several: std::collections::BTreeSet<_> = found.classes.iter().collect();
    assert!(several.len() > 3, "{several:?}");
    // In another order each point keeps its class: there is one nearest point to each pixel.
    let mut backwards = scan.clone();
    backwards.reverse();
    let mut other = segmenter.segment(&backwards).expect("classes");
    other.classes.reverse();
    other.confidences.reverse();
    assert!(other.classes == found.classes && other.confidences == found.confidences);
}

#[test]
fn many_threads_share_a_network_and_get_the_same() {
    let segmenter = segmenter("darknet53");
    let scan = scan();
    let alone = segmenter.segment(&scan).expect("classes");
    std::thread::scope(|scope| {
        let threads: Vec<_> =
            (0..4).map(|_| scope.spawn(|| segmenter.segment(&scan).expect("classes"))).collect();
        for thread in threads {
            let found = thread.join().expect("no panic");
            assert!(found.classes == alone.classes && found.confidences == alone.confidences);
        }
    });
}

#[test]
fn points_without_a_direction_stay_unlabelled_and_change_nothing() {
    let segmenter = segmenter("squeezesegv2");
    let plain = segmenter.segment(&scan()).expect("classes");
    let mut scan = scan();
    let broken = [[0.0; 4], [f32::NAN, 1.0, 0.0, 0.5], [1.0, f32::INFINITY, 0.0, 0.5]];
    scan.splice(100..100, broken);
    let found = segmenter.segment(&scan).expect("classes");
    assert_eq!(found.classes[100..103], [SemanticClass::Unlabelled; 3]);
    assert_eq!(found.confidences[100..103], [0; 3]);
    assert!(found.classes[103..] == plain.classes[100..]);
}

#[test]
fn a_scan_with_nothing_in_the_field_of_view_is_an_error() {
    let segmenter = segmenter("squeezesegv2");
    let above: Vec<_> = (0..50).map(|k| [0.1 * k as f32, 1.0, 9.0, 0.0]).collect();
    for scan in [&above[..], &[], &[[f32::NAN; 4]]] {
        let error = segmenter.segment(scan).expect_err("nothing to see");
        assert!(matches!(error, SegmentationError::NothingInView { points, .. } if points == scan.len()));
        let text = error.to_string();
        assert!(text.contains("-25") && text.contains('3'), "{text}");
    }
}
