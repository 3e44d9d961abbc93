//! Evaluation: published figures where the test data is there, relations everywhere.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix4, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use sdslam::dataset::trajectory::{self, Trajectory};
use sdslam::dataset::{self, DatasetError, Sequence};
use sdslam::evaluate::{
    self, EvaluateError, LabelConfusion, MapEntropyOptions, TrajectoryErrors, matrix_errors,
    trajectory_errors, trajectory_files,
};
use sdslam_core::MapPose;

/// The unpacked test data, or a note that a test is skipped.
fn test_data(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("SDSLAM_TEST_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("{test}: skipped, SDSLAM_TEST_DATA does not name the unpacked test data");
    }
    folder
}

fn pose(translation: [f64; 3], rotation: [f64; 3]) -> MapPose {
    MapPose::from_parts(
        Translation3::from(translation),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
    )
}

/// A winding, hilly drive with 1 m from frame to frame.
fn drive(frames: usize) -> Vec<MapPose> {
    let mut at = MapPose::identity();
    let step = |i: usize| {
        let t = i as f64;
        let now = at;
        at *= pose([1.0, 0.0, 0.0], [0.0, 0.01 * (t / 40.0).cos(), 0.03 * (t / 60.0).sin()]);
        now
    };
    (0..frames).map(step).collect()
}

/// Frames 0.5 m apart.
fn straight(frames: u32) -> Vec<MapPose> {
    (0..frames).map(|i| MapPose::translation(f64::from(i) * 0.5, 0.0, 0.0)).collect()
}

/// The poses when every increment is changed.
fn distorted(poses: &[MapPose], change: impl Fn(&MapPose) -> MapPose) -> Vec<MapPose> {
    let mut at = MapPose::identity();
    let mut out = vec![at];
    for pair in poses.windows(2) {
        at *= change(&pair[0].inv_mul(&pair[1]));
        out.push(at);
    }
    out
}

fn t_rel(errors: &TrajectoryErrors) -> f64 {
    errors.t_rel_percent.expect("long enough")
}

fn r_rel(errors: &TrajectoryErrors) -> f64 {
    errors.r_rel_deg_per_100m.expect("long enough")
}

#[test]
fn identical_trajectories_have_no_error() {
    let poses = drive(500);
    let errors = trajectory_errors(&poses, &poses);
    assert!(errors.devkit_lengths && errors.segments > 50);
    let all = [errors.t_rel_percent, errors.r_rel_deg_per_100m, errors.ate_m, errors.rpe_m, errors.rpe_deg];
    assert!(all.iter().all(|error| error.is_some_and(|error| error < 1e-6)), "{all:?}");
}

#[test]
fn a_scale_error_is_the_translation_error() {
    // On a straight line the error of 1 % of the distance driven is the whole error of a segment, whose end is at most
    // one frame beyond its length.
    let longer = distorted(&straight(2000), |step| MapPose::translation(step.translation.x * 1.01, 0.0, 0.0));
    let errors = trajectory_errors(&straight(2000), &longer);
    assert!((t_rel(&errors) - 1.0).abs() < 0.005, "{}", t_rel(&errors));
    assert!(r_rel(&errors) < 1e-9 && (errors.rpe_m.expect("frames") - 0.005).abs() < 1e-12);
    assert_eq!(errors.per_length.len(), 8);
}

#[test]
fn a_constant_turn_error_is_the_rotation_error() {
    let turning = distorted(&straight(2000), |step| step * pose([0.0; 3], [0.0, 0.0, 0.0001]));
    let errors = trajectory_errors(&straight(2000), &turning);
    // 0.0001 rad per 0.5 m.
    assert!((r_rel(&errors) / 0.02_f64.to_degrees() - 1.0).abs() < 0.005, "{}", r_rel(&errors));
    assert!((errors.rpe_deg.expect("frames") - 0.0001_f64.to_degrees()).abs() < 1e-9);
}

