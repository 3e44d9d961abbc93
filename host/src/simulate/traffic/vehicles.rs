//! Cars, trucks and cyclists: leading, following, oncoming, crossing.

use nalgebra::Point2;

use super::{
    Casting,
    actor::{Kind, Motion},
};
use crate::simulate::{
    bodies::Car,
    fleet,
    path::{Pace, Path, Stop, TimeTable},
    plan::{LANE_M, Plan},
    random::Random,
};

/// The four directions of the plan.
const DIRECTIONS: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// A car that drives ahead on the vehicle's own way.
pub fn add_leader(cast: &mut Casting, random: &mut Random) {
    let (path, table) = (cast.drive.path().clone(), cast.drive.table().clone());
    let start_s = -table.time_s(f64::from(random.between(14.0, 20.0)));
    let car = draw_car(cast, random);
    cast.offer(car, Motion::Through { path, table, start_s });
}

/// A vehicle that shares some streets with the drive, ahead or behind, and comes from and goes elsewhere.
pub fn add_sharing(cast: &mut Casting, random: &mut Random) {
    let route = cast.drive.route();
    let first = 1 + random.below(route.len() - 3);
    let last = (first + 1 + random.below(3)).min(route.len() - 2);
    let onto = to_border(&cast.town.plan, route[first], backwards_choice(route, first, random));
    let off = to_border(&cast.town.plan, route[last], forward_choice(route, last, random));
    let mut nodes: Vec<_> = onto.into_iter().rev().collect();
    nodes.extend(&route[first..=last]);
    nodes.extend(off);
    let lead_s = f64::from(random.between(2.0, 5.0)) * if random.chance(0.6) { 1.0 } else { -1.0 };
    let meeting = cast.town.plan.crossing(route[first]);
    let Some(at_s) = passing_time(cast, meeting) else { return };
    offer_route(cast, &nodes, meeting, at_s - lead_s, random);
}

/// A vehicle that crosses the town and passes near the drive.
pub fn add_through(cast: &mut Casting, random: &mut Random) {
    let (time_s, _, crossing) = cast.moment(random);
    let plan = &cast.town.plan;
    let [entry, exit] = [random.pick(&DIRECTIONS), random.pick(&DIRECTIONS)];
    if entry == exit {
        return;
    }
    let mut nodes: Vec<_> = to_border(plan, crossing, entry).into_iter().rev().collect();
    nodes.push(crossing);
    nodes.extend(to_border(plan, crossing, exit));
    let meeting = plan.crossing(crossing);
    offer_route(cast, &nodes, meeting, time_s + f64::from(random.between(-4.0, 4.0)), random);
}

/// A cyclist at the right edge of the lane.
pub fn add_cyclist(cast: &mut Casting, random: &mut Random) {
    let (time_s, _, crossing) = cast.moment(random);
    let plan = &cast.town.plan;
    let entry = random.pick(&DIRECTIONS);
    let mut nodes: Vec<_> = to_border(plan, crossing, entry).into_iter().rev().collect();
    nodes.push(crossing);
    nodes.extend(to_border(plan, crossing, entry.map(|d| -d)));
    let Some(path) = lane(plan, &nodes, 2.75) else { return };
    let cruise = f64::from(random.between(3.5, 6.0));
    let table = TimeTable::new(&path, &pace(cruise), None);
    let start_s = time_s - time_at(cast, &path, &table, plan.crossing(crossing));
    cast.offer(Kind::Cyclist(random.between(0.15, 0.5)), Motion::Through { path, table, start_s });
}

