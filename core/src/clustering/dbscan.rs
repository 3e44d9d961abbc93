//! DBSCAN (reference [12] of the paper) on weighted points with a radius per point.
//!
//! Exact: with one radius and unit weights it is the textbook algorithm. Two points are neighbours when their distance
//! is at most the smaller of their radii; a point is a core point when the weights of its neighbours, itself included,
//! reach the minimum. Border points join the cluster of their nearest core point.

use heapless::Vec;

use super::radix::{self, Packing};
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
    /// What the caller knows it by.
    pub id: u16,
    /// Result: cluster, or [`NOISE`].
    pub cluster: u16,
    /// Place in the search grid, 16 bits each: column x, y, height z of its cube, zero. In the order of a search.
    key: u64,
    /// In the first point of a column: first point of the next column in the same bucket.
    next: u16,
    /// In the first point of a column: a core point of the one tree that holds all its core points, or [`NOISE`].
    tree: u16,
    core: bool,
}

impl Point {
    /// Column x, y of its cube.
    #[inline]
    fn column(&self) -> u64 {
        self.key >> 32
    }

    #[inline]
    fn cube(&self) -> [u16; 3] {
        [(self.key >> 48) as u16, (self.key >> 32) as u16, (self.key >> 16) as u16]
    }

    /// A point before clustering.
    pub const fn new(position: [f32; 3], radius: f32, weight: u32, id: u16) -> Self {
        Self { position, radius, weight, id, cluster: NOISE, key: 0, next: NOISE, tree: NOISE, core: false }
    }
}

/// Buckets of the hashed grid.
const BUCKETS: usize = 8192;

/// Memory of the search: a hashed grid of cubes, the order of the points, and the forest that joins core points (both as long
/// as the points; the sort needs both).
pub struct Scratch<const N: usize> {
    first: [u16; BUCKETS],
    order: Vec<u16, N>,
    parents: Vec<u16, N>,
}

impl<const N: usize> Scratch<N> {
    /// Nothing in it.
    pub const fn new() -> Self {
        Self { first: [NOISE; BUCKETS], order: Vec::new(), parents: Vec::new() }
    }

    /// Room for as many indices as points, free between two clusterings.
    pub(crate) fn spare(&mut self) -> &mut Vec<u16, N> {
        &mut self.parents
    }
}

impl<const N: usize> Default for Scratch<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[inline]
fn bucket(column: u64) -> usize {
    ((column as u32).wrapping_mul(0x9E37_79B1) >> 16) as usize & (BUCKETS - 1)
}

