//! Drives, labels and trajectory files: what is read is what was written, and what is wrong is named.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use sdslam::dataset::trajectory::{self, Trajectory};
use sdslam::dataset::{self, DatasetError, Sequence, labels};
use sdslam_core::{MapPose, SemanticClass};
use tempfile::TempDir;

const CALIBRATION: &str = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0.1 0 0 -1 0.2 1 0 0 0.3\n";

/// A well-formed drive `00` of three scans with 2, 0 and 1 points.
fn drive() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let sequence = folder.path().join("sequences/00");
    fs::create_dir_all(sequence.join("velodyne")).expect("folder");
    fs::create_dir_all(sequence.join("labels")).expect("folder");
    let scans: [(&[f32], &[u32]); 3] = [
        (&[1.0, 2.0, 3.0, 0.5, f32::NAN, f32::INFINITY, 0.0, 0.0], &[10, 259 | 7 << 16]),
        (&[], &[]),
        (&[0.0, 0.0, 0.0, 0.0], &[0]),
    ];
    for (number, (points, labels)) in scans.iter().enumerate() {
        write(
            &sequence,
            &format!("velodyne/{number:06}.bin"),
            &bytes(points.iter().map(|v| v.to_le_bytes())),
        );
        write(
            &sequence,
            &format!("labels/{number:06}.label"),
            &bytes(labels.iter().map(|v| v.to_le_bytes())),
        );
    }
    write(&sequence, "calib.txt", CALIBRATION.as_bytes());
    write(&sequence, "times.txt", b"0.0\n1e-1\n5e-2\n");
    folder
}

fn bytes(words: impl Iterator<Item = [u8; 4]>) -> Vec<u8> {
    words.flatten().collect()
}

fn write(folder: &Path, file: &str, content: &[u8]) {
    fs::write(folder.join(file), content).expect("writable");
}

fn sequence_folder(drive: &TempDir) -> PathBuf {
    drive.path().join("sequences/00")
}

fn open(drive: &TempDir) -> Result<Sequence, DatasetError> {
    Sequence::open(drive.path(), "00", None)
}

/// The whole chain of causes, as a program prints it.
fn message(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text = format!("{text}: {inner}");
        cause = inner.source();
    }
    text
}

/// Asserts that a message has all of the given parts.
fn names<T: std::fmt::Debug>(result: Result<T, DatasetError>, parts: &[&str]) {
    let text = message(&result.expect_err("an error"));
    for part in parts {
        assert!(text.contains(part), "{text:?} does not name {part:?}");
    }
}

#[test]
fn a_drive_comes_in_as_written() {
    let drive = drive();
    let sequence = open(&drive).expect("well-formed");
    assert_eq!((sequence.name(), sequence.len(), sequence.has_times()), ("00", 3, true));
    assert_eq!([0, 1, 2].map(|frame| sequence.stamp_s(frame)), [0.0, 0.1, 0.05]);
    let scan = sequence.read(0).expect("readable");
    assert_eq!(scan.points[0], [1.0, 2.0, 3.0, 0.5]);
    assert!(scan.points[1][0].is_nan() && scan.points[1][1] == f32::INFINITY);
    assert_eq!(scan.labels, Some(vec![10, 259 | 7 << 16]));
    let empty = sequence.read(1).expect("an empty scan is a scan");
    assert_eq!((empty.points.len(), empty.labels), (0, Some(vec![])));
    let forward = sequence.camera_from_sensor() * nalgebra::Point3::new(1.0, 0.0, 0.0);
    assert!((forward - nalgebra::Point3::new(0.1, 0.2, 1.3)).norm() < 1e-12, "sensor forward is camera z");
    assert!(sequence.ground_truth().expect("absent is fine").is_none());
}