#[test]
fn short_drives_are_measured_over_short_segments() {
    let poses = drive(90);
    let errors = trajectory_errors(&poses, &poses);
    assert!(!errors.devkit_lengths && errors.to_string().contains("not the devkit's"));
    assert_eq!(errors.per_length.first().map(|length| length.length_m), Some(10.0));
    let standing = vec![MapPose::identity(); 5];
    let none = trajectory_errors(&standing, &standing);
    assert_eq!((none.t_rel_percent, none.segments, none.ate_m), (None, 0, Some(0.0)));
    let empty = trajectory_errors(&[], &standing);
    assert_eq!((empty.frames, empty.ate_m, empty.rpe_m), (0, None, None));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

    /// Where the estimate starts and which way it faces there is no error.
    #[test]
    fn a_rigid_transform_of_the_estimate_changes_nothing(
        t in prop::array::uniform3(-1e3..1e3), w in prop::array::uniform3(-1.8..1.8),
    ) {
        let poses = drive(300);
        let estimate = distorted(&poses, |step| step * pose([0.02, 0.0, 0.01], [0.0, 0.0003, 0.0]));
        let moved: Vec<_> = estimate.iter().map(|at| pose(t, w) * at).collect();
        let (a, b) = (trajectory_errors(&poses, &estimate), trajectory_errors(&poses, &moved));
        let values = |e: &TrajectoryErrors| [t_rel(e), r_rel(e), e.ate_m.unwrap(), e.rpe_m.unwrap(), e.rpe_deg.unwrap()];
        for (a, b) in values(&a).into_iter().zip(values(&b)) {
            prop_assert!((a - b).abs() < 1e-7 * (1.0 + a), "{} {}", a, b);
            prop_assert!(a > 1e-3);
        }
    }
}

/// Trajectories of programs that went astray: the largest and smallest numbers, and steps to nowhere.
fn astray() -> impl Strategy<Value = Vec<MapPose>> {
    let extreme = prop::sample::select(vec![0.0, 1e-300, 1.0, -3.0, 1e8, -1e154, 1e300, f64::MAX]);
    let number = prop_oneof![extreme, -100.0..100.0];
    let poses =
        (prop::array::uniform3(number), prop::array::uniform3(-1.8..1.8)).prop_map(|(t, w)| pose(t, w));
    prop::collection::vec(poses, 0..30)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn astray_trajectories_are_measured_all_the_same(truth in astray(), estimate in astray()) {
        let errors = trajectory_errors(&truth, &estimate);
        let all = [errors.t_rel_percent, errors.r_rel_deg_per_100m, errors.ate_m, errors.rpe_m, errors.rpe_deg];
        prop_assert!(all.iter().flatten().all(|error| error.is_finite() && *error >= 0.0), "{all:?}");
        prop_assert!(errors.to_string().lines().count() >= 7);
    }
}

#[test]
fn maps_of_astray_trajectories_are_measured_all_the_same() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let right = street(folder.path(), 8);
    let sequence = Sequence::open(folder.path(), "00", None).expect("a drive");
    let options = MapEntropyOptions { window: 8, radius_m: 1.0, ..MapEntropyOptions::default() };
    for off in [1e7, 1e12, 1e154, f64::MAX] {
        let astray = |(i, at): (usize, &MapPose)| if i < 4 { *at } else { pose([off, -off, off], [0.0; 3]) };
        let poses: Vec<_> = right.iter().enumerate().map(astray).collect();
        let entropy = evaluate::map_entropy(&sequence, &poses, &options).expect("the first half is fine");
        assert!(entropy.mean_map_entropy.is_finite() && entropy.neighbourhoods > 1000, "{off}: {entropy}");
    }
}

/// Remake the table with the evaluator of the test data; its published columns are the devkit's own output.
#[test]
fn published_trajectories_have_their_published_errors() {
    let Some(data) = test_data("published trajectories") else { return };
    let folder = data.join("kitti_poses");
    let table = fs::read_to_string(folder.join("expected_metrics.csv")).expect("expected_metrics.csv");
    let mut compared = 0;
    for row in table.lines().skip(1) {
        let cells: Vec<_> = row.split(',').collect();
        if !cells[1].starts_with("mean") {
            compare_row(&folder, &cells);
            compared += 1;
        }
    }
    assert!(compared >= 30, "only {compared} rows");
}

