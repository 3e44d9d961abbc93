//! Street furniture of varied towns: poles, signs, people and things that have no class. The body faces along x.

use std::f32::consts::FRAC_PI_2;

use nalgebra::Isometry3;

use super::{
    bodies,
    random::Random,
    scene::{Finish, Solid, Surface, drum, rod, solid},
    shape::{Hull, Vec3},
};

/// A lamp, traffic light, flag pole or bollard.
pub fn pole(random: &mut Random) -> Vec<Solid> {
    let steel = Surface::matte(80, random.between(0.05, 0.75));
    let radius = random.between(0.035, 0.14);
    match random.below(10) {
        0..3 => {
            let height = random.between(0.7, 1.3);
            vec![rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, height], radius)]
        }
        3..6 => {
            let height = random.between(2.2, 4.5);
            let mut solids = vec![rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, height], radius)];
            let size = random.between(0.12, 0.3);
            let head = Vec3::new(0.0, 0.0, height);
            solids.push(cuboid(steel, head, [size, size, random.between(0.2, 0.5)]));
            solids
        }
        _ => tall_pole(steel, radius, random),
    }
}

/// A pole higher than the scan, with a thicker foot and sometimes an arm.
fn tall_pole(steel: Surface, radius: f32, random: &mut Random) -> Vec<Solid> {
    let height = random.between(4.0, 10.0);
    let mut solids = vec![rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, height], radius)];
    if random.chance(0.6) {
        let foot = random.between(0.5, 1.4);
        solids.push(rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, foot], 1.5 * radius));
    }
    if random.chance(0.6) {
        let (reach, rise) = (random.between(0.8, 3.0), random.between(0.0, 0.4));
        solids.push(rod(steel, [0.0, 0.0, height], [-reach, 0.0, height + rise], 0.04));
    }
    if random.chance(0.3) {
        // A traffic light.
        let at = Vec3::new(0.15, 0.0, random.between(2.2, 3.0));
        solids.push(cuboid(steel, at, [0.15, 0.15, 0.45]));
    }
    solids
}

/// A traffic sign, of any size and height, on one post or two.
pub fn sign(random: &mut Random) -> Vec<Solid> {
    let post = Surface::matte(80, random.between(0.1, 0.4));
    let face = Surface::matte(81, random.between(0.6, 0.99)).with(Finish::Retro);
    let back = Surface::matte(81, random.between(0.08, 0.4));
    let (half, tall) = match random.below(6) {
        0..4 => (random.between(0.2, 0.45), random.between(0.2, 0.5)),
        4 => (random.between(0.4, 0.7), random.between(0.2, 0.5)),
        _ => (random.between(0.2, 0.4), random.between(0.5, 1.1)),
    };
    let foot = random.pick(&[0.5, 0.9, 1.7, 2.0, 2.2, 2.4]) + random.between(-0.2, 0.3);
    let round = random.chance(0.4);
    let tall = if round { half } else { tall };
    let plate = |x: [f32; 2], surface| {
        if round {
            let quarter = Isometry3::new(Vec3::zeros(), Vec3::z() * FRAC_PI_2);
            let middle = Vec3::new(0.0, -0.5 * (x[0] + x[1]), foot + half);
            let disc = Hull::wheel(middle, half, 0.5 * (x[1] - x[0]));
            return solid(disc, surface).moved(&quarter);
        }
        let board = Hull::cuboid(x, [-half, half], [foot, foot + 2.0 * tall]);
        solid(board, surface)
    };
    let mut solids = vec![plate([0.05, 0.07], face), plate([0.03, 0.05], back)];
    let radius = random.between(0.03, 0.06);
    let posts: &[f32] = if half > 0.6 { &[-0.8, 0.8] } else { &[0.0] };
    for share in posts {
        let y = share * half;
        solids.push(rod(post, [0.0, y, -0.2], [0.0, y, foot + 2.0 * tall], radius));
    }
    solids
}

