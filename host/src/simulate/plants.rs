//! Trees, bushes and hedges: trunks and branches are solid, leaves are clumps that let rays in.

use nalgebra::Isometry3;

use super::{
    random::Random,
    scene::{Finish, Solid, Surface, rod, solid},
    shape::{Hull, Shape, Vec3},
};

const LEAVES: Surface = Surface { label: 70, instance: 0, reflectance: 0.32, finish: Finish::Matte };
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

/// A tree of any size and shape: small or large, bare, thin, dense or a conifer.
pub fn varied_tree(foot: Vec3, random: &mut Random) -> Vec<Solid> {
    let size = random.between(0.6, 1.9);
    let height = size * random.between(1.8, 3.4);
    let trunk = Trunk { radius_m: size * random.between(0.06, 0.22), lean: random.between(0.0, 0.12) };
    let crown_foot = random.pick(&[0.2, 0.8, 1.8, 2.5, 3.5, 4.5]) * random.between(0.8, 1.2);
    let crown = Vec3::new(size * random.between(1.0, 2.4), height, crown_foot);
    let leaves = Leaves {
        density: random.pick(&[0.15, 0.5, 0.8, 1.0]),
        clump_m: [0.25, random.between(0.4, 0.9)],
        free_path_m: random.pick(&[0.04, 0.12, 0.3, 0.6]),
        cone: random.chance(0.2),
    };
    let mut solids = grow_as(foot, crown, trunk, leaves, random);
    if random.chance(0.15) {
        // A second stem.
        let lean = Vec3::new(random.between(-0.3, 0.3), random.between(-0.3, 0.3), 1.0);
        solids.push(rod(BARK, foot - Vec3::z() * 0.3, foot + lean * (crown_foot + 0.5), trunk.radius_m));
    }
    solids
}

/// Stem of a tree.
#[derive(Clone, Copy)]
struct Trunk {
    radius_m: f32,
    /// Largest lean along an axis.
    lean: f32,
}

/// How the leaves of a tree grow.
#[derive(Clone, Copy)]
struct Leaves {
    /// Factor on the number of clumps.
    density: f32,
    /// Smallest and largest radius of a clump [m].
    clump_m: [f32; 2],
    free_path_m: f32,
    /// Narrow at the top.
    cone: bool,
}

/// Trunk, some branches, and a crown of clumps with this radius, half height and height of its foot [m].
fn grow(foot: Vec3, crown: Vec3, random: &mut Random) -> Vec<Solid> {
    let trunk = Trunk { radius_m: random.between(0.10, 0.24), lean: 0.06 };
    let leaves = Leaves { density: 1.0, clump_m: [0.3, 0.6], free_path_m: 0.30, cone: false };
    grow_as(foot, crown, trunk, leaves, random)
}

fn grow_as(foot: Vec3, crown: Vec3, trunk: Trunk, leaves: Leaves, random: &mut Random) -> Vec<Solid> {
    let (crown_radius, crown_half, crown_foot) = (crown.x, crown.y, crown.z);
    let Trunk { radius_m: radius, lean } = trunk;
    let lean = Vec3::new(random.between(-lean, lean), random.between(-lean, lean), 1.0);
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
    let clumps = (leaves.density * 9.0 * crown_radius * crown_radius * crown_half.sqrt()) as usize;
    for _ in 0..clumps {
        let size = random.between(leaves.clump_m[0], leaves.clump_m[1]);
        let mut at = shell(random);
        if leaves.cone {
            let narrow = 0.5 * (1.0 - at.z);
            (at.x, at.y) = (at.x * narrow, at.y * narrow);
        }
        solids.push(clump(middle + at.component_mul(&scale), size, 0.8 * size, leaves.free_path_m));
    }
    solids
}

/// A bush of this radius [m] on the ground at `foot`; a ray gets `free_path_m` into it.
pub fn bush(foot: Vec3, radius_m: f32, free_path_m: f32, random: &mut Random) -> Vec<Solid> {
    let scale = Vec3::new(radius_m, radius_m, radius_m * random.between(0.7, 1.1));
    let middle = foot + Vec3::z() * (0.75 * scale.z);
    (0..(7.0 + 9.0 * radius_m) as usize)
        .map(|_| {
            let size = random.between(0.18, 0.36);
            clump(middle + shell(random).component_mul(&scale) * 0.8, size, size, free_path_m)
        })
        .collect()
}

