//! Trees, bushes and hedges: trunks and branches are solid, leaves are clumps that let rays in.

use super::{
    random::Random,
    scene::{Solid, Surface},
    shape::{Shape, Vec3},
};

const LEAVES: Surface =
    Surface { label: 70, instance: 0, reflectance: 0.32, finish: super::scene::Finish::Matte };
const BARK: Surface = Surface { label: 71, reflectance: 0.28, ..LEAVES };
/// SemanticKITTI counts what is inside a crown as vegetation.
const BRANCH: Surface = Surface { reflectance: 0.28, ..LEAVES };

/// A tree in a garden or park: some have leaves from near the ground.
pub fn tree(foot: Vec3, random: &mut Random) -> Vec<Solid> {
    let crown_foot = if random.chance(0.4) { random.between(0.5, 1.3) } else { random.between(2.0, 3.0) };
    let crown = Vec3::new(random.between(1.4, 2.6), random.between(1.6, 3.0), crown_foot);
    grow(foot, crown, random)
}

/// A tree at the kerb: pruned so that people and cars pass below.
pub fn street_tree(foot: Vec3, random: &mut Random) -> Vec<Solid> {
    let crown = Vec3::new(random.between(1.2, 1.9), random.between(1.6, 3.0), random.between(2.2, 3.0));
    grow(foot, crown, random)
}

/// Trunk, some branches, and a crown of clumps with this radius, half height and height of its foot [m].
fn grow(foot: Vec3, crown: Vec3, random: &mut Random) -> Vec<Solid> {
    let (crown_radius, crown_half, crown_foot) = (crown.x, crown.y, crown.z);
    let radius = random.between(0.10, 0.24);
    let lean = Vec3::new(random.between(-0.06, 0.06), random.between(-0.06, 0.06), 1.0);
    let fork = foot + lean * crown_foot;
    let middle = foot + lean * (crown_foot + 0.8 * crown_half);
    let root = foot - Vec3::z() * 0.3;
    let mut solids = vec![
        rod(BARK, root, fork, radius),
        rod(BARK, root, foot + lean * 0.25, 1.35 * radius),
        rod(BRANCH, fork, middle, 0.6 * radius),
    ];
    for _ in 0..4 {
        let tip = middle + in_ball(random).component_mul(&Vec3::new(0.7, 0.7, 0.6)) * crown_radius;
        solids.push(rod(BRANCH, fork, tip, 0.3 * radius));
    }
    let scale = Vec3::new(crown_radius, crown_radius, crown_half);
    let clumps = (9.0 * crown_radius * crown_radius * crown_half.sqrt()) as usize;
    for _ in 0..clumps {
        let size = random.between(0.3, 0.6);
        solids.push(clump(middle + shell(random).component_mul(&scale), size, 0.8 * size, 0.30));
    }
    solids
}

/// A bush of this radius [m] on the ground at `foot`.
pub fn bush(foot: Vec3, radius_m: f32, random: &mut Random) -> Vec<Solid> {
    let scale = Vec3::new(radius_m, radius_m, radius_m * random.between(0.7, 1.1));
    let middle = foot + Vec3::z() * (0.75 * scale.z);
    (0..(7.0 + 9.0 * radius_m) as usize)
        .map(|_| {
            let size = random.between(0.18, 0.36);
            clump(middle + shell(random).component_mul(&scale) * 0.8, size, size, 0.14)
        })
        .collect()
}

/// A hedge from one foot to another, of this height [m].
pub fn hedge(from: Vec3, to: Vec3, height_m: f32, random: &mut Random) -> Vec<Solid> {
    let steps = ((to - from).norm() / 0.35).ceil().max(1.0) as usize;
    let rows = (height_m / 0.45).round().max(1.0) as usize;
    let mut solids = Vec::with_capacity(steps * rows);
    for (step, row) in (0..=steps).flat_map(|s| (0..rows).map(move |r| (s, r))) {
        let foot = from + (to - from) * (step as f32 / steps as f32);
        let z = (row as f32 + 0.5) * height_m / rows as f32;
        let shift =
            Vec3::new(random.between(-0.06, 0.06), random.between(-0.06, 0.06), random.between(-0.05, 0.05));
        solids.push(clump(foot + Vec3::z() * z + shift, random.between(0.26, 0.34), 0.3, 0.10));
    }
    solids
}

fn clump(centre: Vec3, radius_m: f32, half_height_m: f32, free_path_m: f32) -> Solid {
    Solid { shape: Shape::Clump { centre, radius_m, half_height_m, free_path_m }, surface: LEAVES }
}

fn rod(surface: Surface, a: Vec3, b: Vec3, radius_m: f32) -> Solid {
    Solid { shape: Shape::Capsule { a, b, radius_m }, surface }
}

/// Uniform in the unit ball.
fn in_ball(random: &mut Random) -> Vec3 {
    loop {
        let p = Vec3::from_fn(|_, _| random.between(-1.0, 1.0));
        if p.norm_squared() < 1.0 {
            return p;
        }
    }
}

/// In the unit ball, mostly near its surface: leaves grow outside.
fn shell(random: &mut Random) -> Vec3 {
    let p = in_ball(random);
    p * p.norm().powf(-0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::Domain;

    #[test]
    fn plants_are_rooted_and_labelled() {
        let mut random = Random::keyed(5, Domain::Block, &[]);
        let foot = Vec3::new(3.0, 4.0, 1.0);
        for solids in [
            tree(foot, &mut random),
            street_tree(foot, &mut random),
            bush(foot, 0.8, &mut random),
            hedge(foot, foot + Vec3::x() * 4.0, 1.4, &mut random),
        ] {
            let lowest = solids.iter().map(|s| s.shape.bounds().0.z).fold(f32::MAX, f32::min);
            assert!(lowest < foot.z + 0.25, "floats at {lowest}");
            for solid in &solids {
                let is_trunk =
                    !matches!(solid.shape, Shape::Clump { .. }) && solid.shape.bounds().0.z < foot.z;
                assert_eq!(solid.surface.label, if is_trunk { 71 } else { 70 });
            }
        }
    }
}
