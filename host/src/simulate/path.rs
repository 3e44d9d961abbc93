//! Paths along lanes and sidewalks, and the time table of something that follows one.

use nalgebra::{Point2, Vector2};

use super::plan::{Plan, right_of};

/// Distance of the samples of a path [m].
const STEP_M: f64 = 0.25;

/// A smooth curve in the town, sampled by its length.
#[derive(Clone, Debug)]
pub struct Path {
    points: Vec<Point2<f64>>,
    /// Continuous, not wrapped [rad].
    headings: Vec<f64>,
    curvatures: Vec<f64>,
}

/// A place on a path.
#[derive(Clone, Copy, Debug)]
pub struct PathPoint {
    /// Position in the town [m].
    pub position: Point2<f64>,
    /// Heading [rad].
    pub heading: f64,
}

impl Path {
    /// The path along the right lane of the streets between crossings, `offset_m` right of the centre lines.
    pub fn along_lane(plan: &Plan, nodes: &[[usize; 2]], offset_m: f64) -> Self {
        let legs: Vec<Leg> =
            nodes.windows(2).map(|pair| Leg::new(plan, pair[0], pair[1], offset_m)).collect();
        let mut line = Vec::new();
        let mut from = legs[0].start;
        for (leg, next) in legs.iter().zip(legs.iter().skip(1).map(Some).chain([None])) {
            let Some(turn) = next.and_then(|next| Turn::between(leg, next)) else {
                // Straight on, or the end.
                let to = if next.is_some() { leg.start + leg.way } else { leg.end };
                add_line(&mut line, from, to);
                from = to;
                continue;
            };
            add_line(&mut line, from, turn.points[0]);
            turn.add_to(&mut line);
            from = turn.points[3];
        }
        Self::through(line.into_iter().map(|p| plan.town_from_plan(p)).collect(), 3)
    }

    /// The path through the corners of a line on the plan.
    pub fn along_line(plan: &Plan, corners: &[Point2<f64>]) -> Self {
        let mut line = Vec::new();
        for pair in corners.windows(2) {
            add_line(&mut line, pair[0], pair[1]);
        }
        Self::through(line.into_iter().map(|p| plan.town_from_plan(p)).collect(), 1)
    }

    /// Resamples a dense line by length and smooths it in rounds.
    fn through(line: Vec<Point2<f64>>, rounds: usize) -> Self {
        let mut points = resample(&line);
        for _ in 0..rounds {
            points = smooth(&points, 4);
        }
        let points = resample(&points);
        let headings = headings(&points);
        let slope = |k: usize| {
            let (a, b) = (k.saturating_sub(2), (k + 2).min(headings.len() - 1));
            (headings[b] - headings[a]) / ((b - a) as f64 * STEP_M)
        };
        let curvatures = (0..headings.len()).map(slope).collect();
        Self { points, headings, curvatures }
    }

    /// The rest of this path from a length on.
    pub fn from(mut self, length_m: f64) -> Self {
        let first = ((length_m / STEP_M) as usize).min(self.points.len() - 2);
        self.points.drain(..first);
        self.headings.drain(..first);
        self.curvatures.drain(..first);
        self
    }

    /// Length [m].
    pub fn length_m(&self) -> f64 {
        (self.points.len() - 1) as f64 * STEP_M
    }

    /// The place at a length along the path, its ends if beyond: a cubic between the samples.
    pub fn at(&self, length_m: f64) -> PathPoint {
        let u = (length_m / STEP_M).clamp(0.0, (self.points.len() - 1) as f64);
        let k = (u as usize).min(self.points.len() - 2);
        let t = u - k as f64;
        let mix = |values: &[f64]| values[k] + t * (values[k + 1] - values[k]);
        let direction = |k: usize| Vector2::new(self.headings[k].cos(), self.headings[k].sin()) * STEP_M;
        let chord = self.points[k + 1] - self.points[k];
        let (a, b) = (direction(k) - chord, chord - direction(k + 1));
        let bulge = (a * (1.0 - t) + b * t) * (t * (1.0 - t));
        PathPoint { position: self.points[k] + chord * t + bulge, heading: mix(&self.headings) }
    }
}

/// One street of a route, on the plan.
struct Leg {
    start: Point2<f64>,
    end: Point2<f64>,
    way: Vector2<f64>,
    direction: Vector2<f64>,
}

impl Leg {
    fn new(plan: &Plan, from: [usize; 2], to: [usize; 2], offset_m: f64) -> Self {
        let (a, b) = (plan.crossing(from), plan.crossing(to));
        let direction = (b - a).normalize();
        let side = right_of(direction) * offset_m;
        Self { start: a + side, end: b + side, way: b - a, direction }
    }
}

