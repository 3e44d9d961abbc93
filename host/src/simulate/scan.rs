//! Takes one scan of the town.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use sdslam_core::MapPose;

use super::{
    options::SensorOptions,
    random::{Domain, Random, combine},
    scene::{Echo, RayKey, first_hit},
    sensor::{self, Laser},
    shape::{Ray, Vec3},
    town::Town,
    traffic::{Crowd, Presence},
};

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
}

impl Scanner<'_> {
    /// The scan number `frame`, at a time [s] and a pose; instantaneous, ring after ring from the top.
    pub fn scan(&self, frame: usize, time_s: f64, town_from_sensor: &MapPose) -> Scan {
        let origin: Vec3 = town_from_sensor.translation.vector.cast();
        let near = self.crowd.presences(self.town, time_s, origin, self.sensor.max_range_m);
        let sectors = Sectors::new(&near, origin);
        let mut scan = Scan::default();
        // The encoder does not start at the same angle in each turn.
        let offset = Random::keyed(self.seed, Domain::Scan, &[frame as u64]).unit();
        let first = (frame * sensor::RINGS * self.sensor.columns) as u64;
        let pose = town_from_sensor.cast();
        for (ring, laser) in sensor::lasers().iter().enumerate() {
            for column in 0..self.sensor.columns {
                let azimuth = (column as f32 + offset) / self.sensor.columns as f32 * std::f32::consts::TAU;
                let number = first + (ring * self.sensor.columns + column) as u64;
                self.shoot(&mut scan, &sectors, &pose, laser, azimuth, number);
            }
        }
        scan
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
        if sensor::is_masked(azimuth.to_degrees(), laser) {
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
        let Some(seen) =
            sensor::measure(self.sensor, laser.gain, ray.direction, &echo, &mut Random::hashed(key))
        else {
            return;
        };
        let at = (direction * seen.range_m + lift).map(|c| (1000.0 * c).round() / 1000.0);
        scan.points.push([at.x, at.y, at.z, seen.remission]);
        scan.labels.push(u32::from(echo.surface.label) | u32::from(echo.surface.instance) << 16);
        if echo.surface.label >= 252 {
            scan.moving.insert(echo.surface.instance, echo.surface.label);
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
