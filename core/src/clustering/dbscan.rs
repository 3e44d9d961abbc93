//! DBSCAN (reference [12] of the paper) on weighted points with a radius per point.
//!
//! Exact: with one radius and unit weights it is the textbook algorithm. Two points are neighbours when their distance
//! is at most the smaller of their radii; a point is a core point when the weights of its neighbours, itself included,
//! reach the minimum. Border points join the cluster of their nearest core point.

use heapless::Vec;

use crate::math::floor_i32;

/// Cluster of a point that belongs to none.
pub const NOISE: u16 = u16::MAX;

/// A point to cluster.
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
    /// Column x, y and height z of its cube in the search grid.
    cube: [i16; 3],
    /// In the first point of a column: first point of the next column in the same bucket.
    next: u16,
    core: bool,
}

impl Point {
    /// A point before clustering.
    pub const fn new(position: [f32; 3], radius: f32, weight: u32, id: u16) -> Self {
        Self { position, radius, weight, id, cluster: NOISE, cube: [0; 3], next: NOISE, core: false }
    }
}

/// Buckets of the hashed grid.
const BUCKETS: usize = 8192;

/// Memory of the search: a hashed grid of cubes, and the forest that joins core points (as long as the points).
pub struct Scratch<const N: usize> {
    first: [u16; BUCKETS],
    parents: Vec<u16, N>,
}

impl<const N: usize> Scratch<N> {
    /// Nothing in it.
    pub const fn new() -> Self {
        Self { first: [NOISE; BUCKETS], parents: Vec::new() }
    }
}

impl<const N: usize> Default for Scratch<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[inline]
fn bucket(x: i16, y: i16) -> usize {
    let key = (x as u16 as u32) << 16 | y as u16 as u32;
    (key.wrapping_mul(0x9E37_79B1) >> 16) as usize & (BUCKETS - 1)
}

/// Clusters `points` (at most `N` and 65534), which are reordered; gives the number of clusters. `cube_m` is the side of the search grid [m],
/// best near the typical radius; it has no influence on the result.
pub fn cluster<const N: usize>(points: &mut [Point], scratch: &mut Scratch<N>, cube_m: f32, min_weight: u32) -> u16 {
    let grid = Grid::build(points, &mut scratch.first, cube_m);
    for i in 0..points.len() {
        let mut weight = points[i].weight;
        if weight < min_weight {
            weight = 0;
            grid.for_neighbours(points, i, points.len(), |j, _| {
                weight += points[j].weight;
                weight < min_weight
            });
        }
        points[i].core = weight >= min_weight;
    }
    let parents = &mut scratch.parents;
    parents.clear();
    parents.extend((0..points.len().min(N)).map(|i| i as u16));
    join_cores(points, &grid, parents);
    attach_borders(points, &grid, parents);
    number(points, parents)
}

/// The points, sorted by column and height, so that a search runs along memory.
struct Grid<'a> {
    first: &'a [u16; BUCKETS],
    per_metre: f32,
}

impl<'a> Grid<'a> {
    fn build(points: &mut [Point], first: &'a mut [u16; BUCKETS], cube_m: f32) -> Self {
        first.fill(NOISE);
        let per_metre = 1.0 / cube_m;
        for point in points.iter_mut() {
            point.cube = point.position.map(|v| floor_i32(v * per_metre) as i16);
        }
        points.sort_unstable_by_key(|p| (p.cube, p.id));
        for i in 0..points.len() {
            let [x, y, _] = points[i].cube;
            if i == 0 || points[i - 1].cube[..2] != [x, y] {
                let head = &mut first[bucket(x, y)];
                points[i].next = *head;
                *head = i as u16;
            }
        }
        Self { first, per_metre }
    }

    /// Points of a column, and index of the first of them.
    #[inline]
    fn column<'p>(&self, points: &'p [Point], x: i16, y: i16) -> (usize, &'p [Point]) {
        let mut at = self.first[bucket(x, y)];
        while let Some(point) = points.get(at as usize) {
            if point.cube[..2] == [x, y] {
                return (at as usize, &points[at as usize..]);
            }
            at = point.next;
        }
        (0, &[])
    }

    /// Calls `visit(neighbour, squared distance)` for the neighbours of point `i` among the points before `end`, itself
    /// included, until it says `false`.
    #[inline]
    fn for_neighbours(&self, points: &[Point], i: usize, end: usize, mut visit: impl FnMut(usize, f32) -> bool) {
        let point = &points[i];
        let low = point.position.map(|v| floor_i32((v - point.radius) * self.per_metre) as i16);
        let high = point.position.map(|v| floor_i32((v + point.radius) * self.per_metre) as i16);
        let last_x = points[..end].last().map_or(low[0], |p| p.cube[0]).min(high[0]);
        for x in low[0]..=last_x {
            for y in low[1]..=high[1] {
                let (start, column) = self.column(points, x, y);
                for (offset, other) in column.iter().take(end.saturating_sub(start)).enumerate() {
                    let [ox, oy, oz] = other.cube;
                    if ox != x || oy != y || oz > high[2] {
                        break;
                    }
                    if oz < low[2] {
                        continue;
                    }
                    let d = [0, 1, 2].map(|k| other.position[k] - point.position[k]);
                    let distance2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                    let radius = point.radius.min(other.radius);
                    if distance2 <= radius * radius && !visit(start + offset, distance2) {
                        return;
                    }
                }
            }
        }
    }
}

/// Root of a point's tree; shortens the way for the next time.
fn root(parents: &mut [u16], i: usize) -> usize {
    let mut at = i;
    while parents[at] as usize != at {
        parents[at] = parents[parents[at] as usize];
        at = parents[at] as usize;
    }
    at
}

fn join_cores(points: &[Point], grid: &Grid<'_>, parents: &mut [u16]) {
    for i in 0..points.len() {
        if !points[i].core {
            continue;
        }
        let mut own = root(parents, i);
        grid.for_neighbours(points, i, i, |j, _| {
            if parents[j] as usize != own && points[j].core {
                let other = root(parents, j);
                // The smaller index is the root: the result does not depend on the order of joining.
                let (low, high) = (own.min(other), own.max(other));
                parents[high] = low as u16;
                own = low;
            }
            true
        });
    }
}

fn attach_borders(points: &[Point], grid: &Grid<'_>, parents: &mut [u16]) {
    for i in 0..points.len() {
        if points[i].core {
            continue;
        }
        let mut nearest = (f32::INFINITY, i);
        grid.for_neighbours(points, i, points.len(), |j, distance2| {
            if points[j].core && (distance2, j) < nearest {
                nearest = (distance2, j);
            }
            true
        });
        parents[i] = nearest.1 as u16;
    }
}

fn number(points: &mut [Point], parents: &mut [u16]) -> u16 {
    let mut clusters = 0;
    for i in 0..points.len() {
        if points[i].core && parents[i] as usize == i {
            points[i].cluster = clusters;
            clusters += 1;
        }
    }
    for i in 0..points.len() {
        let top = root(parents, i);
        points[i].cluster = if points[top].core { points[top].cluster } else { NOISE };
    }
    clusters
}