fn offer_route(
    cast: &mut Casting,
    nodes: &[[usize; 2]],
    meeting: Point2<f64>,
    at_s: f64,
    random: &mut Random,
) {
    let Some(path) = lane(&cast.town.plan, nodes, f64::from(LANE_M)) else { return };
    let trucks = if cast.town.varied { 0.12 } else { 0.05 };
    let kind =
        if random.chance(trucks) { Kind::Truck(random.between(5.5, 8.0)) } else { draw_car(cast, random) };
    let cruise = f64::from(random.between(6.5, 11.0));
    let free = TimeTable::new(&path, &pace(cruise), None);
    let meeting_s = time_at(cast, &path, &free, meeting);
    // Some wait before a crossing near the drive and go on while in view.
    let stop = random.chance(0.2).then(|| Stop {
        length_m: (way_to(cast, &path, meeting) - 11.0).max(1.0),
        wait_s: f64::from(random.between(3.0, 9.0)),
    });
    let table = TimeTable::new(&path, &pace(cruise), stop);
    cast.offer(kind, Motion::Through { path, table, start_s: at_s - meeting_s });
}

fn draw_car(cast: &Casting, random: &mut Random) -> Kind {
    match cast.town.varied {
        false => Kind::Car(Car::draw(random)),
        // What passes close by fills much of a scan: vans must not be rare.
        true if random.chance(0.3) => Kind::Van(random.below(1 << 30) as u64),
        true => Kind::Car(fleet::varied_car(random)),
    }
}

fn pace(cruise_mps: f64) -> Pace {
    Pace { cruise_mps, start_mps: cruise_mps, sideways_mps2: 2.2, along_mps2: [1.4, 2.0] }
}

/// The lane along crossings, none of which may lie between equal neighbours (a turn on the spot).
fn lane(plan: &Plan, nodes: &[[usize; 2]], offset_m: f64) -> Option<Path> {
    let turns_back = nodes.windows(3).any(|n| n[0] == n[2]);
    (nodes.len() > 1 && !turns_back).then(|| Path::along_lane(plan, nodes, offset_m))
}

/// Crossings from the next one to the last in a direction.
fn to_border(plan: &Plan, from: [usize; 2], [di, dj]: [i64; 2]) -> Vec<[usize; 2]> {
    let [columns, rows] = plan.size().map(|n| n as i64);
    let node = |k: i64| [from[0] as i64 + k * di, from[1] as i64 + k * dj];
    (1..)
        .map(node)
        .take_while(|n| (0..columns).contains(&n[0]) && (0..rows).contains(&n[1]))
        .map(|n| [n[0] as usize, n[1] as usize])
        .collect()
}

fn step(from: [usize; 2], to: [usize; 2]) -> [i64; 2] {
    [to[0] as i64 - from[0] as i64, to[1] as i64 - from[1] as i64]
}

/// A direction to come from into a crossing of the route: any but the one that the route takes out of it.
fn backwards_choice(route: &[[usize; 2]], at: usize, random: &mut Random) -> [i64; 2] {
    let out = step(route[at], route[at + 1]);
    let choices: Vec<_> = DIRECTIONS.into_iter().filter(|d| *d != out).collect();
    random.pick(&choices)
}

/// A direction to leave a crossing of the route: not back.
fn forward_choice(route: &[[usize; 2]], at: usize, random: &mut Random) -> [i64; 2] {
    let back = step(route[at], route[at - 1]);
    let choices: Vec<_> = DIRECTIONS.into_iter().filter(|d| *d != back).collect();
    random.pick(&choices)
}

/// When the vehicle itself comes near a place of the plan, if it does.
fn passing_time(cast: &Casting, place: Point2<f64>) -> Option<f64> {
    let q = cast.town.plan.town_from_plan(place);
    let near = |k: &u32| (cast.drive.at(0.2 * f64::from(*k)).0.position - q).norm() < 8.0;
    (0..(cast.duration_s / 0.2) as u32).find(near).map(|k| 0.2 * f64::from(k))
}

fn time_at(cast: &Casting, path: &Path, table: &TimeTable, place: Point2<f64>) -> f64 {
    table.time_s(way_to(cast, path, place))
}

/// Length of the path where it comes nearest to a place of the plan [m].
fn way_to(cast: &Casting, path: &Path, place: Point2<f64>) -> f64 {
    let q = cast.town.plan.town_from_plan(place);
    let distance = |k: usize| (path.at(k as f64).position - q).norm_squared();
    let nearest = (0..path.length_m() as usize).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    nearest.unwrap_or(0) as f64
}
