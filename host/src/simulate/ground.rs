//! The ground: a relief with streets, kerbs, sidewalks and gardens on it.

use nalgebra::{Isometry3, Point2, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

use super::{
    options::TownOptions,
    plan::{Place, Plan},
    relief::Relief,
    shape::{Hit, Ray, Vec3},
    style::{BlockStyle, KERB_M},
};

/// What the ground is made of at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cover {
    /// SemanticKITTI id.
    pub label: u16,
    /// Reflectance, 0 to 1.
    pub reflectance: f32,
}

const ROAD: Cover = Cover { label: 40, reflectance: 0.31 };
const PARKING: Cover = Cover { label: 44, reflectance: 0.38 };
const MARKING: Cover = Cover { label: 60, reflectance: 0.62 };
const SIDEWALK: Cover = Cover { label: 48, reflectance: 0.43 };
const TERRAIN: Cover = Cover { label: 72, reflectance: 0.43 };

/// Width over which a kerb rises [m].
const KERB_WIDTH_M: f32 = 0.04;
/// Spacing of the tabulated relief [m].
const CELL_M: f32 = 1.0;

/// The ground of a town.
#[derive(Debug)]
pub struct Ground {
    plan: Plan,
    relief: Relief,
    origin: Vector2<f32>,
    size: [usize; 2],
    /// Relief height and plan coordinates at the nodes.
    nodes: Vec<[f32; 3]>,
    seed: u32,
    /// Whether its reflectance differs from place to place, and grass is rough wherever it grows.
    varied: bool,
}

impl Ground {
    /// Shapes and tabulates the ground for a plan, `margin_m` wider than it.
    pub fn shape(seed: u64, town: &TownOptions, plan: &Plan, margin_m: f32) -> Self {
        let relief = Relief::draw(seed, town, plan);
        let [x0, x1, y0, y1] = plan.extent();
        let origin = Vector2::new(x0 - margin_m, y0 - margin_m);
        let nodes_along = |length: f32| ((length + 2.0 * margin_m) / CELL_M) as usize + 2;
        let size = [nodes_along(x1 - x0), nodes_along(y1 - y0)];
        let node = |k: usize| {
            let (i, j) = (k % size[0], k / size[0]);
            let q = Point2::new(f64::from(origin.x) + i as f64, f64::from(origin.y) + j as f64);
            let p = plan.plan_from_town(q);
            [relief.height(plan.town_from_plan(plan.level(p))) as f32, p.x as f32, p.y as f32]
        };
        let nodes = (0..size[0] * size[1]).map(node).collect();
        Self { plan: plan.clone(), relief, origin, size, nodes, seed: seed as u32, varied: town.varied }
    }

    /// Lower corner and size [m] of the ground in the town.
    pub fn extent(&self) -> (Vector2<f32>, Vector2<f32>) {
        let length = |n: usize| (n - 1) as f32 * CELL_M;
        (self.origin, Vector2::new(length(self.size[0]), length(self.size[1])))
    }

    /// Height of the ground [m], kerbs and banks included, bumps of the grass left out.
    pub fn height(&self, q: Point2<f64>) -> f64 {
        let p = self.plan.plan_from_town(q);
        let relief = self.relief.height(self.plan.town_from_plan(self.plan.level(p)));
        let p = Point2::new(p.x as f32, p.y as f32);
        let profile = street_profile(&self.plan.place(p), self.plan.style_at(p).kerb_m);
        relief + f64::from(profile) + f64::from(self.bank(p))
    }

    /// Whether rays meet blades of grass here and there: then each has to be told how high.
    pub fn has_blades(&self) -> bool {
        self.varied
    }

