//! A world of blocks and posts on level ground, and a spinning LiDAR that sees it. Everything is deterministic.

use nalgebra::{Point3, Vector3};
use sdslam_core::{LabelledPoint, MapPose, SemanticClass};

/// A plan of a thing that stands upright.
#[derive(Clone, Copy, Debug)]
pub enum Plan {
    /// A rectangle along the axes.
    Block {
        /// Half lengths along x and y \[m\].
        half_m: [f64; 2],
    },
    /// A circle.
    Post {
        /// Radius \[m\].
        radius_m: f64,
    },
}

/// A thing in the world.
#[derive(Clone, Copy, Debug)]
pub struct Solid {
    /// Centre in the plane at time zero \[m\].
    pub at: [f64; 2],
    /// Velocity \[m/s\].
    pub velocity: [f64; 2],
    /// Shape seen from above.
    pub plan: Plan,
    /// Lowest and highest point \[m\].
    pub height: [f64; 2],
    /// Class.
    pub class: SemanticClass,
    /// Roughness of the surface \[m\].
    pub rough_m: f64,
}

/// Things on level ground.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// The things.
    pub solids: Vec<Solid>,
}

/// A spinning LiDAR.
#[derive(Clone, Copy, Debug)]
pub struct Lidar {
    /// Beams, half of them above and half below -8.5 degrees.
    pub beams: usize,
    /// Columns of a turn.
    pub columns: usize,
    /// Standard deviation of a range \[m\].
    pub noise_m: f64,
}

impl Default for Lidar {
    fn default() -> Self {
        Self { beams: 48, columns: 600, noise_m: 0.015 }
    }
}

/// Farthest return \[m\].
const MAX_RANGE_M: f64 = 70.0;

/// A number in 0..1 that depends on nothing but its arguments.
pub fn unit(seed: u64, a: u64, b: u64) -> f64 {
    let mut x = seed ^ a.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ b.wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
    for _ in 0..2 {
        x = (x ^ (x >> 31)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 29)).wrapping_mul(0x94D0_49BB_1331_11EB);
    }
    (x >> 11) as f64 / (1u64 << 53) as f64
}

impl Solid {
    /// Centre at a time \[m\].
    pub fn at(&self, time_s: f64) -> [f64; 2] {
        [0, 1].map(|k| self.at[k] + time_s * self.velocity[k])
    }

    /// It moves.
    pub fn moves(&self) -> bool {
        self.velocity != [0.0; 2]
    }

    fn radius_m(&self) -> f64 {
        match self.plan {
            Plan::Block { half_m: [a, b] } => (a * a + b * b).sqrt(),
            Plan::Post { radius_m } => radius_m,
        }
    }

    /// Range at which a ray enters the thing.
    fn hit(&self, time_s: f64, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let at = self.at(time_s);
        let from = [origin.x - at[0], origin.y - at[1]];
        let sides = match self.plan {
            Plan::Block { half_m } => {
                let x = slab(from[0], direction.x, [-half_m[0], half_m[0]])?;
                overlap(x, slab(from[1], direction.y, [-half_m[1], half_m[1]])?)?
            }
            Plan::Post { radius_m } => circle(from, [direction.x, direction.y], radius_m)?,
        };
        let [enter, leave] = overlap(sides, slab(origin.z, direction.z, self.height)?)?;
        (enter > 0.0 && leave > enter).then_some(enter)
    }
}