/// A hedge from one foot to another, of this height [m]; a ray gets `free_path_m` into it.
pub fn hedge(from: Vec3, to: Vec3, height_m: f32, free_path_m: f32, random: &mut Random) -> Vec<Solid> {
    let steps = ((to - from).norm() / 0.35).ceil().max(1.0) as usize;
    let rows = (height_m / 0.45).round().max(1.0) as usize;
    let mut solids = Vec::with_capacity(steps * rows);
    for (step, row) in (0..=steps).flat_map(|s| (0..rows).map(move |r| (s, r))) {
        let foot = from + (to - from) * (step as f32 / steps as f32);
        let z = (row as f32 + 0.5) * height_m / rows as f32;
        let shift =
            Vec3::new(random.between(-0.06, 0.06), random.between(-0.06, 0.06), random.between(-0.05, 0.05));
        solids.push(clump(foot + Vec3::z() * z + shift, random.between(0.26, 0.34), 0.3, free_path_m));
    }
    solids
}

/// A trimmed hedge or a strip of undergrowth: smooth or shaggy, one to many shoots thick.
pub fn shrubs(from: Vec3, to: Vec3, height_m: f32, width_m: f32, random: &mut Random) -> Vec<Solid> {
    let size = random.between(0.18, 0.40).min(0.6 * height_m + 0.1);
    let free_path_m = random.pick(&[0.03, 0.06, 0.12, 0.25]);
    let shag_m = random.pick(&[0.03, 0.08, 0.16, 0.3]);
    let (along, pitch) = (to - from, 1.1 * size);
    let across = Vec3::new(-along.y, along.x, 0.0).try_normalize(1e-6).unwrap_or_default();
    let count = |length: f32| (length / pitch).ceil().max(1.0) as usize;
    let (steps, lanes, rows) = (count(along.norm()), count(width_m), count(height_m));
    let mut solids = Vec::with_capacity(steps * lanes * 2);
    for (step, lane, row) in (0..=steps)
        .flat_map(|s| (0..lanes).map(move |l| (s, l)))
        .flat_map(|(s, l)| (0..rows).map(move |r| (s, l, r)))
    {
        // Only what can be seen: the top and the two sides.
        if row + 1 < rows && lane > 0 && lane + 1 < lanes {
            continue;
        }
        let foot = from + along * (step as f32 / steps as f32) + across * (pitch * lane as f32);
        let shift = Vec3::from_fn(|_, _| random.between(-shag_m, shag_m));
        let z = (row as f32 + 0.5) * height_m / rows as f32;
        solids.push(clump(foot + Vec3::z() * z + shift, size, size.min(height_m), free_path_m));
    }
    solids
}

/// A hedge that is clipped often: its sides and top are tight and nearly flat.
pub fn clipped(from: Vec3, to: Vec3, height_m: f32, width_m: f32, random: &mut Random) -> Vec<Solid> {
    let along = to - from;
    let turn = Vec3::z() * along.y.atan2(along.x);
    let (depth_m, open) = (random.between(0.015, 0.08), random.between(0.2, 0.7));
    let pieces = (along.norm() / random.between(0.4, 1.5)).ceil().max(1.0);
    let half = 0.5 * along.norm() / pieces;
    let mut solids = Vec::new();
    for piece in 0..pieces as usize {
        let uneven = [(); 3].map(|()| random.between(-0.03, 0.03));
        let foot = from + along * ((piece as f32 + 0.5) / pieces);
        let pose = Isometry3::new(foot, turn);
        // Between the outer leaves some rays find those behind.
        for (inside_m, finish) in
            [(0.0, Finish::Open(open)), (depth_m, Finish::Open(0.6)), (2.5 * depth_m, Finish::Matte)]
        {
            let (low, high) = (uneven[0] + inside_m, width_m + uneven[1] - inside_m);
            let top = height_m + uneven[2] - inside_m;
            if high > low && top > 0.0 {
                let hull = Hull::cuboid([-half, half], [low, high], [0.0, top]);
                let surface = LEAVES.with(finish);
                solids.push(solid(hull, surface).moved(&pose));
            }
        }
    }
    solids
}

fn clump(centre: Vec3, radius_m: f32, half_height_m: f32, free_path_m: f32) -> Solid {
    Solid { shape: Shape::Clump { centre, radius_m, half_height_m, free_path_m }, surface: LEAVES }
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
            varied_tree(foot, &mut random),
            shrubs(foot, foot + Vec3::x() * 3.0, 0.7, 1.5, &mut random),
            bush(foot, 0.8, 0.14, &mut random),
            hedge(foot, foot + Vec3::x() * 4.0, 1.4, 0.10, &mut random),
            clipped(foot, foot + Vec3::y() * 4.0, 1.4, 0.8, &mut random),
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