/// Clusters `points` (at most `N` and 65534), which are reordered; gives the number of clusters. `cube_m` is the side of the search grid [m],
/// best near the typical radius; it has no influence on the result.
pub fn cluster<const N: usize>(
    points: &mut [Point],
    scratch: &mut Scratch<N>,
    cube_m: f32,
    min_weight: u32,
) -> u16 {
    let Scratch { first, order, parents } = scratch;
    let per_metre = 1.0 / cube_m;
    sort_by_cube(points, per_metre, order, parents);
    let grid = Grid::build(points, first, per_metre);
    for i in 0..points.len() {
        let core = grid.is_core(points, i, min_weight);
        if let Some(point) = points.get_mut(i) {
            point.core = core;
        }
    }
    parents.clear();
    for i in 0..points.len().min(N) {
        // As many as fit.
        let _ = parents.push(i as u16);
    }
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
    fn build(points: &mut [Point], first: &'a mut [u16; BUCKETS], per_metre: f32) -> Self {
        first.fill(NOISE);
        let mut before = None;
        for (i, point) in points.iter_mut().enumerate() {
            let column = point.column();
            if before.replace(column) != Some(column) {
                let head = &mut first[bucket(column)];
                point.next = *head;
                *head = i as u16;
            }
        }
        Self { first, per_metre }
    }

    /// Points from the first of a column on, and its index; no points when the column is empty.
    #[inline]
    fn column<'p>(&self, points: &'p [Point], column: u64) -> (usize, &'p [Point]) {
        let mut at = self.first[bucket(column)];
        while let Some(rest @ [point, ..]) = points.get(at as usize..) {
            if point.column() == column {
                return (at as usize, rest);
            }
            at = point.next;
        }
        (0, &[])
    }

    /// Columns and heights that the neighbourhood of a point touches: smallest and largest x, y, z.
    #[inline]
    fn reach(&self, point: &Point) -> ([u64; 3], [u64; 3]) {
        let cube = |sign: f32| point.position.map(|v| lattice(v + sign * point.radius, self.per_metre));
        (cube(-1.0), cube(1.0))
    }

    /// The neighbours of point `i` reach the weight. The point itself and its column come first: they mostly do.
    fn is_core(&self, points: &[Point], i: usize, min_weight: u32) -> bool {
        let Some(point) = points.get(i) else { return false };
        let (low, high) = self.reach(point);
        let own = point.column();
        let columns = (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| x << 16 | y));
        let mut weight = point.weight;
        for column in core::iter::once(own).chain(columns.filter(|c| *c != own)) {
            if weight >= min_weight {
                return true;
            }
            let (start, column) = self.column(points, column);
            for (offset, other, _) in within(column, point, low[2], high[2]) {
                if start + offset != i {
                    weight += other.weight;
                }
            }
        }
        weight >= min_weight
    }

    /// Calls `visit(index of the neighbour, neighbour, squared distance)` for the neighbours of a point, itself included.
    #[inline]
    fn for_neighbours(&self, points: &[Point], point: &Point, mut visit: impl FnMut(usize, &Point, f32)) {
        let (low, high) = self.reach(point);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                let (start, column) = self.column(points, x << 16 | y);
                for (offset, other, distance2) in within(column, point, low[2], high[2]) {
                    visit(start + offset, other, distance2);
                }
            }
        }
    }
}

/// Sorts the points by column and height of their cubes.
fn sort_by_cube<const N: usize>(
    points: &mut [Point],
    per_metre: f32,
    order: &mut Vec<u16, N>,
    spare: &mut Vec<u16, N>,
) {
    order.clear();
    for (i, point) in points.iter_mut().enumerate() {
        let [x, y, z] = point.position.map(|v| lattice(v, per_metre));
        point.key = x << 48 | y << 32 | z << 16;
        // As many as fit.
        let _ = order.push(i as u16);
    }
    let packing = Packing::of(points.iter().map(Point::cube));
    let key = |i: u16| points.get(i as usize).map_or(0, |point| packing.pack(point.cube()));
    radix::sort_by_key(order, spare, packing.bits(), key);
    rearrange(points, order);
}

/// Moves each point to its place: `order` says where the point for each place is. Forgets `order`.
fn rearrange(points: &mut [Point], order: &mut [u16]) {
    for start in 0..order.len() {
        let mut place = start;
        // Round the cycle that goes through `start`.
        while let Some(from) = order.get_mut(place) {
            let source = *from as usize;
            *from = place as u16;
            if source == start || source == place || source >= points.len() || place >= points.len() {
                break;
            }
            points.swap(place, source);
            place = source;
        }
    }
}

/// Lattice coordinate, shifted to be positive.
#[inline]
fn lattice(v: f32, per_metre: f32) -> u64 {
    (floor_i32(v * per_metre) + (1 << 15)).clamp(0, 0xFFFF) as u64
}

/// The points at the start of `column` that belong to it, lie between two heights, and are neighbours of `point`: offset,
/// point and squared distance.
#[inline]
fn within<'p>(
    column: &'p [Point],
    point: &Point,
    low: u64,
    high: u64,
) -> impl Iterator<Item = (usize, &'p Point, f32)> {
    let first = column.first().map_or(0, Point::column);
    let (low, high) = ((first << 16 | low) << 16, (first << 16 | high) << 16 | 0xFFFF);
    let inside =
        column.iter().enumerate().take_while(move |(_, p)| p.key <= high).filter(move |(_, p)| p.key >= low);
    inside.filter_map(move |(offset, other)| {
        let d = [0, 1, 2].map(|k| other.position[k] - point.position[k]);
        let distance2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let radius = point.radius.min(other.radius);
        (distance2 <= radius * radius).then_some((offset, other, distance2))
    })
}

