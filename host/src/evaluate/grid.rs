//! Points in a regular grid, for all neighbours within a fixed radius.

use nalgebra::{Point3, Vector3};

/// Cell indices are packed into 21 bits each. Farther apart than 2^21 cells they repeat, which costs time only: distances
/// are checked.
const BITS: u32 = 21;
const MASK: u64 = (1 << BITS) - 1;

/// Points sorted by cell; the cell's side is the search radius.
pub struct Grid {
    radius_m: f64,
    keys: Vec<u64>,
    points: Vec<Point3<f64>>,
}

impl Grid {
    pub fn new(points: &[Point3<f64>], radius_m: f64) -> Self {
        let mut keyed: Vec<_> =
            points.iter().enumerate().map(|(i, point)| (key(cell(point, radius_m)), i as u32)).collect();
        keyed.sort_unstable();
        let sorted = keyed.iter().map(|&(_, i)| points[i as usize]).collect();
        Self { radius_m, keys: keyed.into_iter().map(|(key, _)| key).collect(), points: sorted }
    }

    /// Puts the points within the radius of `centre`, the border included, into `found`: as seen from `centre`.
    pub fn neighbours(&self, centre: &Point3<f64>, found: &mut Vec<Vector3<f64>>) {
        found.clear();
        let [x, y, z] = cell(centre, self.radius_m);
        for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
            // Cells above each other follow each other: one search finds all three.
            self.column([x + dx, y + dy, z], centre, found);
        }
    }

    fn column(&self, [x, y, z]: [i64; 3], centre: &Point3<f64>, found: &mut Vec<Vector3<f64>>) {
        let (first, last) = (key([x, y, z - 1]), key([x, y, z + 1]));
        let start = self.keys.partition_point(|&key| key < first);
        for (key, point) in self.keys[start..].iter().zip(&self.points[start..]) {
            if *key > last {
                break;
            }
            let offset = point - centre;
            if offset.norm_squared() <= self.radius_m * self.radius_m {
                found.push(offset);
            }
        }
    }
}

/// Clamped, so that poses from nowhere do not overflow.
fn cell(point: &Point3<f64>, side_m: f64) -> [i64; 3] {
    [point.x, point.y, point.z].map(|v| (v / side_m).floor().clamp(-1e12, 1e12) as i64)
}

/// The offset keeps neighbours of cell 0 in order.
fn key([x, y, z]: [i64; 3]) -> u64 {
    let packed = |v: i64| (v + (1 << (BITS - 1))) as u64 & MASK;
    packed(x) << (2 * BITS) | packed(y) << BITS | packed(z)
}
