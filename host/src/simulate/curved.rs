//! Buildings of varied towns that are round: bowed and hollow fronts, corner towers, rotundas.

use nalgebra::{Isometry3, Point3, Vector2};

use super::{
    facade::Facade,
    open_blocks::{Yard, any_direction},
    random::Random,
    scene::{Finish, Solid, Surface, rod, solid},
    shape::{Hull, Shape, Vec3},
    town::Site,
};

/// Where a house stands; in its frame x runs along the street, which lies at negative y.
#[derive(Clone, Copy, Debug)]
pub struct Plot {
    /// Frame of the house in the town, on its floor.
    pub pose: Isometry3<f32>,
    /// Half length and half depth [m].
    pub half_m: [f32; 2],
    /// Foot of the foundations and top of the walls [m].
    pub z_m: [f32; 2],
    /// Front to sidewalk [m].
    pub room_m: f32,
    /// Of its walls.
    pub surface: Surface,
}

/// An upright cylinder in the frame of a plot, cut by a box.
#[derive(Clone, Copy, Debug)]
struct Round {
    axis: Vec3,
    radius_m: f32,
    /// The box, from and to along x and y [m].
    x: [f32; 2],
    y: [f32; 2],
}

impl Round {
    /// A whole cylinder.
    fn whole(axis: Vec3, radius_m: f32) -> Self {
        let span = |c: f32| [c - radius_m, c + radius_m];
        Self { axis, radius_m, x: span(axis.x), y: span(axis.y) }
    }

    /// The same, larger on all sides by `out_m`, between two heights.
    fn solid(&self, surface: Surface, out_m: f32, z: [f32; 2]) -> Solid {
        let wider = |[low, high]: [f32; 2]| [low - out_m, high + out_m];
        let hull = Hull::cuboid(wider(self.x), wider(self.y), z);
        Solid { shape: Shape::Drum { axis: self.axis, radius_m: self.radius_m + out_m, hull }, surface }
    }

    /// A point on the wall, at an angle from the middle of the front and this far before it [m].
    fn at(&self, angle: f32, out_m: f32, z: f32) -> Vec3 {
        let reach = self.radius_m + out_m;
        Vec3::new(self.axis.x + reach * angle.sin(), self.axis.y - reach * angle.cos(), z)
    }
}

/// A house with a bowed or a hollow front, or a tower.
pub fn build(site: &mut Site, plot: &Plot, random: &mut Random) {
    let [half_length, half_depth] = plot.half_m;
    let front = -half_depth;
    match random.below(10) {
        0..4 => {
            let radius_m = half_length * random.between(1.02, 2.2);
            let axis = Vec3::new(0.0, front + radius_m, 0.0);
            let round = Round { axis, radius_m, x: [-half_length, half_length], y: [front, half_depth] };
            add_round(site, plot, &round, random);
        }
        4..6 => {
            let radius_m = half_length.min(half_depth);
            let round = Round::whole(Vec3::new(0.0, front + radius_m, 0.0), radius_m);
            add_round(site, plot, &round, random);
        }
        _ => add_hollow(site, plot, random),
    }
}

/// A round tower at a front corner of a house, a little higher than it.
pub fn add_turret(site: &mut Site, plot: &Plot, random: &mut Random) {
    let radius_m = random.between(1.3, 3.5).min(plot.half_m[0]);
    let out_m = (0.5 * radius_m).min(plot.room_m + 0.2);
    let x = random.pick(&[-1.0, 1.0]) * (plot.half_m[0] - random.between(0.3, 1.0) * radius_m);
    let axis = Vec3::new(x, radius_m - out_m - plot.half_m[1], 0.0);
    let plot = Plot { z_m: [plot.z_m[0], plot.z_m[1] + random.between(0.5, 4.0)], room_m: out_m, ..*plot };
    add_round(site, &plot, &Round::whole(axis, radius_m), random);
}