fn compare_row(folder: &Path, cells: &[&str]) {
    let (name, sequence) = (cells[0], cells[1]);
    let truth = matrices(&folder.join(format!("gt/{sequence}.txt")));
    let mut poses = matrices(&folder.join(format!("{name}/{sequence}.txt")));
    if name.starts_with("pylidar") {
        // The only ones in the sensor's frame.
        let camera_from_sensor = calibration(&folder.join(format!("calib/{sequence}.txt")));
        let sensor_from_camera = camera_from_sensor.try_inverse().expect("rigid");
        poses.iter_mut().for_each(|pose| *pose = camera_from_sensor * *pose * sensor_from_camera);
    }
    let errors = matrix_errors(&truth, &poses);
    let found = [errors.t_rel_percent, errors.r_rel_deg_per_100m, errors.ate_m, errors.rpe_m, errors.rpe_deg];
    assert_eq!(errors.segments.to_string(), cells[4], "{name} {sequence}");
    for (found, expected) in found.into_iter().zip(&cells[5..10]) {
        let (found, expected) = (found.expect("a value"), expected.parse::<f64>().expect("a number"));
        assert!((found - expected).abs() < 5e-4, "{name} {sequence}: {found}, expected {expected}");
    }
    for (found, published) in found.into_iter().zip(&cells[10..]) {
        if let Ok(published) = published.parse::<f64>() {
            let found = found.expect("a value");
            assert!((found - published).abs() < 5e-4, "{name} {sequence}: {found}, the devkit {published}");
        }
    }
}

fn matrices(file: &Path) -> Vec<Matrix4<f64>> {
    match trajectory::read(file).expect("a trajectory") {
        Trajectory::Kitti(matrices) => matrices,
        Trajectory::Tum(_) => panic!("{} is no KITTI file", file.display()),
    }
}

fn calibration(file: &Path) -> Matrix4<f64> {
    let text = fs::read_to_string(file).expect("readable");
    let numbers = text.split_whitespace().filter_map(|word| word.parse().ok());
    Matrix4::from_row_iterator(numbers.chain([0.0, 0.0, 0.0, 1.0]))
}

#[test]
fn tum_files_are_compared_by_time() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let file = |name: &str| folder.path().join(name);
    let poses = drive(400);
    let stamps: Vec<_> = (0..poses.len()).map(|i| 100.0 + i as f64 * 0.1).collect();
    // Every other pose, a little late and in reverse order.
    let (late, some): (Vec<_>, Vec<_>) =
        stamps.iter().map(|stamp| stamp + 0.004).zip(poses.iter().copied()).step_by(2).rev().unzip();
    fs::write(file("truth"), trajectory::write_tum(&stamps, &poses)).expect("written");
    fs::write(file("some"), trajectory::write_tum(&late, &some)).expect("written");
    for (truth, estimate, all) in [("truth", "some", 400), ("some", "truth", 200)] {
        let errors = trajectory_files(&file(truth), &file(estimate)).expect("comparable");
        assert_eq!((errors.frames, errors.ground_truth_frames), (200, all));
        assert!(errors.ate_m.is_some_and(|ate| ate < 1e-6) && t_rel(&errors) < 1e-6);
    }
    let later: Vec<_> = stamps.iter().map(|stamp| stamp + 0.05).collect();
    fs::write(file("later"), trajectory::write_tum(&later, &poses)).expect("written");
    let apart = trajectory_files(&file("truth"), &file("later"));
    assert!(matches!(apart, Err(EvaluateError::NothingAssociated { .. })));
    fs::write(file("kitti"), trajectory::write_kitti(&poses)).expect("written");
    let mixed = trajectory_files(&file("truth"), &file("kitti"));
    assert!(matches!(mixed, Err(EvaluateError::MixedFormats { .. })));
    assert_eq!(trajectory_files(&file("kitti"), &file("kitti")).expect("comparable").frames, 400);
}

