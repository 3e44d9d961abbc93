//! Parked vehicles of many kinds for varied towns. Body frame: x forward, y left, z up, origin on the ground.

use super::{
    bodies::{self, Car},
    random::Random,
    scene::{Finish, Solid, Surface, rod, solid},
    shape::{Hull, Slab, Vec3},
};

/// SemanticKITTI ids.
const CAR: u16 = 10;
const MOTORCYCLE: u16 = 15;
const TRUCK: u16 = 18;
const OTHER_VEHICLE: u16 = 20;

/// A vehicle as it may stand at a kerb or in a car park.
pub fn parked(instance: u16, random: &mut Random) -> Vec<Solid> {
    match random.below(20) {
        0..13 => varied_car(random).solids(CAR, instance),
        13..17 => van(CAR, instance, random),
        17 => bodies::truck(random.between(5.5, 9.0), TRUCK, instance),
        18 => van(TRUCK, instance, random),
        _ => trailer(instance, random),
    }
}

/// A vehicle that is taller than the sensor sees: what is left in the image is a wall with windows.
pub fn tall(instance: u16, random: &mut Random) -> Vec<Solid> {
    match random.below(5) {
        0 | 1 => van(CAR, instance, random),
        2 => van(TRUCK, instance, random),
        3 => bodies::truck(random.between(5.5, 9.0), TRUCK, instance),
        _ => bus(instance, random),
    }
}

/// A bus or a coach.
fn bus(instance: u16, random: &mut Random) -> Vec<Solid> {
    let reflectance = random.between(0.05, 0.6);
    let paint = Surface { label: OTHER_VEHICLE, instance, reflectance, finish: Finish::Matte };
    let (l, w) = (0.5 * random.between(6.5, 12.5), 0.5 * random.between(2.2, 2.55));
    let (sill, lintel, top) = (random.between(0.9, 1.6), random.between(2.0, 2.5), random.between(2.7, 3.4));
    let mut solids = vec![
        solid(Hull::cuboid([-l, l], [-w, w], [0.3, sill]), paint),
        solid(
            Hull::cuboid([0.05 - l, l - 0.05], [0.05 - w, w - 0.05], [sill, lintel]),
            paint.with(Finish::Glass),
        ),
        solid(Hull::cuboid([-l, l], [-w, w], [lintel, top]), paint),
    ];
    let pillars = 3 + random.below(6);
    for k in 0..=pillars {
        let x = (l - 0.1) * (2.0 * k as f32 / pillars as f32 - 1.0);
        solids.push(solid(Hull::cuboid([x - 0.08, x + 0.08], [-w, w], [sill, lintel]), paint));
    }
    for (x, y) in [(0.6, 0.9), (0.6, -0.9), (-0.5, 0.9), (-0.5, -0.9)] {
        solids.push(solid(Hull::wheel(Vec3::new(x * l, y * w, 0.5), 0.5, 0.15), paint));
    }
    solids
}

/// A car whose proportions and paint spread wider than those of [`Car::draw`].
pub fn varied_car(random: &mut Random) -> Car {
    let mut car = Car::draw(random);
    let stretch = random.between(0.88, 1.08);
    car.size_m = [car.size_m[0] * stretch, car.size_m[1] * random.between(0.93, 1.06)];
    car.cabin_m = car.cabin_m.map(|row| row.map(|c| c * stretch));
    let lift = random.between(-0.06, 0.22);
    car.heights_m = [car.heights_m[0] + 0.5 * lift, car.heights_m[1] + lift];
    car.bright_parts = random.chance(0.7);
    car.paint = match random.below(10) {
        0..6 => random.between(0.003, 0.045),
        6..8 => random.between(0.05, 0.15),
        _ => random.between(0.15, 0.7),
    };
    car
}

