//! Simulated streets: true loops are found in both directions, look-alikes are not.

use sdslam_core::SemanticClass;
use sdslam_core::loop_closure::{Config, LoopCandidate};
use sdslam_tests::loops::{Detector, Keyframe, detector, drive_lane, error_of, features_of};
use sdslam_tests::street::{car, street};
use sdslam_tests::world::{Solid, World, unit};

fn along(from: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| from + 4.0 * k as f64).collect()
}

/// A detector that knows these places, by their index.
fn that_knows(config: Config, places: &[Keyframe]) -> Box<Detector> {
    let mut detector = detector(config);
    for (k, place) in places.iter().enumerate() {
        detector.add(k as u32, place.stamp_s, &features_of(&place.points));
    }
    detector
}

fn ask(detector: &mut Detector, new: &Keyframe) -> Option<LoopCandidate> {
    detector.query(&features_of(&new.points), Some(new.stamp_s)).first().copied()
}

/// The share of keyframes for which the right place is found; panics at a wrong one.
fn recall(detector: &mut Detector, old: &[Keyframe], new: &[Keyframe], largest_m: f64) -> f64 {
    let mut found = 0;
    for keyframe in new {
        let Some(candidate) = ask(detector, keyframe) else { continue };
        let place = &old[candidate.place as usize].world_from_sensor;
        let (error_m, error_deg) = error_of(place, &keyframe.world_from_sensor, &candidate.old_from_new);
        assert!(error_m < largest_m && error_deg < 3.0, "{error_m} m, {error_deg} deg: {candidate:?}");
        found += 1;
    }
    f64::from(found) / new.len() as f64
}

/// The street, with other parked cars.
fn later(world: &World, seed: u64) -> World {
    let stays = |s: &&Solid| s.class != SemanticClass::Car;
    let mut solids: Vec<Solid> = world.solids.iter().filter(stays).copied().collect();
    for k in 0..12 {
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        solids.push(car([12.0 * k as f64 + 10.0 * unit(seed, k, 1), 3.6 * side], 0.0));
    }
    World { solids }
}

#[test]
fn the_same_street_is_recognised_after_the_parked_cars_have_changed() {
    let world = street(120.0, 7);
    let old = drive_lane(&world, &along(20.0, 20), -1.5, 1.0, 0.0);
    let new = drive_lane(&later(&world, 3), &along(21.5, 19), -1.2, 1.0, 100.0);
    for config in [Config::DEFAULT, Config::PAPER] {
        let share = recall(&mut that_knows(config, &old), &old, &new, 0.4);
        assert!(share >= 0.9, "{:?}: {share}", config.rule);
    }
}

#[test]
fn the_same_street_is_recognised_when_driven_the_other_way() {
    let world = street(120.0, 7);
    let old = drive_lane(&world, &along(20.0, 20), -1.5, 1.0, 0.0);
    let new = drive_lane(&later(&world, 4), &along(22.0, 19), 1.5, -1.0, 100.0);
    let mut detector = that_knows(Config::DEFAULT, &old);
    let share = recall(&mut detector, &old, &new, 0.4);
    assert!(share >= 0.8, "{share}");
    let candidate = ask(&mut detector, &new[9]).expect("in the middle of the street");
    assert!(candidate.is_reverse() && candidate.distance_m() > 2.9, "{candidate:?}");
}

#[test]
fn another_street_is_not_taken_for_this_one() {
    let old = drive_lane(&street(120.0, 7), &along(20.0, 20), -1.5, 1.0, 0.0);
    for seed in [8, 1007, 2007] {
        let new = drive_lane(&street(120.0, seed), &along(20.0, 20), -1.5, 1.0, 100.0);
        for config in [Config::DEFAULT, Config::PAPER] {
            let mut detector = that_knows(config, &old);
            let wrong: Vec<LoopCandidate> = new.iter().filter_map(|k| ask(&mut detector, k)).collect();
            assert!(wrong.is_empty(), "{:?}, street {seed}: {wrong:?}", config.rule);
        }
    }
}

