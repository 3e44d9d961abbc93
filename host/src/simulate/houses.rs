//! Houses in a row along each side of a block, with roofs, bays, gardens, fences, hedges and drives between them.

use nalgebra::{Isometry3, Point2, Vector2};

use super::{
    barriers::add_fence,
    bodies::Car,
    curved,
    facade::Facade,
    fleet, open_blocks,
    plan::right_of,
    plants,
    random::Random,
    scene::{Finish, Solid, Surface, rod, solid},
    shape::{Hull, Slab, Vec3},
    style::{BlockStyle, Purpose},
    town::Site,
};

/// One side of a block on the plan: `origin` is its start on the outer edge of the sidewalk.
struct Side {
    origin: Point2<f64>,
    /// Along the street.
    along: Vector2<f64>,
    /// Into the block.
    inward: Vector2<f64>,
    length_m: f32,
    /// Room for houses and their set-back [m].
    depth_m: f32,
}

impl Side {
    fn at(&self, along_m: f32, inward_m: f32) -> Point2<f64> {
        self.origin + self.along * f64::from(along_m) + self.inward * f64::from(inward_m)
    }
}

/// A house on its lot.
struct House {
    /// From and to along the side [m].
    span: [f32; 2],
    setback_m: f32,
    depth_m: f32,
    storeys: f32,
    reflectance: f32,
}

/// Fills a block.
pub fn build_up_block(site: &mut Site, block: [usize; 2], random: &mut Random) {
    let style = *site.plan.style(block);
    for side in sides(site, block, &style) {
        match style.purpose {
            Purpose::Houses => build_up_side(site, &side, &style, random),
            Purpose::Park => plant_park_edge(site, &side, random),
            _ => {}
        }
    }
    match style.purpose {
        Purpose::Houses | Purpose::Park => plant_yard(site, block, &style, random),
        purpose => open_blocks::fill(site, block, purpose, random),
    }
}

/// The two long sides first; the other two begin behind their houses.
fn sides(site: &Site, [i, j]: [usize; 2], style: &BlockStyle) -> Vec<Side> {
    let (avenues, streets) = (&site.plan.avenues, &site.plan.streets);
    let x = [avenues[i].centre_m + avenues[i].reach_m(), avenues[i + 1].centre_m - avenues[i + 1].reach_m()];
    let y = [streets[j].centre_m + streets[j].reach_m(), streets[j + 1].centre_m - streets[j + 1].reach_m()];
    let (width, height) = (x[1] - x[0], y[1] - y[0]);
    let depth_m = (0.5 * height - 1.0).min(12.0 + style.setback_m);
    let (clear, side_depth) = (depth_m + 1.5, (0.5 * width - 1.0).min(12.0 + style.setback_m));
    let corner = |x: f32, y: f32| Point2::new(f64::from(x), f64::from(y));
    let side = |origin, along: Vector2<f64>, length_m, depth_m| Side {
        origin,
        along,
        inward: -right_of(along),
        length_m,
        depth_m,
    };
    let (ex, ey) = (Vector2::x(), Vector2::y());
    vec![
        side(corner(x[0], y[0]), ex, width, depth_m),
        side(corner(x[1], y[1]), -ex, width, depth_m),
        side(corner(x[1], y[0] + clear), ey, height - 2.0 * clear, side_depth),
        side(corner(x[0], y[1] - clear), -ey, height - 2.0 * clear, side_depth),
    ]
}

fn build_up_side(site: &mut Site, side: &Side, style: &BlockStyle, random: &mut Random) {
    let mut start = random.between(0.2, 1.5);
    while start + 7.0 < side.length_m {
        let varied = site.options.varied;
        let (longest, jump_m) = if varied { (random.pick(&[12.0, 20.0, 35.0]), 2.5) } else { (16.0, 0.8) };
        let end = (start + random.between(8.0, longest)).min(side.length_m - 0.5);
        let setback_m = style.setback_m + random.between(0.0, jump_m);
        let house = House {
            span: [start, end],
            setback_m,
            depth_m: (side.depth_m - setback_m).min(random.between(8.0, 11.0)),
            storeys: style.storeys + random.between(-0.5, 0.5),
            reflectance: wall_reflectance(varied, random),
        };
        if random.chance(if varied && style.gap_m > 1.0 { 0.85 } else { 0.94 }) {
            build_house(site, side, &house, random);
        }
        let gap = style.gap_m * random.between(0.7, 1.3);
        if style.setback_m > 2.0 {
            fence_front(site, side, [start, end], random);
            plant_front(site, side, &house, random);
            fill_gap(site, side, [end, end + gap], setback_m, random);
        }
        start = end + gap;
    }
}

