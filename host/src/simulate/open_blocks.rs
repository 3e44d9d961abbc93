//! Blocks without houses in varied towns: squares, car parks, thickets.

use nalgebra::{Point2, Vector2};

use super::{bodies, clutter, country, curved, fleet, plants, random::Random, style::Purpose, town::Site};

/// The part of a block inside its sidewalks, on the plan.
pub struct Yard {
    /// Lower corner [m].
    pub low: Point2<f64>,
    /// Upper corner [m].
    pub high: Point2<f64>,
}

impl Yard {
    fn of(site: &Site, [i, j]: [usize; 2]) -> Self {
        let (avenues, streets) = (&site.plan.avenues, &site.plan.streets);
        let after = |s: &super::plan::Street| f64::from(s.centre_m + s.reach_m() + 0.3);
        let before = |s: &super::plan::Street| f64::from(s.centre_m - s.reach_m() - 0.3);
        Self {
            low: Point2::new(after(&avenues[i]), after(&streets[j])),
            high: Point2::new(before(&avenues[i + 1]), before(&streets[j + 1])),
        }
    }

    /// Any place in it.
    pub fn anywhere(&self, random: &mut Random) -> Point2<f64> {
        let share = Vector2::new(random.unit().into(), random.unit().into());
        self.low + (self.high - self.low).component_mul(&share)
    }

    /// Its area.
    pub fn area_m2(&self) -> f64 {
        let size = self.high - self.low;
        size.x * size.y
    }
}

/// Any direction on the plan.
pub fn any_direction(random: &mut Random) -> Vector2<f64> {
    let angle = f64::from(random.between(0.0, std::f32::consts::TAU));
    Vector2::new(angle.cos(), angle.sin())
}

/// Fills a block that has no houses.
pub fn fill(site: &mut Site, block: [usize; 2], purpose: Purpose, random: &mut Random) {
    let yard = Yard::of(site, block);
    match purpose {
        Purpose::Square => fill_square(site, &yard, random),
        Purpose::CarPark => fill_car_park(site, &yard, random),
        Purpose::Field => country::fill_field(site, &yard, random),
        _ => fill_thicket(site, &yard, random),
    }
}

fn fill_square(site: &mut Site, yard: &Yard, random: &mut Random) {
    let beds = 1 + random.below(6);
    for _ in 0..beds {
        plant_bed(site, yard.anywhere(random), random);
    }
    if random.chance(0.2) {
        curved::add_rotunda(site, yard, random);
    }
    let density = f64::from(random.between(0.01, 0.05));
    for _ in 0..(density * yard.area_m2()) as usize {
        let at = yard.anywhere(random);
        furnish_place(site, at, random);
    }
}

/// Puts one thing that stands about in open places.
pub fn furnish_place(site: &mut Site, at: Point2<f64>, random: &mut Random) {
    let facing = any_direction(random);
    match random.below(24) {
        23 => site.stand(&clutter::column(random), at, facing),
        22 => site.stand(&clutter::board(random), at, facing),
        21 => {
            let body = fleet::tall(site.instance(), random);
            site.park(&body, at, facing, [1.3, 0.75]);
        }
        19 | 20 => site.stand(&clutter::kiosk(random), at, facing),
        0..7 => gather(site, at, random),
        7..9 => site.stand(&clutter::object(random), at, facing),
        9..12 => site.stand(&clutter::pole(random), at, facing),
        12..14 => site.stand(&clutter::sign(random), at, facing),
        14..16 => {
            let foot = site.foot(at);
            site.solids.extend(plants::varied_tree(foot, random));
        }
        16 => {
            let foot = site.foot(at);
            let (radius, free_path_m) = (random.between(0.4, 1.2), site.free_path_m(0.14, random));
            site.solids.extend(plants::bush(foot, radius, free_path_m, random));
        }
        17 => {
            let body = bodies::bicycle(11, site.instance());
            site.park(&body, at, facing, [0.5, 0.1]);
        }
        18 => {
            let body = fleet::motorcycle(site.instance(), random);
            site.park(&body, at, facing, [0.6, 0.1]);
        }
        _ => {
            let body = fleet::parked(site.instance(), random);
            site.park(&body, at, facing, [1.3, 0.75]);
        }
    }
}

/// One person or a group.
fn gather(site: &mut Site, at: Point2<f64>, random: &mut Random) {
    let people = if random.chance(0.65) { 1 } else { 2 + random.below(5) };
    for _ in 0..people {
        let body = clutter::bystander(site.instance(), random);
        let spread = if people == 1 { 0.0 } else { random.between(0.3, 1.6) };
        let place = at + any_direction(random) * f64::from(spread);
        site.stand(&body, place, any_direction(random));
    }
}

