//! Graham's scan (reference [31] of the paper).

use core::cmp::Ordering;

use heapless::VecView;

use crate::total;

/// Twice the signed area of the triangle a, b, c: positive when it turns left. Differences and products of f32
/// coordinates are exact in f64, so the sign is too.
#[inline]
pub fn turn(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> f64 {
    let d = |p: [f32; 2]| [f64::from(p[0]) - f64::from(a[0]), f64::from(p[1]) - f64::from(a[1])];
    let (b, c) = (d(b), d(c));
    b[0] * c[1] - b[1] * c[0]
}

/// Convex hull of `points`, counter-clockwise, without collinear vertices, written to `hull`; `points` are reordered.
///
/// Fewer than three vertices come out when the points are collinear. Returns `false`, with the hull cut short, when
/// `hull` cannot hold it. Points must be finite.
pub fn convex_hull(points: &mut [[f32; 2]], hull: &mut VecView<[f32; 2]>) -> bool {
    hull.clear();
    let lowest = |a: &[f32; 2], b: &[f32; 2]| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0]));
    let Some(pivot) = points.iter().copied().min_by(lowest) else { return true };
    let distance2 = |p: [f32; 2]| {
        let (x, y) = (f64::from(p[0]) - f64::from(pivot[0]), f64::from(p[1]) - f64::from(pivot[1]));
        x * x + y * y
    };
    total::sort_by(points, |a, b| {
        let by_distance = distance2(*a).total_cmp(&distance2(*b));
        if distance2(*a) == 0.0 || distance2(*b) == 0.0 {
            return by_distance.is_lt();
        }
        0.0f64.partial_cmp(&turn(pivot, *a, *b)).unwrap_or(Ordering::Equal).then(by_distance).is_lt()
    });
    for p in points.iter() {
        while let [.., a, b] = hull.as_slice()
            && turn(*a, *b, *p) <= 0.0
        {
            hull.pop();
        }
        if hull.last() == Some(p) {
            continue;
        }
        if hull.push(*p).is_err() {
            return false;
        }
    }
    true
}
