//! LinK3D descriptors and their matching, the paper's own way (references of section 3.5: LinK3D sections III-B and III-C).
//!
//! Selected by [`super::Rule::Bow3d`]. The descriptor describes a keypoint by the distances to the others in sectors of
//! two degrees around it, counted from the direction of its nearest neighbour; it does not change when the view turns.

use heapless::Vec;
use oorandom::Rand32;

use super::features::Features;
use super::place_table::Place;
use super::verification::planar_from_triples;
use super::{Bow3dConfig, Config};
use crate::capacity::{HYPOTHESES, KEYPOINTS, WORDS};
use crate::math;
use crate::pose::PlanarPose;

/// Sectors of two degrees.
pub const DIMENSIONS: usize = 180;

/// Nearest neighbours that give a direction each.
const AXES: usize = 3;

/// Distances are counted in tenths of a metre.
const PER_METRE: f32 = 10.0;

/// Values that differ by this much still match (0.2 m).
const VALUE_TOLERANCE: u16 = 2;

/// Distance [0.1 m] to the nearest keypoint in each sector, 0 where there is none: 360 bytes.
pub type Descriptor = [u16; DIMENSIONS];

/// The descriptor of keypoint `of`: what the nearest neighbour's axis gives has priority over the second's, that over
/// the third's.
pub fn descriptor(keypoints: &[[f32; 3]], of: usize) -> Descriptor {
    let mut result = [0; DIMENSIONS];
    for axis in nearest(keypoints, of) {
        let sectors = seen_along(keypoints, of, axis);
        for (value, new) in result.iter_mut().zip(sectors) {
            if *value == 0 {
                *value = new;
            }
        }
    }
    result
}

/// The nearest neighbours, nearest first.
fn nearest(keypoints: &[[f32; 3]], of: usize) -> Vec<usize, AXES> {
    let mut near: Vec<(f32, usize), AXES> = Vec::new();
    for i in (0..keypoints.len()).filter(|i| *i != of) {
        let distance_m = distance_m(&keypoints[of], &keypoints[i]);
        let at = near.iter().position(|n| distance_m < n.0).unwrap_or(near.len());
        if at < AXES {
            near.truncate(AXES - 1);
            let _ = near.insert(at, (distance_m, i));
        }
    }
    near.iter().map(|n| n.1).collect()
}

/// Distances in sectors counted counter-clockwise from the direction to `axis`; sector 0 holds `axis` alone.
fn seen_along(keypoints: &[[f32; 3]], of: usize, axis: usize) -> Descriptor {
    let mut sectors = [0; DIMENSIONS];
    let direction =
        |i: usize| math::atan2(keypoints[i][1] - keypoints[of][1], keypoints[i][0] - keypoints[of][0]);
    let zero = direction(axis);
    let tenths = |i: usize| ((distance_m(&keypoints[of], &keypoints[i]) * PER_METRE + 0.5) as u16).max(1);
    sectors[0] = tenths(axis);
    for i in (0..keypoints.len()).filter(|i| *i != of && *i != axis) {
        let mut angle_deg = (direction(i) - zero).to_degrees();
        if angle_deg < 0.0 {
            angle_deg += 360.0;
        }
        // Sector k holds the angles of (2 k - 1, 2 k + 1] degrees; those next to the axis belong to no sector but its own.
        let sector = (((angle_deg - 1.0) / 2.0).max(0.0) as usize + 1).min(DIMENSIONS - 1);
        let value = tenths(i);
        if sectors[sector] == 0 || value < sectors[sector] {
            sectors[sector] = value;
        }
    }
    sectors
}

fn distance_m(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    let d = [0, 1, 2].map(|k| a[k] - b[k]);
    math::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
}

/// Sectors that hold about the same distance in both.
pub fn similarity(a: &Descriptor, b: &Descriptor) -> u32 {
    let same = |(x, y): &(&u16, &u16)| **x != 0 && **y != 0 && x.abs_diff(**y) <= VALUE_TOLERANCE;
    a.iter().zip(b).filter(same).count() as u32
}

/// BoW3D's words of a keyframe: (value, dimension) of the descriptors of the nearest keypoints, with the keypoint's
/// class; and the keypoint.
pub fn words(config: &Bow3dConfig, features: &Features) -> Vec<(u32, [u8; 3]), WORDS> {
    let mut words = Vec::new();
    let positions = positions(features);
    for i in 0..positions.len().min(config.descriptors as usize) {
        let class = features.keypoints[i].class as u64;
        for (dimension, value) in descriptor(&positions, i).into_iter().enumerate().filter(|(_, v)| *v != 0) {
            let key = class << 32 | (dimension as u64) << 16 | u64::from(value);
            let word = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as u32;
            if words.push((word, [i as u8; 3])).is_err() {
                return words;
            }
        }
    }
    words
}

fn positions(features: &Features) -> Vec<[f32; 3], KEYPOINTS> {
    features.keypoints.iter().map(|k| k.position).collect()
}

/// A pair of keypoints with like descriptors.
#[derive(Clone, Copy, Debug)]
struct Match {
    similarity: u32,
    new: u8,
    old: u8,
}

/// Transforms drawn from the matches between two views by RANSAC: every draw is a triple of matches that fits.
///
/// Gives the number of matches too. `new_descriptors` are those of the new view's keypoints.
pub fn propose(
    config: &Config,
    new: &Features,
    new_descriptors: &[Descriptor],
    old: &Place,
    hypotheses: &mut Vec<PlanarPose, HYPOTHESES>,
) -> u32 {
    let matches = matches(&config.bow3d, new, new_descriptors, old);
    let count = matches.len() as u32;
    if count < config.bow3d.min_matches {
        return count;
    }
    let mut random = Rand32::new(u64::from(old.id));
    for _ in 0..config.bow3d.draws {
        let drawn = [0; 3].map(|_: u8| matches[random.rand_range(0..count) as usize]);
        let (a, b, c) = (drawn[0].new, drawn[1].new, drawn[2].new);
        if a == b || b == c || a == c {
            continue;
        }
        let (pose, worst_m) = planar_from_triples(
            drawn.map(|m| new.keypoints[m.new as usize].position),
            drawn.map(|m| old.position(m.old)),
        );
        if worst_m < 1.5 * config.inlier_radius_m && hypotheses.push(pose).is_err() {
            break;
        }
    }
    count
}

/// Each old keypoint with the one of the new view that is most like it and of its class; one to one.
fn matches(
    config: &Bow3dConfig,
    new: &Features,
    new_descriptors: &[Descriptor],
    old: &Place,
) -> Vec<Match, KEYPOINTS> {
    let positions: Vec<[f32; 3], KEYPOINTS> = old.keypoints().map(|(p, _)| p).collect();
    let mut best: Vec<Match, KEYPOINTS> = Vec::new();
    for (j, (_, class)) in old.keypoints().enumerate() {
        let descriptor = descriptor(&positions, j);
        let like = new.keypoints.iter().zip(new_descriptors).enumerate();
        let like =
            like.filter(|(_, (k, _))| k.class == class).map(|(i, (_, d))| (similarity(d, &descriptor), i));
        let Some((similarity, i)) = like.max_by_key(|(s, i)| (*s, core::cmp::Reverse(*i))) else { continue };
        if similarity < config.min_similarity {
            continue;
        }
        let found = Match { similarity, new: i as u8, old: j as u8 };
        match best.iter_mut().find(|m| m.new == found.new) {
            Some(rival) if rival.similarity < similarity => *rival = found,
            Some(_) => {}
            // As many as old keypoints.
            None => best.push(found).unwrap_or_default(),
        }
    }
    best
}