/// Trees and poles at equal distances fit themselves, moved by one distance, almost as well as they fit themselves.
#[test]
fn a_street_that_repeats_itself_gives_no_loop() {
    let first: Vec<Solid> = street(0.0, 7)
        .solids
        .into_iter()
        .filter(|s| (0.0..12.0).contains(&s.at[0]) && s.class != SemanticClass::Building)
        .collect();
    let copies = (-10..30).flat_map(|k| {
        first.iter().map(move |s| Solid { at: [s.at[0] + 12.0 * f64::from(k), s.at[1]], ..*s })
    });
    let world = World { solids: copies.collect() };
    let old = drive_lane(&world, &along(20.0, 6), -1.5, 1.0, 0.0);
    // 60 m farther, where the vehicle has never been, everything looks the same.
    let new = drive_lane(&world, &along(80.5, 6), -1.5, 1.0, 100.0);
    let mut detector = that_knows(Config::DEFAULT, &old);
    let wrong: Vec<LoopCandidate> = new.iter().filter_map(|k| ask(&mut detector, k)).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// One label in five wrong, drawn anew for every thing and every scan, as a bad segmentation would have it.
fn with_wrong_labels(keyframes: &[Keyframe], world: &World, share: f64) -> Vec<Keyframe> {
    use SemanticClass::*;
    let classes = [Trunk, Pole, TrafficSign, OtherObject, Vegetation, Building];
    let mut spoilt = keyframes.to_vec();
    for keyframe in &mut spoilt {
        let seed = keyframe.stamp_s.to_bits();
        for point in &mut keyframe.points {
            let at = keyframe.world_from_sensor * nalgebra::Point3::from(point.position.map(f64::from));
            let distance = |s: &Solid| (at.x - s.at[0]).hypot(at.y - s.at[1]);
            let thing = world.solids.iter().position(|s| s.class == point.class && distance(s) < 0.5);
            if let Some(thing) = thing.filter(|thing| unit(seed, *thing as u64, 1) < share) {
                point.class = classes[(6.0 * unit(seed, thing as u64, 2)) as usize];
            }
        }
    }
    spoilt
}

#[test]
fn wrong_labels_cost_recall_but_make_no_false_loop() {
    let world = street(120.0, 7);
    let old = with_wrong_labels(&drive_lane(&world, &along(20.0, 20), -1.5, 1.0, 0.0), &world, 0.2);
    let new = with_wrong_labels(&drive_lane(&world, &along(21.0, 19), -1.2, 1.0, 100.0), &world, 0.2);
    let share = recall(&mut that_knows(Config::DEFAULT, &old), &old, &new, 0.5);
    assert!(share >= 0.5, "{share}");
    let elsewhere = street(120.0, 8);
    let other = drive_lane(&elsewhere, &along(20.0, 20), -1.5, 1.0, 100.0);
    let other = with_wrong_labels(&other, &elsewhere, 0.2);
    let mut detector = that_knows(Config::DEFAULT, &old);
    let wrong: Vec<LoopCandidate> = other.iter().filter_map(|k| ask(&mut detector, k)).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn the_same_drive_gives_the_same_bits() {
    let world = street(60.0, 7);
    let old = drive_lane(&world, &along(20.0, 8), -1.5, 1.0, 0.0);
    let new = drive_lane(&world, &along(21.0, 7), 1.5, -1.0, 100.0);
    for config in [Config::DEFAULT, Config::PAPER] {
        let run = || {
            let mut detector = that_knows(config, &old);
            new.iter().map(|k| ask(&mut detector, k)).collect::<Vec<_>>()
        };
        let (a, b) = (run(), run());
        assert!(a.iter().any(Option::is_some));
        // Debug prints the shortest text that reads back as the same bits.
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
    }
}
