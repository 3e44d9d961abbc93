//! Stage 4: pairing, hulls and swarm.

use nalgebra::Point3;
use proptest::prelude::*;
use sdslam_core::landmarks::Landmark;
use sdslam_core::optimise::pso;
use sdslam_core::pose::{self, PlanarPose, Pose};
use sdslam_core::preliminary_pose::hull_registration::{self, HullPair};
use sdslam_core::preliminary_pose::pairing::{self, Candidate};
use sdslam_core::{LabelledPoint, MotionClass};
use sdslam_tests::drive::Drive;
use sdslam_tests::stages::landmarks_of;
use sdslam_tests::world::unit;

use crate::planar;

/// Landmarks of a street, enough to pair.
fn street_landmarks() -> Vec<Landmark> {
    let scan = Drive::down_the_street(1, 8.0).frames.remove(0).points;
    let near = |p: &&LabelledPoint| {
        p.position[0].hypot(p.position[1]) < 30.0 && p.class.motion() != MotionClass::Ground
    };
    let points: Vec<LabelledPoint> = scan.iter().filter(near).copied().collect();
    landmarks_of(&points)
}

fn pairs_of(
    config: &pairing::Config,
    target: &[Landmark],
    source: &[Landmark],
    target_from_source: &Pose,
) -> Vec<Candidate> {
    let mut pairs = heapless::Vec::<Candidate, 64>::new();
    pairing::pair(config, target.iter(), source, target_from_source, |_| true, &mut pairs);
    pairs.to_vec()
}

/// The landmarks seen by a sensor that has moved: `moved * p` is what `p` was.
fn seen_from(moved: &Pose) -> Vec<Landmark> {
    let scan = Drive::down_the_street(1, 8.0).frames.remove(0).points;
    let near = |p: &&LabelledPoint| {
        p.position[0].hypot(p.position[1]) < 30.0 && p.class.motion() != MotionClass::Ground
    };
    let points = scan.iter().filter(near).map(|p| LabelledPoint {
        position: moved.inverse_transform_point(&Point3::from(p.position)).coords.into(),
        ..*p
    });
    landmarks_of(&points.collect::<Vec<_>>())
}

#[test]
fn mutual_pairs_do_not_depend_on_which_side_asks() {
    let moved = planar(0.6, -0.1, 0.02);
    let (target, source) = (street_landmarks(), seen_from(&moved));
    // Half of one side is missing and the gate is wide: many nearest neighbours are not mutual.
    let source: Vec<Landmark> = source.into_iter().step_by(2).collect();
    let config = pairing::Config { gate_m: 15.0, ..pairing::Config::DEFAULT };
    let guess = planar(0.4, 0.0, 0.0);
    let there = pairs_of(&config, &target, &source, &guess);
    let back = pairs_of(&config, &source, &target, &guess.inverse());
    let mut swapped: Vec<(u16, u16)> = back.iter().map(|c| (c.source, c.target)).collect();
    let mut forth: Vec<(u16, u16)> = there.iter().map(|c| (c.target, c.source)).collect();
    swapped.sort_unstable();
    forth.sort_unstable();
    assert_eq!(forth, swapped);
    assert!(forth.len() > 10, "{} pairs", forth.len());
    assert!(there.windows(2).all(|w| w[0].distance_m <= w[1].distance_m), "nearest first");
    assert!(there.iter().all(|c| c.distance_m < config.gate_m));
    for c in &there {
        assert_eq!(target[c.target as usize].family, source[c.source as usize].family);
    }
    let mut sources: Vec<u16> = there.iter().map(|c| c.source).collect();
    sources.sort_unstable();
    sources.dedup();
    assert_eq!(sources.len(), there.len(), "nobody is paired twice");
}

#[test]
fn the_papers_pairs_are_nearer_than_the_mean() {
    let (target, source) = (street_landmarks(), seen_from(&planar(0.6, -0.1, 0.02)));
    let all = pairing::Config { rule: pairing::Rule::Mutual, ..pairing::Config::PAPER };
    let by_mean = pairs_of(&pairing::Config::PAPER, &target, &source, &pose::IDENTITY);
    let mutual = pairs_of(&all, &target, &source, &pose::IDENTITY);
    assert!(!by_mean.is_empty() && by_mean.len() < mutual.len(), "{} of {}", by_mean.len(), mutual.len());
    let farthest = |pairs: &[Candidate]| pairs.iter().map(|c| c.distance_m).fold(0.0, f32::max);
    assert!(farthest(&by_mean) < farthest(&mutual));
}

/// Registers the hulls of the street after a known motion, starting from none.
fn registered(config: &hull_registration::Config, moved: &Pose, seed: u64) -> (PlanarPose, f32, u32) {
    let (target, source) = (street_landmarks(), seen_from(moved));
    let candidates = pairs_of(&pairing::Config::DEFAULT, &target, &source, &pose::IDENTITY);
    let mut pairs = heapless::Vec::<HullPair, 64>::new();
    let start = pose::IDENTITY;
    let target_of = |i: usize| target.get(i);
    hull_registration::pair_hulls(config, target_of, &source, &start, &candidates, &mut pairs);
    let (found, evidence) = hull_registration::register(config, seed, PlanarPose::from_pose(&start), &pairs);
    assert_eq!(evidence.pairs as usize, pairs.len());
    (found, evidence.overlap, evidence.evaluations)
}