#[test]
fn label_errors_are_those_of_semantic_kitti_api() {
    // By hand: true label, label, how often. Road is split by its lane markings; true 0 and 52 do not count for classes;
    // a point called 0 is missed, but not wrong.
    let points = [
        (10, 252, 6),
        (252, 252, 3),
        (252, 10, 1),
        (40, 60, 8),
        (40, 48, 2),
        (0, 10, 50),
        (52, 10, 5),
        (70, 0, 4),
    ];
    let expand = |pick: fn(&(u32, u32, usize)) -> u32| -> Vec<u32> {
        points.iter().flat_map(|row| std::iter::repeat_n(pick(row), row.2)).collect()
    };
    let (truth, found) = (expand(|row| row.0), expand(|row| row.1 | 9 << 16));
    let mut confusion = LabelConfusion::default();
    confusion.add(&truth[..30], &found[..30]).expect("same length");
    confusion.add(&truth[30..], &found[30..]).expect("same length");
    let errors = confusion.errors();
    let iou = |name: &str| errors.classes.iter().find(|class| class.class == name).expect("a class").iou;
    assert_eq!((iou("car"), iou("road"), iou("sidewalk"), iou("vegetation")), (1.0, 0.8, 0.0, 0.0));
    assert!(
        (errors.mean_iou - 1.8 / 19.0).abs() < 1e-12 && (errors.mean_iou_of_present - 0.45).abs() < 1e-12
    );
    assert!((errors.accuracy - 18.0 / 20.0).abs() < 1e-12);
    assert_eq!((errors.points, errors.moving_points), (24, 4));
    // Moving: 3 right, 6 static cars called moving, 1 missed.
    assert!((errors.moving_iou - 0.3).abs() < 1e-12);
    assert!(
        (errors.moving_recall - 0.75).abs() < 1e-12 && (errors.moving_precision - 1.0 / 3.0).abs() < 1e-12
    );
    let unequal = confusion.add(&[1, 2], &[1]);
    assert!(matches!(unequal, Err(EvaluateError::LabelCounts { ground_truth: 2, labels: 1, .. })));
}

#[test]
fn label_folders_are_compared_file_by_file() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (truth, found) = (folder.path().join("truth"), folder.path().join("found"));
    let write = |folder: &Path, file: &str, labels: &[u32]| {
        fs::create_dir_all(folder).expect("folder");
        let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_le_bytes()).collect();
        fs::write(folder.join(file), bytes).expect("written");
    };
    write(&truth, "000000.label", &[252, 10, 40]);
    write(&truth, "000001.label", &[252]);
    fs::create_dir(&found).expect("folder");
    let none = evaluate::label_folders(&truth, &found);
    assert!(matches!(none, Err(EvaluateError::NoLabels { .. })));
    write(&found, "000000.label", &[252, 10, 40]);
    let errors = evaluate::label_folders(&truth, &found).expect("comparable");
    assert_eq!((errors.scans, errors.scans_without_labels, errors.moving_iou, errors.points), (1, 1, 1.0, 3));
    assert_eq!((errors.accuracy, errors.mean_iou_of_present), (1.0, 1.0));
    write(&found, "000000.label", &[252, 10]);
    let shorter = evaluate::label_folders(&truth, &found).expect_err("other length").to_string();
    assert!(
        shorter.contains("2 labels") && shorter.contains("with 3") && shorter.contains("000000.label"),
        "{shorter}"
    );
    write(&found, "000000.label", &[252, 10, 40]);
    write(&found, "000007.label", &[10]);
    let extra = evaluate::label_folders(&truth, &found);
    assert!(matches!(extra, Err(EvaluateError::Dataset(DatasetError::Missing { .. }))));
}

