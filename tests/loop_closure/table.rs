//! The table of places: what is dropped when it is full, and that nothing else changes.

use sdslam_core::SemanticClass;
use sdslam_core::loop_closure::{Config, Features, Keypoint, LoopCandidate, LoopDetector};
use sdslam_tests::loops::{Detector, detector};
use sdslam_tests::world::unit;

/// A place with 30 keypoints that no other place has.
fn place(seed: u64) -> Features {
    let keypoint = |k: u64| {
        let draw = |what| unit(seed, k, what);
        let classes = [SemanticClass::Trunk, SemanticClass::Pole, SemanticClass::TrafficSign];
        let position = [70.0 * draw(1) - 35.0, 70.0 * draw(2) - 35.0, draw(3)].map(|v| v as f32);
        Keypoint { position, class: classes[(3.0 * draw(4)) as usize], points: 50 }
    };
    Features::from_keypoints((0..30).map(keypoint))
}

fn answers<const P: usize, const B: usize>(
    detector: &mut LoopDetector<P, B>,
    seeds: std::ops::Range<u64>,
) -> Vec<Vec<LoopCandidate>> {
    seeds.map(|seed| detector.query(&place(seed), None).to_vec()).collect()
}

fn without_gap() -> Config {
    Config { min_gap_s: 0.0, ..Config::DEFAULT }
}

#[test]
fn a_place_is_found_again_at_once_and_where_it_is() {
    for config in [without_gap(), Config { min_gap_s: 0.0, ..Config::PAPER }] {
        let mut detector: Box<Detector> = detector(config);
        for seed in 0..40 {
            detector.add(seed as u32, seed as f64, &place(seed));
        }
        for (seed, found) in answers(&mut detector, 0..40).into_iter().enumerate() {
            let [best, ..] = found[..] else { panic!("{:?}: place {seed} is not found", config.rule) };
            assert_eq!((best.place, best.inliers, found.len()), (seed as u32, 30, 1));
            assert!(best.old_from_new.translation.vector.norm() < 0.01 && best.score > 0.99, "{best:?}");
            assert!(best.old_from_new.rotation.angle() < 1e-3 && !best.is_reverse(), "{best:?}");
        }
        assert!(answers(&mut detector, 100..140).iter().all(Vec::is_empty), "{:?}", config.rule);
    }
}

#[test]
fn a_full_table_forgets_the_place_that_was_added_first() {
    for config in [without_gap(), Config { min_gap_s: 0.0, ..Config::PAPER }] {
        let mut full: Box<LoopDetector<8, 1024>> = detector(config);
        for seed in 0..21 {
            full.add(seed as u32, seed as f64, &place(seed));
        }
        assert_eq!((full.len(), full.forgotten()), (8, 13));
        let found = answers(&mut full, 0..21);
        let known: Vec<usize> = (0..21).filter(|seed| !found[*seed].is_empty()).collect();
        assert_eq!(known, (13..21).collect::<Vec<usize>>(), "{:?}", config.rule);
        // What was forgotten left nothing behind: the answers are those of a table that never knew it.
        let mut fresh: Box<LoopDetector<8, 1024>> = detector(config);
        for seed in 13..21 {
            fresh.add(seed as u32, seed as f64, &place(seed));
        }
        assert_eq!(answers(&mut full, 0..21), answers(&mut fresh, 0..21));
    }
}

#[test]
fn a_cleared_table_is_a_new_one() {
    let mut used: Box<LoopDetector<8, 1024>> = detector(without_gap());
    for seed in 50..70 {
        used.add(seed as u32, seed as f64, &place(seed));
    }
    used.clear();
    assert!(used.is_empty() && used.forgotten() == 0);
    let mut fresh: Box<LoopDetector<8, 1024>> = detector(without_gap());
    for seed in 0..11 {
        used.add(seed as u32, seed as f64, &place(seed));
        fresh.add(seed as u32, seed as f64, &place(seed));
    }
    assert_eq!(answers(&mut used, 0..70), answers(&mut fresh, 0..70));
}

#[test]
fn young_places_are_not_asked_for() {
    let mut detector: Box<Detector> = detector(Config { min_gap_s: 30.0, ..Config::DEFAULT });
    detector.add(0, 100.0, &place(1));
    assert!(detector.query(&place(1), Some(129.9)).is_empty());
    assert_eq!(detector.query(&place(1), Some(130.1)).len(), 1);
    assert_eq!(detector.query(&place(1), None).len(), 1);
}

#[test]
fn nothing_is_found_with_nothing() {
    let mut detector: Box<Detector> = detector(Config::DEFAULT);
    for few in [0, 1, 2, 3] {
        let features = Features::from_keypoints(place(1).keypoints.into_iter().take(few));
        detector.add(few as u32, few as f64, &features);
        assert!(detector.query(&features, None).is_empty());
    }
}

/// What a foreign map may hold: the detector stays upright, and finds what is sound.
#[test]
fn strange_keypoints_do_no_harm() {
    let values = [f32::NAN, f32::INFINITY, -1e30, 1e9, 500.0, 0.0, -0.0];
    let strange = |k: usize| Keypoint {
        position: [values[k % 7], values[k / 7 % 7], values[k / 49]],
        class: SemanticClass::ALL[k % SemanticClass::COUNT],
        points: 0,
    };
    for config in [without_gap(), Config { min_gap_s: 0.0, ..Config::PAPER }] {
        let mut detector: Box<LoopDetector<8, 1024>> = detector(config);
        detector.add(7, 0.0, &place(7));
        for start in 0..20 {
            let features =
                Features::from_keypoints((start * 16..start * 16 + 40).filter(|k| *k < 343).map(strange));
            assert!(features.keypoints.iter().all(|k| k.position.iter().all(|v| v.is_finite())));
            for candidate in detector.query(&features, None) {
                let t = candidate.old_from_new.translation.vector;
                assert!(candidate.place != 7 && t.iter().all(|v| v.is_finite()), "{candidate:?}");
            }
            detector.add(100 + start as u32, 0.0, &features);
            detector.add(7, 0.0, &place(7));
        }
        assert_eq!(detector.query(&place(7), None)[0].place, 7, "{:?}", config.rule);
    }
}
