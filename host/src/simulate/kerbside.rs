//! What stands along the kerbs: lamps, signs, trees, bins, parked cars and bicycles.

use nalgebra::{Point2, Vector2};

use super::{
    barriers,
    bodies::{self, Car},
    clutter, country, fleet, open_blocks,
    plan::{Course, Street, right_of},
    plants,
    random::{Domain, Random},
    scene::{Finish, Solid, Surface, rod, solid},
    shape::Hull,
    town::Site,
};

/// One side of a street between two crossings, on the plan.
pub struct Kerb {
    /// The street.
    pub street: Street,
    /// On the centre line, at the kerb of the first crossing in driving direction.
    origin: Point2<f64>,
    /// Driving direction of this side.
    pub along: Vector2<f64>,
    /// Kerb to kerb of the crossing streets [m].
    pub length_m: f32,
    /// Block behind the sidewalk.
    block: Option<[usize; 2]>,
}

impl Kerb {
    /// A place `along_m` on the way and `outside_m` outside the kerb.
    pub fn at(&self, along_m: f32, outside_m: f32) -> Point2<f64> {
        let out = right_of(self.along) * f64::from(self.street.half_width_m + outside_m);
        self.origin + self.along * f64::from(along_m) + out
    }

    /// Away from the road.
    pub fn outward(&self) -> Vector2<f64> {
        right_of(self.along)
    }
}

/// Furnishes all streets.
pub fn furnish_streets(site: &mut Site, seed: u64) {
    let [avenues, streets] = site.plan.size();
    let mut number = 0;
    for (course, lines, parts) in
        [(Course::Avenue, avenues, streets - 1), (Course::Street, streets, avenues - 1)]
    {
        for (line, part, forward) in (0..lines)
            .flat_map(|line| (0..parts).map(move |part| (line, part)))
            .flat_map(|(line, part)| [(line, part, true), (line, part, false)])
        {
            number += 1;
            let kerb = kerb(site, course, line, part, forward);
            let random = &mut Random::keyed(seed, Domain::Kerb, &[number]);
            let is_open = kerb.block.is_some_and(|block| site.plan.style(block).is_open);
            match () {
                () if is_open => country::furnish_roadside(site, &kerb, random),
                () if site.options.varied => furnish_varied(site, &kerb, random),
                () => furnish(site, &kerb, random),
            }
            if forward && kerb.street.half_width_m > 6.5 && random.chance(0.6 * site.options.country) {
                country::divide_road(site, &kerb, random);
            }
            park_cars(site, &kerb, random);
        }
    }
}

fn kerb(site: &Site, course: Course, line: usize, part: usize, forward: bool) -> Kerb {
    let (street, crossing, axis) = match course {
        Course::Avenue => (site.plan.avenues[line], &site.plan.streets, Vector2::y()),
        Course::Street => (site.plan.streets[line], &site.plan.avenues, Vector2::x()),
    };
    let from = crossing[part].centre_m + crossing[part].half_width_m;
    let to = crossing[part + 1].centre_m - crossing[part + 1].half_width_m;
    let across = if course == Course::Avenue { Vector2::x() } else { Vector2::y() };
    let start = f64::from(if forward { from } else { to });
    let origin = Point2::from(axis * start + across * f64::from(street.centre_m));
    let mut kerb =
        Kerb { street, origin, along: if forward { axis } else { -axis }, length_m: to - from, block: None };
    let behind = kerb.at(0.5 * kerb.length_m, 4.0);
    kerb.block = site.plan.block_at(Point2::new(behind.x as f32, behind.y as f32));
    kerb
}

fn furnish(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let trees = kerb.block.is_some_and(|block| site.plan.style(block).avenue_trees);
    let tree_share =
        if trees { 0.7 * site.options.vegetation.min(1.4) } else { 0.25 * site.options.vegetation };
    let mut at = random.between(5.0, 7.0);
    let mut number = random.below(3);
    while at < kerb.length_m - 5.0 {
        number += 1;
        let place = kerb.at(at, 0.45);
        match random.unit() {
            _ if number.is_multiple_of(3) => site.stand(&lamp(random), place, kerb.outward()),
            draw if draw < tree_share => {
                let foot = site.foot(place);
                site.solids.extend(plants::street_tree(foot, random));
            }
            draw if draw > 0.88 => site.stand(&sign(random), place, -kerb.along),
            draw if draw > 0.80 => {
                site.stand(&bin(random), kerb.at(at, kerb.street.sidewalk_m - 0.25), kerb.along)
            }
            draw if draw > 0.74 => park_bicycles(site, kerb, at, random),
            draw if draw > 0.74 - 0.2 * site.options.vegetation => {
                let foot = site.foot(place);
                let (radius, free_path_m) = (random.between(0.25, 0.4), site.free_path_m(0.14, random));
                site.solids.extend(plants::bush(foot, radius, free_path_m, random));
            }
            _ => {}
        }
        at += random.between(5.0, 8.0);
    }
    if random.chance(0.7) {
        site.stand(&sign(random), kerb.at(kerb.length_m - 4.5, 0.4), -kerb.along);
    }
}

