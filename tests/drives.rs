//! Whole drives: how far the pose may be off, what is found to move, and what happens when the sensor sees nothing.

use std::path::PathBuf;
use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};
use sdslam::dataset::{ELEVATION_CORRECTION_DEG, Sequence, correct_elevation, labels};
use sdslam_core::landmarks::MotionState;
use sdslam_core::{
    Config, FrameEstimate, FrameStatus, FullScanOdometry, LabelledPoint, MapPose, MotionClass, SemanticClass,
    TrackReport,
};
use sdslam_tests::drive::{Drive, Frame, largest_difference, pose_on_street, poses, traffic};
use sdslam_tests::odometry::{full_scan, process, process_fully};
use sdslam_tests::simulated::{Simulated, options, simulated};
use sdslam_tests::street::{car, street};
use sdslam_tests::world::{Lidar, Solid};

/// A sensor with few columns, where the scene matters and not the density of the points.
const COARSE: Lidar = Lidar { beams: 48, columns: 360, noise_m: 0.015 };

/// Straight down a street, 0.8 m a scan, from a place along it.
fn straight(from_m: f64, frames: usize, step_m: f64) -> Drive {
    let world = street(from_m + step_m * frames as f64, 3);
    let poses: Vec<MapPose> =
        (0..frames).map(|k| pose_on_street(from_m + step_m * k as f64, -1.2, 0.0)).collect();
    Drive::record(&world, &COARSE, &poses)
}

fn accurate() -> Box<FullScanOdometry> {
    full_scan(Config::accurate())
}

fn is_registered(estimate: &FrameEstimate) -> bool {
    estimate.status == FrameStatus::Registered
}

/// Errors of the motion from frame to frame \[m, deg\].
fn largest_step_error(found: &[MapPose], truth: &[MapPose]) -> (f64, f64) {
    let steps =
        |poses: &[MapPose]| -> Vec<MapPose> { poses.windows(2).map(|w| w[0].inv_mul(&w[1])).collect() };
    largest_difference(&steps(found), &steps(truth))
}

// ---- the simulated town ----

fn town() -> &'static Simulated {
    static TOWN: OnceLock<Simulated> = OnceLock::new();
    TOWN.get_or_init(|| simulated(&options(90)))
}

/// Points of movable things by truth and answer.
#[derive(Default, Debug)]
struct MovingPoints {
    found: u32,
    missed: u32,
    false_alarms: u32,
}

impl MovingPoints {
    fn iou(&self) -> f64 {
        f64::from(self.found) / f64::from(self.found + self.missed + self.false_alarms)
    }
}

/// The town's drive with a preset: its poses, and how well points were told to move after the first second.
fn drive_through_town(config: Config) -> (Vec<MapPose>, MovingPoints) {
    let (mut odometry, mut found, mut moving) = (full_scan(config), Vec::new(), MovingPoints::default());
    for (k, frame) in town().drive.frames.iter().enumerate() {
        let answer = process_fully(&mut odometry, frame.stamp_s, &frame.points);
        assert!(k == 0 || is_registered(&answer.estimate), "frame {k}: {:?}", answer.estimate.status);
        found.push(answer.estimate.map_from_sensor);
        let movable = |p: &LabelledPoint| p.class.motion() == MotionClass::UnknownMotion;
        let points = answer.points.iter().zip(&town().moving[k]).filter(|(p, _)| k >= 10 && movable(p));
        for (point, moves) in points {
            let landmark = odometry.landmarks().get(point.landmark as usize);
            match (moves, landmark.is_some_and(|l| l.state == MotionState::Dynamic)) {
                (true, true) => moving.found += 1,
                (true, false) => moving.missed += 1,
                (false, true) => moving.false_alarms += 1,
                (false, false) => {}
            }
        }
    }
    (found, moving)
}

#[test]
fn the_town_is_followed_and_its_traffic_recognised() {
    let (found, moving) = drive_through_town(Config::accurate());
    let (off_m, off_deg) = largest_difference(&found, &town().drive.truth());
    assert!(off_m < 0.05 && off_deg < 0.05, "{off_m} m, {off_deg} deg off");
    assert!(moving.found > 10_000 && moving.iou() > 0.85, "{moving:?}, IoU {}", moving.iou());
}

