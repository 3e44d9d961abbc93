//! What must hold for any scene.

use nalgebra::{UnitQuaternion, Vector3};
use sdslam_core::{Config, FrameStatus, LabelledPoint, MapPose, MotionClass, SemanticClass};
use sdslam_tests::drive::{Drive, PERIOD_S, pose_on_street, poses, turned};
use sdslam_tests::odometry::{full_scan, process, process_fully};
use sdslam_tests::street::street;
use sdslam_tests::world::{Lidar, unit};

use crate::{FRAMES, accurate, assert_close, drive, is_valid, run};

#[test]
fn the_drive_itself_is_followed() {
    assert_close(&run(drive()), &drive().truth(), 0.04, 0.05);
}

#[test]
fn order_of_the_points_does_not_matter() {
    let mut shuffled = drive().clone();
    for (k, frame) in shuffled.frames.iter_mut().enumerate() {
        let mut keyed: Vec<(u64, LabelledPoint)> = frame
            .points
            .iter()
            .copied()
            .enumerate()
            .map(|(i, p)| ((unit(k as u64, i as u64, 5) * 1e15) as u64, p))
            .collect();
        keyed.sort_unstable_by_key(|(key, _)| *key);
        frame.points = keyed.into_iter().map(|(_, p)| p).collect();
    }
    assert_ne!(shuffled.frames[0].points, drive().frames[0].points);
    assert_close(&run(&shuffled), &run(drive()), 0.01, 0.01);
}

#[test]
fn the_height_of_far_grass_does_not_matter() {
    let far_grass_lifted = |by_m: f32| {
        let mut lifted = drive().clone();
        // At first, while the motion is being found, all terrain counts.
        for point in lifted.frames[8..].iter_mut().flat_map(|frame| &mut frame.points) {
            let distance = point.position[0].hypot(point.position[1]);
            if point.class.motion() == MotionClass::Ground && distance > 22.0 {
                point.class = SemanticClass::Terrain;
                point.position[2] += by_m;
            }
        }
        lifted
    };
    let (flat, lifted) = (far_grass_lifted(0.0), far_grass_lifted(0.2));
    assert_ne!(flat.frames[8].points, lifted.frames[8].points);
    assert_eq!(run(&lifted), run(&flat));
    let mut without_bound = Config::accurate();
    without_bound.precise_pose.dense.max_terrain_range_m = f32::INFINITY;
    assert_ne!(poses(&lifted.run(&mut full_scan(without_bound))), run(&lifted));
}

#[test]
fn a_turned_sensor_measures_the_same_motion() {
    // Turned about the vertical, and a little nose down: the grids of cells and voxels lie differently.
    for (roll, pitch, yaw) in [(0.0, 0.0, 0.6), (0.01, 0.03, 0.0), (0.0, 0.0, 3.0)] {
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let mount = MapPose::from_parts(Vector3::zeros().into(), rotation);
        let moved = drive().with_points_moved(|p| turned(&mount, p));
        let expected: Vec<MapPose> =
            drive().truth().iter().map(|pose| mount * pose * mount.inverse()).collect();
        assert_close(&run(&moved), &expected, 0.05, 0.06);
    }
}

#[test]
fn the_papers_height_follows_the_ground_under_a_tilted_sensor() {
    // Nose down by 1.7 degrees: driving along the ground is climbing in the sensor's frame.
    let mount =
        MapPose::from_parts(Vector3::zeros().into(), UnitQuaternion::from_euler_angles(0.0, 0.03, 0.0));
    let moved = drive().with_points_moved(|p| turned(&mount.inverse(), p));
    let estimates = moved.run(&mut full_scan(Config::paper()));
    let last = drive().truth()[FRAMES - 1];
    let expected = mount.inverse() * last * mount;
    let found = estimates[FRAMES - 1].map_from_sensor.translation;
    assert!(expected.translation.z > 0.6, "{expected}");
    assert!(
        (found.z - expected.translation.z).abs() < 0.15,
        "{} instead of {}",
        found.z,
        expected.translation.z
    );
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_motion() {
    let mirrored = drive().with_points_moved(|[x, y, z]| [x, -y, z]);
    let mirror = |pose: MapPose| {
        let (t, q) = (pose.translation.vector, pose.rotation);
        let rotation = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q.w, -q.i, q.j, -q.k));
        MapPose::from_parts(Vector3::new(t.x, -t.y, t.z).into(), rotation)
    };
    let expected: Vec<MapPose> = run(drive()).into_iter().map(mirror).collect();
    assert_close(&run(&mirrored), &expected, 0.03, 0.03);
}

#[test]
fn backwards_is_the_way_back() {
    let mut reversed = drive().clone();
    reversed.frames.reverse();
    for (k, frame) in reversed.frames.iter_mut().enumerate() {
        frame.stamp_s = k as f64 * PERIOD_S;
    }
    assert_close(&run(&reversed), &reversed.truth(), 0.04, 0.05);
}