#[test]
fn missing_parts_are_named() {
    let drive = drive();
    let folder = sequence_folder(&drive);
    names(Sequence::open(&drive.path().join("nowhere"), "00", None), &["dataset folder", "nowhere"]);
    names(Sequence::open(&folder, "00", None), &["sequences folder", "DATASET/sequences/NN/velodyne"]);
    names(Sequence::open(drive.path(), "07", None), &["sequence 07", "there are 00"]);
    names(Sequence::open(drive.path(), "", None), &["not found", "there are 00"]);
    names(Sequence::open(drive.path(), "00", Some("predictions")), &["labels folder", "predictions"]);
    for (file, parts) in
        [("calib.txt", ["calibration", "Tr:"]), ("velodyne", ["velodyne folder", "00/velodyne"])]
    {
        let aside = folder.join("aside");
        fs::rename(folder.join(file), &aside).expect("renamed");
        names(open(&drive), &parts);
        fs::rename(aside, folder.join(file)).expect("renamed");
    }
    fs::remove_dir_all(folder.join("labels")).expect("removed");
    names(open(&drive), &["labels folder"]);
    let unlabelled = Sequence::open_unlabelled(drive.path(), "00").expect("needs no labels");
    assert_eq!(unlabelled.read(0).expect("readable").labels, None);
    fs::remove_dir_all(folder.join("velodyne")).expect("removed");
    fs::create_dir(folder.join("velodyne")).expect("created");
    names(open(&drive), &["no scans", "velodyne"]);
}

#[test]
fn malformed_text_is_named_by_line() {
    let drive = drive();
    let folder = sequence_folder(&drive);
    let cases: [(&str, &str, &[&str]); 9] = [
        ("calib.txt", "P0: 1\nP1: 2\n", &["calib.txt, line 2", "without a line `Tr: `"]),
        ("calib.txt", "", &["calib.txt", "without a line `Tr: `"]),
        ("calib.txt", "P0: 1\nTr: 1 0 0 0 0 1 0 0 0 0 1\n", &["line 2", "found 11 numbers, expected 12"]),
        ("calib.txt", "Tr: 1 0 0 0 0 1 0 0 0 0 x 0\n", &["line 1", "\"x\" is not a number"]),
        ("calib.txt", "Tr: 2 0 0 0 0 1 0 0 0 0 1 0\n", &["line 1", "not a rotation"]),
        ("calib.txt", "Tr: -1 0 0 0 0 1 0 0 0 0 1 0\n", &["line 1", "not a rotation"]),
        ("times.txt", "0.0\n\n0.1 0.2\n0.3\n", &["times.txt, line 3", "found 2 numbers, expected 1"]),
        ("times.txt", "0.0\ninf\n0.3\n", &["line 2", "not a finite number"]),
        ("times.txt", "0.0\n0.1\n", &["2 time stamps", "number 2", "line 3"]),
    ];
    for (file, content, parts) in cases {
        let good = fs::read(folder.join(file)).expect("readable");
        write(&folder, file, content.as_bytes());
        names(open(&drive), parts);
        write(&folder, file, &good);
    }
    fs::remove_file(folder.join("times.txt")).expect("removed");
    let assumed = open(&drive).expect("times are optional");
    assert!(!assumed.has_times() && (assumed.stamp_s(2) - 0.2).abs() < 1e-12);
}

#[test]
fn broken_scans_and_labels_are_told_apart() {
    let drive = drive();
    let folder = sequence_folder(&drive);
    let sequence = open(&drive).expect("well-formed");
    write(&folder, "labels/000000.label", &[0; 12]);
    names(sequence.read(0), &["labels/000000.label", "3 labels", "2 points"]);
    write(&folder, "labels/000000.label", &[0; 7]);
    names(sequence.read(0), &["7 bytes", "multiple of 4"]);
    fs::remove_file(folder.join("labels/000000.label")).expect("removed");
    names(sequence.read(0), &["label file", "000000.label"]);
    write(&folder, "velodyne/000000.bin", &[0; 33]);
    names(sequence.read(0), &["000000.bin", "33 bytes", "multiple of 16"]);
    assert!(matches!(sequence.read(3), Err(DatasetError::MissingFrame { .. })), "beyond the end");
}

#[test]
fn a_missing_frame_costs_only_itself() {
    let drive = drive();
    fs::remove_file(sequence_folder(&drive).join("velodyne/000001.bin")).expect("removed");
    let sequence = open(&drive).expect("still a drive");
    assert_eq!(sequence.len(), 3);
    let missing = sequence.read(1);
    assert!(
        matches!(&missing, Err(DatasetError::MissingFrame { path }) if path.ends_with("velodyne/000001.bin"))
    );
    assert_eq!(sequence.read(2).expect("readable").points.len(), 1);
}