/// A cubic from one lane into a crossing one.
struct Turn {
    points: [Point2<f64>; 4],
}

impl Turn {
    /// `None` if the second leg goes straight on.
    fn between(leg: &Leg, next: &Leg) -> Option<Self> {
        let across = leg.direction.perp(&next.direction);
        if across.abs() < 0.5 {
            return None;
        }
        // The lanes meet here.
        let corner = leg.start + leg.direction * (next.start - leg.start).dot(&leg.direction);
        let reach = if across > 0.0 { 10.0 } else { 6.5 };
        let at = |direction: Vector2<f64>, share: f64| corner + direction * (reach * share);
        Some(Self {
            points: [
                at(leg.direction, -1.0),
                at(leg.direction, -0.45),
                at(next.direction, 0.45),
                at(next.direction, 1.0),
            ],
        })
    }

    fn add_to(&self, line: &mut Vec<Point2<f64>>) {
        let [a, b, c, d] = self.points.map(|p| p.coords);
        for step in 1..=60 {
            let t = f64::from(step) / 60.0;
            let s = 1.0 - t;
            line.push(
                (a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)).into(),
            );
        }
    }
}

fn add_line(line: &mut Vec<Point2<f64>>, from: Point2<f64>, to: Point2<f64>) {
    let steps = ((to - from).norm() / STEP_M).ceil().max(1.0) as usize;
    let first = usize::from(!line.is_empty());
    line.extend((first..=steps).map(|k| from + (to - from) * (k as f64 / steps as f64)));
}

fn resample(line: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut points = vec![line[0]];
    let mut left = STEP_M;
    for pair in line.windows(2) {
        let length = (pair[1] - pair[0]).norm();
        let mut done = left;
        while done <= length {
            points.push(pair[0] + (pair[1] - pair[0]) * (done / length));
            done += STEP_M;
        }
        left = done - length;
    }
    points
}

/// Moving average over `2 * reach + 1` samples, shorter towards the ends, which stay.
fn smooth(points: &[Point2<f64>], reach: usize) -> Vec<Point2<f64>> {
    let average = |k: usize| {
        let reach = reach.min(k).min(points.len() - 1 - k);
        let sum: Vector2<f64> = points[k - reach..=k + reach].iter().map(|p| p.coords).sum();
        Point2::from(sum / (2 * reach + 1) as f64)
    };
    (0..points.len()).map(average).collect()
}

fn headings(points: &[Point2<f64>]) -> Vec<f64> {
    let last = points.len() - 1;
    let mut headings: Vec<f64> = Vec::with_capacity(points.len());
    for k in 0..points.len() {
        let d = points[(k + 1).min(last)] - points[k.saturating_sub(1)];
        let raw = d.y.atan2(d.x);
        let turn = headings.last().map_or(0.0, |before| ((before - raw) / std::f64::consts::TAU).round());
        headings.push(raw + turn * std::f64::consts::TAU);
    }
    headings
}

/// Limits of a driver or rider.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Speed on a straight [m/s].
    pub cruise_mps: f64,
    /// Speed at the start of the path [m/s].
    pub start_mps: f64,
    /// Sideways acceleration in a corner [m/s2].
    pub sideways_mps2: f64,
    /// Speeding up and braking [m/s2].
    pub along_mps2: [f64; 2],
}

/// A stop on the way.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Where [m].
    pub length_m: f64,
    /// How long [s].
    pub wait_s: f64,
}

/// When something that follows a path is where.
#[derive(Clone, Debug)]
pub struct TimeTable {
    /// Time at each sample of the path, and when it leaves again [s].
    times: Vec<[f64; 2]>,
}

/// Slowest speed of something that is not waiting [m/s]: ends every approach to a stop in finite time.
const CRAWL_MPS: f64 = 0.35;

impl TimeTable {
    /// The time table along a path at this pace; time 0 is its start.
    pub fn new(path: &Path, pace: &Pace, stop: Option<Stop>) -> Self {
        let stop_at = stop.map(|stop| (stop.length_m / STEP_M) as usize);
        let speeds = speeds(path, pace, stop_at);
        let mut times = vec![[0.0, 0.0]];
        for (k, pair) in speeds.windows(2).enumerate() {
            let arrive = times[k][1] + 2.0 * STEP_M / (pair[0] + pair[1]);
            let wait = stop.filter(|_| stop_at == Some(k + 1)).map_or(0.0, |stop| stop.wait_s);
            times.push([arrive, arrive + wait]);
        }
        Self { times }
    }

    /// Time at a length along the path [s].
    pub fn time_s(&self, length_m: f64) -> f64 {
        let u = (length_m / STEP_M).clamp(0.0, (self.times.len() - 1) as f64);
        let k = (u as usize).min(self.times.len() - 2);
        let (leave, arrive) = (self.times[k][1], self.times[k + 1][0]);
        leave + (u - k as f64) * (arrive - leave)
    }