/// Where a line is inside an interval.
fn slab(origin: f64, direction: f64, [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    if direction.abs() < 1e-12 {
        return (low..=high).contains(&origin).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let (a, b) = ((low - origin) / direction, (high - origin) / direction);
    Some([a.min(b), a.max(b)])
}

fn overlap(a: [f64; 2], b: [f64; 2]) -> Option<[f64; 2]> {
    let both = [a[0].max(b[0]), a[1].min(b[1])];
    (both[0] < both[1]).then_some(both)
}

fn circle(from: [f64; 2], direction: [f64; 2], radius: f64) -> Option<[f64; 2]> {
    let a = direction[0] * direction[0] + direction[1] * direction[1];
    let b = from[0] * direction[0] + from[1] * direction[1];
    let c = from[0] * from[0] + from[1] * from[1] - radius * radius;
    let root = (b * b - a * c).max(0.0).sqrt();
    (root > 0.0).then_some([(-b - root) / a, (-b + root) / a])
}

/// Sines and cosines of a sensor's elevations and azimuths.
struct Rays {
    beams: Vec<[f64; 2]>,
    columns: Vec<[f64; 2]>,
}

/// Sine and cosine.
pub fn sin_cos(angle: f64) -> [f64; 2] {
    // nalgebra's functions are libm's, the same on every platform.
    let turn = nalgebra::Rotation2::new(angle);
    [turn.matrix()[(1, 0)], turn.matrix()[(0, 0)]]
}

impl Rays {
    fn new(lidar: &Lidar) -> Self {
        let elevation_deg = |beam: usize| {
            let share = beam as f64 / (lidar.beams - 1) as f64;
            // Twice as dense above -8.5 degrees as below, like an HDL-64E.
            if share < 0.5 { 2.0 - 21.0 * share } else { -8.5 - 32.0 * (share - 0.5) }
        };
        let azimuth = |column: usize| (column as f64 + 0.5) / lidar.columns as f64 * std::f64::consts::TAU;
        Self {
            beams: (0..lidar.beams).map(|b| sin_cos(elevation_deg(b).to_radians())).collect(),
            columns: (0..lidar.columns).map(|c| sin_cos(azimuth(c))).collect(),
        }
    }

    /// Direction of a ray in the sensor frame; rays are counted column by column.
    fn direction(&self, ray: usize) -> Vector3<f64> {
        let [up, out] = self.beams[ray % self.beams.len()];
        let [sin, cos] = self.columns[ray / self.beams.len()];
        Vector3::new(out * cos, out * sin, up)
    }

    fn len(&self) -> usize {
        self.beams.len() * self.columns.len()
    }
}

impl Lidar {
    /// The columns that may see a thing: first, and how many.
    fn columns_of(&self, centre: &Point3<f64>, radius_m: f64) -> (usize, usize) {
        let distance = (centre.x * centre.x + centre.y * centre.y).sqrt();
        if distance < 1.05 * radius_m {
            return (0, self.columns);
        }
        let per_radian = self.columns as f64 / std::f64::consts::TAU;
        // A degree more for a sensor that is not level.
        let half = (radius_m / distance).asin() + 0.02;
        let first = ((centre.y.atan2(centre.x) - half) * per_radian).floor();
        let count = (2.0 * half * per_radian).ceil() as usize + 1;
        (first.rem_euclid(self.columns as f64) as usize, count.min(self.columns))
    }
}

fn ground_class(y: f64) -> SemanticClass {
    match y.abs() {
        y if y < 4.5 => SemanticClass::Road,
        y if y < 7.0 => SemanticClass::Sidewalk,
        _ => SemanticClass::Terrain,
    }
}

impl World {
    /// One scan, taken in an instant; `seed` draws its noise.
    pub fn scan(
        &self,
        lidar: &Lidar,
        world_from_sensor: &MapPose,
        time_s: f64,
        seed: u64,
    ) -> Vec<LabelledPoint> {
        let rays = Rays::new(lidar);
        let directions: Vec<Vector3<f64>> =
            (0..rays.len()).map(|ray| world_from_sensor.rotation * rays.direction(ray)).collect();
        let origin = Point3::from(world_from_sensor.translation.vector);
        let mut nearest: Vec<Return> = directions.iter().map(|d| ground_return(&origin, d)).collect();
        for solid in &self.solids {
            let at = solid.at(time_s);
            let centre = world_from_sensor.inverse_transform_point(&Point3::new(at[0], at[1], origin.z));
            if centre.coords.norm() > MAX_RANGE_M + solid.radius_m() {
                continue;
            }
            let (first, count) = lidar.columns_of(&centre, solid.radius_m());
            for column in (first..first + count).map(|c| c % lidar.columns) {
                for ray in column * lidar.beams..(column + 1) * lidar.beams {
                    let hit = solid.hit(time_s, &origin, &directions[ray]);
                    if let Some(range_m) = hit.filter(|range| *range < nearest[ray].range_m) {
                        nearest[ray] = Return { range_m, class: solid.class, rough_m: solid.rough_m };
                    }
                }
            }
        }
        measure(lidar, &rays, &nearest, seed)
    }
}

fn ground_return(origin: &Point3<f64>, direction: &Vector3<f64>) -> Return {
    let range_m = -origin.z / direction.z;
    if direction.z > -1e-6 || range_m > MAX_RANGE_M {
        return Return { range_m: MAX_RANGE_M, class: SemanticClass::Unlabelled, rough_m: 0.0 };
    }
    Return { range_m, class: ground_class(origin.y + range_m * direction.y), rough_m: 0.0 }
}

#[derive(Clone, Copy)]
struct Return {
    range_m: f64,
    class: SemanticClass,
    rough_m: f64,
}

/// The points of the rays that met something, with noise.
fn measure(lidar: &Lidar, rays: &Rays, returns: &[Return], seed: u64) -> Vec<LabelledPoint> {
    let met = returns.iter().enumerate().filter(|(_, r)| r.range_m < MAX_RANGE_M);
    let points = met.map(|(ray, r)| {
        let uniform = |k| unit(seed, ray as u64, k) - 0.5;
        // Four uniform numbers make a bell of deviation 1 / sqrt(3).
        let bell = 1.732 * (0..4).map(uniform).sum::<f64>();
        let range_m = r.range_m + lidar.noise_m * bell + 2.0 * r.rough_m * uniform(9);
        let p = rays.direction(ray) * range_m;
        LabelledPoint::new([p.x as f32, p.y as f32, p.z as f32], r.class)
    });
    points.collect()
}