    /// Pose of a body that rests on the ground on four feet, this far from its middle along and across [m].
    pub fn resting_pose(&self, at: Point2<f64>, heading: f64, feet_m: [f64; 2]) -> Isometry3<f64> {
        let ahead = Vector2::new(heading.cos(), heading.sin());
        let left = Vector2::new(-ahead.y, ahead.x);
        let ends = |axis: Vector2<f64>, reach: f64| {
            let (high, low) = (self.height(at + axis * reach), self.height(at - axis * reach));
            (0.5 * (high + low), (high - low) / (2.0 * reach))
        };
        let ((z, pitch), (_, roll)) = (ends(ahead, feet_m[0]), ends(left, feet_m[1]));
        let forward = Vector3::new(ahead.x, ahead.y, pitch).normalize();
        let up = forward.cross(&Vector3::new(left.x, left.y, roll)).normalize();
        let axes = Rotation3::from_basis_unchecked(&[forward, up.cross(&forward), up]);
        Isometry3::from_parts(Translation3::new(at.x, at.y, z), UnitQuaternion::from_rotation_matrix(&axes))
    }

    /// Height [m] as a ray sees it and the place on the plan; `None` beyond the ground's end.
    fn surface(&self, x: f32, y: f32, blades: f32) -> Option<(f32, Place, Point2<f32>)> {
        let [z, px, py] = self.sample(x, y)?;
        let p = Point2::new(px, py);
        let place = self.plan.place(p);
        if place.outside_m < 0.0 {
            return Some((z + street_profile(&place, KERB_M), place, p));
        }
        let style = self.plan.style_at(p);
        let rough = self.roughness(style, &place);
        let bumps = if rough > 0.0 { rough * self.bumps(style, x, y, blades) } else { 0.0 };
        Some((z + street_profile(&place, style.kerb_m) + (self.bank(p) + bumps), place, p))
    }

    /// Height of a bank at a place of the plan [m].
    fn bank(&self, p: Point2<f32>) -> f32 {
        let Some(block) = self.plan.block_at(p) else { return 0.0 };
        let style = self.plan.style(block);
        if style.bank.is_flat() {
            return 0.0;
        }
        style.bank.rise(self.plan.depth_m(p, block, style.is_open))
    }

    /// How much of the bumps of grass there is, 0 to 1: none on stone, less at its edges.
    fn roughness(&self, style: &BlockStyle, place: &Place) -> f32 {
        let inside = place.outside_m - place.street.sidewalk_m;
        if !self.varied {
            return if inside < style.paved_m { 0.0 } else { inside.clamp(0.0, 1.0) };
        }
        let lawn = inside - style.paved_m;
        (2.0 * lawn.max(verge_m(style, place))).clamp(0.0, 1.0)
    }

    /// Range at which the ray, between two ranges, meets the ground. Rays start above it. `blades` is where between
    /// the ground and the tips of the grass it is stopped, 0 to 1.
    pub fn hit(&self, ray: &Ray, from_m: f32, to_m: f32, blades: f32) -> Option<(Hit, Cover)> {
        let gap = |range: f32| {
            let at = ray.at(range);
            self.surface(at.x, at.y, blades).map(|(z, ..)| at.z - z)
        };
        let stride_m = if self.varied { 0.5 } else { 0.7 };
        let steps = ((to_m - from_m) / stride_m).ceil().max(1.0);
        let (mut above, mut gap_above) = (from_m, gap(from_m)?);
        if gap_above < 0.0 {
            return self.describe(ray, from_m, blades);
        }
        for step in 1..=steps as usize {
            let range = from_m + (to_m - from_m) * step as f32 / steps;
            let gap_here = gap(range)?;
            if gap_here < 0.0 {
                return self.describe(ray, narrow(gap, (above, gap_above), (range, gap_here))?, blades);
            }
            (above, gap_above) = (range, gap_here);
        }
        None
    }

    fn describe(&self, ray: &Ray, range_m: f32, blades: f32) -> Option<(Hit, Cover)> {
        let at = ray.at(range_m);
        let (z, place, p) = self.surface(at.x, at.y, blades)?;
        let slope = |dx: f32, dy: f32| {
            self.surface(at.x + dx, at.y + dy, blades).map_or(0.0, |(ahead, ..)| ahead - z)
        };
        let normal = Vec3::new(-slope(0.02, 0.0), -slope(0.0, 0.02), 0.02).normalize();
        let mut cover = self.cover(p, &place);
        if self.varied {
            cover.reflectance *= self.patches(at.x, at.y);
        }
        Some((Hit { range_m, normal }, cover))
    }