/// Most walls are bright; some of a varied town are of dark stone, steel or glass.
fn wall_reflectance(varied: bool, random: &mut Random) -> f32 {
    if varied && random.chance(0.2) { random.between(0.02, 0.15) } else { random.between(0.32, 0.72) }
}

fn build_house(site: &mut Site, side: &Side, house: &House, random: &mut Random) {
    let [from, to] = house.span;
    let (half_length, half_depth) = (0.5 * (to - from), 0.5 * house.depth_m);
    let middle = side.at(0.5 * (from + to), house.setback_m + half_depth);
    let corners = [(from, 0.0), (to, 0.0), (from, house.depth_m), (to, house.depth_m)];
    let heights = corners.map(|(u, v)| site.foot(side.at(u, house.setback_m + v)).z);
    let floor = heights.iter().copied().fold(f32::MIN, f32::max);
    let lowest = heights.iter().copied().fold(f32::MAX, f32::min);
    let wall = 0.4 + random.between(2.7, 3.1) * house.storeys.round().max(1.0);
    let town = site.plan.town_from_plan(middle);
    let yaw = site.plan.heading(middle, side.along) as f32;
    let foot = Vec3::new(town.x as f32, town.y as f32, floor);
    let pose = Isometry3::new(foot, Vec3::z() * yaw);

    let along = Vector2::new(yaw.cos(), yaw.sin());
    let plot = curved::Plot {
        pose,
        half_m: [half_length, half_depth],
        z_m: [lowest - floor - 0.5, wall],
        room_m: house.setback_m,
        surface: Surface::matte(50, house.reflectance),
    };
    if site.options.varied && random.chance(0.06) {
        return curved::build(site, &plot, random);
    }
    if site.options.varied && random.chance(0.03) {
        curved::add_turret(site, &plot, random);
    }
    let mut facade = Facade::draw(foot, along, plot.half_m, wall, random);
    if site.options.varied {
        facade.vary(random);
    }
    let main = Hull::cuboid([-half_length, half_length], [-half_depth, half_depth], plot.z_m);
    let mut parts = vec![solid(main, plot.surface.with(Finish::Facade(site.facades.len() as u32)))];
    site.facades.push(facade);
    parts.push(roof(half_length, half_depth, wall, random));
    add_front_parts(&mut parts, &facade, half_length, half_depth, house, random);
    if site.options.varied {
        add_relief(&mut parts, [half_length, half_depth], wall, house, random);
    }
    site.solids.extend(parts.iter().map(|solid| solid.moved(&pose)));
}

/// Pillars, ledges, awnings, boxes and boards on the four walls.
fn add_relief(
    parts: &mut Vec<Solid>,
    [half_length, half_depth]: [f32; 2],
    wall: f32,
    house: &House,
    random: &mut Random,
) {
    let room = house.setback_m.clamp(0.4, 1.5);
    let most = random.pick(&[4, 16, 40, 80]);
    for _ in 0..random.below(most) {
        let surface = Surface::matte(50, random.between(0.1, 0.8));
        let at = random.between(-half_length, half_length);
        let out = random.between(0.04, 1.0) * room;
        // What is seen from a car is mostly the ground floor.
        let (half, z) = match random.below(8) {
            0 => (random.between(0.1, 0.35), [-0.5, wall]),
            1 => (random.between(0.5, 3.0), [random.between(2.2, 2.8), random.between(2.8, 3.2)]),
            2 => {
                let foot = random.between(0.3, wall);
                (half_length, [foot, foot + random.between(0.1, 0.4)])
            }
            3 => (random.between(0.2, 0.6), [random.between(0.0, 2.0), random.between(2.0, 3.0)]),
            4 | 5 => {
                let foot = random.between(-0.2, 2.2);
                (random.between(0.05, 0.5), [foot, foot + random.between(0.2, 1.3)])
            }
            6 => {
                let foot = random.pick(&[0.0, 0.4, 3.2, 6.2]);
                (random.between(0.6, 2.5), [foot, foot + random.between(0.8, 1.1)])
            }
            _ => (random.between(0.3, 2.0), [-0.5, random.between(0.3, 2.6)]),
        };
        let x = [(at - half).max(-half_length), (at + half).min(half_length)];
        let y = if random.chance(0.7) {
            [-half_depth - out, 0.1 - half_depth]
        } else {
            [half_depth - 0.1, half_depth + out]
        };
        // Railings and lattices.
        let finish = if random.chance(0.2) { Finish::Open(random.between(0.3, 0.7)) } else { Finish::Matte };
        parts.push(solid(Hull::cuboid(x, y, z), surface.with(finish)));
    }
}

