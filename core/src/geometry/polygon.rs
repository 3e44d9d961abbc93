//! Convex polygons: area, intersection, and the measures of similarity of L-LO.

use heapless::Vec;

use crate::math;
use crate::total;

/// Most vertices of an intersection: those of both polygons.
const CLIP_VERTICES: usize = 64;

/// Area [m2] of a polygon by the shoelace formula; positive when counter-clockwise.
pub fn area(polygon: &[[f32; 2]]) -> f32 {
    // Relative to the first vertex: polygons are small and may be far from the origin.
    let Some(o) = polygon.first() else { return 0.0 };
    let d = |p: &[f32; 2]| [p[0] - o[0], p[1] - o[1]];
    0.5 * polygon
        .windows(2)
        .map(|e| {
            let (a, b) = (d(&e[0]), d(&e[1]));
            a[0] * b[1] - a[1] * b[0]
        })
        .sum::<f32>()
}

/// Area [m2] of the intersection of two convex counter-clockwise polygons (eq. 1), by clipping `subject` at the
/// edges of `clip` (Sutherland and Hodgman). At most 32 vertices each; those beyond are ignored.
pub fn intersection_area(subject: &[[f32; 2]], clip: &[[f32; 2]]) -> f32 {
    if subject.len() < 3 || clip.len() < 3 {
        return 0.0;
    }
    let mut first: Vec<[f32; 2], CLIP_VERTICES> =
        total::collect(subject.iter().copied().take(CLIP_VERTICES / 2));
    let mut second: Vec<[f32; 2], CLIP_VERTICES> = Vec::new();
    let (mut current, mut next) = (&mut first, &mut second);
    let clip = clip.get(..CLIP_VERTICES / 2).unwrap_or(clip);
    for (a, b) in clip.iter().zip(clip.iter().cycle().skip(1)) {
        cut(current, *a, *b, next);
        if next.is_empty() {
            return 0.0;
        }
        core::mem::swap(&mut current, &mut next);
    }
    area(current).max(0.0)
}

/// The part of a convex polygon left of the line from `a` to `b`.
#[inline]
fn cut(polygon: &[[f32; 2]], a: [f32; 2], b: [f32; 2], left: &mut Vec<[f32; 2], CLIP_VERTICES>) {
    left.clear();
    let edge = [b[0] - a[0], b[1] - a[1]];
    let side = |p: &[f32; 2]| edge[0] * (p[1] - a[1]) - edge[1] * (p[0] - a[0]);
    let Some(mut from) = polygon.last().copied() else { return };
    let mut from_side = side(&from);
    for to in polygon {
        let to_side = side(to);
        if (from_side < 0.0) != (to_side < 0.0) {
            let t = from_side / (from_side - to_side);
            let _ = left.push([from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])]);
        }
        if to_side >= 0.0 {
            let _ = left.push(*to);
        }
        (from, from_side) = (*to, to_side);
    }
}

fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    math::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]))
}

/// Symmetric Hausdorff distance [m] between two sets of vertices (L-LO eq. 6-8).
pub fn hausdorff(a: &[[f32; 2]], b: &[[f32; 2]]) -> f32 {
    let directed = |from: &[[f32; 2]], to: &[[f32; 2]]| {
        let nearest = |p: &[f32; 2]| to.iter().map(|q| distance(*p, *q)).fold(f32::INFINITY, f32::min);
        from.iter().map(nearest).fold(0.0, f32::max)
    };
    directed(a, b).max(directed(b, a))
}

/// Area under the turning function of a polygon (L-LO eq. 5): the accumulated exterior angle [rad] over the share of
/// the perimeter, from the vertex with the smallest coordinates.
pub fn turning_area(polygon: &[[f32; 2]]) -> f32 {
    let n = polygon.len();
    if n < 3 {
        return 0.0;
    }
    let sums = polygon.iter().map(|p| p[0] + p[1]).enumerate();
    let start = sums.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i);
    let vertex = |i: usize| polygon.get((start + i) % n).copied().unwrap_or_default();
    let heading = |i: usize| {
        let (a, b) = (vertex(i), vertex(i + 1));
        math::atan2(b[1] - a[1], b[0] - a[0])
    };
    let perimeter: f32 = (0..n).map(|i| distance(vertex(i), vertex(i + 1))).sum();
    let (mut angle, mut sum) = (0.0, 0.0);
    for i in 0..n {
        angle += math::wrap(heading(i) - heading(i + n - 1));
        sum += angle * distance(vertex(i), vertex(i + 1)) / perimeter.max(f32::MIN_POSITIVE);
    }
    sum
}
