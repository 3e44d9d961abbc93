//! Vehicles, people and bicycles as a few solids each. Body frame: x forward, y left, z up, origin on the ground.

use super::{
    random::Random,
    scene::{Finish, Solid, Surface, rod, solid},
    shape::{Hull, Slab, Vec3},
};

/// Size and paint of a car.
#[derive(Clone, Copy, Debug)]
pub struct Car {
    /// Length and width [m].
    pub size_m: [f32; 2],
    /// Height of the bonnet line and the roof [m].
    pub heights_m: [f32; 2],
    /// Where the cabin begins and ends at the bonnet line, and at the roof, measured from the middle [m].
    pub cabin_m: [[f32; 2]; 2],
    /// Reflectance of the paint.
    pub paint: f32,
    /// Whether it has lights and bright rims.
    pub bright_parts: bool,
}

impl Car {
    /// Draws a hatchback, saloon, estate or van.
    pub fn draw(random: &mut Random) -> Self {
        let scale = random.between(0.94, 1.06);
        let (length, width, heights_m, cabin) = match random.below(10) {
            0..4 => (4.0, 1.74, [0.92, 1.46], [[-1.95, 1.05], [-1.55, 0.25]]),
            4..7 => (4.6, 1.80, [0.94, 1.44], [[-1.75, 1.00], [-1.05, 0.20]]),
            7..9 => (4.7, 1.82, [0.98, 1.52], [[-2.28, 1.00], [-1.95, 0.25]]),
            _ => (4.9, 1.90, [1.10, 1.95], [[-2.42, 1.75], [-2.35, 1.10]]),
        };
        Self {
            size_m: [length * scale, width],
            heights_m,
            cabin_m: cabin.map(|row| row.map(|c| c * scale)),
            paint: if random.chance(0.5) { random.between(0.02, 0.09) } else { random.between(0.1, 0.5) },
            bright_parts: false,
        }
    }

    /// Its solids: body, bonnet edges, cabin with windows, wheels, plates.
    pub fn solids(&self, label: u16, instance: u16) -> Vec<Solid> {
        let paint = Surface { label, instance, reflectance: self.paint, finish: Finish::Matte };
        let (l, w) = (0.5 * self.size_m[0], 0.5 * self.size_m[1]);
        let [bonnet, roof] = self.heights_m;
        let waist = 0.62 * bonnet;
        let ring = |inset: f32, z: f32| Slab { x: [inset - l, l - inset], y: [inset - w, w - inset], z };
        let [low, high] = self.cabin_m;
        let glass_foot = bonnet + 0.02;
        let cabin = Hull::between(
            Slab { x: low, y: [0.04 - w, w - 0.04], z: glass_foot },
            Slab { x: high, y: [0.22 - w, w - 0.22], z: roof },
        );
        let roof_plate = Hull::cuboid(high, [0.24 - w, w - 0.24], [roof - 0.04, roof + 0.02]);
        let mut solids = vec![
            solid(Hull::between(ring(0.06, 0.20), ring(0.0, waist)), paint),
            solid(Hull::between(ring(0.0, waist), ring(0.07, glass_foot)), paint),
            solid(cabin, paint.with(Finish::Glass)),
            solid(roof_plate, paint),
        ];
        self.add_pillars(&mut solids, paint, glass_foot);
        self.add_wheels(&mut solids, paint);
        self.add_plates(&mut solids, paint);
        if self.bright_parts {
            self.add_bright_parts(&mut solids, paint);
        }
        solids
    }

    /// Lights at the four corners, rims, and a band of trim around the body.
    fn add_bright_parts(&self, solids: &mut Vec<Solid>, paint: Surface) {
        let (l, w) = (0.5 * self.size_m[0], 0.5 * self.size_m[1]);
        let waist = 0.62 * self.heights_m[0];
        let glass = Surface { reflectance: 0.6, ..paint }.with(Finish::Retro);
        let metal = Surface { reflectance: 0.45, ..paint };
        for (x, y) in [(l, w), (l, -w), (-l, w), (-l, -w)] {
            let (inner, axle) = (y - 0.35 * y.signum(), 0.305 * 2.0 * x);
            let span = [inner.min(y), inner.max(y)];
            solids.push(solid(Hull::cuboid([x - 0.04, x + 0.01], span, [waist, waist + 0.16]), glass));
            let rim = Vec3::new(axle, y - 0.05 * y.signum(), 0.31);
            solids.push(solid(Hull::wheel(rim, 0.2, 0.07), metal));
        }
        let trim = Surface { reflectance: 0.08, ..paint };
        solids.push(solid(Hull::cuboid([-l, l], [-w - 0.01, w + 0.01], [waist - 0.12, waist]), trim));
    }