/// A street of two walls and a floor, a scan every metre, with a moving car that the labels name.
fn street(folder: &Path, frames: usize) -> Vec<MapPose> {
    let sequence = folder.join("sequences/00");
    fs::create_dir_all(sequence.join("velodyne")).expect("folder");
    fs::create_dir_all(sequence.join("labels")).expect("folder");
    fs::write(sequence.join("calib.txt"), "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n").expect("written");
    let poses: Vec<_> = (0..frames).map(|i| pose([i as f64, 0.0, 0.0], [0.0; 3])).collect();
    for frame in 0..frames {
        let mut points = Vec::new();
        let mut labels = Vec::new();
        let mut noise = 1_u32 + frame as u32;
        for i in 0..8000 {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let rough = (f64::from(noise) / f64::from(u32::MAX) - 0.5) * 0.02;
            let (along, across) = (f64::from(i % 200) * 0.2 - 20.0, f64::from(i / 200) * 0.2);
            let (y, z, label) = match i % 4 {
                0 => (5.0 + rough, across - 2.0, 50),
                1 => (-5.0 + rough, across - 2.0, 51),
                2 => (across - 4.0, -2.0 + rough, 40),
                _ => (3.0 + rough, frame as f64 * 0.1, 252),
            };
            points.extend([along, y, z, 0.0].map(|v| v as f32));
            labels.push(label);
        }
        let bytes: Vec<u8> = points.iter().flat_map(|v: &f32| v.to_le_bytes()).collect();
        fs::write(sequence.join(format!("velodyne/{frame:06}.bin")), bytes).expect("written");
        let bytes: Vec<u8> = labels.iter().flat_map(|v: &u32| v.to_le_bytes()).collect();
        fs::write(sequence.join(format!("labels/{frame:06}.label")), bytes).expect("written");
    }
    poses
}

#[test]
fn the_right_trajectory_makes_the_crispest_map() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let poses = street(folder.path(), 12);
    let sequence = Sequence::open(folder.path(), "00", None).expect("a drive");
    let options = MapEntropyOptions { window: 8, ..MapEntropyOptions::default() };
    let measure = |poses: &[MapPose]| evaluate::map_entropy(&sequence, poses, &options).expect("a map");
    let right = measure(&poses);
    let turned: Vec<_> = poses.iter().map(|at| pose([700.0, -50.0, 3.0], [0.3, -0.2, 2.0]) * at).collect();
    let wavy: Vec<_> = poses
        .iter()
        .enumerate()
        .map(|(i, at)| at * pose([0.0, 0.03 * (i % 3) as f64, 0.0], [0.0; 3]))
        .collect();
    assert!(right.mean_plane_variance_mm2 < 100.0, "walls of 20 mm: {}", right.mean_plane_variance_mm2);
    assert!((measure(&turned).mean_map_entropy - right.mean_map_entropy).abs() < 1e-3, "no place is special");
    assert!(measure(&wavy).mean_map_entropy > right.mean_map_entropy + 0.1);
    let unlabelled = Sequence::open_unlabelled(folder.path(), "00").expect("a drive");
    let smeared = evaluate::map_entropy(&unlabelled, &poses, &options).expect("a map");
    assert!(smeared.mean_map_entropy > right.mean_map_entropy, "the moving car counts without labels");
}

#[test]
fn map_entropy_copes_with_gaps_and_refuses_nonsense() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let poses = street(folder.path(), 6);
    fs::remove_file(folder.path().join("sequences/00/velodyne/000002.bin")).expect("removed");
    let sequence = Sequence::open(folder.path(), "00", None).expect("a drive");
    let measure =
        |poses: &[MapPose], options: &MapEntropyOptions| evaluate::map_entropy(&sequence, poses, options);
    let options = MapEntropyOptions { window: 4, radius_m: 0.6, ..MapEntropyOptions::default() };
    let gap = measure(&poses, &options).expect("a map");
    assert_eq!((gap.frames, gap.missing_frames), (5, 1));
    let part = MapEntropyOptions { frames: Some(3..6), ..options.clone() };
    let (all, own) = (measure(&poses, &part).expect("a map"), measure(&poses[3..], &part).expect("a map"));
    assert_eq!(all, own, "poses of the whole drive or of the part");
    assert!(matches!(
        measure(&poses[1..], &part),
        Err(EvaluateError::PoseCount { poses: 5, frames: 3, all: 6 })
    ));
    let wrong = [
        MapEntropyOptions { window: 1, ..options.clone() },
        MapEntropyOptions { radius_m: 0.0, ..options.clone() },
        MapEntropyOptions { radius_m: f64::NAN, ..options.clone() },
        MapEntropyOptions { max_range_m: 1.0, ..options.clone() },
        MapEntropyOptions { frames: Some(8..9), ..options.clone() },
    ];
    for wrong in wrong {
        assert!(matches!(measure(&poses, &wrong), Err(EvaluateError::Option { .. })), "{wrong:?}");
    }
    let sparse = MapEntropyOptions { radius_m: 0.01, ..options };
    assert!(matches!(measure(&poses, &sparse), Err(EvaluateError::EmptyMap { .. })));
}

