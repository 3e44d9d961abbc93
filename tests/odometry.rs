//! `Odometry::process_scan` as its caller meets it: relations that must hold for any scene, and input that is not a scene.

use std::sync::OnceLock;

use nalgebra::{UnitQuaternion, Vector3};
use sdslam_core::estimate::Fallback;
use sdslam_core::{
    Config, FrameEstimate, FrameStatus, FullScanOdometry, LabelledPoint, LabelledScan, MapPose, MotionClass,
    OdometryError, SemanticClass,
};
use sdslam_tests::drive::{Drive, PERIOD_S, largest_difference, pose_on_street, poses, turned};
use sdslam_tests::odometry::{TinyOdometry, full_scan, on_heap, process, process_fully};
use sdslam_tests::street::street;
use sdslam_tests::world::{Lidar, unit};

const FRAMES: usize = 30;

/// One winding drive for all tests.
fn drive() -> &'static Drive {
    static DRIVE: OnceLock<Drive> = OnceLock::new();
    DRIVE.get_or_init(|| Drive::down_the_street(FRAMES, 8.0))
}

fn accurate() -> Box<FullScanOdometry> {
    full_scan(Config::accurate())
}

fn run(drive: &Drive) -> Vec<MapPose> {
    poses(&drive.run(&mut accurate()))
}

fn assert_close(a: &[MapPose], b: &[MapPose], position_m: f64, angle_deg: f64) {
    let (position, angle) = largest_difference(a, b);
    assert!(position < position_m && angle < angle_deg, "{position:.4} m and {angle:.4} deg apart");
}

fn is_valid(estimate: &FrameEstimate) -> bool {
    let t = estimate.map_from_sensor.translation.vector;
    let q = estimate.map_from_sensor.rotation;
    let covariance = estimate.covariance;
    t.iter().all(|v| v.is_finite())
        && (q.norm() - 1.0).abs() < 1e-4
        && covariance.iter().flatten().all(|v| v.is_finite())
        && (0..6).all(|i| covariance[i][i] > 0.0)
}

// ---- relations ----

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

// ---- reset, and stamps that go back ----

#[test]
fn a_reset_odometry_gives_the_bits_of_a_new_one() {
    let mut used = accurate();
    drive().run(&mut used);
    used.reset();
    assert_eq!((used.landmarks().len(), used.tracks().count()), (0, 0));
    let mut new = accurate();
    for frame in &drive().frames[5..20] {
        let [of_used, of_new] =
            [&mut used, &mut new].map(|odometry| process_fully(odometry, frame.stamp_s, &frame.points));
        assert_eq!(of_used, of_new);
    }
}

/// Offers a scan that must be refused.
fn refused(odometry: &mut FullScanOdometry, stamp_s: f64) -> OdometryError {
    let mut points = drive().frames[20].points.clone();
    odometry
        .process_scan(&mut LabelledScan { stamp_s, points: &mut points })
        .expect_err("a stamp out of order")
}

#[test]
fn a_stamp_that_goes_back_is_refused_and_changes_nothing() {
    let (mut disturbed, mut calm) = (accurate(), accurate());
    for (k, frame) in drive().frames[..12].iter().enumerate() {
        if let Some(before) = k.checked_sub(1) {
            let previous_s = drive().frames[before].stamp_s;
            for current_s in [previous_s, previous_s - 0.01, -1e300] {
                let expected = OdometryError::TimeWentBack { previous_s, current_s };
                assert_eq!(refused(&mut disturbed, current_s), expected);
            }
        }
        for stamp_s in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(refused(&mut disturbed, stamp_s), OdometryError::StampNotFinite);
        }
        let [a, b] =
            [&mut disturbed, &mut calm].map(|odometry| process_fully(odometry, frame.stamp_s, &frame.points));
        assert_eq!(a, b, "frame {k}");
    }
}

#[test]
fn errors_name_what_is_wrong() {
    let back = OdometryError::TimeWentBack { previous_s: 2.5, current_s: 1.5 }.to_string();
    assert!(back.contains("1.5") && back.contains("2.5"), "{back}");
    assert!(OdometryError::StampNotFinite.to_string().contains("finite"));
}

