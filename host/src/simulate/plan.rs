//! The street plan. It is drawn on squared paper (plan coordinates: avenues along y, streets along x) and then bent
//! by a smooth map into the town, so that no street is straight and no crossing exactly square.

use nalgebra::{Point2, Rotation2, Vector2};

use super::{
    options::TownOptions,
    random::{Domain, Random},
    style::{BlockStyle, Kind, OUTSIDE, draw_style, draw_varied_style},
};

/// A street of the plan.
#[derive(Clone, Copy, Debug)]
pub struct Street {
    /// Plan coordinate of the centre line [m].
    pub centre_m: f32,
    /// Centre line to kerb [m].
    pub half_width_m: f32,
    /// Width of the parking strip at each kerb [m], 0 = none.
    pub parking_m: f32,
    /// Width of each sidewalk [m].
    pub sidewalk_m: f32,
}

impl Street {
    /// Centre line to the outer edge of the sidewalk [m].
    pub fn reach_m(&self) -> f32 {
        self.half_width_m + self.sidewalk_m
    }
}

/// Direction in which a street runs on the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Along plan y.
    Avenue,
    /// Along plan x.
    Street,
}

/// Where a point of the plan lies relative to the streets.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Distance outside the nearest kerb [m]; negative on the road.
    pub outside_m: f32,
    /// Distance from the nearest centre line [m].
    pub lateral_m: f32,
    /// Distance outside the kerb of the nearest crossing street [m].
    pub from_crossing_m: f32,
    /// Coordinate along the nearest street [m].
    pub along_m: f32,
    /// The nearest street.
    pub street: Street,
    /// Avenue and street index of the nearest crossing.
    pub crossing: [usize; 2],
}

/// Lane centre to centre line [m].
pub const LANE_M: f32 = 1.65;
/// Radius of the kerb at a crossing [m].
const KERB_RADIUS_M: f32 = 5.0;

/// The street plan.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Streets along plan y, by x.
    pub avenues: Vec<Street>,
    /// Streets along plan x, by y.
    pub streets: Vec<Street>,
    styles: Vec<BlockStyle>,
    bend: Bend,
}

/// The smooth map from the plan to the town.
#[derive(Clone, Copy, Debug)]
struct Bend {
    amplitude_m: f64,
    wave: [f64; 2],
    phase: [f64; 2],
}

impl Plan {
    /// Draws the plan of a seed.
    pub fn draw(seed: u64, town: &TownOptions) -> Self {
        let mut random = Random::keyed(seed, Domain::Plan, &[]);
        let avenues = draw_streets(town, 0, &mut random);
        let streets = draw_streets(town, 1, &mut random);
        let first = random.below(5);
        let kind = |k: usize| Kind::ALL[(first + k / town.blocks[1] + 2 * (k % town.blocks[1])) % 5];
        let styles = (0..town.blocks[0] * town.blocks[1])
            .map(|k| {
                if town.varied {
                    draw_varied_style(town, &mut random)
                } else {
                    draw_style(kind(k), &mut random)
                }
            })
            .collect();
        let mut wave = || std::f64::consts::TAU / f64::from(random.between(130.0, 200.0));
        let bend = Bend {
            amplitude_m: f64::from(town.bend_m),
            wave: [wave(), wave()],
            phase: [f64::from(random.between(0.0, 6.0)), f64::from(random.between(0.0, 6.0))],
        };
        Self { avenues, streets, styles, bend }
    }

    /// Plan to town.
    pub fn town_from_plan(&self, p: Point2<f64>) -> Point2<f64> {
        let shift =
            |k: usize, c: f64| self.bend.amplitude_m * (self.bend.wave[k] * c + self.bend.phase[k]).sin();
        Point2::new(p.x + shift(0, p.y), p.y + shift(1, p.x))
    }

    /// Town to plan.
    pub fn plan_from_town(&self, q: Point2<f64>) -> Point2<f64> {
        // The bend's slope is below 0.25, so that each round divides the error by four or more.
        let mut p = q;
        for _ in 0..14 {
            let error = q - self.town_from_plan(p);
            p += error;
            if error.norm_squared() < 1e-14 {
                break;
            }
        }
        p
    }

    /// A direction on the plan as an angle in the town [rad].
    pub fn heading(&self, p: Point2<f64>, direction: Vector2<f64>) -> f64 {
        let ahead = self.town_from_plan(p + direction * 0.05) - self.town_from_plan(p - direction * 0.05);
        ahead.y.atan2(ahead.x)
    }

    /// Middle of a crossing on the plan.
    pub fn crossing(&self, node: [usize; 2]) -> Point2<f64> {
        Point2::new(f64::from(self.avenues[node[0]].centre_m), f64::from(self.streets[node[1]].centre_m))
    }

