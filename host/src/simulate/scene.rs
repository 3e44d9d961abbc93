//! Solids with surfaces, and the static scene that rays are cast into.

use std::ops::Range;

use nalgebra::{Isometry3, Vector2};

use super::{
    facade::Facade,
    grid::Grid,
    ground::Ground,
    random::{Random, combine},
    shape::{Hit, Hull, Ray, Shape, Vec3},
};

/// What a solid looks like to a laser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finish {
    /// An ordinary surface.
    Matte,
    /// Glass: most rays vanish.
    Glass,
    /// A mesh or pickets: this share of the rays is stopped.
    Open(f32),
    /// A wall with windows, by its number in the scene.
    Facade(u32),
    /// Paint or foil that sends light back.
    Retro,
}

/// Surface of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// SemanticKITTI id.
    pub label: u16,
    /// Instance number, 0 = none.
    pub instance: u16,
    /// Reflectance, 0 to 1.
    pub reflectance: f32,
    /// What it looks like to a laser.
    pub finish: Finish,
}

impl Surface {
    /// A matte surface of no instance.
    pub fn matte(label: u16, reflectance: f32) -> Self {
        Self { label, instance: 0, reflectance, finish: Finish::Matte }
    }

    /// The same with another finish.
    pub fn with(self, finish: Finish) -> Self {
        Self { finish, ..self }
    }
}

/// A shape with a surface.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Its shape.
    pub shape: Shape,
    /// Its surface.
    pub surface: Surface,
}

impl Solid {
    /// This solid moved from a body's frame into the town's.
    pub fn moved(&self, pose: &Isometry3<f32>) -> Self {
        Self { shape: self.shape.moved(pose), surface: self.surface }
    }
}

/// A convex solid.
pub fn solid(hull: Hull, surface: Surface) -> Solid {
    Solid { shape: Shape::Hull(hull), surface }
}

/// A rod with round ends.
pub fn rod(surface: Surface, from: impl Into<Vec3>, to: impl Into<Vec3>, radius_m: f32) -> Solid {
    Solid { shape: Shape::Capsule { a: from.into(), b: to.into(), radius_m }, surface }
}

/// An upright cylinder around the z axis between two heights.
pub fn drum(surface: Surface, radius_m: f32, z: [f32; 2]) -> Solid {
    let hull = Hull::cuboid([-radius_m, radius_m], [-radius_m, radius_m], z);
    Solid { shape: Shape::Drum { axis: Vec3::zeros(), radius_m, hull }, surface }
}

/// What a ray met.
#[derive(Clone, Copy, Debug)]
pub struct Echo {
    /// Where.
    pub hit: Hit,
    /// On what.
    pub surface: Surface,
}

/// Hash of a ray, from which everything random along it follows.
pub type RayKey = u64;

/// The first of some solids that a ray meets, nearer than `limit_m`. `number` tells the solids apart.
pub fn first_hit<'a>(
    solids: impl Iterator<Item = (u64, &'a Solid)>,
    facades: &[Facade],
    ray: &Ray,
    key: RayKey,
    limit_m: f32,
) -> Option<Echo> {
    let mut best: Option<Echo> = None;
    for (number, solid) in solids {
        let random = || Random::hashed(combine(key, number));
        let Some(mut hit) = solid.shape.hit(ray, random) else { continue };
        let mut surface = solid.surface;
        match surface.finish {
            Finish::Open(share) if !random().chance(share) => continue,
            Finish::Facade(index) => {
                let detail = facades[index as usize].refine(ray, hit);
                (hit, surface.finish) = (detail.hit, detail.finish);
                surface.reflectance *= detail.shade;
            }
            _ => {}
        }
        if hit.range_m < best.map_or(limit_m, |b| b.hit.range_m) {
            best = Some(Echo { hit, surface });
        }
    }
    best
}

/// Everything that stands still.
#[derive(Debug)]
pub struct Scene {
    ground: Ground,
    solids: Vec<Solid>,
    facades: Vec<Facade>,
    grid: Grid,
    /// Lowest and highest ground of each cell [m].
    ground_bounds: Vec<(f32, f32)>,
}

/// Number of the grass among the things that a ray may meet; solids have lower ones.
const BLADES: u64 = 1 << 62;
/// Side of a cell of the scene's grid [m].
const CELL_M: f32 = 2.0;