// ---- scans that are not what they should be ----

/// The drive with the scans of some frames replaced.
fn with_replaced(frames: std::ops::Range<usize>, points: &[LabelledPoint]) -> Drive {
    let mut replaced = drive().clone();
    replaced.frames[frames].iter_mut().for_each(|f| f.points = points.to_vec());
    replaced
}

#[test]
fn an_empty_scan_is_predicted_and_the_next_one_registered() {
    let estimates = with_replaced(15..16, &[]).run(&mut accurate());
    for (k, estimate) in estimates.iter().enumerate() {
        let expected = match k {
            0 => FrameStatus::First,
            15 => FrameStatus::Predicted(Fallback::EmptyScan),
            _ => FrameStatus::Registered,
        };
        assert_eq!(estimate.status, expected, "frame {k}");
        assert!(is_valid(estimate));
    }
    let off = (0.1, 0.3);
    assert_close(&poses(&estimates), &drive().truth(), off.0, off.1);
    assert!(estimates[15].covariance[0][0] > 100.0 * estimates[14].covariance[0][0]);
}

#[test]
fn a_gap_of_empty_scans_is_predicted_and_the_drive_goes_on() {
    let estimates = with_replaced(12..20, &[]).run(&mut accurate());
    let registered = |e: &FrameEstimate| e.status == FrameStatus::Registered;
    assert!(!estimates[12..20].iter().any(registered));
    assert!(estimates[21..].iter().all(registered), "{:?}", estimates[21].status);
    assert_close(&poses(&estimates[22..]), &drive().truth()[22..], 0.05, 0.06);
}

#[test]
#[ignore = "a first scan without points leaves the submap empty, and a frame that is not registered never fills it"]
fn a_drive_may_begin_with_empty_scans() {
    let estimates = with_replaced(0..3, &[]).run(&mut accurate());
    assert_eq!(estimates[0].status, FrameStatus::First);
    let tail = &estimates[8..];
    assert!(tail.iter().all(|e| e.status == FrameStatus::Registered), "{:?}", tail[0].status);
}

/// A drive in which the scans of some frames show only one class: largest error \[m, deg\] while it lasts, and after.
fn errors_of_scans_of_one_class(config: Config, class: SemanticClass) -> [(f64, f64); 2] {
    let mut drive = Drive { frames: drive().frames[..20].to_vec() };
    drive.frames[8..14].iter_mut().for_each(|f| f.points.retain(|p| p.class == class));
    let estimates = drive.run(&mut full_scan(config));
    assert!(estimates.iter().all(is_valid), "{class:?}");
    let (found, truth) = (poses(&estimates), drive.truth());
    [8..14, 15..20].map(|frames| largest_difference(&found[frames.clone()], &truth[frames]))
}

#[test]
fn scans_of_one_class_are_survived() {
    use SemanticClass::{Bicyclist, Building, Car, Pole, Trunk, Vegetation};
    for class in [Building, Vegetation, Trunk, Pole, Car, Bicyclist] {
        let [during, after] = errors_of_scans_of_one_class(Config::accurate(), class);
        assert!(during.0 < 1.0 && during.1 < 3.0, "{class:?}: {during:?} off");
        assert!(after.0 < 0.03 && after.1 < 0.05, "{class:?}: {after:?} off afterwards");
        let [during, after] = errors_of_scans_of_one_class(Config::paper(), class);
        assert!(during.0 < 0.5 && during.1 < 1.5, "paper, {class:?}: {during:?} off");
        assert!(after.0 < 0.3 && after.1 < 0.6, "paper, {class:?}: {after:?} off afterwards");
    }
}

#[test]
fn ground_alone_does_not_mislead_the_paper_preset() {
    let [during, after] = errors_of_scans_of_one_class(Config::paper(), SemanticClass::Road);
    assert!(during.0 < 0.2 && during.1 < 1.0 && after.0 < 0.2, "{during:?}, {after:?} off");
}