    /// Number of avenues and streets.
    pub fn size(&self) -> [usize; 2] {
        [self.avenues.len(), self.streets.len()]
    }

    /// Plan rectangle from the middle of the first crossing to that of the last: x from, x to, y from, y to [m].
    pub fn extent(&self) -> [f32; 4] {
        let ends = |s: &[Street]| [s[0].centre_m, s[s.len() - 1].centre_m];
        let ([x0, x1], [y0, y1]) = (ends(&self.avenues), ends(&self.streets));
        [x0, x1, y0, y1]
    }

    /// Style of the block whose lower left crossing is this one.
    pub fn style(&self, block: [usize; 2]) -> &BlockStyle {
        &self.styles[block[0] * (self.streets.len() - 1) + block[1]]
    }

    /// Style of the block that a point lies in.
    pub fn style_at(&self, p: Point2<f32>) -> &BlockStyle {
        self.block_at(p).map_or(&OUTSIDE, |block| self.style(block))
    }

    /// How far a point lies inside a block [m]: from the kerb, or from the inner edge of the sidewalk.
    pub fn depth_m(&self, p: Point2<f32>, [i, j]: [usize; 2], from_kerb: bool) -> f32 {
        let edge = |s: &Street| if from_kerb { s.half_width_m } else { s.reach_m() };
        let within = |streets: &[Street], k: usize, c: f32| {
            let (low, high) = (&streets[k], &streets[k + 1]);
            (c - low.centre_m - edge(low)).min(high.centre_m - edge(high) - c)
        };
        rounded_corner(within(&self.avenues, i, p.x), within(&self.streets, j, p.y))
    }

    /// The block that a point lies in, centre lines taken as its edges; `None` outside the town.
    pub fn block_at(&self, p: Point2<f32>) -> Option<[usize; 2]> {
        let slot = |streets: &[Street], c: f32| {
            let after = streets.partition_point(|s| s.centre_m <= c);
            (after > 0 && after < streets.len()).then(|| after - 1)
        };
        Some([slot(&self.avenues, p.x)?, slot(&self.streets, p.y)?])
    }

    /// Draws a point of the plan towards the middle of the streets near it: a relief seen from there has hardly a
    /// slope across the streets, and none at crossings.
    pub fn level(&self, p: Point2<f64>) -> Point2<f64> {
        let squeeze = |streets: &[Street], c: f64| {
            let centre = f64::from(streets[nearest(streets, c as f32)].centre_m);
            centre + flatten(c - centre)
        };
        Point2::new(squeeze(&self.avenues, p.x), squeeze(&self.streets, p.y))
    }

    /// Where a point lies relative to the streets.
    pub fn place(&self, p: Point2<f32>) -> Place {
        let (i, j) = (nearest(&self.avenues, p.x), nearest(&self.streets, p.y));
        let (avenue, street) = (self.avenues[i], self.streets[j]);
        let (dx, dy) = (p.x - avenue.centre_m, p.y - street.centre_m);
        let (ex, ey) = (dx.abs() - avenue.half_width_m, dy.abs() - street.half_width_m);
        let common = |street, lateral_m, along_m, from_crossing_m| Place {
            outside_m: rounded_corner(ex, ey),
            lateral_m,
            from_crossing_m,
            along_m,
            street,
            crossing: [i, j],
        };
        if ex < ey { common(avenue, dx, p.y, ey) } else { common(street, dy, p.x, ex) }
    }
}

/// Index of the street whose centre line is nearest to a coordinate. No branch to guess: rays ask at random.
fn nearest(streets: &[Street], c: f32) -> usize {
    let beyond = |pair: &[Street]| usize::from(2.0 * c > pair[0].centre_m + pair[1].centre_m);
    streets.windows(2).map(beyond).sum()
}

/// A smooth odd function: small slope up to the edge of a road, the identity from some way into the block.
fn flatten(offset_m: f64) -> f64 {
    const SLOPE: f64 = 0.4;
    const EDGES_M: [f64; 2] = [6.0, 17.0];
    let (d, [low, high]) = (offset_m.abs(), EDGES_M);
    if d <= low {
        return SLOPE * offset_m;
    }
    if d >= high {
        return offset_m;
    }
    let (t, width) = ((d - low) / (high - low), high - low);
    let s = 1.0 - t;
    let cubic = s * s * (1.0 + 2.0 * t) * SLOPE * low + t * t * (3.0 - 2.0 * t) * high;
    (cubic + s * s * t * width * SLOPE - t * t * s * width).copysign(offset_m)
}

