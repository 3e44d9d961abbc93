//! DBSCAN (reference [12] of the paper) on weighted points with a radius per point.
//!
//! Exact: with one radius and unit weights it is the textbook algorithm. Two points are neighbours when their distance
//! is at most the smaller of their radii; a point is a core point when the weights of its neighbours, itself included,
//! reach the minimum. Border points join the cluster of their nearest core point.

use heapless::VecView;

use crate::math::floor_i32;

/// Cluster of a point that belongs to none.
pub const NOISE: u16 = u16::MAX;

/// A point to cluster, and the memory of the algorithm for it.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Position [m].
    pub position: [f32; 3],
    /// Radius of its neighbourhood [m].
    pub radius: f32,
    /// Measurements it stands for.
    pub weight: u32,
    /// Index that the caller knows it by.
    pub id: u16,
    /// Result: cluster, or [`NOISE`].
    pub cluster: u16,
    column: [i16; 2],
    next: u16,
    parent: u16,
    core: bool,
}

impl Point {
    /// A point before clustering.
    pub const fn new(position: [f32; 3], radius: f32, weight: u32, id: u16) -> Self {
        Self {
            position,
            radius,
            weight,
            id,
            cluster: NOISE,
            column: [0; 2],
            next: NOISE,
            parent: NOISE,
            core: false,
        }
    }
}

/// Buckets of the hashed grid of columns.
const BUCKETS: usize = 4096;

/// A hashed grid of vertical columns: the first point of each bucket.
pub struct Columns {
    first: [u16; BUCKETS],
}

impl Columns {
    /// An empty grid.
    pub const fn new() -> Self {
        Self { first: [NOISE; BUCKETS] }
    }
}

impl Default for Columns {
    fn default() -> Self {
        Self::new()
    }
}

fn bucket(column: [i16; 2]) -> usize {
    let key = (column[0] as u16 as u32) << 16 | column[1] as u16 as u32;
    (key.wrapping_mul(0x9E37_79B1) >> 20) as usize & (BUCKETS - 1)
}

/// Clusters `points` (at most 65534); gives the number of clusters. `column_m` is the side of the search grid [m],
/// best near the typical radius; it has no influence on the result.
pub fn cluster(points: &mut VecView<Point>, columns: &mut Columns, column_m: f32, min_weight: u32) -> u16 {
    build(points, columns, column_m);
    for i in 0..points.len() {
        let mut weight = 0;
        for_neighbours(points, columns, column_m, i, |j, _| {
            weight += points[j].weight;
            weight < min_weight
        });
        points[i].core = weight >= min_weight;
    }
    join_cores(points, columns, column_m);
    attach_borders(points, columns, column_m);
    number(points)
}

fn build(points: &mut VecView<Point>, columns: &mut Columns, column_m: f32) {
    columns.first.fill(NOISE);
    for i in 0..points.len() {
        let [x, y, _] = points[i].position;
        let column = [floor_i32(x / column_m) as i16, floor_i32(y / column_m) as i16];
        let first = &mut columns.first[bucket(column)];
        let point = &mut points[i];
        (point.column, point.next, point.parent, point.cluster) = (column, *first, i as u16, NOISE);
        *first = i as u16;
    }
}

/// Calls `visit(neighbour, squared distance)` for the neighbours of point `i`, itself included, until it says `false`.
#[inline]
fn for_neighbours(
    points: &VecView<Point>,
    columns: &Columns,
    column_m: f32,
    i: usize,
    mut visit: impl FnMut(usize, f32) -> bool,
) {
    let point = &points[i];
    let [x, y, _] = point.position;
    let low = [x - point.radius, y - point.radius].map(|v| floor_i32(v / column_m) as i16);
    let high = [x + point.radius, y + point.radius].map(|v| floor_i32(v / column_m) as i16);
    for cx in low[0]..=high[0] {
        for cy in low[1]..=high[1] {
            let mut j = columns.first[bucket([cx, cy])];
            while j != NOISE {
                let other = &points[j as usize];
                // Different columns may share a bucket.
                if other.column == [cx, cy] {
                    let d = [0, 1, 2].map(|k| other.position[k] - point.position[k]);
                    let distance2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                    let radius = point.radius.min(other.radius);
                    if distance2 <= radius * radius && !visit(j as usize, distance2) {
                        return;
                    }
                }
                j = other.next;
            }
        }
    }
}

/// Root of a point's set; shortens the way for the next time.
fn root(parents: &mut VecView<Point>, i: usize) -> usize {
    let mut at = i;
    while parents[at].parent as usize != at {
        let up = parents[at].parent as usize;
        parents[at].parent = parents[up].parent;
        at = up;
    }
    at
}

fn join_cores(points: &mut VecView<Point>, columns: &Columns, column_m: f32) {
    for i in 0..points.len() {
        if !points[i].core {
            continue;
        }
        // The neighbours are gathered in small batches: visiting borrows the points that joining changes.
        let mut from = 0;
        loop {
            let mut batch: heapless::Vec<u16, 64> = heapless::Vec::new();
            let mut seen = 0usize;
            for_neighbours(points, columns, column_m, i, |j, _| {
                if j < i && points[j].core {
                    seen += 1;
                    if seen > from {
                        return batch.push(j as u16).is_ok() && batch.len() < batch.capacity();
                    }
                }
                true
            });
            for j in &batch {
                let (a, b) = (root(points, i), root(points, *j as usize));
                // The smaller index is the root: the result does not depend on the order of joining.
                let (low, high) = (a.min(b), a.max(b));
                points[high].parent = low as u16;
            }
            if batch.len() < batch.capacity() {
                break;
            }
            from += batch.len();
        }
    }
}

fn attach_borders(points: &mut VecView<Point>, columns: &Columns, column_m: f32) {
    for i in 0..points.len() {
        if points[i].core {
            continue;
        }
        let mut nearest = (f32::INFINITY, i);
        for_neighbours(points, columns, column_m, i, |j, distance2| {
            if points[j].core && (distance2, j) < nearest {
                nearest = (distance2, j);
            }
            true
        });
        points[i].parent = nearest.1 as u16;
    }
}

fn number(points: &mut VecView<Point>) -> u16 {
    let mut clusters = 0;
    for i in 0..points.len() {
        if points[i].core && points[i].parent as usize == i {
            points[i].cluster = clusters;
            clusters += 1;
        }
    }
    for i in 0..points.len() {
        let top = root(points, i);
        points[i].cluster = if points[top].core { points[top].cluster } else { NOISE };
    }
    clusters
}