#[test]
fn the_papers_method_alone_follows_the_town_roughly() {
    let (found, moving) = drive_through_town(Config::paper());
    let truth = town().drive.truth();
    // Roll is not estimated, and a hull is good to a decimetre.
    let (off_m, off_deg) = largest_difference(&found, &truth);
    assert!(off_m < 2.0 && off_deg < 12.0, "{off_m} m, {off_deg} deg off");
    let (step_m, step_deg) = largest_step_error(&found, &truth);
    assert!(step_m < 0.4 && step_deg < 2.0, "{step_m} m, {step_deg} deg in a frame");
    // Equation 5 misses what moves steadily.
    assert!(moving.found > 10_000 && moving.iou() > 0.3, "{moving:?}, IoU {}", moving.iou());
}

// ---- the street ----

/// What is seen of one thing over a drive.
#[derive(Clone, Copy, Default, Debug)]
struct Followed {
    frames: u32,
    dynamic: u32,
    /// Frames with a settled track, and those in which its speed is right.
    settled: u32,
    right_speed: u32,
}

impl Followed {
    fn add(&mut self, track: &TrackReport, velocity: [f64; 2]) {
        let off = [0, 1].map(|k| f64::from(track.velocity[k]) - velocity[k]);
        self.frames += 1;
        self.dynamic += u32::from(track.state == MotionState::Dynamic);
        self.settled += u32::from(track.hits > 10);
        self.right_speed += u32::from(track.hits > 10 && off[0].hypot(off[1]) < 2.0);
    }

    fn dynamic_share(&self) -> f64 {
        f64::from(self.dynamic) / f64::from(self.frames)
    }
}

/// Follows the three movers of the street, and all that is parked.
fn follow_traffic(config: Config) -> ([Followed; 3], Followed) {
    let drive = Drive::down_the_street(100, 8.0);
    let world_from_map = drive.frames[0].world_from_sensor;
    let (mut odometry, movers) = (full_scan(config), traffic());
    let (mut moving, mut parked) = ([Followed::default(); 3], Followed::default());
    for frame in &drive.frames {
        process(&mut odometry, frame.stamp_s, &frame.points);
        for mut track in odometry.tracks().filter(|t| t.landmark.is_some()) {
            let at = world_from_map * Point3::from(track.position);
            let turned = world_from_map.rotation
                * Vector3::new(f64::from(track.velocity[0]), f64::from(track.velocity[1]), 0.0);
            track.velocity = [turned.x as f32, turned.y as f32];
            let is_at = |m: &Solid| {
                let c = m.at(frame.stamp_s);
                m.class == track.class && (c[0] - at.x).abs() < 2.5 && (c[1] - at.y).abs() < 1.0
            };
            match movers.iter().position(is_at) {
                Some(mover) => moving[mover].add(&track, movers[mover].velocity),
                None => parked.add(&track, [0.0; 2]),
            }
        }
    }
    (moving, parked)
}

#[test]
fn what_moves_on_the_street_is_dynamic_and_what_is_parked_is_not() {
    let (moving, parked) = follow_traffic(Config::accurate());
    for followed in moving {
        assert!(followed.frames > 60, "{followed:?}");
        assert!(followed.dynamic_share() > 0.9, "{followed:?}");
        assert!(f64::from(followed.right_speed) > 0.6 * f64::from(followed.settled), "{followed:?}");
    }
    assert!(parked.frames > 800 && parked.dynamic_share() < 0.03, "{parked:?}");
}

#[test]
fn equation_5_calls_more_parked_cars_dynamic_than_the_evidence_does() {
    let (moving, parked) = follow_traffic(Config::paper());
    assert!(moving.iter().all(|m| m.frames > 60 && m.dynamic_share() > 0.4), "{moving:?}");
    let (_, parked_by_evidence) = follow_traffic(Config::accurate());
    assert!(parked.dynamic_share() > 2.0 * parked_by_evidence.dynamic_share(), "{parked:?}");
    assert!(parked.dynamic_share() < 0.3, "{parked:?}");
}