/// Signed distance to the kerb of two crossing streets whose corner is rounded.
fn rounded_corner(ex: f32, ey: f32) -> f32 {
    if ex.max(ey) <= 0.0 || ex >= KERB_RADIUS_M || ey >= KERB_RADIUS_M {
        return ex.min(ey);
    }
    let (x, y) = ((KERB_RADIUS_M - ex).max(0.0), (KERB_RADIUS_M - ey).max(0.0));
    KERB_RADIUS_M - x.hypot(y)
}

fn draw_streets(town: &TownOptions, axis: usize, random: &mut Random) -> Vec<Street> {
    let (blocks, [short, long]) = (town.blocks[axis], town.block_length_m);
    let gaps: Vec<f32> = (0..blocks).map(|_| random.between(short, long)).collect();
    let mut centre_m = -0.5 * gaps.iter().sum::<f32>();
    let mut streets = Vec::with_capacity(blocks + 1);
    for k in 0..=blocks {
        let parking_m = if random.chance(0.6) { 2.0 } else { 0.0 };
        let street = Street {
            centre_m,
            half_width_m: 3.3 + parking_m,
            parking_m,
            sidewalk_m: random.between(1.9, 2.8),
        };
        streets.push(if town.varied { vary_street(street, town, random) } else { street });
        centre_m += gaps.get(k).copied().unwrap_or(0.0);
    }
    streets
}

/// More lanes, bays for parking across, narrow and wide sidewalks; in the centre narrow streets, in the country wide
/// ones.
fn vary_street(street: Street, town: &TownOptions, random: &mut Random) -> Street {
    if random.chance(town.country) {
        let half_width_m = 3.3 + random.pick(&[0.0, 0.5, 2.5, 4.0, 7.0]);
        return Street { half_width_m, parking_m: 0.0, sidewalk_m: random.between(1.9, 2.8), ..street };
    }
    if random.chance(0.8 * town.centre) {
        let parking_m = random.pick(&[0.0, 0.0, 2.0]);
        let sidewalk_m = random.pick(&[0.8, 1.3, 2.0, 3.5, 6.0]) + random.between(0.0, 0.7);
        return Street { half_width_m: 3.3 + parking_m, parking_m, sidewalk_m, ..street };
    }
    let parking_m = random.pick(&[0.0, street.parking_m, 2.0, 2.0, 4.8]);
    let lanes_m = random.pick(&[0.0, 0.0, 0.0, 0.0, 0.8, 3.2, 5.0]);
    Street {
        half_width_m: 3.3 + parking_m + lanes_m,
        parking_m,
        sidewalk_m: random.pick(&[1.3, 1.8, 2.4, 3.0, 4.5, 6.0]) + random.between(0.0, 0.5),
        ..street
    }
}

/// Unit vector to the right of a direction.
pub fn right_of(direction: Vector2<f64>) -> Vector2<f64> {
    Rotation2::new(-std::f64::consts::FRAC_PI_2) * direction
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        Plan::draw(3, &TownOptions::default())
    }

    #[test]
    fn bending_and_straightening_are_inverse() {
        let plan = plan();
        for k in 0..200 {
            let p = Point2::new(-100.0 + f64::from(k), 0.7 * f64::from(k) - 60.0);
            assert!((plan.plan_from_town(plan.town_from_plan(p)) - p).norm() < 1e-6);
        }
    }

    #[test]
    fn centre_lines_are_road_and_block_middles_are_not() {
        let plan = plan();
        let [x, y] = [plan.avenues[2].centre_m, plan.streets[2].centre_m];
        let next = plan.avenues[3].centre_m;
        assert!(plan.place(Point2::new(x, y + 20.0)).outside_m <= -3.2);
        assert!(plan.place(Point2::new(0.5 * (x + next), y + 20.0)).outside_m > 5.0);
        assert_eq!(plan.block_at(Point2::new(x + 1.0, y + 1.0)), Some([2, 2]));
        assert_eq!(plan.block_at(Point2::new(x - 1e4, y)), None);
    }

    #[test]
    fn flattening_is_continuous_and_monotone() {
        for k in -250..250 {
            let [a, b] = [0.1 * f64::from(k), 0.1 * f64::from(k) + 0.1].map(flatten);
            assert!(b > a && b - a < 0.19, "{k}: {a} {b}");
        }
    }

    #[test]
    fn edge_distance_has_no_jumps() {
        let plan = plan();
        let node = plan.crossing([2, 2]);
        for k in 0..400 {
            let angle = f64::from(k) * 0.0157;
            let at = |a: f64| {
                let p = node + Vector2::new(a.cos(), a.sin()) * 8.0;
                plan.place(Point2::new(p.x as f32, p.y as f32)).outside_m
            };
            assert!((at(angle) - at(angle + 0.0157)).abs() < 0.2);
        }
    }
}