    /// Length along the path [m] and speed [m/s] at a time, `None` before the start and after the end.
    pub fn at(&self, time_s: f64) -> Option<(f64, f64)> {
        let after = self.times.partition_point(|[arrive, _]| *arrive <= time_s);
        if after == 0 || after == self.times.len() {
            return None;
        }
        let (leave, arrive) = (self.times[after - 1][1], self.times[after][0]);
        let length = (after - 1) as f64 * STEP_M;
        if time_s < leave {
            return Some((length, 0.0));
        }
        let rate = STEP_M / (arrive - leave);
        Some((length + (time_s - leave) * rate, rate))
    }
}

fn speeds(path: &Path, pace: &Pace, stop_at: Option<usize>) -> Vec<f64> {
    let cap = |k: usize| match path.curvatures[k].abs() {
        _ if stop_at == Some(k) => CRAWL_MPS,
        bend => (pace.sideways_mps2 / bend.max(1e-6)).sqrt().min(pace.cruise_mps),
    };
    let mut v: Vec<f64> = (0..path.points.len()).map(cap).collect();
    v[0] = v[0].min(pace.start_mps.max(CRAWL_MPS));
    for k in 1..v.len() {
        v[k] = v[k].min((v[k - 1].powi(2) + 2.0 * pace.along_mps2[0] * STEP_M).sqrt());
    }
    for k in (1..v.len()).rev() {
        v[k - 1] = v[k - 1].min((v[k].powi(2) + 2.0 * pace.along_mps2[1] * STEP_M).sqrt());
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::options::TownOptions;

    const PACE: Pace = Pace { cruise_mps: 9.0, start_mps: 7.0, sideways_mps2: 2.5, along_mps2: [1.5, 2.0] };

    fn round_a_block() -> (Plan, Path) {
        let plan = Plan::draw(1, &TownOptions::default());
        let path = Path::along_lane(
            &plan,
            &[[1, 2], [2, 2], [3, 2], [3, 3], [2, 3], [2, 2], [3, 2], [3, 1], [2, 1]],
            f64::from(crate::simulate::plan::LANE_M),
        );
        (plan, path)
    }

    #[test]
    fn lane_path_keeps_to_the_road_right_of_the_centre_line() {
        let (plan, path) = round_a_block();
        let mut centre_crossed = 0;
        for k in 0..(path.length_m() / 0.5) as usize {
            let at = path.at(0.5 * k as f64);
            let p = plan.plan_from_town(at.position);
            let place = plan.place(Point2::new(p.x as f32, p.y as f32));
            assert!(place.outside_m < -1.3, "{place:?}");
            centre_crossed += usize::from(place.from_crossing_m > 3.0 && place.lateral_m.abs() < 1.0);
        }
        assert_eq!(centre_crossed, 0);
    }

    #[test]
    fn path_is_smooth_and_its_samples_are_evenly_spaced() {
        let (_, path) = round_a_block();
        for k in 0..(path.length_m() / 0.1) as usize - 2 {
            let [a, b] = [0.1 * k as f64, 0.1 * k as f64 + 0.1].map(|s| path.at(s));
            assert!(((b.position - a.position).norm() - 0.1).abs() < 0.004);
            assert!((b.heading - a.heading).abs() < 0.02, "{k} {a:?} {b:?}");
        }
    }

    #[test]
    fn accelerations_stay_within_the_pace() {
        let (_, path) = round_a_block();
        let table = TimeTable::new(&path, &PACE, None);
        let dt = 0.5;
        let end_s = table.time_s(path.length_m());
        let speed = |t: f64| table.at(t).expect("on the path").1;
        for k in 1..(end_s / dt) as usize - 1 {
            let t = k as f64 * dt;
            let along = (speed(t + dt) - speed(t)) / dt;
            assert!((-2.5..2.0).contains(&along), "{along} at {t} s");
            let (s, v) = table.at(t).expect("on the path");
            assert!(v * v * path.curvatures[(s / STEP_M) as usize].abs() < 2.9);
        }
    }

    #[test]
    fn stop_waits_as_long_as_told() {
        let (_, path) = round_a_block();
        let stop = Stop { length_m: 30.0, wait_s: 4.0 };
        let table = TimeTable::new(&path, &PACE, Some(stop));
        let waiting =
            (0..400).filter(|k| table.at(0.05 * f64::from(*k)).is_some_and(|(_, v)| v == 0.0)).count();
        assert!((79..=81).contains(&waiting), "{waiting}");
        assert!((table.at(table.time_s(20.0)).expect("on the path").0 - 20.0).abs() < 1e-6);
    }
}