fn roof(half_length: f32, half_depth: f32, wall: f32, random: &mut Random) -> Solid {
    let tiles = Surface::matte(50, 0.22);
    let (eave, rise) = (random.between(0.2, 0.5), half_depth * random.between(0.5, 0.9));
    let x = [-half_length - 0.2, half_length + 0.2];
    let y = [-half_depth - eave, half_depth + eave];
    if random.chance(0.3) {
        return solid(Hull::cuboid(x, y, [wall, wall + 0.35]), tiles);
    }
    let hip = if random.chance(0.4) { 0.6 * half_depth } else { 0.0 };
    let ridge = Slab { x: [x[0] + hip, x[1] - hip], y: [-0.05, 0.05], z: wall + rise };
    solid(Hull::between(Slab { x, y, z: wall - 0.15 }, ridge), tiles)
}

/// Steps, a bay, balconies and a drain pipe on the street front, which lies at negative y.
fn add_front_parts(
    parts: &mut Vec<Solid>,
    facade: &Facade,
    half_length: f32,
    half_depth: f32,
    house: &House,
    random: &mut Random,
) {
    let plain = Surface::matte(50, house.reflectance);
    let wall = house.storeys.round().max(1.0) * facade.storey_m;
    let front = -half_depth;
    let mut place = |half_width: f32| random.between(half_width - half_length, half_length - half_width);
    let door = place(1.2);
    let (bay, balcony, pipe) = (place(1.9), place(1.6), place(0.3));
    let room = house.setback_m.min(1.3);
    let steps = Hull::cuboid([door - 0.8, door + 0.8], [front - 0.6 * room, front + 0.1], [-1.0, 0.38]);
    parts.push(solid(steps, plain));
    if house.setback_m > 1.0 && random.chance(0.5) {
        let bay = Hull::cuboid([bay - 1.5, bay + 1.5], [front - 0.7 * room, front + 0.1], [-1.0, wall - 0.4]);
        parts.push(solid(bay, plain));
    }
    if house.storeys > 1.5 && random.chance(0.5) {
        for storey in 1..house.storeys.round() as usize {
            let z = 0.4 + storey as f32 * facade.storey_m;
            let x = [balcony - 1.4, balcony + 1.4];
            let y = [front - 1.0, front + 0.1];
            parts.push(solid(Hull::cuboid(x, y, [z - 0.15, z]), plain));
            let rail = Hull::cuboid(x, [front - 1.0, front - 0.96], [z, z + 0.95]);
            parts.push(solid(rail, plain.with(Finish::Open(0.5))));
        }
    }
    let (a, b) = (Vec3::new(pipe, front - 0.07, -0.3), Vec3::new(pipe, front - 0.07, wall));
    parts.push(rod(plain, a, b, 0.05));
}

/// Hedge, fence, wall or nothing along the sidewalk, with a gate.
fn fence_front(site: &mut Site, side: &Side, [from, to]: [f32; 2], random: &mut Random) {
    if site.options.varied && random.chance(0.35) {
        let ends = [side.at(from, 0.3), side.at(to, 0.3)];
        return open_blocks::plant_strip(site, ends, random.between(0.4, 1.7), random);
    }
    let kind = random.below(9);
    let gate = random.between(from + 1.0, (to - 2.2).max(from + 1.1));
    let height = random.between(0.9, 1.9);
    for [a, b] in [[from, gate], [gate + 1.2, to]] {
        let ends = [side.at(a, 0.35), side.at(b, 0.35)];
        match kind {
            0..=4 if site.options.vegetation > 0.0 => {
                let free_path_m = site.free_path_m(0.10, random);
                let feet = ends.map(|end| site.foot(end));
                let solids = if site.options.varied && random.chance(0.4) {
                    plants::clipped(feet[0], feet[1], height, random.between(0.4, 1.2), random)
                } else {
                    plants::hedge(feet[0], feet[1], height, free_path_m, random)
                };
                site.solids.extend(solids);
            }
            6 | 7 => add_fence(site, ends, height, 0.015, Finish::Open(0.45)),
            8 => add_fence(site, ends, 0.8 * height, 0.12, Finish::Matte),
            _ => {}
        }
    }
}