    fn add_pillars(&self, solids: &mut Vec<Solid>, paint: Surface, foot_m: f32) {
        let w = 0.5 * self.size_m[1];
        let [low, high] = self.cabin_m;
        let middle = [0.5 * (low[0] + low[1]), 0.5 * (high[0] + high[1])];
        for side in [-1.0, 1.0] {
            for (from, to) in [(low[0], high[0]), (low[1], high[1]), (middle[0], middle[1])] {
                solids.push(rod(
                    paint,
                    [from, side * (w - 0.06), foot_m],
                    [to, side * (w - 0.24), self.heights_m[1] - 0.02],
                    0.05,
                ));
            }
        }
    }

    fn add_wheels(&self, solids: &mut Vec<Solid>, paint: Surface) {
        let rubber = Surface { reflectance: 0.05, ..paint };
        let (axle, track) = (0.305 * self.size_m[0], 0.5 * self.size_m[1] - 0.09);
        for (x, y) in [(axle, track), (axle, -track), (-axle, track), (-axle, -track)] {
            solids.push(solid(Hull::wheel(Vec3::new(x, y, 0.31), 0.31, 0.1), rubber));
        }
    }

    fn add_plates(&self, solids: &mut Vec<Solid>, paint: Surface) {
        let l = 0.5 * self.size_m[0];
        let plate = Surface { reflectance: 0.9, ..paint }.with(Finish::Retro);
        for x in [l, -l] {
            solids.push(solid(Hull::cuboid([x - 0.02, x + 0.02], [-0.26, 0.26], [0.42, 0.54]), plate));
        }
    }
}

/// A box truck of this length [m].
pub fn truck(length_m: f32, label: u16, instance: u16) -> Vec<Solid> {
    let paint = Surface { label, instance, reflectance: 0.5, finish: Finish::Matte };
    let dark = Surface { reflectance: 0.06, ..paint };
    let (l, cab) = (0.5 * length_m, 0.5 * length_m - 1.9);
    let mut solids = vec![
        solid(Hull::cuboid([-l, cab - 0.1], [-1.2, 1.2], [0.95, 3.3]), paint),
        solid(Hull::cuboid([-l, l - 0.4], [-0.5, 0.5], [0.45, 0.95]), dark),
        solid(Hull::cuboid([cab, l], [-1.1, 1.1], [0.45, 1.5]), paint),
        solid(
            Hull::between(
                Slab { x: [cab, l], y: [-1.1, 1.1], z: 1.5 },
                Slab { x: [cab, l - 0.45], y: [-1.0, 1.0], z: 2.5 },
            ),
            paint.with(Finish::Glass),
        ),
        solid(Hull::cuboid([cab, l - 0.45], [-1.05, 1.05], [2.45, 2.6]), paint),
    ];
    for (x, y) in [(l - 1.0, 0.95), (l - 1.0, -0.95), (1.2 - l, 0.95), (1.2 - l, -0.95)] {
        solids.push(solid(Hull::wheel(Vec3::new(x, y, 0.45), 0.45, 0.15), dark));
    }
    solids
}

/// A person of this height [m]; `stride` is the phase of the step [rad], `swing` its size (0 = standing).
pub fn person(height_m: f32, stride: f32, swing: f32, cloth: f32, label: u16, instance: u16) -> Vec<Solid> {
    let surface = Surface { label, instance, reflectance: cloth, finish: Finish::Matte };
    let h = height_m;
    let mut solids = vec![
        rod(surface, [0.0, 0.0, 0.60 * h], [0.02, 0.0, 0.76 * h], 0.135),
        rod(surface, [0.0, 0.10, 0.79 * h], [0.0, -0.10, 0.79 * h], 0.09),
        rod(surface, [0.03, 0.0, 0.92 * h], [0.03, 0.0, 0.94 * h], 0.105),
    ];
    for side in [-1.0f32, 1.0] {
        let leg = side * swing * stride.sin();
        let lift = 0.08 * swing * (side * stride.cos()).max(0.0);
        let knee = [0.20 * h * leg + 0.04, side * 0.09, 0.28 * h];
        solids.push(rod(surface, [0.0, side * 0.09, 0.51 * h], knee, 0.08));
        solids.push(rod(surface, knee, [0.42 * h * leg, side * 0.09, 0.06 + lift], 0.055));
        let elbow = [-0.12 * h * leg, side * 0.22, 0.62 * h];
        solids.push(rod(surface, [0.0, side * 0.19, 0.79 * h], elbow, 0.05));
        solids.push(rod(surface, elbow, [0.06 - 0.20 * h * leg, side * 0.22, 0.48 * h], 0.042));
    }
    solids
}