#[test]
fn what_moves_is_left_out_of_the_registration() {
    let mut world = street(40.0, 3);
    // Vans on the left, all as fast as the sensor.
    let van = |k: i32| Solid { height: [0.3, 2.6], ..car([10.0 * f64::from(k), 1.6], 8.0) };
    world.solids.extend((-1..=1).map(van));
    let poses: Vec<MapPose> = (0..20).map(|k| pose_on_street(0.8 * k as f64, -1.2, 0.0)).collect();
    let mut drive = Drive::record(&world, &Lidar::default(), &poses);
    // The last scan shows nothing but them.
    drive.frames[19].points.retain(|p| {
        p.class == SemanticClass::Car && p.position[0].abs() < 18.0 && (1.0..4.0).contains(&p.position[1])
    });
    let estimates = drive.run(&mut accurate());
    let [before, alone] = [18, 19].map(|k| estimates[k].evidence);
    assert!(alone.motion.dynamic > 2 && alone.buffers.cells > 150, "{alone:?}");
    assert!(alone.dense.source_points < alone.buffers.cells / 4, "{:?}", alone.dense);
    assert!(before.dense.source_points > 1000 && is_registered(&estimates[18]));
}

#[test]
fn a_car_in_parts_keeps_its_track() {
    // Rear and roof are 1.8 m apart in the scans, and the car moves by 1.6 m from one to the next.
    let mut world = street(50.0, 3);
    world.solids.push(car([12.0, -1.2], 16.0));
    let poses: Vec<MapPose> = (0..30).map(|k| pose_on_street(1.6 * k as f64, -1.2, 0.0)).collect();
    let drive = Drive::record(&world, &Lidar { columns: 900, ..COARSE }, &poses);
    let mut odometry = accurate();
    for (k, frame) in drive.frames.iter().enumerate() {
        process(&mut odometry, frame.stamp_s, &frame.points);
        let rear_m = 9.9 + 1.6 * k as f64;
        let is_rear = |t: &TrackReport| (t.position[0] - rear_m).abs() < 1.0 && t.position[1].abs() < 0.5;
        let track = odometry.tracks().find(is_rear);
        let state = track.map(|t| (t.state, t.hits));
        assert!(k < 10 || state.is_some_and(|s| s.0 == MotionState::Dynamic), "frame {k}: {state:?}");
    }
}

// ---- long drives ----

#[test]
fn a_long_drive_moves_its_anchor_without_a_jump() {
    let drive = straight(0.0, 280, 1.6);
    let mut odometry = accurate();
    let (mut found, mut parked) = (Vec::new(), std::collections::BTreeMap::<u32, [f64; 3]>::new());
    for frame in &drive.frames {
        let estimate = process(&mut odometry, frame.stamp_s, &frame.points);
        assert!(estimate.frame == 0 || is_registered(&estimate), "{:?}", estimate.status);
        found.push(estimate.map_from_sensor);
        for track in odometry.tracks().filter(|t| t.state == MotionState::SemiStatic && t.hits > 5) {
            if let Some(before) = parked.insert(track.id, track.position) {
                let moved = (0..3).map(|k| (track.position[k] - before[k]).powi(2)).sum::<f64>().sqrt();
                assert!(moved < 10.0, "frame {}: track {} jumped {moved} m", estimate.frame, track.id);
            }
        }
    }
    let truth = drive.truth();
    assert!(truth[279].translation.x > 440.0 && parked.len() > 20);
    let (off_m, off_deg) = largest_difference(&found, &truth);
    assert!(off_m < 0.5 && off_deg < 0.1, "{off_m} m, {off_deg} deg off");
    let (step_m, step_deg) = largest_step_error(&found, &truth);
    assert!(step_m < 0.02 && step_deg < 0.03, "{step_m} m, {step_deg} deg in a frame");
}