/// Bushes and small trees in a front garden.
fn plant_front(site: &mut Site, side: &Side, house: &House, random: &mut Random) {
    let count = (site.options.vegetation * random.between(3.0, 8.0)) as usize;
    for _ in 0..count {
        let radius = random.between(0.4, 0.9);
        let room = house.setback_m - 1.0;
        if room < radius {
            continue;
        }
        let at = side.at(random.between(house.span[0] + 1.0, house.span[1] - 1.0), random.between(0.9, room));
        let foot = site.foot(at);
        let solids = match random.chance(0.25) {
            true if site.options.varied => plants::varied_tree(foot, random),
            true => plants::tree(foot, random),
            false => plants::bush(foot, radius, site.free_path_m(0.14, random), random),
        };
        site.solids.extend(solids);
    }
}

/// A drive with a car, a side fence or bushes in the gap between two houses.
fn fill_gap(site: &mut Site, side: &Side, [from, to]: [f32; 2], setback_m: f32, random: &mut Random) {
    let middle = 0.5 * (from + to);
    if to > side.length_m {
        return;
    }
    if to - from > 3.2 && random.chance(site.options.parked) {
        let car = if site.options.varied { fleet::varied_car(random) } else { Car::draw(random) };
        let car = car.solids(10, site.instance());
        let facing = if random.chance(0.5) { side.inward } else { -side.inward };
        site.park(&car, side.at(middle, setback_m + random.between(1.0, 3.0)), facing, [1.3, 0.75]);
    } else if random.chance(0.5) {
        let ends = [side.at(from, setback_m + 1.0), side.at(to, setback_m + 1.0)];
        add_fence(site, ends, random.between(1.4, 1.9), 0.03, Finish::Matte);
    } else if site.options.vegetation > 0.0 {
        let foot = site.foot(side.at(middle, setback_m + 2.0));
        site.solids.extend(plants::tree(foot, random));
    }
}

/// Hedges, bushes and trees along the edge of a park.
fn plant_park_edge(site: &mut Site, side: &Side, random: &mut Random) {
    let mut at = random.between(1.0, 3.0);
    while at + 5.0 < side.length_m {
        let inward = random.between(0.6, 4.0);
        let foot = site.foot(side.at(at, inward));
        match random.below(4) {
            _ if site.options.vegetation == 0.0 => {}
            0 => {
                let to = site.foot(side.at(at + 4.0, inward));
                let height = random.between(0.7, 1.6);
                let free_path_m = site.free_path_m(0.10, random);
                site.solids.extend(plants::hedge(foot, to, height, free_path_m, random));
            }
            1 => {
                let radius = random.between(0.6, 1.4);
                let free_path_m = site.free_path_m(0.14, random);
                site.solids.extend(plants::bush(foot, radius, free_path_m, random));
            }
            _ => site.solids.extend(plants::tree(foot, random)),
        }
        at += random.between(3.0, 6.0) / site.options.vegetation.max(0.2);
    }
}

/// Trees behind the houses, or all over a park.
fn plant_yard(site: &mut Site, [i, j]: [usize; 2], style: &BlockStyle, random: &mut Random) {
    let (a, b) = (site.plan.crossing([i, j]), site.plan.crossing([i + 1, j + 1]));
    let (count, reach) = match style {
        style if style.purpose == Purpose::Park => (16.0, 0.25),
        style if style.setback_m > 2.0 => (4.0, 0.04),
        _ => (1.0, 0.04),
    };
    for _ in 0..(site.options.vegetation * count) as usize {
        let share = Vector2::new(random.between(-reach, reach), random.between(-reach, reach));
        let share = share.add_scalar(0.5).cast::<f64>();
        let foot = site.foot(a + (b - a).component_mul(&share));
        let tree =
            if site.options.varied { plants::varied_tree(foot, random) } else { plants::tree(foot, random) };
        site.solids.extend(tree);
    }
}
