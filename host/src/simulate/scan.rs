//! Takes one scan of the town.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use sdslam_core::MapPose;

use super::{
    options::{Options, SensorOptions},
    random::{Domain, Random, combine},
    scene::{Echo, RayKey, first_hit},
    sensor::{self, Laser},
    shape::{Ray, Vec3},
    town::Town,
    traffic::{Crowd, Presence},
};
use crate::dataset::labels;

/// Points in the sensor frame with remission, and a SemanticKITTI label each: id, and instance in the high half.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// x, y, z [m], remission.
    pub points: Vec<[f32; 4]>,
    /// One label for each point.
    pub labels: Vec<u32>,
    /// Instances that moved at the time and have at least one point, with their ids.
    pub moving: BTreeMap<u16, u16>,
}

/// The world and the sensor in it.
pub struct Scanner<'a> {
    /// Everything that stands still.
    pub town: &'a Town,
    /// Everything that moves.
    pub crowd: &'a Crowd,
    /// The sensor.
    pub sensor: &'a SensorOptions,
    /// Seed of the noise.
    pub seed: u64,
    /// Time between two scans [s].
    pub interval_s: f64,
}

impl<'a> Scanner<'a> {
    /// The scanner of a drive.
    pub fn new(options: &'a Options, town: &'a Town, crowd: &'a Crowd) -> Self {
        Self { town, crowd, sensor: &options.sensor, seed: options.seed, interval_s: options.interval_s }
    }

    /// The scan number `frame`, at a pose; instantaneous, ring after ring from the top.
    pub fn scan(&self, frame: usize, town_from_sensor: &MapPose) -> Scan {
        let time_s = frame as f64 * self.interval_s;
        let origin: Vec3 = town_from_sensor.translation.vector.cast();
        let near = self.crowd.presences(self.town, time_s, origin, self.sensor.max_range_m);
        let sectors = Sectors::new(&near, origin);
        let mut scan = Scan::default();
        // The encoder does not start at the same angle in each turn.
        let offset = Random::keyed(self.seed, Domain::Scan, &[frame as u64]).unit();
        let first = (frame * sensor::RINGS * self.sensor.columns) as u64;
        let pose = town_from_sensor.cast();
        for (ring, laser) in sensor::lasers(&self.sensor.flaws).iter().enumerate() {
            let start = scan.points.len();
            for column in 0..self.sensor.columns {
                let step = column as f32 + offset + self.half_steps(first + ring as u64, column);
                let azimuth = step / self.sensor.columns as f32 * std::f32::consts::TAU;
                let number = first + (ring * self.sensor.columns + column) as u64;
                self.shoot(&mut scan, &sectors, &pose, laser, azimuth, number);
            }
            self.mix_edges(&mut scan.points[start..], laser, first + ring as u64);
        }
        scan
    }

    /// What the encoder has added before this column of a ring, in columns.
    fn half_steps(&self, ring: u64, column: usize) -> f32 {
        if !self.sensor.flaws.half_steps {
            return 0.0;
        }
        let same = combine(self.seed ^ 0x4853, ring);
        let added = Random::hashed(combine(same, column as u64 / 12)).below(2);
        Random::hashed(same).unit() + 0.5 * added as f32
    }

    fn shoot(
        &self,
        scan: &mut Scan,
        sectors: &Sectors,
        pose: &Isometry3<f32>,
        laser: &Laser,
        azimuth: f32,
        number: u64,
    ) {
        if !self.sensor.flaws.unmasked && sensor::is_masked(azimuth.to_degrees(), laser) {
            return;
        }
        let (rise, reach) = laser.elevation_deg.to_radians().sin_cos();
        let direction = Vec3::new(reach * azimuth.cos(), reach * azimuth.sin(), rise);
        let lift = Vec3::z() * laser.origin_m;
        let ray = Ray {
            origin: pose.translation.vector + pose.rotation * lift,
            direction: pose.rotation * direction,
        };
        let key = combine(combine(self.seed, Domain::Ray as u64), number);
        let Some(echo) = self.cast(sectors, &ray, key) else { return };
        let streak = self.streak(&echo, azimuth, number);
        let random = &mut Random::hashed(key);
        let Some(seen) = sensor::measure(self.sensor, laser, ray.direction, &echo, random, streak) else {
            return;
        };
        let at = (direction * seen.range_m + lift).map(|c| (1000.0 * c).round() / 1000.0);
        scan.points.push([at.x, at.y, at.z, seen.remission]);
        scan.labels.push(u32::from(echo.surface.label) | u32::from(echo.surface.instance) << 16);
        if labels::is_moving(echo.surface.label.into()) {
            scan.moving.insert(echo.surface.instance, echo.surface.label);
        }
    }