/// Root of a point's tree; shortens the way for the next time.
fn root(parents: &mut [u16], i: usize) -> usize {
    let mut at = i;
    while let Some(&parent) = parents.get(at)
        && parent as usize != at
    {
        let Some(&grandparent) = parents.get(parent as usize) else { break };
        if let Some(place) = parents.get_mut(at) {
            *place = grandparent;
        }
        at = grandparent as usize;
    }
    at
}

/// Joins neighbouring core points, column by column. A finished column whose core points are all in one tree is joined
/// as one: what is in its tree already need not look at it again, what is not needs one neighbour in it.
fn join_cores(points: &mut [Point], grid: &Grid<'_>, parents: &mut [u16]) {
    let mut start = 0;
    while let Some((head, rest)) = points.get(start..).and_then(<[Point]>::split_first) {
        let column = head.column();
        let end = start + 1 + rest.iter().take_while(|p| p.column() == column).count();
        for i in start..end {
            join(points, grid, parents, start, i);
        }
        let of_column = points.get(start..end).unwrap_or_default().iter().enumerate();
        let mut roots = of_column.filter(|(_, p)| p.core).map(|(offset, _)| root(parents, start + offset));
        let first = roots.next();
        let tree = first.filter(|f| roots.all(|r| r == *f)).map_or(NOISE, |f| f as u16);
        if let Some(head) = points.get_mut(start) {
            head.tree = tree;
        }
        start = end;
    }
}

/// Joins point `i` of the column that begins at `own_start`, if it is a core point, with its neighbours before it.
fn join(points: &[Point], grid: &Grid<'_>, parents: &mut [u16], own_start: usize, i: usize) {
    let Some(point) = points.get(i).filter(|p| p.core) else { return };
    let (low, high) = grid.reach(point);
    let mut own = root(parents, i);
    for x in low[0]..=point.column() >> 16 {
        for y in low[1]..=high[1] {
            let (start, column) = grid.column(points, x << 16 | y);
            let Some(head) = column.first().filter(|_| start <= own_start) else { continue };
            let before = column.get(..i.saturating_sub(start)).unwrap_or_default();
            let (column, tree) = if start == own_start { (before, NOISE) } else { (column, head.tree) };
            if tree != NOISE && root(parents, tree as usize) == own {
                continue;
            }
            for (offset, neighbour, _) in within(column, point, low[2], high[2]) {
                if neighbour.core {
                    let other = root(parents, start + offset);
                    // The smaller index is the root: the result does not depend on the order of joining.
                    if let Some(parent) = parents.get_mut(own.max(other)) {
                        *parent = own.min(other) as u16;
                    }
                    own = own.min(other);
                    if tree != NOISE {
                        break;
                    }
                }
            }
        }
    }
}

fn attach_borders(points: &[Point], grid: &Grid<'_>, parents: &mut [u16]) {
    for (i, (point, parent)) in points.iter().zip(parents).enumerate().filter(|(_, (p, _))| !p.core) {
        let mut nearest = (f32::INFINITY, i);
        grid.for_neighbours(points, point, |j, neighbour, distance2| {
            if neighbour.core && (distance2, j) < nearest {
                nearest = (distance2, j);
            }
        });
        *parent = nearest.1 as u16;
    }
}

fn number(points: &mut [Point], parents: &mut [u16]) -> u16 {
    let mut clusters = 0;
    for (i, (point, parent)) in points.iter_mut().zip(parents.iter()).enumerate() {
        if point.core && *parent as usize == i {
            point.cluster = clusters;
            clusters += 1;
        }
    }
    for i in 0..points.len() {
        let top = points.get(root(parents, i)).filter(|top| top.core);
        let cluster = top.map_or(NOISE, |top| top.cluster);
        if let Some(point) = points.get_mut(i) {
            point.cluster = cluster;
        }
    }
    clusters
}