#[test]
#[ignore = "level ground alone counts as registered although x, y and yaw are free: the pose runs away"]
fn ground_alone_is_not_registered() {
    for class in [SemanticClass::Road, SemanticClass::Sidewalk, SemanticClass::Terrain] {
        let [during, after] = errors_of_scans_of_one_class(Config::accurate(), class);
        assert!(during.0 < 0.3 && after.0 < 0.05 && after.1 < 0.1, "{class:?}: {during:?}, {after:?} off");
    }
}

#[test]
fn the_covariance_of_ground_alone_tells_that_it_is_loose() {
    let mut drive = Drive { frames: drive().frames[..10].to_vec() };
    drive.frames[9].points.retain(|p| p.class == SemanticClass::Road);
    let estimates = drive.run(&mut accurate());
    let deviation_m = |e: &FrameEstimate| e.covariance[0][0].max(e.covariance[1][1]).sqrt();
    assert!(deviation_m(&estimates[8]) < 0.05 && deviation_m(&estimates[9]) > 0.5);
}

#[test]
fn a_drive_of_one_class_relabelled_is_survived() {
    for class in [SemanticClass::Road, SemanticClass::Building, SemanticClass::Car, SemanticClass::Unlabelled]
    {
        let mut drive = drive().clone();
        drive.frames.iter_mut().flat_map(|f| &mut f.points).for_each(|p| p.class = class);
        let estimates = drive.run(&mut accurate());
        assert!(estimates.iter().all(is_valid), "{class:?}");
        if class == SemanticClass::Unlabelled {
            let empty = FrameStatus::Predicted(Fallback::EmptyScan);
            assert!(estimates[1..].iter().all(|e| e.status == empty));
        }
    }
}

#[test]
fn broken_points_are_counted_and_change_nothing() {
    let broken = [
        [f32::NAN, 1.0, 1.0],
        [1.0, f32::INFINITY, 1.0],
        [1.0, 1.0, f32::NEG_INFINITY],
        [f32::NAN; 3],
        [0.0; 3],
        [-0.0; 3],
        [0.1, 0.0, 0.0],
        [150.0, 0.0, 0.0],
    ];
    let mut damaged = drive().clone();
    for frame in &mut damaged.frames {
        for (k, position) in broken.into_iter().enumerate() {
            let class = [SemanticClass::Car, SemanticClass::Road, SemanticClass::Building][k % 3];
            frame.points.push(LabelledPoint::new(position, class));
        }
        frame.points.push(LabelledPoint::new([10.0, 0.0, 0.0], SemanticClass::Unlabelled));
        frame.points.push(LabelledPoint::new([10.0, 0.0, 0.0], SemanticClass::Outlier));
    }
    let (with, without) = (damaged.run(&mut accurate()), drive().run(&mut accurate()));
    for (with, without) in with.iter().zip(&without) {
        let (a, b) = (with.evidence.points, without.evidence.points);
        assert_eq!((a.not_finite, a.unlabelled), (b.not_finite + 4, b.unlabelled + 2));
        assert_eq!(a.out_of_range, b.out_of_range + 4);
        assert_eq!((a.ground, a.pure_static, a.unknown_motion), (b.ground, b.pure_static, b.unknown_motion));
    }
    assert_close(&poses(&with), &poses(&without), 0.005, 0.005);
}

#[test]
#[ignore = "the square of the range overflows before it is compared"]
fn a_finite_point_beyond_the_range_is_not_called_infinite() {
    let far = LabelledPoint::new([1e20, 0.0, 0.0], SemanticClass::Building);
    let counts = process(&mut accurate(), 0.0, &[far]).evidence.points;
    assert_eq!((counts.out_of_range, counts.not_finite), (1, 0));
}

#[test]
fn a_scan_of_rubbish_is_not_registered() {
    let rubbish: Vec<LabelledPoint> = (0..20_000u64)
        .map(|i| {
            let at = [0, 1, 2].map(|k| (60.0 * unit(3, i, k) - 30.0) as f32);
            LabelledPoint::new(
                [at[0], at[1], 0.2 * at[2]],
                SemanticClass::ALL[i as usize % SemanticClass::COUNT],
            )
        })
        .collect();
    let estimates = with_replaced(15..16, &rubbish).run(&mut accurate());
    assert!(estimates.iter().all(is_valid));
    let (off_m, off_deg) = largest_difference(&poses(&estimates[17..]), &drive().truth()[17..]);
    assert!(off_m < 0.1 && off_deg < 0.2, "{off_m} m, {off_deg} deg off");
}