#[test]
fn a_drive_may_start_late() {
    let drive = drive();
    let folder = sequence_folder(&drive);
    fs::remove_file(folder.join("velodyne/000000.bin")).expect("removed");
    fs::create_dir(drive.path().join("poses")).expect("created");
    let poses: Vec<_> = (0..3).map(|x| MapPose::translation(f64::from(x), 0.0, 0.0)).collect();
    write(drive.path(), "poses/00.txt", trajectory::write_kitti(&poses).as_bytes());
    let sequence = open(&drive).expect("well-formed");
    assert_eq!((sequence.len(), sequence.file_number(0), sequence.stamp_s(0)), (2, 1, 0.1));
    assert_eq!(sequence.ground_truth().expect("readable").expect("there")[0].translation.x, 1.0);
}

#[test]
fn labels_keep_class_and_instance() {
    for class in SemanticClass::ALL {
        let raw = labels::raw_id(class) | 3 << 16;
        assert_eq!(labels::class_of(raw), class);
        let moving = labels::moving_id(raw);
        assert_eq!(moving >> 16, 3);
        let can_move = class.motion() == sdslam_core::MotionClass::UnknownMotion;
        assert_eq!(labels::is_moving(moving), can_move, "{class:?}");
        assert_eq!(labels::moving_id(moving), moving);
    }
    let pairs =
        [(10, 252), (13, 257), (16, 256), (18, 258), (20, 259), (30, 254), (31, 253), (32, 255), (9, 251)];
    for (still, moving) in pairs {
        assert_eq!((labels::moving_id(still), labels::static_id(moving)), (moving, still));
        assert_eq!(labels::class_of(still), labels::class_of(moving));
    }
    assert_eq!([11, 15].map(labels::moving_id), [253, 255]);
    assert_eq!([13, 16, 256, 257].map(labels::class_of), [SemanticClass::OtherVehicle; 4]);
    assert_eq!(labels::class_of(12345), SemanticClass::Unlabelled);
    assert_eq!(labels::colour(SemanticClass::Car), [100, 150, 245]);
}

#[test]
fn elevation_correction_turns_points_up() {
    let mut points = [[10.0, 0.0, 0.0, 0.1], [0.0, -20.0, -1.0, 0.2], [0.0, 0.0, 5.0, 0.3], [f32::NAN; 4]];
    let before = points;
    dataset::correct_elevation(&mut points, dataset::ELEVATION_CORRECTION_DEG);
    let elevation = |p: [f32; 4]| f64::from(p[2]).atan2(f64::from(p[0]).hypot(f64::from(p[1]))).to_degrees();
    let range = |p: [f32; 4]| p[..3].iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    for (now, was) in points.into_iter().zip(before).take(2) {
        assert!((elevation(now) - elevation(was) - 0.205).abs() < 1e-5);
        assert!((range(now) - range(was)).abs() < 1e-5);
        assert_eq!((now[0].signum(), now[1].signum(), now[3]), (was[0].signum(), was[1].signum(), was[3]));
    }
    assert_eq!(points[2], before[2]);
    assert!(points[3][0].is_nan());
}