/// A delivery van or minibus.
pub fn van(label: u16, instance: u16, random: &mut Random) -> Vec<Solid> {
    let reflectance = random.pick(&[0.03, 0.1, 0.3, 0.45, 0.6]);
    let paint = Surface { label, instance, reflectance, finish: Finish::Matte };
    let dark = Surface { reflectance: 0.04, ..paint };
    let (l, w) = (0.5 * random.between(4.6, 6.8), 0.5 * random.between(1.85, 2.1));
    let (waist, top) = (random.between(1.05, 1.3), random.between(1.9, 2.8));
    let nose = l - random.between(0.3, 0.9);
    let mut solids = vec![
        solid(Hull::cuboid([-l, l], [-w, w], [0.25, 0.85 * waist]), paint),
        solid(Hull::cuboid([-l, nose], [-w, w], [0.85 * waist, waist]), paint),
        solid(Hull::cuboid([-l, nose - 1.3], [-w, w], [top - 0.3, top]), paint),
        solid(
            Hull::between(
                Slab { x: [nose - 1.4, nose], y: [-w, w], z: waist },
                Slab { x: [nose - 1.4, nose - 0.7], y: [0.1 - w, w - 0.1], z: top - 0.1 },
            ),
            paint.with(Finish::Glass),
        ),
    ];
    let sides = if random.chance(0.3) { paint.with(Finish::Glass) } else { paint };
    solids.push(solid(Hull::cuboid([-l, nose - 1.4], [0.02 - w, w - 0.02], [waist, top - 0.3]), sides));
    for (x, y) in [(0.6, 0.9), (0.6, -0.9), (-0.6, 0.9), (-0.6, -0.9)] {
        solids.push(solid(Hull::wheel(Vec3::new(x * l, y * w, 0.34), 0.34, 0.11), dark));
    }
    solids
}

/// A trailer or a caravan.
fn trailer(instance: u16, random: &mut Random) -> Vec<Solid> {
    let reflectance = random.between(0.1, 0.6);
    let paint = Surface { label: OTHER_VEHICLE, instance, reflectance, finish: Finish::Matte };
    let (l, w) = (0.5 * random.between(2.5, 5.5), 0.5 * random.between(1.5, 2.2));
    let top = random.between(0.9, 2.6);
    let mut solids = vec![solid(Hull::cuboid([-l, l], [-w, w], [0.5, top]), paint)];
    solids.push(rod(paint, [l, 0.0, 0.5], [l + 1.2, 0.0, 0.5], 0.05));
    for y in [-0.9, 0.9] {
        solids.push(solid(Hull::wheel(Vec3::new(0.0, y * w, 0.3), 0.3, 0.1), paint));
    }
    solids
}

/// A motorcycle or scooter on its stand.
pub fn motorcycle(instance: u16, random: &mut Random) -> Vec<Solid> {
    let reflectance = random.between(0.03, 0.4);
    let paint = Surface { label: MOTORCYCLE, instance, reflectance, finish: Finish::Matte };
    let seat = random.between(0.72, 0.85);
    let mut solids: Vec<Solid> =
        [-0.65, 0.68].map(|x| solid(Hull::wheel(Vec3::new(x, 0.0, 0.3), 0.3, 0.06), paint)).into();
    solids.push(solid(Hull::cuboid([-0.5, 0.35], [-0.14, 0.14], [0.3, seat]), paint));
    solids.push(solid(Hull::cuboid([-0.85, -0.1], [-0.12, 0.12], [seat - 0.08, seat + 0.04]), paint));
    solids.push(rod(paint, [0.68, 0.0, 0.35], [0.42, 0.0, 1.0], 0.06));
    solids.push(rod(paint, [0.40, 0.33, 1.05], [0.40, -0.33, 1.05], 0.03));
    if random.chance(0.4) {
        solids.push(solid(Hull::cuboid([0.3, 0.6], [-0.18, 0.18], [0.7, 1.2]), paint));
    }
    solids
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::Domain;

    #[test]
    fn vehicles_stand_on_the_ground_and_have_one_label_each() {
        let mut random = Random::keyed(3, Domain::Kerb, &[]);
        let mut labels = std::collections::BTreeSet::new();
        for k in 0..200 {
            let body = match k % 10 {
                0 => motorcycle(7, &mut random),
                1 => tall(7, &mut random),
                _ => parked(7, &mut random),
            };
            let low = body.iter().map(|s| s.shape.bounds().0.z).fold(f32::MAX, f32::min);
            let high = body.iter().map(|s| s.shape.bounds().1.z).fold(f32::MIN, f32::max);
            assert!(low.abs() < 0.06 && (0.85..3.5).contains(&high), "{low} {high}");
            let label = body[0].surface.label;
            assert!(body.iter().all(|s| s.surface.label == label && s.surface.instance == 7));
            labels.insert(label);
        }
        assert_eq!(labels.into_iter().collect::<Vec<_>>(), [CAR, MOTORCYCLE, TRUCK, OTHER_VEHICLE]);
    }
}