/// Someone who stands or sits about, tall or small, sometimes with a bag or a pram.
pub fn bystander(instance: u16, random: &mut Random) -> Vec<Solid> {
    let cloth = random.between(0.08, 0.6);
    let height = if random.chance(0.12) { random.between(1.0, 1.5) } else { random.between(1.5, 1.95) };
    let (stride, swing) = (random.between(0.0, 6.3), random.pick(&[0.0, 0.25, 0.55]));
    let mut solids = bodies::person(height, stride, swing, cloth, 30, instance);
    let surface = Surface { label: 30, instance, reflectance: cloth, finish: Finish::Matte };
    if random.chance(0.5) {
        // A coat: people are wider than their limbs.
        let (low, high) = (random.between(0.35, 0.5) * height, 0.8 * height);
        solids.push(rod(surface, [0.0, 0.0, low], [0.0, 0.0, high], random.between(0.16, 0.24)));
    }
    if random.chance(0.3) {
        let at = Vec3::new(random.between(-0.3, 0.3), random.between(-0.3, 0.3), 0.5);
        solids.push(cuboid(surface, at, [0.12, 0.18, 0.2]));
    }
    solids
}

/// Something without a class: a bin, bench, box, planter, table, kiosk, hydrant or heap.
pub fn object(random: &mut Random) -> Vec<Solid> {
    let surface = Surface::matte(99, random.between(0.08, 0.5));
    let size = |low: f32, high: f32, random: &mut Random| 0.5 * random.between(low, high);
    match random.below(5) {
        0 => {
            let (x, y, z) = (size(0.3, 0.7, random), size(0.3, 0.7, random), size(0.8, 1.3, random));
            vec![cuboid(surface, Vec3::z() * z, [x, y, z])]
        }
        1 => {
            let half = size(1.2, 2.0, random);
            let seat = cuboid(surface, Vec3::z() * 0.42, [0.22, half, 0.03]);
            let back = cuboid(surface, Vec3::new(-0.22, 0.0, 0.65), [0.03, half, 0.18]);
            let foot = |y: f32| cuboid(surface, Vec3::new(0.0, y, 0.2), [0.2, 0.05, 0.22]);
            vec![seat, back, foot(0.8 * half), foot(-0.8 * half)]
        }
        2 => {
            let (x, y, z) = (size(1.0, 2.5, random), size(0.6, 1.5, random), size(0.8, 2.2, random));
            vec![cuboid(surface, Vec3::z() * z, [x, y, z])]
        }
        3 => {
            let (x, z) = (size(0.6, 1.0, random), random.between(0.68, 1.0));
            let top = cuboid(surface, Vec3::z() * z, [x, x, 0.03]);
            vec![top, rod(surface, [0.0; 3], [0.0, 0.0, z], 0.05)]
        }
        _ => shelter(surface, random),
    }
}

/// A kiosk, a container or a screen of boards: built, but no house.
pub fn kiosk(random: &mut Random) -> Vec<Solid> {
    let surface = Surface::matte(50, random.between(0.1, 0.7));
    let depth_m = if random.chance(0.5) { random.between(0.06, 0.3) } else { random.between(0.3, 3.0) };
    let half = [0.5 * depth_m, 0.5 * random.between(1.2, 5.0)];
    let (foot, top) = (random.pick(&[0.0, 0.0, 0.4, 0.8]), random.between(1.9, 3.4));
    let middle = Vec3::z() * (0.5 * (foot + top));
    let mut solids = vec![cuboid(surface, middle, [half[0], half[1], 0.5 * (top - foot)])];
    for share in [-0.8, 0.8] {
        solids.push(rod(surface, [0.0, share * half[1], -0.2], [0.0, share * half[1], top], 0.06));
    }
    if random.chance(0.5) {
        // An eave, a counter or a poster.
        let surface = Surface::matte(50, random.between(0.1, 0.8));
        let at = Vec3::new(random.pick(&[-1.0, 1.0]) * half[0], 0.0, random.between(0.8, top));
        solids.push(cuboid(
            surface,
            at,
            [random.between(0.05, 0.6), 0.7 * half[1], random.between(0.03, 0.4)],
        ));
    }
    solids
}

/// An advertising panel on two legs or on a central one.
pub fn board(random: &mut Random) -> Vec<Solid> {
    let surface = Surface::matte(50, random.between(0.1, 0.8));
    let leg = Surface::matte(80, random.between(0.1, 0.4));
    let half = [0.5 * random.between(0.05, 0.25), 0.5 * random.between(1.0, 1.9)];
    let foot = if random.chance(0.7) { random.between(0.3, 0.9) } else { random.between(0.9, 2.2) };
    let top = foot + random.between(1.2, 2.2);
    let mut solids =
        vec![cuboid(surface, Vec3::z() * (0.5 * (foot + top)), [half[0], half[1], 0.5 * (top - foot)])];
    if random.chance(0.4) {
        // A frame that stands out.
        let size = [half[0] + 0.03, half[1] + 0.02, 0.05];
        solids.extend([foot, top].map(|z| cuboid(surface, Vec3::z() * z, size)));
    }
    let (places, thick): (&[f32], _) =
        if random.chance(0.5) { (&[-0.8, 0.8], [0.02, 0.06]) } else { (&[0.0], [0.06, 0.2]) };
    let radius = random.between(thick[0], thick[1]);
    for share in places {
        let y = share * half[1];
        solids.push(rod(leg, [0.0, y, -0.2], [0.0, y, foot], radius));
    }
    solids
}