/// Puts one thing on a sidewalk: like [`furnish_place`], but nothing that is driven.
pub fn furnish_sidewalk(site: &mut Site, at: Point2<f64>, random: &mut Random) {
    let facing = any_direction(random);
    match random.below(10) {
        0..4 => gather(site, at, random),
        4..7 => site.stand(&clutter::object(random), at, facing),
        7 => {
            let body = fleet::motorcycle(site.instance(), random);
            site.park(&body, at, facing, [0.6, 0.1]);
        }
        9 if random.chance(0.6) => site.stand(&clutter::kiosk(random), at, facing),
        8 => {
            let foot = site.foot(at);
            let (radius, free_path_m) = (random.between(0.25, 0.6), site.free_path_m(0.14, random));
            site.solids.extend(plants::bush(foot, radius, free_path_m, random));
        }
        _ => {}
    }
}

/// A bed of low bushes, sometimes with trees, a lamp or a sign in it.
fn plant_bed(site: &mut Site, at: Point2<f64>, random: &mut Random) {
    let along = any_direction(random);
    let (length, width) = (random.between(3.0, 18.0), random.between(1.0, 9.0));
    plant_strip(site, [at, at + along * f64::from(length)], width, random);
    for _ in 0..random.below(3) {
        let foot = site.foot(at + along * f64::from(length * random.unit()));
        site.solids.extend(plants::varied_tree(foot, random));
    }
    match random.below(4) {
        0 => site.stand(&clutter::pole(random), at, along),
        1 => site.stand(&clutter::sign(random), at, along),
        _ => {}
    }
}

/// Undergrowth or a trimmed hedge between two places, to the left of the line; short pieces follow the ground.
pub fn plant_strip(site: &mut Site, [from, to]: [Point2<f64>; 2], width_m: f32, random: &mut Random) {
    let height_m = if random.chance(0.6) { random.between(0.2, 0.9) } else { random.between(0.9, 2.4) };
    let clipped = width_m < 2.5 && random.chance(0.35);
    let across = Vector2::new(from.y - to.y, to.x - from.x).normalize();
    let middle = from + (to - from) * 0.5;
    let drop_m = site.foot(middle + across * f64::from(width_m)).z - site.foot(middle).z;
    // On a slope each lane stands at its own height.
    let lanes = if drop_m.abs() > 0.25 { width_m.ceil() } else { 1.0 };
    let pieces = ((to - from).norm() / 3.0).ceil().max(1.0) as usize;
    for (lane, piece) in (0..lanes as usize).flat_map(|lane| (0..pieces).map(move |piece| (lane, piece))) {
        let shift = across * f64::from(width_m * lane as f32 / lanes);
        let end = |k: usize| site.foot(from + shift + (to - from) * (k as f64 / pieces as f64));
        let ends = [end(piece), end(piece + 1)];
        let grow = if clipped { plants::clipped } else { plants::shrubs };
        let height_m = height_m * if clipped { 1.0 } else { random.between(0.85, 1.1) };
        site.solids.extend(grow(ends[0], ends[1], height_m, width_m / lanes, random));
    }
}

/// Rows of vehicles across, with lamps and trees between.
fn fill_car_park(site: &mut Site, yard: &Yard, random: &mut Random) {
    let parked = random.between(0.3, 0.9);
    let mut y = yard.low.y + 3.0;
    while y + 3.0 < yard.high.y {
        let mut x = yard.low.x + 2.0;
        while x + 2.0 < yard.high.x {
            let at = Point2::new(x, y);
            if random.chance(parked) {
                let body = fleet::parked(site.instance(), random);
                let facing = if random.chance(0.5) { Vector2::y() } else { -Vector2::y() };
                site.park(&body, at, facing, [1.3, 0.75]);
            } else if random.chance(0.15) {
                furnish_place(site, at, random);
            }
            x += f64::from(random.between(2.6, 3.2));
        }
        y += random.pick(&[5.5, 8.0, 11.0]);
    }
}

/// Undergrowth, bushes and trees.
fn fill_thicket(site: &mut Site, yard: &Yard, random: &mut Random) {
    let density = f64::from(random.between(0.02, 0.08));
    for _ in 0..(density * yard.area_m2()) as usize {
        let foot = site.foot(yard.anywhere(random));
        match random.below(6) {
            0 => site.solids.extend(plants::varied_tree(foot, random)),
            1 => {
                let at = yard.anywhere(random);
                plant_bed(site, at, random);
            }
            _ => {
                let (radius, free_path_m) = (random.between(0.4, 2.0), site.free_path_m(0.14, random));
                site.solids.extend(plants::bush(foot, radius, free_path_m, random));
            }
        }
    }
}