#[test]
fn a_later_start_gives_the_same_relative_motion() {
    let mut late = drive().clone();
    late.frames.drain(..7);
    let all = run(drive());
    let expected: Vec<MapPose> = all[7..].iter().map(|pose| all[7].inv_mul(pose)).collect();
    assert_close(&run(&late), &expected, 0.04, 0.05);
}

#[test]
fn stamps_of_another_clock_give_the_same_poses() {
    let mut shifted = drive().clone();
    shifted.frames.iter_mut().for_each(|f| f.stamp_s += 1.7e9);
    assert_close(&run(&shifted), &run(drive()), 1e-3, 1e-3);
}

#[test]
fn a_standing_sensor_stays_at_the_origin() {
    let world = street(0.0, 7);
    let standing = Drive::record(&world, &Lidar::default(), &vec![pose_on_street(0.0, -1.2, 0.1); FRAMES]);
    for (config, position_m, angle_deg) in [(Config::accurate(), 0.005, 0.01), (Config::paper(), 0.05, 0.1)] {
        let estimates = standing.run(&mut full_scan(config));
        assert_close(&poses(&estimates), &standing.truth(), position_m, angle_deg);
        let last = estimates[FRAMES - 1].evidence.motion;
        assert!(last.dynamic == 0 && last.semi_static > 5, "{last:?}");
    }
}

#[test]
fn the_first_scan_is_the_origin() {
    let estimate = process(&mut accurate(), 12.5, &drive().frames[3].points);
    assert_eq!((estimate.frame, estimate.stamp_s), (0, 12.5));
    assert_eq!((estimate.map_from_sensor, estimate.status), (MapPose::identity(), FrameStatus::First));
}

#[test]
fn every_frame_carries_its_evidence() {
    let mut odometry = accurate();
    for (k, frame) in drive().frames.iter().enumerate() {
        let answer = process_fully(&mut odometry, frame.stamp_s, &frame.points);
        let (estimate, counts) = (answer.estimate, answer.estimate.evidence.points);
        assert_eq!((estimate.frame, estimate.stamp_s), (k as u32, frame.stamp_s));
        assert!(is_valid(&estimate), "{estimate:?}");
        let kept = counts.ground + counts.pure_static + counts.unknown_motion;
        let dropped = counts.not_finite + counts.out_of_range + counts.unlabelled + counts.unsure;
        assert_eq!(kept + dropped + counts.over_capacity, counts.received);
        assert_eq!(counts.received as usize, frame.points.len());
        let (buffers, motion) = (estimate.evidence.buffers, estimate.evidence.motion);
        assert_eq!(buffers.landmarks as usize, odometry.landmarks().len());
        assert_eq!(buffers.tracks as usize, answer.tracks.len());
        assert_eq!(motion.tracks as usize, answer.tracks.len());
        assert!(estimate.evidence.preliminary.overlap <= 1.001);
    }
}

#[test]
fn every_point_names_a_landmark_of_its_family() {
    let mut odometry = accurate();
    let frame = &drive().frames[0];
    let answer = process_fully(&mut odometry, frame.stamp_s, &frame.points);
    let landmarks = odometry.landmarks();
    let mut counted = vec![0u32; landmarks.len()];
    for (point, given) in answer.points.iter().zip(&frame.points) {
        assert_eq!(
            (point.position, point.class),
            (given.position, given.class),
            "only the landmark is written"
        );
        if point.landmark == LabelledPoint::NO_LANDMARK {
            continue;
        }
        let landmark = &landmarks[point.landmark as usize];
        counted[point.landmark as usize] += 1;
        assert_eq!(point.class.motion() == MotionClass::UnknownMotion, landmark.track.is_some());
        let margin = 0.5;
        assert!(
            (0..3).all(|k| point.position[k] > landmark.min[k] - margin
                && point.position[k] < landmark.max[k] + margin)
        );
    }
    let expected: Vec<u32> = landmarks.iter().map(|l| l.point_count).collect();
    assert_eq!(counted, expected);
    assert!(landmarks.len() > 20);
}

#[test]
fn the_covariance_turns_with_the_sensor() {
    // Along a street less is known than across it; the sensor turns from one to the other where it stands.
    let poses: Vec<MapPose> =
        (0..31).map(|k| pose_on_street(0.0, -1.2, (3.0 * k as f64).to_radians())).collect();
    let turning = Drive::record(&street(0.0, 7), &Lidar::default(), &poses);
    let estimates = turning.run(&mut accurate());
    let ratio = |k: usize| estimates[k].covariance[0][0] / estimates[k].covariance[1][1];
    assert!(ratio(8) > 1.2 && ratio(30) < 1.0 / 1.2, "{} then {}", ratio(8), ratio(30));
    assert_close(&sdslam_tests::drive::poses(&estimates), &turning.truth(), 0.05, 0.05);
}