/// A round building that stands alone in an open place.
pub fn add_rotunda(site: &mut Site, yard: &Yard, random: &mut Random) {
    let size = yard.high - yard.low;
    let widest = 0.35 * size.x.min(size.y) as f32;
    if widest < 3.5 {
        return;
    }
    let radius_m = random.between(3.0, widest.min(20.0));
    // Mostly near a street, where it is seen.
    let reach = (size * 0.5).add_scalar(-f64::from(radius_m) - 1.0);
    let share = Vector2::new(random.between(-1.0, 1.0), random.pick(&[-1.0, 1.0, 0.0]));
    let at = yard.low + size * 0.5 + reach.component_mul(&share.cast());
    let around = [0.0f64, 1.6, 3.1, 4.7].map(|a| Vector2::new(a.cos(), a.sin()) * f64::from(radius_m));
    let feet = around.map(|step| site.foot(at + step).z);
    let floor = feet.iter().copied().fold(f32::MIN, f32::max);
    let lowest = feet.iter().copied().fold(f32::MAX, f32::min);
    let q = site.plan.town_from_plan(at);
    let facing = any_direction(random);
    let plot = Plot {
        pose: Isometry3::new(
            Vec3::new(q.x as f32, q.y as f32, floor),
            Vec3::z() * site.plan.heading(at, facing) as f32,
        ),
        half_m: [radius_m; 2],
        z_m: [lowest - floor - 0.5, random.between(4.0, 16.0)],
        room_m: 1.0,
        surface: Surface::matte(50, random.between(0.1, 0.7)),
    };
    add_round(site, &plot, &Round::whole(Vec3::zeros(), radius_m), random);
}

/// Walls with windows, a roof, ledges and pillars.
fn add_round(site: &mut Site, plot: &Plot, round: &Round, random: &mut Random) {
    let [foot, top] = plot.z_m;
    let centre = (plot.pose * Point3::from(round.axis)).coords;
    let front = plot.pose.rotation * -Vec3::y();
    let mut facade = Facade::draw(centre, front.xy(), plot.half_m, top, random);
    facade.vary(random);
    facade.round_m = round.radius_m;
    let walls = plot.surface.with(Finish::Facade(site.facades.len() as u32));
    site.facades.push(facade);
    let mut parts = vec![round.solid(walls, 0.0, [foot, top])];
    let eave = random.between(0.0, 0.5);
    parts.push(round.solid(Surface::matte(50, 0.22), eave, [top, top + random.between(0.2, 0.6)]));
    add_bands(&mut parts, plot, round, facade.storey_m, random);
    add_pillars(&mut parts, plot, round, random);
    site.solids.extend(parts.iter().map(|part| part.moved(&plot.pose)));
}

/// Ledges around each storey or some of them, and a plinth.
fn add_bands(parts: &mut Vec<Solid>, plot: &Plot, round: &Round, storey_m: f32, random: &mut Random) {
    let surface = Surface::matte(50, random.between(0.1, 0.8));
    let (out, tall) = (random.between(0.03, 0.35), random.between(0.1, 0.6));
    let share = random.pick(&[0.0, 0.4, 1.0]);
    let mut z = 0.3;
    while z + tall < plot.z_m[1] {
        if random.chance(share) {
            parts.push(round.solid(surface, out, [z, z + tall]));
        }
        z += storey_m;
    }
    if random.chance(0.3) {
        parts.push(round.solid(surface, out, [plot.z_m[0], random.between(0.3, 1.2)]));
    }
}

/// Pillars along the wall, or a ring of columns before it under an architrave.
fn add_pillars(parts: &mut Vec<Solid>, plot: &Plot, round: &Round, random: &mut Random) {
    if random.chance(0.4) {
        return;
    }
    let surface = Surface::matte(50, random.between(0.1, 0.8));
    let gap_m = random.between(1.0, 4.0);
    let [foot, top] = plot.z_m;
    let before = if random.chance(0.3) { plot.room_m.min(1.5) } else { 0.05 };
    let top = if before > 0.1 { top.min(random.between(2.8, 6.0)) } else { top };
    let radius_m = random.between(0.1, 0.3);
    let count = (std::f32::consts::TAU * round.radius_m / gap_m).ceil();
    for k in 0..count as usize {
        let angle = std::f32::consts::TAU * (k as f32 / count - 0.5);
        let ends = [foot, top].map(|z| round.at(angle, before, z));
        let [x, y] = [ends[0].x, ends[0].y];
        if (round.x[0] - 0.1 - before..round.x[1] + 0.1 + before).contains(&x) && y < round.y[1] {
            parts.push(rod(surface, ends[0], ends[1], radius_m));
        }
    }
    if before > 0.1 {
        parts.push(round.solid(surface, before + radius_m, [top - 0.4, top]));
    }
}