// ---- full buffers ----

#[test]
fn full_buffers_are_named_and_the_next_scan_is_processed() {
    for config in [Config::accurate(), Config::paper()] {
        let mut tiny: Box<TinyOdometry> = on_heap(config);
        let mut worst = sdslam_core::estimate::BufferUse::default();
        for frame in &drive().frames {
            let mut points = frame.points.clone();
            let scan = &mut LabelledScan { stamp_s: frame.stamp_s, points: &mut points };
            let estimate = tiny.process_scan(scan).expect("the stamp is in order");
            assert!(is_valid(&estimate), "{estimate:?}");
            let b = estimate.evidence.buffers;
            assert!(b.cells <= 2048 && b.landmarks <= 12 && b.tracks <= 2 && b.submap_landmarks <= 4);
            assert!(b.voxels <= 32);
            assert_eq!(b.cells_refused, estimate.evidence.points.over_capacity);
            worst.cells_refused += b.cells_refused;
            worst.landmarks_refused += b.landmarks_refused;
            worst.tracks_refused += b.tracks_refused;
            worst.voxels_evicted = worst.voxels_evicted.max(b.voxels_evicted);
            worst.submap_landmarks_evicted = worst.submap_landmarks_evicted.max(b.submap_landmarks_evicted);
            assert_eq!(b.landmarks as usize, tiny.landmarks().len());
            assert!(points.iter().all(|p| p.landmark == LabelledPoint::NO_LANDMARK || p.landmark < 12));
        }
        assert!(
            worst.cells_refused > 0 && worst.landmarks_refused > 0 && worst.tracks_refused > 0,
            "{worst:?}"
        );
        let (dense, hulls) = (worst.voxels_evicted > 0, worst.submap_landmarks_evicted > 0);
        assert_eq!((dense, hulls), (config.precise_pose.dense.enabled, config.precise_pose.horizontal));
    }
}

#[test]
fn a_profile_that_is_a_little_too_small_still_follows_the_drive() {
    // Cells, tracks and landmarks run over; what is kept is enough.
    let mut small: Box<sdslam_core::Odometry<4096, 64, 32, 4, 2048, 32>> = on_heap(Config::accurate());
    let estimates: Vec<FrameEstimate> = drive()
        .frames
        .iter()
        .map(|frame| {
            let mut points = frame.points.clone();
            small
                .process_scan(&mut LabelledScan { stamp_s: frame.stamp_s, points: &mut points })
                .expect("in order")
        })
        .collect();
    let refused = |f: fn(&FrameEstimate) -> u32| estimates.iter().map(f).max();
    assert!(refused(|e| e.evidence.buffers.cells_refused) > Some(0));
    assert!(refused(|e| e.evidence.buffers.tracks_refused) > Some(0));
    assert!(refused(|e| e.evidence.buffers.landmarks_refused) > Some(0));
    assert_close(&poses(&estimates), &drive().truth(), 0.1, 0.1);
}

#[test]
fn one_over_full_scan_leaves_no_trace() {
    // Every point in a cell of its own: more cells than the full profile has.
    let crowd: Vec<LabelledPoint> = (0..60_000u32)
        .map(|i| {
            let at = [i % 200, i / 200 % 200, i / 40_000].map(|k| k as f32);
            LabelledPoint::new(
                [0.5 * at[0] - 50.0, 0.5 * at[1] - 50.0, at[2] - 1.0],
                SemanticClass::Vegetation,
            )
        })
        .collect();
    let estimates = with_replaced(15..16, &crowd).run(&mut accurate());
    let over = estimates[15].evidence;
    assert_eq!(over.buffers.cells, 32_768);
    assert!(over.points.over_capacity > 0 && over.buffers.cells_refused == over.points.over_capacity);
    assert!(estimates[16..].iter().all(|e| e.evidence.points.over_capacity == 0));
    assert_close(&poses(&estimates[17..]), &drive().truth()[17..], 0.1, 0.1);
}