/// More of everything, at any place of the sidewalk.
fn furnish_varied(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let trees = kerb.block.is_some_and(|block| site.plan.style(block).avenue_trees);
    let tree_share = if trees { 0.25 * site.options.vegetation.min(1.6) } else { 0.04 };
    let spacing = random.pick(&[1.5, 3.0, 5.0, 8.0]);
    let mut at = 4.0 + spacing * random.unit();
    while at < kerb.length_m - 4.0 {
        let place =
            kerb.at(at, random.pick(&[0.4, 0.4, 0.5 * kerb.street.sidewalk_m, kerb.street.sidewalk_m - 0.2]));
        match random.unit() {
            draw if draw < tree_share => {
                let foot = site.foot(kerb.at(at, 0.6));
                site.solids.extend(plants::varied_tree(foot, random));
            }
            draw if draw < 0.40 => site.stand(&clutter::pole(random), kerb.at(at, 0.4), kerb.outward()),
            draw if draw < 0.60 => {
                let facing =
                    if random.chance(0.7) { -kerb.along } else { open_blocks::any_direction(random) };
                if draw > 0.54 && kerb.street.sidewalk_m > 2.2 {
                    advertise(site, kerb, at, facing, random);
                } else {
                    site.stand(&clutter::sign(random), kerb.at(at, 0.5), facing);
                }
            }
            draw if draw < 0.65 => park_bicycles(site, kerb, at, random),
            draw if draw < 0.70 => bollards(site, kerb, at, random),
            draw if draw < 0.70 + 0.08 * site.options.vegetation => {
                let length = random.between(2.0, 9.0).min(kerb.length_m - 4.0 - at);
                let inset = random.pick(&[0.5, kerb.street.sidewalk_m + 0.2]);
                let ends = [kerb.at(at + length, inset), kerb.at(at, inset)];
                let width = random.between(0.4, if inset > 1.0 { 3.0 } else { 0.9 });
                open_blocks::plant_strip(site, ends, width, random);
            }
            _ => open_blocks::furnish_sidewalk(site, place, random),
        }
        at += spacing * random.between(0.4, 1.6);
    }
    if random.chance(0.25) {
        plant_kerb(site, kerb, random);
    }
    if random.chance(0.3) {
        wall_off(site, kerb, random);
    }
    // A wide road is more likely to be shielded.
    let wide = kerb.street.half_width_m - kerb.street.parking_m > 6.0;
    if random.chance(if wide { 0.4 } else { 0.07 }) {
        let outside = random.pick(&[0.3, 0.6, kerb.street.sidewalk_m + 0.3]);
        let ends = [kerb.at(5.5, outside), kerb.at(kerb.length_m - 5.5, outside)];
        barriers::add_barrier(site, ends, random);
    }
}

/// An advertising panel or column on a wide sidewalk.
fn advertise(site: &mut Site, kerb: &Kerb, at: f32, facing: Vector2<f64>, random: &mut Random) {
    let body = if random.chance(0.3) { clutter::column(random) } else { clutter::board(random) };
    let inset = random.between(0.9, (kerb.street.sidewalk_m - 1.0).max(1.0));
    site.stand(&body, kerb.at(at, inset), facing);
}

/// A wall, railing or fence along the kerb or behind the sidewalk.
fn wall_off(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let length = random.between(3.0, 30.0).min(kerb.length_m - 10.0);
    if length < 3.0 {
        return;
    }
    let from = random.between(5.0, kerb.length_m - 5.0 - length);
    let outside = random.pick(&[0.3, kerb.street.sidewalk_m - 0.1, kerb.street.sidewalk_m + 0.2]);
    let ends = [kerb.at(from, outside), kerb.at(from + length, outside)];
    let (half_width, finish) = random.pick(&[
        (0.15, Finish::Matte),
        (0.05, Finish::Matte),
        (0.02, Finish::Open(0.35)),
        (0.02, Finish::Open(0.6)),
    ]);
    barriers::add_fence(site, ends, random.between(0.5, 2.2), half_width, finish);
}