/// The scan of a resting world from a sensor in constant motion, by integrating that motion in small steps.
#[test]
fn deskewing_restores_a_resting_world() {
    let motion = pose([1.2, 0.1, -0.05], [0.01, -0.02, 0.08]);
    let small = pose_power(&motion, 1.0 / 4096.0);
    let world: Vec<_> = (0..300)
        .map(|i| (f64::from(i) * 0.7, 5.0 + f64::from(i % 40)))
        .map(|(a, r)| nalgebra::Point3::new(r * a.cos(), r * a.sin(), a.sin()))
        .collect();
    // A point is measured when the sensor, on its way, looks at it. Right behind, it can be missed.
    let seen = |point: &nalgebra::Point3<f64>| {
        let mut map_from_sensor = pose_power(&motion, -0.5);
        let mut best = (f64::INFINITY, [0.0; 4]);
        for step in 0..=4096 {
            let p = map_from_sensor.inverse_transform_point(point).cast::<f32>();
            let off = (dataset::time_in_scan(p.x, p.y) - (f64::from(step) / 4096.0 - 0.5)).abs();
            if off < best.0 {
                best = (off, [p.x, p.y, p.z, 0.0]);
            }
            map_from_sensor *= small;
        }
        (best.0 < 5e-4).then_some((best.1, point.coords))
    };
    let (mut scan, world): (Vec<_>, Vec<_>) = world.iter().filter_map(seen).unzip();
    assert!(scan.len() > 270, "only {} seen", scan.len());
    let worst = |scan: &[[f32; 4]]| {
        let off =
            |(p, w): (&[f32; 4], &Vector3<f64>)| (Vector3::new(p[0], p[1], p[2]).cast::<f64>() - w).norm();
        scan.iter().zip(&world).map(off).fold(0.0, f64::max)
    };
    assert!(worst(&scan) > 0.5, "the motion must matter");
    dataset::deskew(&mut scan, &motion);
    assert!(worst(&scan) < 2e-3, "{} m left", worst(&scan));
}

#[test]
fn deskewing_leaves_what_it_cannot_move() {
    let mut points = [[0.0; 4], [f32::NAN, 1.0, 0.0, 0.0], [1.0, f32::INFINITY, 0.0, 0.0]];
    dataset::deskew(&mut points, &pose([1.0, 0.0, 0.0], [0.0, 0.0, 0.1]));
    assert_eq!(points[0], [0.0; 4]);
    assert!(points[1][0].is_nan() && points[2] == [1.0, f32::INFINITY, 0.0, 0.0]);
    let still = [[5.0, 6.0, 7.0, 0.5]];
    let mut same = still;
    dataset::deskew(&mut same, &MapPose::identity());
    assert_eq!(same, still);
}

fn pose(translation: [f64; 3], rotation: [f64; 3]) -> MapPose {
    MapPose::from_parts(
        Translation3::from(translation),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
    )
}

/// Fraction of a screw motion: the matrix logarithm by repeated halving.
fn pose_power(motion: &MapPose, exponent: f64) -> MapPose {
    let halve = |p: &MapPose| {
        let rotation = p.rotation.powf(0.5);
        let both = nalgebra::Matrix3::identity() + rotation.to_rotation_matrix().matrix();
        let t = both.try_inverse().expect("less than half a turn") * p.translation.vector;
        MapPose::from_parts(Translation3::from(t), rotation)
    };
    let unit = (0..12).fold(*motion, |p, _| halve(&p));
    let steps = (exponent.abs() * 4096.0).round() as u32;
    let power = (0..steps).fold(MapPose::identity(), |p, _| p * unit);
    if exponent < 0.0 { power.inverse() } else { power }
}

#[test]
fn trajectory_files_are_strict() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let file = folder.path().join("poses.txt");
    let identity = "1 0 0 0 0 1 0 0 0 0 1 0\n";
    fs::write(&file, format!("# comment\n\n{identity}1 0 0\n")).expect("written");
    names(trajectory::read_kitti(&file), &["poses.txt, line 4", "found 3 numbers, expected 12"]);
    fs::write(&file, "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 0\n").expect("written");
    names(trajectory::read_tum(&file), &["line 2", "norm 0.000"]);
    names(trajectory::read(&file), &["line 2", "norm 0.000"]);
    fs::write(&file, "0 1 2 3 0 0 0 1\n").expect("written");
    assert!(matches!(trajectory::read(&file), Ok(Trajectory::Tum(poses)) if poses[0].1.translation.z == 3.0));
    names(trajectory::read_kitti(&folder.path().join("none.txt")), &["none.txt", "cannot read"]);
}

/// Arbitrary bytes, and good files with some bytes replaced, cut off or repeated.
fn mangled(good: &'static [u8]) -> impl Strategy<Value = Vec<u8>> {
    let edits = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6);
    let edited = (edits, any::<prop::sample::Index>()).prop_map(|(edits, cut)| {
        let mut bytes = good.to_vec();
        for (at, byte) in edits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(good.len() - cut.index(good.len()) / 2);
        bytes
    });
    prop_oneof![prop::collection::vec(any::<u8>(), 0..300), edited]
}