    /// Factor on the reflectance: repairs, stains, other paving.
    fn patches(&self, x: f32, y: f32) -> f32 {
        let (wide, narrow) = (self.noise(x * 0.12, y * 0.12), self.noise(y * 0.9 + 31.0, x * 0.9));
        (0.6 + 0.8 * wide) * if narrow > 0.72 { 0.65 } else { 1.0 }
    }

    /// Lowest and highest ground [m] in a square of the town.
    pub fn bounds(&self, low: Vector2<f32>, side_m: f32) -> (f32, f32) {
        let steps = (side_m / CELL_M).ceil() as usize + 1;
        let spans = (0..steps * steps).filter_map(|k| {
            let at = low + Vector2::new((k % steps) as f32, (k / steps) as f32) * CELL_M;
            let [z, x, y] = self.sample(at.x, at.y)?;
            let p = Point2::new(x, y);
            let [below, above] = self.plan.style_at(p).roughness_m();
            let z = z + self.bank(p);
            Some((z - below, z + above))
        });
        let (low, high) = spans.fold((f32::MAX, f32::MIN), |(l, h), (a, b)| (l.min(a), h.max(b)));
        // Gutters and hollows below the relief, kerbs and tufts above it.
        (low - 0.13, high + 0.14)
    }

    fn sample(&self, x: f32, y: f32) -> Option<[f32; 3]> {
        let (u, v) = ((x - self.origin.x) / CELL_M, (y - self.origin.y) / CELL_M);
        if u < 0.0 || v < 0.0 {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        if i + 1 >= self.size[0] || j + 1 >= self.size[1] {
            return None;
        }
        let (fu, fv) = (u - i as f32, v - j as f32);
        let row = j * self.size[0] + i;
        let [a, b] = [self.nodes[row], self.nodes[row + 1]];
        let [c, d] = [self.nodes[row + self.size[0]], self.nodes[row + self.size[0] + 1]];
        Some(std::array::from_fn(|k| {
            let (low, high) = (a[k] + fu * (b[k] - a[k]), c[k] + fu * (d[k] - c[k]));
            low + fv * (high - low)
        }))
    }

    fn cover(&self, p: Point2<f32>, place: &Place) -> Cover {
        if place.outside_m < 0.0 {
            return road_cover(place);
        }
        let style = self.plan.style_at(p);
        let is_paved = place.outside_m - place.street.sidewalk_m < style.paved_m;
        if is_paved && verge_m(style, place) <= 0.0 { SIDEWALK } else { TERRAIN }
    }

    /// Tufts and unevenness of grass [m]: value noise of two sizes, and blades where it is high.
    fn bumps(&self, style: &BlockStyle, x: f32, y: f32, blades: f32) -> f32 {
        let wide = self.noise(x * 0.8, y * 0.8);
        let ground = 0.10 * (wide - 0.5) + 0.05 * (self.noise(x * 3.1, y * 3.1) - 0.5);
        style.bumps * ground + style.fuzz_m * blades * (2.0 * wide).min(1.5)
    }

    fn noise(&self, x: f32, y: f32) -> f32 {
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (smooth(x - i), smooth(y - j));
        let node = |di: i32, dj: i32| lattice(self.seed, i as i32 + di, j as i32 + dj);
        let low = node(0, 0) + u * (node(1, 0) - node(0, 0));
        let high = node(0, 1) + u * (node(1, 1) - node(0, 1));
        low + v * (high - low)
    }
}

/// False position on a sign change, to 1 mm.
fn narrow(
    gap: impl Fn(f32) -> Option<f32>,
    (mut above, mut gap_above): (f32, f32),
    (mut below, mut gap_below): (f32, f32),
) -> Option<f32> {
    for round in 0..12 {
        // Every third round halves, so that the foot of a kerb cannot stall the search.
        let share = if round % 3 == 2 { 0.5 } else { gap_above / (gap_above - gap_below) };
        let range = above + share * (below - above);
        let here = gap(range)?;
        if here.abs() < 1e-3 {
            return Some(range);
        }
        if here > 0.0 { (above, gap_above) = (range, here) } else { (below, gap_below) = (range, here) }
    }
    Some(0.5 * (above + below))
}

/// How far a place lies inside the grass along the kerb [m]; 0 or less off it.
fn verge_m(style: &BlockStyle, place: &Place) -> f32 {
    let from_kerb = place.outside_m - 0.2;
    if style.is_open {
        return from_kerb;
    }
    let to_edge = style.verge_m - place.outside_m;
    let to_crossing = place.from_crossing_m - 6.0;
    from_kerb.min(to_crossing).min(to_edge)
}

/// Height of the street's surface above the relief [m]: crown, gutter, kerb.
fn street_profile(place: &Place, kerb_m: f32) -> f32 {
    if place.outside_m < 0.0 {
        return 0.01 * (-place.outside_m).min(2.5) - 0.08;
    }
    (place.outside_m / KERB_WIDTH_M).min(1.0) * kerb_m - 0.08
}

fn road_cover(place: &Place) -> Cover {
    let (street, lateral) = (&place.street, place.lateral_m.abs());
    let open = place.from_crossing_m;
    let zebra = (place.crossing[0] * 7 + place.crossing[1] * 3) % 5 == 2;
    if open < 1.0 {
        return ROAD;
    }
    if zebra && open < 4.0 {
        return zebra_bar(lateral);
    }
    let has_stop_line = (place.crossing[0] + place.crossing[1]) % 3 == 1;
    if has_stop_line && (4.3..4.6).contains(&open) && lateral < 3.4 {
        return MARKING;
    }
    if lateral < 0.06 && open > 6.0 && (place.along_m / 6.0).rem_euclid(1.0) < 0.34 {
        return MARKING;
    }
    let bay = lateral > street.half_width_m - street.parking_m;
    if bay && open > 8.0 { PARKING } else { ROAD }
}

fn zebra_bar(lateral: f32) -> Cover {
    if (lateral + 0.25).rem_euclid(1.0) < 0.5 { MARKING } else { ROAD }
}

fn smooth(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// A fixed number in [0, 1) for a lattice point.
fn lattice(seed: u32, i: i32, j: i32) -> f32 {
    let mut h = seed ^ (i as u32).wrapping_mul(0x8DA6_B343) ^ (j as u32).wrapping_mul(0xD816_3841);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    ((h ^ (h >> 15)) >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A varied town of open land.
    fn land(seed: u64) -> Ground {
        let town = TownOptions { blocks: [4, 4], varied: true, country: 1.0, ..TownOptions::default() };
        Ground::shape(seed, &town, &Plan::draw(seed, &town), 20.0)
    }

    #[test]
    fn rough_ground_stays_within_its_bounds_and_near_its_height() {
        let mut steepest = 0.0f32;
        for seed in 0..8 {
            let ground = land(seed);
            for k in 0..1500 {
                let corner = Vector2::new((k % 39) as f32 * 2.3 - 45.0, (k / 39) as f32 * 2.3 - 45.0);
                let (low, high) = ground.bounds(corner, 2.0);
                let at = corner + Vector2::new((k % 7) as f32, (k % 5) as f32) * 0.3;
                let height = ground.height(Point2::new(at.x.into(), at.y.into())) as f32;
                for blades in [0.0, 1.0] {
                    let (z, ..) = ground.surface(at.x, at.y, blades).expect("on the ground");
                    assert!(low < z && z < high, "{at}: {low} {z} {high}");
                    assert!((-0.3..0.6).contains(&(z - height)), "{at}: {z} {height}");
                }
                steepest = steepest.max(high - low);
            }
        }
        assert!(steepest > 2.0, "no banks: {steepest}");
    }

    #[test]
    fn roads_are_as_flat_beside_banks_as_anywhere() {
        let ground = land(3);
        let road = (0..2000).filter_map(|k| {
            let at = Vector2::new((k % 50) as f32 * 1.7 - 42.0, (k / 50) as f32 * 2.1 - 42.0);
            let (z, place, p) = ground.surface(at.x, at.y, 1.0)?;
            let is_road = place.outside_m < 0.0;
            is_road.then_some((z - ground.sample(at.x, at.y)?[0], ground.cover(p, &place)))
        });
        let places: Vec<(f32, Cover)> = road.collect();
        assert!(places.len() > 200);
        assert!(places.iter().all(|(z, cover)| (-0.081..-0.04).contains(z) && cover.label != 72));
    }
}