/// A bed of low bushes at the kerb, as wide as the sidewalk leaves room for.
fn plant_kerb(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let room = kerb.street.sidewalk_m - 0.5;
    let length = random.between(4.0, 25.0).min(kerb.length_m - 10.0);
    if length < 3.0 {
        return;
    }
    let from = random.between(5.0, kerb.length_m - 5.0 - length);
    let ends = [kerb.at(from + length, 0.3), kerb.at(from, 0.3)];
    open_blocks::plant_strip(site, ends, random.between(0.5, 1.0) * room, random);
}

/// A row of bollards or railings along the kerb.
fn bollards(site: &mut Site, kerb: &Kerb, from: f32, random: &mut Random) {
    let steel = Surface::matte(80, random.between(0.1, 0.5));
    let (height, radius) = (random.between(0.6, 1.4), random.between(0.04, 0.16));
    let gap = random.between(1.2, 2.5);
    for k in 0..3 + random.below(6) {
        let at = from + gap * k as f32;
        if at < kerb.length_m - 4.0 {
            let post = rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, height], radius);
            site.stand(&[post], kerb.at(at, 0.35), kerb.along);
        }
    }
}

fn park_bicycles(site: &mut Site, kerb: &Kerb, at: f32, random: &mut Random) {
    let most = if site.options.varied { 8 } else { 3 };
    for k in 0..1 + random.below(most) {
        let bicycle = bodies::bicycle(11, site.instance());
        let place = kerb.at(at + 0.7 * k as f32, kerb.street.sidewalk_m - 0.45);
        let tilt = f64::from(random.between(-0.3, 0.3));
        site.park(&bicycle, place, kerb.along + kerb.outward() * tilt, [0.5, 0.1]);
    }
}

fn park_cars(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    if kerb.street.parking_m == 0.0 {
        return;
    }
    let mut at = 9.5 + random.between(0.0, 2.0);
    while at < kerb.length_m - 9.5 {
        if random.chance(site.options.parked) {
            let instance = site.instance();
            let body = if site.options.varied {
                fleet::parked(instance, random)
            } else if random.chance(0.03) {
                bodies::truck(6.0, 18, instance)
            } else {
                Car::draw(random).solids(10, instance)
            };
            let inset = -0.5 * kerb.street.parking_m - 0.05 + random.between(-0.08, 0.08);
            let across = kerb.street.parking_m > 4.0;
            let ahead = if across { kerb.outward() } else { kerb.along };
            let facing = if random.chance(0.9) { ahead } else { -ahead };
            let skew = kerb.outward() * f64::from(random.between(-0.03, 0.03));
            site.park(&body, kerb.at(at, inset), facing + skew, [1.3, 0.75]);
        }
        at += if kerb.street.parking_m > 4.0 { random.between(2.5, 3.0) } else { random.between(5.6, 6.4) };
    }
}

/// A street lamp; its arm points backwards, over the road.
fn lamp(random: &mut Random) -> Vec<Solid> {
    let height = random.between(5.0, 8.0);
    let steel = Surface::matte(80, 0.30);
    let mut solids = vec![
        rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, height], 0.075),
        rod(steel, [0.0, 0.0, -0.2], [0.0, 0.0, 1.0], 0.10),
        rod(steel, [0.0, 0.0, height], [-1.3, 0.0, height + 0.25], 0.04),
    ];
    let head = Hull::cuboid([-1.9, -1.3], [-0.12, 0.12], [height + 0.18, height + 0.32]);
    solids.push(solid(head, steel));
    solids
}

/// A traffic sign that faces along x.
fn sign(random: &mut Random) -> Vec<Solid> {
    let post = Surface::matte(80, 0.30);
    let face = Surface::matte(81, 0.85).with(Finish::Retro);
    let height = random.between(2.1, 2.5);
    let half = random.between(0.25, 0.4);
    let plate = Hull::cuboid([0.035, 0.055], [-half, half], [height, height + 2.0 * half]);
    vec![rod(post, [0.0, 0.0, -0.2], [0.0, 0.0, height + 2.0 * half], 0.035), solid(plate, face)]
}

/// A litter bin or a switch box.
fn bin(random: &mut Random) -> Vec<Solid> {
    let surface = Surface::matte(99, 0.25);
    let half = [random.between(0.2, 0.5), random.between(0.15, 0.22)];
    let top = random.between(0.8, 1.3);
    let hull = Hull::cuboid([-half[0], half[0]], [-half[1], half[1]], [-0.1, top]);
    vec![solid(hull, surface)]
}