/// Remake the figures with the Python evaluator that comes with the test data:
/// `map_consistency.py sequences/90 poses/90.txt [--labels labels] --correct --frames 0..150 --window 50`.
#[test]
fn map_entropy_is_that_of_the_reference_program() {
    let Some(data) = test_data("map entropy") else { return };
    let labelled = Sequence::open(&data, "90", None).expect("sequence 90");
    let unlabelled = Sequence::open_unlabelled(&data, "90").expect("sequence 90");
    let options = MapEntropyOptions {
        frames: Some(0..150),
        window: 50,
        correct_elevation: true,
        ..MapEntropyOptions::default()
    };
    let rows = [
        (&labelled, "poses/90.txt", -3.1325, 2179.4),
        (&unlabelled, "poses/90.txt", -3.0601, 2513.5),
        (&unlabelled, "sequences/90/poses_gps_imu.txt", -2.5156, 5653.7),
    ];
    for (sequence, file, entropy, variance_mm2) in rows {
        let poses = sensor_poses(sequence, &data.join(file));
        let found = evaluate::map_entropy(sequence, &poses, &options).expect("a map");
        println!("{file}\n{found}");
        assert!((found.mean_map_entropy - entropy).abs() < 0.001, "{file}: {}", found.mean_map_entropy);
        assert!((found.mean_plane_variance_mm2 / variance_mm2 - 1.0).abs() < 0.001, "{file}: {found}");
    }
}

fn sensor_poses(sequence: &Sequence, file: &Path) -> Vec<MapPose> {
    let camera = trajectory::read_kitti(file).expect("poses");
    evaluate::map_from_sensor(&camera, &sequence.camera_from_sensor())
}

/// Drive 90 is not compensated for the motion: its map gets crisper when it is, and worse when it is done backwards.
#[test]
fn deskewing_makes_a_real_map_crisper() {
    const FRAMES: usize = 60;
    let Some(data) = test_data("deskewing") else { return };
    let sequence = Sequence::open(&data, "90", None).expect("sequence 90");
    let poses = sensor_poses(&sequence, &data.join("poses/90.txt"));
    let entropy = |sign: i32| {
        let folder = tempfile::tempdir().expect("temporary folder");
        let copy = folder.path().join("sequences/90");
        fs::create_dir_all(copy.join("velodyne")).expect("folder");
        fs::copy(data.join("sequences/90/calib.txt"), copy.join("calib.txt")).expect("copied");
        for frame in 0..FRAMES {
            let motion = poses[frame.saturating_sub(1)].inv_mul(&poses[frame.max(1)]);
            let motion = [motion.inverse(), MapPose::identity(), motion][(sign + 1) as usize];
            let mut points = sequence.read(frame).expect("a scan").points;
            dataset::correct_elevation(&mut points, dataset::ELEVATION_CORRECTION_DEG);
            dataset::deskew(&mut points, &motion);
            let bytes: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
            fs::write(copy.join(format!("velodyne/{frame:06}.bin")), bytes).expect("written");
        }
        let sequence = Sequence::open_unlabelled(folder.path(), "90").expect("a drive");
        evaluate::map_entropy(&sequence, &poses[..FRAMES], &MapEntropyOptions::default()).expect("a map")
    };
    let [backwards, raw, deskewed] = [-1, 0, 1].map(|sign| entropy(sign).mean_map_entropy);
    println!("deskewed {deskewed:.4}, as measured {raw:.4}, deskewed backwards {backwards:.4}");
    assert!(deskewed < raw - 0.02 && raw < backwards - 0.02);
}
