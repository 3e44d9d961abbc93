//! The drive: its route, and where the sensor is at each scan.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use sdslam_core::MapPose;

use super::{
    ground::Ground,
    options::{Options, Route, SensorOptions},
    path::{Pace, Path, PathPoint, TimeTable},
    plan::{LANE_M, Plan},
    random::{Domain, Random},
};

/// Time between two scans of the real device [s].
pub const SCAN_S: f64 = 0.1;

/// Middle of the vehicle to its axles and to its wheels [m].
const FEET_M: [f64; 2] = [1.35, 0.75];

/// The vehicle that carries the sensor, on its way.
#[derive(Debug)]
pub struct Drive {
    route: Vec<[usize; 2]>,
    path: Path,
    table: TimeTable,
    ride: Ride,
    sensor: SensorOptions,
}

impl Drive {
    /// Plans the drive, long enough for all frames and 15 s more.
    pub fn plan(options: &Options, plan: &Plan) -> Self {
        let needed_s = options.frames as f64 * options.interval_s + 15.0;
        let legs = (needed_s * options.speed_mps / f64::from(options.town.block_length_m[0])) as usize + 4;
        let route = route(options, plan, legs);
        let lane = Path::along_lane(plan, &route, f64::from(LANE_M));
        let first_leg = (plan.crossing(route[1]) - plan.crossing(route[0])).norm();
        let path = lane.from(0.35 * first_leg);
        let pace = Pace {
            cruise_mps: options.speed_mps,
            start_mps: options.start_speed_mps,
            sideways_mps2: 3.0,
            along_mps2: [1.7, 2.2],
        };
        let table = TimeTable::new(&path, &pace, None);
        Self { route, path, table, ride: Ride::draw(options.seed), sensor: options.sensor.clone() }
    }

    /// The crossings on the way; the drive starts between the first two.
    pub fn route(&self) -> &[[usize; 2]] {
        &self.route
    }

    /// The path of the middle of the vehicle.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// When the vehicle is where; time 0 is the first scan.
    pub fn table(&self) -> &TimeTable {
        &self.table
    }

    /// Where the vehicle is at a time [s], and its speed [m/s].
    pub fn at(&self, time_s: f64) -> (PathPoint, f64) {
        let (length, speed) = self.table.at(time_s).unwrap_or((self.path.length_m(), 0.0));
        (self.path.at(length), speed)
    }

    /// Pose of the sensor in the town at a time [s].
    pub fn town_from_sensor(&self, ground: &Ground, time_s: f64) -> MapPose {
        let (point, _) = self.at(time_s);
        let town_from_vehicle = ground.resting_pose(point.position, point.heading, FEET_M);
        let (along, sideways) = self.acceleration(time_s);
        let vehicle_from_body = self.ride.body(time_s, along, sideways);
        let mount = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.sensor.pitch_deg.to_radians());
        let body_from_sensor =
            Isometry3::from_parts(Translation3::new(0.0, 0.0, self.sensor.height_m), mount);
        town_from_vehicle * vehicle_from_body * body_from_sensor
    }

    /// Acceleration along and to the left [m/s2], averaged over the springs' answer time.
    fn acceleration(&self, time_s: f64) -> (f64, f64) {
        let half = 0.5;
        let [(a, va), (b, vb)] = [time_s - half, time_s + half].map(|t| self.at(t.max(0.0)));
        let span = time_s + half - (time_s - half).max(0.0);
        let speed = 0.5 * (va + vb);
        ((vb - va) / span, speed * (b.heading - a.heading) / span)
    }
}

/// The body on its springs: dips when braking, leans in corners, trembles on the road.
#[derive(Debug)]
struct Ride {
    /// Angular frequency [rad/s], phase, and size in heave [m], roll and pitch [rad].
    waves: Vec<(f64, f64, [f64; 3])>,
}

impl Ride {
    fn draw(seed: u64) -> Self {
        let mut random = Random::keyed(seed, Domain::Ride, &[]);
        let mut wave = |frequency_hz: f32| {
            let omega = f64::from(std::f32::consts::TAU * frequency_hz * random.between(0.8, 1.2));
            let sizes = [0.004, 0.0007, 0.0007].map(|s| s * f64::from(random.between(-1.0, 1.0)));
            (omega, f64::from(random.between(0.0, 6.3)), sizes)
        };
        Self { waves: [0.4, 0.9, 1.3, 1.9, 2.6].map(&mut wave).into() }
    }

