//! Fences, walls, guard rails and concrete barriers: long things that follow the ground piece by piece.

use nalgebra::{Isometry3, Point2};

use super::{
    random::Random,
    scene::{Finish, Solid, Surface, rod, solid},
    shape::{Hull, Slab, Vec3},
    town::Site,
};

/// A straight fence between two places of the plan.
pub fn add_fence(site: &mut Site, ends: [Point2<f64>; 2], height: f32, half_width: f32, finish: Finish) {
    let surface = Surface::matte(51, 0.33);
    lay(site, ends, |half, drop| {
        let panel = Hull::cuboid([-half, half], [-half_width, half_width], [-drop, height]);
        vec![
            solid(panel, surface.with(finish)),
            rod(surface, [-half, 0.0, -drop], [-half, 0.0, height], 0.05),
        ]
    });
}

/// What keeps vehicles or their noise on a road: a guard rail, a concrete barrier or a high wall.
pub fn add_barrier(site: &mut Site, ends: [Point2<f64>; 2], random: &mut Random) {
    let surface = Surface::matte(51, random.between(0.1, 0.6));
    match random.below(4) {
        0 | 1 => {
            let (low, radius) = (random.between(0.4, 0.6), random.between(0.04, 0.09));
            let rails = 1 + random.below(3);
            lay(site, ends, |half, drop| guard_rail(surface, half, drop, low, radius, rails));
        }
        2 => {
            let (height, foot) = (random.between(0.7, 1.2), random.between(0.15, 0.4));
            lay(site, ends, |half, drop| concrete(surface, half, drop, height, foot));
        }
        _ => {
            let (height, half_width) = (random.between(1.6, 4.5), random.between(0.04, 0.25));
            lay(site, ends, |half, drop| {
                let wall = Hull::cuboid([-half, half], [-half_width, half_width], [-drop, height]);
                let post = rod(surface, [-half, 0.0, -drop], [-half, 0.0, height], 1.3 * half_width);
                vec![solid(wall, surface), post]
            });
        }
    }
}

/// What divides a road: a guard rail or a concrete barrier, narrow enough to drive beside.
pub fn add_median(site: &mut Site, ends: [Point2<f64>; 2], random: &mut Random) {
    let surface = Surface::matte(51, random.between(0.1, 0.6));
    let (low, height) = (random.between(0.4, 0.6), random.between(0.7, 1.2));
    if random.chance(0.6) {
        let rails = 1 + random.below(2);
        lay(site, ends, |half, drop| guard_rail(surface, half, drop, low, 0.08, rails));
    } else {
        lay(site, ends, |half, drop| concrete(surface, half, drop, height, 0.25));
    }
}

/// Corrugated steel on posts, `low` above the ground.
fn guard_rail(surface: Surface, half: f32, drop: f32, low: f32, radius: f32, rails: usize) -> Vec<Solid> {
    let height = |k: usize| low + 2.2 * radius * k as f32;
    let mut solids: Vec<Solid> =
        (0..rails).map(|k| rod(surface, [-half, 0.0, height(k)], [half, 0.0, height(k)], radius)).collect();
    let top = height(rails);
    for x in [-half, 0.0] {
        solids.push(solid(Hull::cuboid([x, x + 0.1], [-0.16, -0.06], [-drop, top]), surface));
    }
    solids
}

/// A wide foot, a slope and a narrow top.
fn concrete(surface: Surface, half: f32, drop: f32, height: f32, foot: f32) -> Vec<Solid> {
    let slab = |half_width: f32, z: f32| Slab { x: [-half, half], y: [-half_width, half_width], z };
    let waist = 0.3 * height;
    vec![
        solid(Hull::between(slab(foot, -drop), slab(foot.min(0.22), waist)), surface),
        solid(Hull::between(slab(foot.min(0.22), waist), slab(0.09, height)), surface),
    ]
}

/// Lays a body between two places, in pieces of 2.5 m: it is given its half length along x and how deep it has to go.
fn lay(site: &mut Site, ends: [Point2<f64>; 2], body: impl Fn(f32, f32) -> Vec<Solid>) {
    let pieces = ((ends[1] - ends[0]).norm() / 2.5).ceil().max(1.0) as usize;
    for piece in 0..pieces {
        let end = |k: usize| site.foot(ends[0] + (ends[1] - ends[0]) * (k as f64 / pieces as f64));
        let (a, b) = (end(piece), end(piece + 1));
        let foot = Vec3::new(0.5 * (a.x + b.x), 0.5 * (a.y + b.y), a.z.max(b.z));
        let pose = Isometry3::new(foot, Vec3::z() * (b.y - a.y).atan2(b.x - a.x));
        let solids = body(0.5 * (b - a).xy().norm(), (a.z - b.z).abs() + 0.1);
        site.solids.extend(solids.iter().map(|solid| solid.moved(&pose)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barriers_stand_in_the_ground_and_reach_as_high_as_they_are_said_to() {
        let surface = Surface::matte(51, 0.3);
        for (body, high) in [
            (guard_rail(surface, 1.25, 0.2, 0.5, 0.08, 2), 0.5 + 4.4 * 0.08),
            (concrete(surface, 1.25, 0.2, 0.9, 0.3), 0.9),
        ] {
            let bounds: Vec<(Vec3, Vec3)> = body.iter().map(|solid| solid.shape.bounds()).collect();
            let low = bounds.iter().map(|b| b.0.z).fold(f32::MAX, f32::min);
            let top = bounds.iter().map(|b| b.1.z).fold(f32::MIN, f32::max);
            assert!((low + 0.2).abs() < 1e-5 && (top - high).abs() < 1e-5, "{low} {top}");
            let length = bounds.iter().map(|b| b.1.x).fold(f32::MIN, f32::max);
            assert!((1.25..1.4).contains(&length) && body.iter().all(|solid| solid.surface == surface));
        }
    }
}