    /// A number that the rays of a ring share while they meet the same thing, 2 to 8 degrees far.
    fn streak(&self, echo: &Echo, azimuth: f32, number: u64) -> Option<f32> {
        if !self.sensor.flaws.streaks {
            return None;
        }
        let ring = number / self.sensor.columns as u64;
        let same = combine(combine(self.seed ^ 0x5354, ring), echo.surface.instance.into());
        let random = &mut Random::hashed(same);
        let (width_deg, shift_deg) = (random.between(2.0, 8.0), random.between(0.0, 8.0));
        let chunk = ((azimuth.to_degrees() + shift_deg) / width_deg) as u64;
        Some(Random::hashed(combine(same, chunk)).unit())
    }

    /// Moves some points at the edges of a ring's surfaces to between the two surfaces.
    fn mix_edges(&self, points: &mut [[f32; 4]], laser: &Laser, number: u64) {
        let share = self.sensor.flaws.mixed;
        if share == 0.0 {
            return;
        }
        let random = &mut Random::hashed(combine(self.seed ^ 0x4d49, number));
        let lift = Vec3::z() * laser.origin_m;
        let from_laser = |p: &[f32; 4]| Vec3::new(p[0], p[1], p[2]) - lift;
        for k in 1..points.len() {
            let (a, b) = (from_laser(&points[k - 1]), from_laser(&points[k]));
            let ratio = b.norm() / a.norm();
            let neighbours = a.dot(&b) > 0.99995 * a.norm() * b.norm();
            if neighbours && !(0.97..=1.03).contains(&ratio) && random.chance(share) {
                let moved = a * (1.0 + (ratio - 1.0) * random.unit()) + lift;
                points[k - 1][..3].copy_from_slice(moved.as_slice());
            }
        }
    }

    fn cast(&self, sectors: &Sectors, ray: &Ray, key: RayKey) -> Option<Echo> {
        let moving = sectors.first_hit(ray, key, self.sensor.max_range_m);
        let limit_m = moving.map_or(self.sensor.max_range_m, |echo| echo.hit.range_m);
        self.town.scene.cast(ray, key, limit_m).or(moving)
    }
}

/// What is around the sensor, sorted by azimuth.
struct Sectors<'a> {
    presences: &'a [Presence],
    sectors: Vec<Vec<u32>>,
}

/// Number of sectors of a turn.
const SECTORS: usize = 360;

impl<'a> Sectors<'a> {
    fn new(presences: &'a [Presence], origin: Vec3) -> Self {
        let mut sectors = vec![Vec::new(); SECTORS];
        for (index, presence) in presences.iter().enumerate() {
            let to = (presence.centre - origin).xy();
            let half_width = (presence.radius_m / to.norm().max(presence.radius_m)).asin() + 0.02;
            let width = (half_width / std::f32::consts::TAU * SECTORS as f32).ceil() as i64;
            for k in -width..=width {
                let sector = (sector_of(to.x, to.y) as i64 + k).rem_euclid(SECTORS as i64);
                let list: &mut Vec<u32> = &mut sectors[sector as usize];
                if list.last() != Some(&(index as u32)) {
                    list.push(index as u32);
                }
            }
        }
        Self { presences, sectors }
    }