/// An advertising column: a cylinder, sometimes with a foot and a cap that stand out.
pub fn column(random: &mut Random) -> Vec<Solid> {
    let surface = Surface::matte(50, random.between(0.15, 0.8));
    let (radius, height) = (random.between(0.4, 0.75), random.between(2.2, 3.6));
    let out = random.between(0.03, 0.2);
    let mut solids = vec![drum(surface, radius, [-0.3, height])];
    if random.chance(0.6) {
        solids.push(drum(surface, radius + out, [height - 0.2, height + random.between(0.0, 0.15)]));
        solids.push(drum(surface, radius + 0.5 * out, [-0.3, random.between(0.1, 0.5)]));
    }
    if random.chance(0.4) {
        solids.push(rod(surface, [0.0, 0.0, height - 0.2], [0.0, 0.0, height - 0.1], 0.8 * radius));
    }
    solids
}

/// A shelter at a stop: glass walls, a roof.
fn shelter(surface: Surface, random: &mut Random) -> Vec<Solid> {
    let (half, height) = (random.between(1.0, 2.2), random.between(2.2, 2.6));
    let surface = Surface { label: 52, ..surface };
    let wall = |centre: Vec3, size| cuboid(surface.with(Finish::Glass), centre, size);
    let middle = 0.5 * height;
    vec![
        cuboid(surface, Vec3::z() * height, [0.8, half, 0.06]),
        wall(Vec3::new(-0.75, 0.0, middle), [0.02, half, middle - 0.1]),
        wall(Vec3::new(0.0, half, middle), [0.7, 0.02, middle - 0.1]),
        wall(Vec3::new(0.0, -half, middle), [0.7, 0.02, middle - 0.1]),
    ]
}

fn cuboid(surface: Surface, centre: Vec3, half: [f32; 3]) -> Solid {
    let span = |k: usize| [centre[k] - half[k], centre[k] + half[k]];
    solid(Hull::cuboid(span(0), span(1), span(2)), surface)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::Domain;

    /// Lowest and highest point of a body [m].
    fn reach(body: &[Solid]) -> [f32; 2] {
        let bounds = body.iter().map(|s| s.shape.bounds());
        bounds.fold([f32::MAX, f32::MIN], |[low, high], (a, b)| [low.min(a.z), high.max(b.z)])
    }

    #[test]
    fn furniture_is_rooted_and_has_its_labels() {
        let mut random = Random::keyed(4, Domain::Kerb, &[]);
        for _ in 0..100 {
            for (body, labels, lowest, highest) in [
                (pole(&mut random), &[80][..], 0.6, 10.7),
                (sign(&mut random), &[80, 81], 0.6, 5.1),
                (bystander(3, &mut random), &[30], 0.9, 2.0),
                (object(&mut random), &[52, 99], 0.6, 4.2),
                (kiosk(&mut random), &[50], 1.8, 3.9),
                (board(&mut random), &[50, 80], 1.4, 4.5),
                (column(&mut random), &[50], 2.1, 4.2),
            ] {
                let [low, high] = reach(&body);
                assert!(low < 0.12 && (lowest..highest).contains(&high), "{labels:?} {low} {high}");
                assert!(body.iter().all(|s| labels.contains(&s.surface.label)));
            }
        }
    }

    #[test]
    fn only_the_front_of_a_sign_shines() {
        let mut random = Random::keyed(5, Domain::Kerb, &[]);
        let body = sign(&mut random);
        let (shining, dull): (Vec<_>, Vec<_>) = body.iter().partition(|s| s.surface.finish == Finish::Retro);
        let front = |solids: &[&Solid]| solids.iter().map(|s| s.shape.bounds().1.x).fold(f32::MIN, f32::max);
        assert!(front(&shining) > front(&dull) && shining.iter().all(|s| s.surface.label == 81));
    }
}