    fn body(&self, time_s: f64, along_mps2: f64, sideways_mps2: f64) -> MapPose {
        let tremble = |k: usize| -> f64 {
            self.waves.iter().map(|(omega, phase, sizes)| sizes[k] * (omega * time_s + phase).sin()).sum()
        };
        // A soft car: 0.25 deg of pitch, and as much of roll for each m/s2.
        let pitch = tremble(2) - 0.25f64.to_radians() * along_mps2;
        let roll = tremble(1) + 0.25f64.to_radians() * sideways_mps2;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, 0.0);
        Isometry3::from_parts(Translation3::new(0.0, 0.0, tremble(0)), rotation)
    }
}

fn route(options: &Options, plan: &Plan, legs: usize) -> Vec<[usize; 2]> {
    let [i, j] = [(options.town.blocks[0] - 1) / 2, (options.town.blocks[1] - 1) / 2];
    if options.route == Route::Block {
        let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
        return corners.into_iter().cycle().take(legs.max(7)).collect();
    }
    // Round two blocks, over the start street again, and then anywhere.
    let mut route =
        vec![[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1], [i - 1, j + 1], [i - 1, j], [i, j], [i + 1, j]];
    let mut random = Random::keyed(options.seed, Domain::Route, &[]);
    while route.len() < legs {
        let next = next_crossing(plan, &route, &mut random);
        route.push(next);
    }
    route
}

/// Straight on, left or right, never back and never to the edge of the town.
fn next_crossing(plan: &Plan, route: &[[usize; 2]], random: &mut Random) -> [usize; 2] {
    let (here, before) = (route[route.len() - 1], route[route.len() - 2]);
    let size = plan.size();
    let inside = |c: usize, n: usize| c >= 1 && c + 2 <= n;
    let neighbours = [(1i64, 0i64), (0, 1), (-1, 0), (0, -1)]
        .map(|(di, dj)| [(here[0] as i64 + di) as usize, (here[1] as i64 + dj) as usize]);
    let open: Vec<_> = neighbours
        .into_iter()
        .filter(|n| *n != before && inside(n[0], size[0]) && inside(n[1], size[1]))
        .collect();
    let straight = [2 * here[0] - before[0], 2 * here[1] - before[1]];
    if open.contains(&straight) && random.chance(0.35) { straight } else { random.pick(&open) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(options: &Options) -> (Ground, Drive) {
        let plan = Plan::draw(options.seed, &options.town);
        let ground = Ground::shape(options.seed, &options.town, &plan, 60.0);
        (ground, Drive::plan(options, &plan))
    }

    #[test]
    fn demo_returns_to_its_start() {
        for seed in 1..6 {
            let options = Options { seed, ..Options::demo() };
            let (_, drive) = drive(&options);
            let last = (options.frames - 1) as f64 * SCAN_S;
            let start = drive.at(0.0).0;
            let back = (0..=20).any(|k| {
                let (point, _) = drive.at(last - 0.1 * f64::from(k));
                (point.position - start.position).norm() < 1.0
            });
            let end = drive.at(last).0;
            assert!(back || (end.position - start.position).norm() < 40.0, "seed {seed}: {end:?}");
            assert!((end.heading - start.heading).abs() > 4.0, "seed {seed} has not gone round");
        }
    }

    #[test]
    fn long_drive_comes_back_to_its_start_street_and_goes_on() {
        let options = Options { frames: 900, ..Options::town() };
        let (_, drive) = drive(&options);
        let start = drive.at(0.0).0.position;
        let distance = |k: usize| (drive.at(k as f64 * SCAN_S).0.position - start).norm();
        assert!((200..900).any(|k| distance(k) < 1.0));
        assert!((0..900).any(|k| distance(k) > 60.0) && distance(899) > 5.0);
        assert!(drive.at(89.9).1 > 1.0, "stands still before the end");
    }

    #[test]
    fn motion_is_smooth_in_all_six_directions() {
        for options in [Options::demo(), Options { frames: 600, ..Options::town() }] {
            let (ground, drive) = drive(&options);
            let poses: Vec<MapPose> =
                (0..options.frames).map(|k| drive.town_from_sensor(&ground, k as f64 * SCAN_S)).collect();
            let steps: Vec<MapPose> = poses.windows(2).map(|w| w[0].inverse() * w[1]).collect();
            for pair in steps.windows(2) {
                let change = pair[0].inverse() * pair[1];
                assert!(change.translation.vector.norm() / (SCAN_S * SCAN_S) < 5.0, "{change:?}");
                assert!(change.rotation.angle().to_degrees() < 1.2, "{change:?}");
            }
            for pose in &poses {
                let (roll, pitch, _) = pose.rotation.euler_angles();
                assert!(roll.to_degrees().abs() < 5.0 && pitch.to_degrees().abs() < 9.0, "{roll} {pitch}");
            }
            for step in steps {
                assert!(step.translation.x > 0.2 && step.translation.x < 1.1, "{step:?}");
            }
        }
    }
}