impl Scene {
    /// Sorts solids into a grid over the ground.
    pub fn new(ground: Ground, solids: Vec<Solid>, facades: Vec<Facade>) -> Self {
        let (origin, size) = ground.extent();
        let bounds: Vec<_> = solids.iter().map(|solid| solid.shape.bounds()).collect();
        let grid = Grid::new(origin, size, CELL_M, &bounds);
        let ground_bounds = (0..grid.len()).map(|c| ground.bounds(grid.corner(c), CELL_M)).collect();
        Self { ground, solids, facades, grid, ground_bounds }
    }

    /// The ground.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// What the ray meets first, nearer than `limit_m`.
    pub fn cast(&self, ray: &Ray, key: RayKey, limit_m: f32) -> Option<Echo> {
        let blades = if self.ground.has_blades() { Random::hashed(combine(key, BLADES)).unit() } else { 0.0 };
        for step in self.grid.walk(ray, limit_m) {
            let lowest = ray.at(step.from_m).z.min(ray.at(step.to_m).z);
            let mut found = None;
            if lowest <= self.grid.top(step.cell) {
                found = self.first_solid(ray, key, step.cell, limit_m);
            }
            // A solid found here may still lie in a later cell: then it will be found again there.
            found = found.filter(|echo: &Echo| echo.hit.range_m <= step.to_m + 0.3);
            if lowest <= self.ground_bounds[step.cell].1 {
                let end = found.map_or(step.to_m, |echo| echo.hit.range_m.min(step.to_m));
                found = self.hit_ground(ray, step.from_m..end, step.cell, blades).or(found);
            }
            if found.is_some() {
                return found;
            }
        }
        None
    }

    fn first_solid(&self, ray: &Ray, key: RayKey, cell: usize, limit_m: f32) -> Option<Echo> {
        let here = self.grid.items(cell).iter().map(|i| (u64::from(*i), &self.solids[*i as usize]));
        first_hit(here, &self.facades, ray, key, limit_m)
    }

    fn hit_ground(&self, ray: &Ray, span: Range<f32>, cell: usize, blades: f32) -> Option<Echo> {
        let span = between_heights(ray, span, self.ground_bounds[cell]);
        if span.is_empty() {
            return None;
        }
        let (hit, cover) = self.ground.hit(ray, span.start, span.end, blades)?;
        Some(Echo { hit, surface: Surface::matte(cover.label, cover.reflectance) })
    }

    /// True if no solid's bounds lie within `radius_m` of a place between two heights [m].
    pub fn is_free(&self, at: Vector2<f32>, radius_m: f32, heights: Range<f32>) -> bool {
        self.grid.cells_near(at, radius_m).all(|cell| {
            self.grid.items(cell).iter().all(|item| {
                let (low, high) = self.solids[*item as usize].shape.bounds();
                let gap = (low.xy() - at).sup(&(at - high.xy())).sup(&Vector2::zeros());
                gap.norm() > radius_m || high.z < heights.start || low.z > heights.end
            })
        })
    }
}

/// The part of a span of ranges in which the ray is between two heights.
fn between_heights(ray: &Ray, span: Range<f32>, (low, high): (f32, f32)) -> Range<f32> {
    let rate = ray.direction.z;
    if rate.abs() < 1e-4 {
        return span;
    }
    let (a, b) = ((low - ray.origin.z) / rate, (high - ray.origin.z) / rate);
    span.start.max(a.min(b))..span.end.min(a.max(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::shape::Vec3;

    #[test]
    fn span_is_cut_where_the_ray_leaves_the_heights() {
        let falling = Ray { origin: Vec3::new(0.0, 0.0, 2.0), direction: Vec3::new(0.8, 0.0, -0.6) };
        let span = between_heights(&falling, 0.0..100.0, (0.2, 1.4));
        assert!((span.start - 1.0).abs() < 1e-6 && (span.end - 3.0).abs() < 1e-6, "{span:?}");
        let rising = Ray { direction: Vec3::new(0.8, 0.0, 0.6), ..falling };
        assert!(between_heights(&rising, 0.0..100.0, (0.2, 1.4)).is_empty());
    }
}