const TUM: &[u8] = b"# stamp\n0.1 1 2 3 0 0 0 1\n0.2 1e5 -2 3 0.6 0 0 0.8\n";
const KITTI: &[u8] = b"1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 5 1 0 0 6.5 0 0 1 7e-3\n";

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn drives_of_any_bytes_are_read_or_refused(
        calibration in mangled(CALIBRATION.as_bytes()),
        times in mangled(b"0.0\n0.1\n0.2\n"),
        scan in prop::collection::vec(any::<u8>(), 0..70),
        labels in prop::collection::vec(any::<u8>(), 0..20),
    ) {
        let drive = drive();
        let folder = sequence_folder(&drive);
        write(&folder, "calib.txt", &calibration);
        let calibrated = open(&drive);
        if let Ok(sequence) = calibrated {
            let rotation = sequence.camera_from_sensor().rotation;
            prop_assert!((rotation.norm() - 1.0).abs() < 1e-9);
        }
        write(&folder, "calib.txt", CALIBRATION.as_bytes());
        write(&folder, "times.txt", &times);
        let _ = open(&drive).map(|sequence| assert!(sequence.stamp_s(2).is_finite()));
        write(&folder, "times.txt", b"0\n1\n2\n");
        write(&folder, "velodyne/000000.bin", &scan);
        write(&folder, "labels/000000.label", &labels);
        let read = open(&drive).expect("well-formed").read(0);
        let fits = scan.len() % 16 == 0 && labels.len() % 4 == 0 && scan.len() / 16 == labels.len() / 4;
        prop_assert_eq!(read.is_ok(), fits);
    }

    #[test]
    fn trajectories_of_any_bytes_are_read_or_refused(tum in mangled(TUM), kitti in mangled(KITTI)) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let file = folder.path().join("t.txt");
        fs::write(&file, &tum).expect("written");
        if let Ok(poses) = trajectory::read_tum(&file) {
            prop_assert!(poses.iter().all(|(stamp, pose)| stamp.is_finite() && is_rigid(pose)));
        }
        fs::write(&file, &kitti).expect("written");
        if let Ok(poses) = trajectory::read_kitti(&file) {
            prop_assert!(poses.iter().all(is_rigid));
        }
        let _ = trajectory::read(&file);
    }

    #[test]
    fn trajectories_survive_the_file(
        parts in prop::collection::vec((-1e4..1e4, -1e4..1e4, -500.0..500.0, prop::array::uniform3(-1.8..1.8)), 1..20),
    ) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let file = folder.path().join("t.txt");
        let poses: Vec<_> = parts.into_iter().map(|(x, y, z, w)| pose([x, y, z], w)).collect();
        let stamps: Vec<_> = (0..poses.len()).map(|i| 1.5e9 + i as f64 * 0.1).collect();
        fs::write(&file, trajectory::write_kitti(&poses)).expect("written");
        prop_assert!(matches!(trajectory::read(&file), Ok(Trajectory::Kitti(_))));
        let back = trajectory::read_kitti(&file).expect("as written");
        prop_assert!(back.iter().zip(&poses).all(|(a, b)| near(a, b)) && back.len() == poses.len());
        fs::write(&file, trajectory::write_tum(&stamps, &poses)).expect("written");
        let Ok(Trajectory::Tum(back)) = trajectory::read(&file) else { panic!("not TUM") };
        prop_assert!(back.iter().zip(&poses).all(|((_, a), b)| near(a, b)) && back.len() == poses.len());
        prop_assert!(back.iter().zip(&stamps).all(|((a, _), b)| (a - b).abs() < 1e-6));
    }
}

fn is_rigid(pose: &MapPose) -> bool {
    pose.translation.vector.iter().all(|v| v.is_finite()) && (pose.rotation.norm() - 1.0).abs() < 1e-9
}

fn near(a: &MapPose, b: &MapPose) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-7 && a.rotation.angle_to(&b.rotation) < 1e-9
}