#[test]
fn hulls_find_a_known_motion() {
    for config in [hull_registration::Config::DEFAULT, hull_registration::Config::PAPER] {
        for (k, [x, y, yaw]) in
            [[0.3, -0.15, 0.02], [-0.4, 0.2, -0.025], [0.0, 0.0, 0.0]].into_iter().enumerate()
        {
            let (found, overlap, evaluations) = registered(&config, &planar(x, y, yaw), k as u64);
            let off = (found.x - x).hypot(found.y - y);
            // Cells are up to 0.4 m wide and lie differently after the motion.
            assert!(off < 0.06 && (found.yaw - yaw).abs() < 0.005, "{found:?} instead of {x} {y} {yaw}");
            assert!(overlap > 0.8 && overlap <= 1.001, "{overlap}");
            assert!(evaluations <= budget(&config.swarm));
        }
    }
}

#[test]
fn identical_hulls_overlap_most_where_they_are() {
    let (found, overlap, _) = registered(&hull_registration::Config::DEFAULT, &pose::IDENTITY, 3);
    assert_eq!(found, PlanarPose::default());
    assert!((overlap - 1.0).abs() < 1e-3, "{overlap}");
}

#[test]
fn without_pairs_the_start_comes_back() {
    let start = PlanarPose { x: 1.0, y: 2.0, yaw: 0.3 };
    let (found, evidence) = hull_registration::register(&hull_registration::Config::DEFAULT, 1, start, &[]);
    assert_eq!((found, evidence.pairs, evidence.evaluations), (start, 0, 0));
}

/// Most evaluations that a swarm may use.
fn budget(config: &pso::Config) -> u32 {
    config.particles * (config.iterations + 1) + config.polish_evaluations
}

proptest! {
    #[test]
    fn swarm_finds_the_top_of_a_hill_in_its_box(
        seed in any::<u64>(), at in [-0.9f32..0.9, -0.9f32..0.9, -0.9f32..0.9], centre in [-50.0f32..50.0, -50.0f32..50.0, -3.0f32..3.0],
    ) {
        let half = [0.5f32, 0.4, 0.05];
        let top = [0, 1, 2].map(|d| centre[d] + at[d] * half[d]);
        let mut outside = 0;
        let hill = |p: &[f32; 3]| -> f32 {
            (0..3).map(|d| -((p[d] - top[d]) / half[d]).powi(2)).sum()
        };
        let config = pso::Config::PAPER;
        let found = pso::maximise(&config, seed, centre, half, |p| {
            let inside = (0..3).all(|d| (p[d] - centre[d]).abs() <= half[d] * 1.0001 + 1e-5);
            outside += u32::from(!inside);
            hill(p)
        });
        prop_assert_eq!(outside, 0, "every particle stays in the box");
        prop_assert!(found.evaluations <= budget(&config));
        prop_assert_eq!(found.value, hill(&found.position));
        for d in 0..3 {
            let off = (found.position[d] - top[d]).abs() / half[d];
            prop_assert!(off < 0.02, "axis {d}: {off} of the half width");
        }
    }

    #[test]
    fn swarm_stops_at_the_wall_when_the_top_is_beyond(seed in any::<u64>(), direction in -3.0f32..3.0) {
        let slope = [direction.cos(), direction.sin()];
        let found = pso::maximise(&pso::Config::PAPER, seed, [0.0; 2], [1.0; 2], |p| slope[0] * p[0] + slope[1] * p[1]);
        for (at, slope) in found.position.iter().zip(slope) {
            prop_assert!(at.abs() <= 1.0);
            prop_assert!(slope.abs() <= 0.2 || at * slope.signum() > 0.97, "{:?}", found);
        }
    }

    #[test]
    fn swarm_never_ends_below_its_start(seed in any::<u64>()) {
        // Rough: the top is one of many.
        let rough = |p: &[f32; 2]| unit(9, u64::from((p[0] * 50.0) as i32 as u32), u64::from((p[1] * 50.0) as i32 as u32)) as f32;
        let found = pso::maximise(&pso::Config::SMALL, seed, [0.3, 0.2], [1.0, 1.0], rough);
        prop_assert!(found.value >= rough(&[0.3, 0.2]));
        prop_assert!(found.evaluations <= budget(&pso::Config::SMALL));
    }
}

#[test]
fn swarm_repeats_itself_and_its_seed_matters() {
    let hills = |p: &[f32; 2]| (3.0 * p[0]).sin() * (4.0 * p[1]).cos() - 0.1 * (p[0] * p[0] + p[1] * p[1]);
    let run = |seed| {
        let mut trace = Vec::new();
        let config = pso::Config { polish_evaluations: 0, ..pso::Config::PAPER };
        pso::maximise(&config, seed, [0.0; 2], [2.0; 2], |p| {
            trace.push(p.map(f32::to_bits));
            hills(p)
        });
        trace
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5), run(6));
}

#[test]
fn a_flat_objective_keeps_the_start() {
    let found = pso::maximise(&pso::Config::PAPER, 1, [0.7, -0.2], [1.0; 2], |_| 0.0);
    assert_eq!(found.position, [0.7, -0.2]);
    // It stalls from the beginning: no more than the patience allows.
    let config = pso::Config::PAPER;
    assert!(found.evaluations <= config.particles * (config.patience + 1) + config.polish_evaluations);
}