#[test]
fn evidence_of_motion_outlives_a_move_of_the_anchor() {
    // An oncoming van stands, in each scan, where the scans before looked through.
    let mut world = street(190.0, 3);
    world.solids.push(Solid { height: [0.3, 2.6], ..car([264.0, 1.6], -8.0) });
    let poses: Vec<MapPose> = (0..108).map(|k| pose_on_street(1.6 * k as f64, -1.2, 0.0)).collect();
    let drive = Drive::record(&world, &Lidar { columns: 900, ..COARSE }, &poses);
    let mut odometry = accurate();
    let evidence = |frame: &Frame| {
        process(&mut odometry, frame.stamp_s, &frame.points);
        let van_m = 264.0 - 8.0 * frame.stamp_s;
        let is_van = |t: &TrackReport| {
            (t.position[0] - van_m).abs() < 3.0 && (t.position[1] - 2.8).abs() < 1.0 && t.landmark.is_some()
        };
        let track = odometry.tracks().find(is_van);
        track.map_or(0.0, |t| t.evidence.appeared)
    };
    let appeared: Vec<f32> = drive.frames.iter().map(evidence).collect();
    let least = |frames: std::ops::Range<usize>| appeared[frames].iter().copied().fold(1.0, f32::min);
    // The anchor moves at 160 m, which is frame 100.
    let (before, after) = (least(93..99), least(101..107));
    assert!(before > 0.3 && after > 0.5 * before, "{before} before, {after} after");
}

#[test]
fn the_papers_method_alone_survives_a_long_drive() {
    let drive = straight(0.0, 280, 1.6);
    let estimates = drive.run(&mut full_scan(Config::paper()));
    assert!(estimates[1..].iter().all(is_registered));
    let (off_m, off_deg) = largest_difference(&poses(&estimates), &drive.truth());
    assert!(off_m < 5.0 && off_deg < 0.5, "{off_m} m, {off_deg} deg off");
    let (step_m, _) = largest_step_error(&poses(&estimates), &drive.truth());
    assert!(step_m < 0.5, "{step_m} m in a frame");
}

#[test]
fn memory_in_use_stops_growing() {
    // There and back, twice: the second time meets nothing new.
    let there: Vec<Frame> = straight(0.0, 40, 1.0).frames;
    let round: Vec<Frame> = there.iter().chain(there.iter().rev()).cloned().collect();
    let mut odometry = accurate();
    let mut used = Vec::new();
    for (k, frame) in round.iter().cycle().take(2 * round.len()).enumerate() {
        let estimate = process(&mut odometry, 0.1 * k as f64, &frame.points);
        assert!(k == 0 || is_registered(&estimate), "frame {k}");
        used.push(estimate.evidence.buffers);
    }
    let (first, second) = (used[round.len() - 1], used[2 * round.len() - 1]);
    assert!(second.voxels < first.voxels + first.voxels / 20, "{first:?} then {second:?}");
    assert!(first.voxels > 3000 && second.voxels_evicted == 0 && second.tracks < 2 * first.tracks + 5);
}

// ---- in the dark ----

#[test]
fn a_tunnel_of_two_seconds_is_predicted_and_the_drive_goes_on() {
    for (config, off_m, off_deg) in [(Config::accurate(), 0.05, 0.05), (Config::paper(), 0.4, 0.4)] {
        let mut drive = Drive::down_the_street(45, 8.0);
        drive.frames[12..32].iter_mut().for_each(|f| f.points.clear());
        let estimates = drive.run(&mut full_scan(config));
        assert!(estimates[12..32].iter().all(|e| matches!(e.status, FrameStatus::Predicted(_))));
        assert!(estimates[34..].iter().all(is_registered));
        let (position, angle) = largest_difference(&poses(&estimates)[34..], &drive.truth()[34..]);
        assert!(position < off_m && angle < off_deg, "{position} m, {angle} deg off");
    }
}

#[test]
fn a_change_of_speed_in_the_dark_is_found() {
    // Ten scans without a point; meanwhile the sensor slows down and is 2 m short of where it was expected.
    let x = |k: usize| 0.8 * k as f64 - if k >= 30 { 2.0 } else { 0.0 };
    let poses: Vec<MapPose> = (0..40).map(|k| pose_on_street(x(k), -1.2, 0.0)).collect();
    let mut drive = Drive::record(&street(40.0, 3), &Lidar::default(), &poses);
    drive.frames[20..30].iter_mut().for_each(|f| f.points.clear());
    let found = sdslam_tests::drive::poses(&drive.run(&mut accurate()));
    let (off_m, off_deg) = largest_difference(&found[31..], &drive.truth()[31..]);
    assert!(off_m < 0.05 && off_deg < 0.05, "{off_m} m, {off_deg} deg off");
}