    fn first_hit(&self, ray: &Ray, key: RayKey, limit_m: f32) -> Option<Echo> {
        let mut best = None;
        for index in &self.sectors[sector_of(ray.direction.x, ray.direction.y)] {
            let presence = &self.presences[*index as usize];
            let to = presence.centre - ray.origin;
            let miss = to - ray.direction * to.dot(&ray.direction);
            if miss.norm_squared() > presence.radius_m * presence.radius_m {
                continue;
            }
            let limit = best.map_or(limit_m, |echo: Echo| echo.hit.range_m);
            // The high bit keeps these numbers apart from those of the scene.
            let first = 1 << 63 | u64::from(*index) << 16;
            let numbered = presence.solids.iter().enumerate().map(|(k, solid)| (first + k as u64, solid));
            best = first_hit(numbered, &[], ray, key, limit).or(best);
        }
        best
    }
}

fn sector_of(x: f32, y: f32) -> usize {
    let turn = y.atan2(x) / std::f32::consts::TAU + 0.5;
    ((turn * SECTORS as f32) as usize).min(SECTORS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{
        drive::{Drive, SCAN_S},
        options::{Options, Traffic},
    };
    use nalgebra::Point3;

    struct World {
        options: Options,
        town: Town,
        drive: Drive,
        crowd: Crowd,
    }

    /// Small scans without noise, with heavy traffic.
    fn world() -> World {
        let mut options = Options { traffic: Traffic::Heavy, frames: 120, ..Options::demo() };
        options.sensor.columns = 200;
        options.sensor.range_noise_m = 0.0;
        let town = Town::build(options.seed, &options.town);
        let drive = Drive::plan(&options, &town.plan);
        let crowd = Crowd::draw(&options, &town, &drive);
        World { options, town, drive, crowd }
    }

    impl World {
        /// The scan of a frame, with its points in the town.
        fn scan(&self, frame: usize) -> (Scan, Vec<Point3<f64>>) {
            let time_s = frame as f64 * SCAN_S;
            let pose = self.drive.town_from_sensor(self.town.scene.ground(), time_s);
            let (town, crowd) = (&self.town, &self.crowd);
            let scan = Scanner::new(&self.options, town, crowd).scan(frame, &pose);
            let place = |p: &[f32; 4]| pose * Point3::new(p[0].into(), p[1].into(), p[2].into());
            let points = scan.points.iter().map(place).collect();
            (scan, points)
        }
    }

    #[test]
    fn points_of_the_street_lie_on_the_ground_and_houses_off_the_street() {
        let world = world();
        let ground = world.town.scene.ground();
        for frame in [0, 57, 119] {
            let (scan, points) = world.scan(frame);
            for (label, point) in scan.labels.iter().zip(&points) {
                let place = world.town.plan.place(world.town.plan.plan_from_town(point.xy()).cast());
                match label & 0xffff {
                    40 | 44 | 60 => {
                        assert!((ground.height(point.xy()) - point.z).abs() < 0.03, "{label} {point}");
                        assert!(place.outside_m < 0.02, "{label} {place:?}");
                    }
                    // A kerb is steep: the height of a point on its face says little.
                    48 if place.outside_m > 0.1 => {
                        assert!((ground.height(point.xy()) - point.z).abs() < 0.03, "{label} {point}");
                    }
                    48 | 72 => assert!(place.outside_m > -0.02, "{label} {place:?}"),
                    50 | 51 => assert!(place.outside_m > 1.0, "{label} {place:?}"),
                    10 if (label >> 16) < u32::from(world.town.next_instance) => {
                        assert!(point.z > ground.height(point.xy()) - 0.05, "{label} {point}");
                    }
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn only_what_moves_has_a_moving_id_and_lies_where_its_actor_is() {
        let world = world();
        let mut seen = [0, 0];
        for frame in (0..120).step_by(17) {
            let (scan, points) = world.scan(frame);
            for (label, point) in scan.labels.iter().zip(&points) {
                let instance = (label >> 16) as u16;
                if instance < world.town.next_instance {
                    assert!(!labels::is_moving(*label), "{label}");
                    continue;
                }
                let actor = world.crowd.actor(instance).expect("an actor for each instance");
                let state = actor.at(frame as f64 * SCAN_S).expect("present when seen");
                assert_eq!(labels::is_moving(*label), state.speed_mps > 0.3, "{label} {state:?}");
                let (_, radius_m) = actor.kind.sphere();
                assert!((point.xy() - state.position).norm() < f64::from(radius_m) + 0.1);
                seen[usize::from(labels::is_moving(*label))] += 1;
            }
        }
        assert!(seen[0] > 20 && seen[1] > 100, "{seen:?}");
    }

    #[test]
    fn shape_of_what_is_far_away_does_not_hide_what_is_near() {
        let world = world();
        let (scan, _) = world.scan(30);
        let nothing = Crowd::draw(
            &Options { traffic: Traffic::None, ..world.options.clone() },
            &world.town,
            &world.drive,
        );
        let empty = World { crowd: nothing, ..world };
        let (without, _) = empty.scan(30);
        let still = |scan: &Scan| -> Vec<[u32; 4]> {
            let town = |label: &u32| (label >> 16) < u32::from(empty.town.next_instance);
            let points = scan.points.iter().zip(&scan.labels).filter(|(_, label)| town(label));
            points.map(|(point, _)| point.map(f32::to_bits)).collect()
        };
        let all: std::collections::BTreeSet<_> = still(&without).into_iter().collect();
        assert!(still(&scan).iter().all(|point| all.contains(point)), "traffic changed the town");
        assert!(still(&scan).len() < all.len());
    }

    #[test]
    fn mixed_points_stay_on_their_rays_between_two_surfaces() {
        let mut world = world();
        world.options.sensor.columns = 1000;
        let (clean, _) = world.scan(30);
        world.options.sensor.flaws.mixed = 0.5;
        let (mixed, _) = world.scan(30);
        assert_eq!(clean.labels, mixed.labels);
        let mut moved = 0;
        for (a, b) in clean.points.iter().zip(&mixed.points).filter(|(a, b)| a != b) {
            // The lasers sit 0.11 to 0.20 m above the origin of the sensor.
            let ray = |p: &[f32; 4], lift: f32| Vec3::new(p[0], p[1], p[2] - lift);
            let bend = [0.11, 0.20].map(|lift| ray(a, lift).angle(&ray(b, lift)));
            assert!(bend[0].min(bend[1]) < 2e-3, "{a:?} {b:?}");
            moved += 1;
        }
        assert!((50..clean.points.len() / 4).contains(&moved), "{moved} of {}", clean.points.len());
    }

    #[test]
    fn half_steps_move_rays_within_their_columns() {
        let mut world = world();
        let clean = world.scan(30).0;
        world.options.sensor.flaws.half_steps = true;
        let step = std::f32::consts::TAU / world.options.sensor.columns as f32;
        let phase = |p: &[f32; 4]| (p[1].atan2(p[0]).rem_euclid(std::f32::consts::TAU) / step).fract();
        // How well the rays of a scan agree about where in a column they are.
        let agreement = |scan: &Scan| {
            let n = scan.points.len() as f32;
            let sum = |f: fn(f32) -> f32| {
                scan.points.iter().map(|p| f(std::f32::consts::TAU * phase(p))).sum::<f32>() / n
            };
            sum(f32::cos).hypot(sum(f32::sin))
        };
        assert!(agreement(&clean) > 0.95, "{}", agreement(&clean));
        let moved = world.scan(30).0;
        assert!(agreement(&moved) < 0.5, "{}", agreement(&moved));
    }

    #[test]
    fn streaks_take_neighbouring_rays_of_glass_together() {
        let mut world = world();
        world.options.sensor.flaws.streaks = true;
        world.options.sensor.columns = 2000;
        let lone = |world: &World| {
            let (scan, _) = world.scan(30);
            let azimuth = |p: &[f32; 4]| p[1].atan2(p[0]).rem_euclid(std::f32::consts::TAU);
            let step = std::f32::consts::TAU / 2000.0;
            // Gaps of exactly one ray: rays that were lost alone.
            let gaps = scan.points.windows(2).map(|w| (azimuth(&w[1]) - azimuth(&w[0])) / step);
            gaps.filter(|gap| (1.5..2.5).contains(gap)).count()
        };
        let with = lone(&world);
        world.options.sensor.flaws.streaks = false;
        assert!(10 * with < 9 * lone(&world), "{with} of {}", lone(&world));
    }
}
