//! Section 3.2.2: vertical layering and convex hulls.

use heapless::Vec;

use super::{Landmark, OUTLINE};
use crate::geometry::convex_hull::convex_hull;

/// Most vertices of a hull: every outline point of both layers.
pub const HULL_VERTICES: usize = 2 * OUTLINE;

/// A convex hull in the plane [m], counter-clockwise.
pub type Hull = Vec<[f32; 2], HULL_VERTICES>;

/// The hulls of the lower and the upper layer; empty where a layer has no area.
#[derive(Clone, Debug, Default)]
pub struct Layers {
    /// Points below the split.
    pub lower: Hull,
    /// Points above the split.
    pub upper: Hull,
}

/// Splits a landmark at a height [m, sensor frame] and takes each layer's hull.
pub fn layers(landmark: &Landmark, split_z: f32) -> Layers {
    let mut parts: [Vec<[f32; 2], HULL_VERTICES>; 2] = [Vec::new(), Vec::new()];
    for p in landmark.outline.iter().flatten().flatten() {
        // Both layers together never hold more than HULL_VERTICES points.
        let _ = parts[usize::from(p[2] > split_z)].push([p[0], p[1]]);
    }
    let mut layers = Layers::default();
    convex_hull(&mut parts[0], &mut layers.lower);
    convex_hull(&mut parts[1], &mut layers.upper);
    layers
}