#[test]
fn missing_scans_are_bridged_by_the_prediction() {
    // The stamps tell of the gap; there are no scans in it.
    let mut drive = Drive::down_the_street(40, 8.0);
    drive.frames.drain(15..20);
    let estimates = drive.run(&mut accurate());
    assert!(estimates[1..].iter().all(is_registered));
    let (off_m, off_deg) = largest_difference(&poses(&estimates), &drive.truth());
    assert!(off_m < 0.05 && off_deg < 0.05, "{off_m} m, {off_deg} deg off");
}

#[test]
fn a_long_tunnel_ends() {
    let mut drive = straight(0.0, 180, 0.8);
    drive.frames[20..160].iter_mut().for_each(|f| f.points.clear());
    let estimates = drive.run(&mut accurate());
    assert!(estimates[170..].iter().all(is_registered), "{:?}", estimates[179].status);
    let (found, truth) = (poses(&estimates), drive.truth());
    let (step_m, step_deg) = largest_step_error(&found[170..], &truth[170..]);
    assert!(step_m < 0.03 && step_deg < 0.05, "{step_m} m, {step_deg} deg in a frame");
}

/// A drive whose sensor is somewhere else, looking elsewhere, from frame 20 on.
fn kidnapped() -> Drive {
    let mut drive = straight(0.0, 40, 0.8);
    let world = street(240.0, 3);
    let elsewhere: Vec<MapPose> =
        (0..40).map(|k| pose_on_street(200.0 + 0.8 * k as f64, -1.2, 1.5)).collect();
    drive.frames[20..].clone_from_slice(&Drive::record(&world, &COARSE, &elsewhere).frames[20..]);
    drive
}

#[test]
fn after_a_kidnapping_motion_is_followed_again() {
    let drive = kidnapped();
    let found = poses(&drive.run(&mut accurate()));
    let (step_m, step_deg) = largest_step_error(&found[32..], &drive.truth()[32..]);
    assert!(step_m < 0.03 && step_deg < 0.05, "{step_m} m, {step_deg} deg in a frame");
}

#[test]
fn a_kidnapping_is_noticed() {
    let estimates = kidnapped().run(&mut accurate());
    let certain = |e: &FrameEstimate| is_registered(e) && e.covariance[0][0] < 0.1 * 0.1;
    assert!(estimates[1..20].iter().all(certain));
    assert!(!certain(&estimates[20]), "{:?}", estimates[20].covariance[0][0].sqrt());
}

// ---- real scans ----

#[test]
fn real_scans_are_all_registered() {
    let Some(dataset) = std::env::var_os("SDSLAM_TEST_DATA").map(PathBuf::from) else {
        return println!("skipped, SDSLAM_TEST_DATA does not name the unpacked test data");
    };
    let sequence = Sequence::open(&dataset, "90", None).expect("sequence 90 is there");
    let mut odometry = accurate();
    let estimates: Vec<FrameEstimate> = (0..40)
        .map(|k| {
            let mut scan = sequence.read(k).expect("the scan is readable");
            correct_elevation(&mut scan.points, ELEVATION_CORRECTION_DEG);
            let raw = scan.labels.expect("labels come with it");
            let points: Vec<LabelledPoint> = (scan.points.iter().zip(&raw))
                .map(|(p, l)| LabelledPoint::new([p[0], p[1], p[2]], labels::class_of(*l)))
                .collect();
            process(&mut odometry, sequence.stamp_s(k), &points)
        })
        .collect();
    assert!(estimates[1..].iter().all(is_registered));
    let camera_from_sensor = sequence.camera_from_sensor();
    let reference = sequence.ground_truth().expect("readable").expect("references come with it");
    let reference: Vec<MapPose> =
        reference.iter().map(|pose| camera_from_sensor.inverse() * pose * camera_from_sensor).collect();
    let truth: Vec<MapPose> = reference[..40].iter().map(|pose| reference[0].inv_mul(pose)).collect();
    // The reference itself is good to about a percent.
    let (off_m, off_deg) = largest_difference(&poses(&estimates), &truth);
    let path_m: f64 = truth.windows(2).map(|w| w[0].inv_mul(&w[1]).translation.vector.norm()).sum();
    assert!(off_m < 0.2 + 0.02 * path_m && off_deg < 1.0, "{off_m} m of {path_m}, {off_deg} deg off");
}
