//! Words: what of a keyframe's geometry can be looked up, whatever the direction it is seen from.
//!
//! BoW3D's words are pairs (value, dimension) of a LinK3D descriptor. They turn over when one nearest neighbour is
//! missed, and with pure static points alone there are few to spare. A triangle of three keypoints is a word here: its
//! three sides, rounded, and the three classes. It depends on three keypoints only, is the same from every direction,
//! and fixes the transform between the two views by itself.

use heapless::Vec;

use super::Config;
use super::features::Features;
use crate::capacity::{KEYPOINTS, WORDS};
use crate::math;
use crate::scan::SemanticClass;

/// Neighbours of each keypoint that it forms triangles with, at most.
pub const MAX_NEIGHBOURS: usize = 12;

/// Three keypoints, in the order of the sides opposite to them, shortest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Indices of the keypoints.
    pub corners: [u8; 3],
    /// Horizontal sides [m], ascending.
    pub sides_m: [f32; 3],
    /// Classes at the corners.
    pub classes: [SemanticClass; 3],
}

impl Triangle {
    /// The triangle of three keypoints.
    pub fn new(features: &Features, corners: [u8; 3]) -> Self {
        let opposite = |k: usize| {
            let [a, b] =
                [corners[(k + 1) % 3], corners[(k + 2) % 3]].map(|i| features.keypoints[i as usize].position);
            math::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]))
        };
        let mut sides = [0, 1, 2].map(|k| (opposite(k), corners[k]));
        sides.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let corners = sides.map(|s| s.1);
        let classes = corners.map(|i| features.keypoints[i as usize].class);
        Self { corners, sides_m: sides.map(|s| s.0), classes }
    }

    /// The word of the triangle.
    pub fn word(&self, step_m: f32) -> u32 {
        word(self.sides_m.map(|s| (s / step_m) as u32), self.classes)
    }

    /// Calls `visit` for every word that the same triangle may have when each side is off by up to `tolerance_m`.
    pub fn for_words(&self, step_m: f32, tolerance_m: f32, mut visit: impl FnMut(u32)) {
        let range = |side: f32| {
            let low = ((side - tolerance_m).max(0.0) / step_m) as u32;
            low..=((side + tolerance_m) / step_m) as u32
        };
        for a in range(self.sides_m[0]) {
            for b in range(self.sides_m[1]) {
                for c in range(self.sides_m[2]) {
                    visit(word([a, b, c], self.classes));
                }
            }
        }
    }
}

/// 9 bits for each side, mixed with the classes.
fn word(sides: [u32; 3], classes: [SemanticClass; 3]) -> u32 {
    let sides =
        u64::from(sides[0].min(511)) << 18 | u64::from(sides[1].min(511)) << 9 | u64::from(sides[2].min(511));
    let classes = (classes[0] as u64) << 10 | (classes[1] as u64) << 5 | classes[2] as u64;
    ((classes << 27 | sides).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as u32
}

/// The triangles of a keyframe: every keypoint with each pair of its nearest neighbours, keypoints near the sensor
/// and close neighbours first; at most [`WORDS`] of them.
pub fn triangles(config: &Config, features: &Features) -> Vec<Triangle, WORDS> {
    let mut found: Vec<Triangle, WORDS> = Vec::new();
    let mut seen: Vec<[u8; 3], WORDS> = Vec::new();
    let near: Vec<Vec<u8, MAX_NEIGHBOURS>, KEYPOINTS> =
        (0..features.keypoints.len()).map(|i| neighbours(config, features, i)).collect();
    // By the rank of the farther neighbour: when not all fit, every keypoint keeps its closest.
    for far in 1..MAX_NEIGHBOURS {
        for close in 0..far {
            for (i, near) in near.iter().enumerate() {
                let (Some(a), Some(b)) = (near.get(close), near.get(far)) else { continue };
                let mut corners = [i as u8, *a, *b];
                corners.sort_unstable();
                if seen.contains(&corners) {
                    continue;
                }
                if seen.push(corners).is_err() {
                    return found;
                }
                // As long as `seen`.
                let _ = found.push(Triangle::new(features, corners));
            }
        }
    }
    found
}

/// The nearest keypoints around one, nearest first, that are far enough from it to give a direction.
fn neighbours(config: &Config, features: &Features, of: usize) -> Vec<u8, MAX_NEIGHBOURS> {
    let centre = features.keypoints[of].position;
    let limit = (config.neighbours as usize).min(MAX_NEIGHBOURS);
    let mut near: Vec<(f32, u8), MAX_NEIGHBOURS> = Vec::new();
    for (i, keypoint) in features.keypoints.iter().enumerate() {
        let [x, y] = [keypoint.position[0] - centre[0], keypoint.position[1] - centre[1]];
        let distance2 = x * x + y * y;
        if distance2 < config.min_side_m * config.min_side_m {
            continue;
        }
        let at = near.iter().position(|n| distance2 < n.0).unwrap_or(near.len());
        if at < limit {
            near.truncate(limit - 1);
            let _ = near.insert(at, (distance2, i as u8));
        }
    }
    near.iter().map(|n| n.1).collect()
}