/// A bicycle.
pub fn bicycle(label: u16, instance: u16) -> Vec<Solid> {
    let frame = Surface { label, instance, reflectance: 0.3, finish: Finish::Matte };
    let spokes = frame.with(Finish::Open(0.35));
    let (rear, front) = ([-0.52, 0.0, 0.34], [0.53, 0.0, 0.34]);
    let (saddle, head, crank) = ([-0.22, 0.0, 0.92], [0.38, 0.0, 0.88], [-0.08, 0.0, 0.30]);
    let mut solids: Vec<Solid> =
        [rear, front].map(|axle| solid(Hull::wheel(Vec3::from(axle), 0.34, 0.025), spokes)).into();
    let tubes =
        [(rear, saddle), (rear, crank), (crank, saddle), (crank, head), (saddle, head), (head, front)];
    solids.extend(tubes.map(|(from, to)| rod(frame, from, to, 0.022)));
    solids.push(rod(frame, [0.36, 0.27, 1.02], [0.36, -0.27, 1.02], 0.02));
    solids.push(rod(frame, [-0.34, 0.0, 0.95], [-0.12, 0.0, 0.95], 0.06));
    solids
}

/// A cyclist with the bicycle, all of one label as SemanticKITTI has it; `pedal` is the crank's angle [rad].
pub fn cyclist(pedal: f32, cloth: f32, label: u16, instance: u16) -> Vec<Solid> {
    let mut solids = bicycle(label, instance);
    let surface = Surface { label, instance, reflectance: cloth, finish: Finish::Matte };
    solids.push(rod(surface, [-0.20, 0.0, 1.05], [0.10, 0.0, 1.45], 0.15));
    solids.push(rod(surface, [0.20, 0.0, 1.66], [0.20, 0.0, 1.70], 0.11));
    for side in [-1.0f32, 1.0] {
        let phase = pedal + if side > 0.0 { std::f32::consts::PI } else { 0.0 };
        let foot = [-0.08 + 0.17 * phase.cos(), side * 0.12, 0.30 + 0.17 * phase.sin()];
        let knee = [0.20 + 0.06 * phase.cos(), side * 0.12, 0.72 + 0.10 * phase.sin()];
        solids.push(rod(surface, [-0.18, side * 0.10, 0.98], knee, 0.075));
        solids.push(rod(surface, knee, foot, 0.055));
        solids.push(rod(surface, [0.10, side * 0.19, 1.42], [0.36, side * 0.25, 1.05], 0.045));
    }
    solids
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::Domain;

    fn bounds(solids: &[Solid]) -> (Vec3, Vec3) {
        solids
            .iter()
            .map(|s| s.shape.bounds())
            .fold((Vec3::repeat(f32::MAX), Vec3::repeat(f32::MIN)), |(low, high), (a, b)| {
                (low.inf(&a), high.sup(&b))
            })
    }

    #[test]
    fn bodies_stand_on_the_ground_and_have_their_size() {
        let mut random = Random::keyed(1, Domain::Traffic, &[]);
        for _ in 0..50 {
            let car = Car::draw(&mut random);
            let (low, high) = bounds(&car.solids(10, 1));
            assert!(low.z.abs() < 0.03 && (high.z - car.heights_m[1]).abs() < 0.05, "{low} {high}");
            assert!(high.x - low.x < car.size_m[0] + 0.05 && high.y - low.y < car.size_m[1] + 0.05);
        }
        for (solids, height) in [
            (person(1.8, 0.7, 0.6, 0.3, 30, 1), 1.8),
            (bicycle(11, 1), 1.04),
            (cyclist(1.0, 0.3, 31, 1), 1.81),
            (truck(7.5, 18, 1), 3.3),
        ] {
            let (low, high) = bounds(&solids);
            assert!(low.z > -0.05 && low.z < 0.05 && (high.z - height).abs() < 0.06, "{low} {high}");
        }
    }
}