/// A front that curves away from the street: a ring of short walls, each with its own windows.
fn add_hollow(site: &mut Site, plot: &Plot, random: &mut Random) {
    let [half_length, half_depth] = plot.half_m;
    let deepest = (2.0 * half_depth - 2.0).min(half_length) * random.between(0.4, 1.0);
    let radius_m = (half_length * half_length + deepest * deepest) / (2.0 * deepest);
    let reach = (half_length / radius_m).min(1.0).asin();
    let centre_y = deepest - radius_m - half_depth;
    let count = (2.0 * reach * radius_m / random.between(0.8, 3.0)).ceil().max(6.0);
    let (step, thick) = (2.0 * reach / count, 1.5);
    let half = (radius_m + thick) * (0.5 * step).tan();
    let mut pattern = Facade::draw(Vec3::zeros(), Vector2::x(), [half, 0.5 * thick], plot.z_m[1], random);
    pattern.vary(random);
    for k in 0..count as usize {
        let angle = (k as f32 + 0.5) * step - reach;
        let turn = Isometry3::new(Vec3::new(0.0, centre_y, 0.0), -Vec3::z() * angle);
        let pose = plot.pose * turn;
        add_segment(
            site,
            plot,
            &pose,
            [half, radius_m, thick],
            Facade { irregular: pattern.irregular + k as u64, ..pattern },
        );
    }
}

/// One wall of a hollow front: half its length, distance from the axis and thickness [m], in the frame of its axis.
fn add_segment(site: &mut Site, plot: &Plot, pose: &Isometry3<f32>, size_m: [f32; 3], pattern: Facade) {
    let [half, near, thick] = size_m;
    let middle = pose * Point3::new(0.0, near + 0.5 * thick, 0.0);
    let along = pose.rotation * Vec3::x();
    let floor = plot.pose.translation.vector.z;
    let facade = Facade {
        centre: middle.coords.xy(),
        along: along.xy(),
        floor_m: pattern.floor_m + floor,
        top_m: pattern.top_m + floor,
        ..pattern
    };
    let walls = plot.surface.with(Finish::Facade(site.facades.len() as u32));
    site.facades.push(facade);
    let hull = Hull::cuboid([-half, half], [near, near + thick], plot.z_m);
    site.solids.push(solid(hull, walls).moved(pose));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{ground::Ground, options::TownOptions, plan::Plan, random::Domain, shape::Ray};

    /// What a ray from far before the front meets, at `x` along it: how deep behind the front line [m].
    fn depth(solids: &[Solid], x: f32) -> Option<f32> {
        let ray = Ray { origin: Vec3::new(x, -40.0, 1.7), direction: Vec3::y() };
        let random = || Random::keyed(1, Domain::Ray, &[]);
        let ranges = solids.iter().filter_map(|s| s.shape.hit(&ray, random)).map(|hit| hit.range_m - 35.0);
        ranges.reduce(f32::min)
    }

    #[test]
    fn fronts_bow_out_or_in_and_stay_on_their_plots() {
        let options = TownOptions { varied: true, ..TownOptions::default() };
        let plan = Plan::draw(4, &options);
        let ground = Ground::shape(4, &options, &plan, 10.0);
        for seed in 0..40 {
            let mut site = Site {
                plan: &plan,
                ground: &ground,
                options: &options,
                solids: vec![],
                facades: vec![],
                next_instance: 1,
            };
            let plot = Plot {
                pose: Isometry3::identity(),
                half_m: [8.0, 5.0],
                z_m: [-0.5, 9.0],
                room_m: 1.0,
                surface: Surface::matte(50, 0.4),
            };
            build(&mut site, &plot, &mut Random::keyed(seed, Domain::Block, &[]));
            let [middle, edge] = [0.0, 4.7].map(|x| depth(&site.solids, x).expect("a wall"));
            assert!(
                (-1.9..10.0).contains(&middle) && (-1.9..10.0).contains(&edge),
                "{seed}: {middle} {edge}"
            );
            assert!((middle - edge).abs() > 0.1, "{seed}: flat");
            assert!(site.solids.iter().all(|s| s.surface.label == 50 && s.shape.bounds().0.y > -7.0));
        }
    }
}
