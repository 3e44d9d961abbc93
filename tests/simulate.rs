//! Simulated drives as their readers see them: layout, determinism, and scans that agree with the poses.

use std::{collections::BTreeMap, fs, path::Path};

use nalgebra::Point3;
use sdslam::{
    dataset::{Sequence, labels},
    simulate::{Options, SimulateError, Summary, Traffic, simulate},
};

/// Small scans, few of them, in traffic.
fn small() -> Options {
    let mut options = Options { frames: 8, threads: 1, traffic: Traffic::Heavy, ..Options::demo() };
    options.sensor.columns = 360;
    options
}

fn drive(options: &Options, out: &Path) -> Summary {
    simulate(options, out, &mut |_, _| {}).expect("simulates")
}

/// All files below a folder by their path in it.
fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).expect("below the root").display().to_string();
                files.insert(name, fs::read(&path).expect("file"));
            }
        }
    }
    files
}

#[test]
fn seed_decides_every_byte_and_threads_none() {
    let folders = [0, 1, 2].map(|_| tempfile::tempdir().expect("folder"));
    let options = small();
    drive(&options, folders[0].path());
    drive(&Options { threads: 2, ..options.clone() }, folders[1].path());
    drive(&Options { seed: 2, ..options }, folders[2].path());
    let [one, two, other] = folders.map(|folder| files(folder.path()));
    assert_eq!(one.len(), 2 * 8 + 3);
    assert!(one == two, "two threads write other bytes than one");
    let scan = "sequences/80/velodyne/000003.bin";
    assert_ne!(one[scan], other[scan]);
}

#[test]
fn first_frames_do_not_depend_on_how_many_follow_without_traffic() {
    let folders = [0, 1].map(|_| tempfile::tempdir().expect("folder"));
    let options = Options { traffic: Traffic::None, frames: 2, ..small() };
    drive(&options, folders[0].path());
    drive(&Options { frames: 5, ..options }, folders[1].path());
    let [short, long] = folders.map(|folder| files(folder.path()));
    for name in ["velodyne/000001.bin", "labels/000001.label"] {
        let name = format!("sequences/80/{name}");
        assert!(short[&name] == long[&name], "{name}");
    }
}

#[test]
fn reader_finds_a_whole_drive_that_fits_the_summary() {
    let folder = tempfile::tempdir().expect("folder");
    let options = small();
    let mut calls = vec![];
    let summary =
        simulate(&options, folder.path(), &mut |done, all| calls.push((done, all))).expect("simulates");
    assert_eq!(calls, (1..=8).map(|done| (done, 8)).collect::<Vec<_>>());

    let sequence = Sequence::open(folder.path(), "80", None).expect("opens");
    assert_eq!((sequence.len(), summary.frames), (8, 8));
    let poses = sequence.ground_truth().expect("reads").expect("has poses");
    assert_eq!(poses.len(), 8);
    assert!((poses[0].to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-9);
    let (mut points, mut moving) = (0, BTreeMap::new());
    let mut by_id: BTreeMap<u32, usize> = BTreeMap::new();
    for frame in 0..8 {
        assert!((sequence.stamp_s(frame) - 0.1 * frame as f64).abs() < 1e-9);
        let scan = sequence.read(frame).expect("reads");
        let raw = scan.labels.expect("has labels");
        assert_eq!(raw.len(), scan.points.len());
        points += raw.len();
        for label in raw {
            *by_id.entry(label & 0xffff).or_default() += 1;
            if labels::is_moving(label) {
                moving.insert(label >> 16, label & 0xffff);
            }
        }
        for [x, y, z, remission] in scan.points {
            let range = (x * x + y * y + z * z).sqrt();
            assert!((0.9..81.0).contains(&range) && (0.0..1.0).contains(&remission));
        }
    }
    assert_eq!(summary.points_per_scan, points as f64 / 8.0);
    assert_eq!(summary.moving_objects, moving.len());
    for class in &summary.classes {
        let counted = by_id[&u32::from(class.id)] as f64 / points as f64;
        assert!((class.share - counted).abs() < 1e-12);
    }
    assert!((summary.classes.iter().map(|class| class.share).sum::<f64>() - 1.0).abs() < 1e-9);
    for id in [10, 40, 48, 50, 70, 80] {
        assert!(by_id.contains_key(&id), "no point of class {id}");
    }
}

#[test]
fn standing_things_keep_their_place_in_the_map() {
    let folder = tempfile::tempdir().expect("folder");
    let mut options = Options { frames: 6, ..small() };
    options.sensor.columns = 1800;
    drive(&options, folder.path());
    let sequence = Sequence::open(folder.path(), "80", None).expect("opens");
    let camera_from_sensor = sequence.camera_from_sensor();
    let poses = sequence.ground_truth().expect("reads").expect("has poses");
    // Points of walls, poles and trunks within 20 m, in the map.
    let standing = |frame: usize| -> Vec<Point3<f64>> {
        let scan = sequence.read(frame).expect("reads");
        let raw = scan.labels.expect("has labels");
        let near = |p: &[f32; 4]| p[0].hypot(p[1]) < 20.0;
        let map_from_sensor = poses[frame] * camera_from_sensor;
        let kept =
            scan.points.iter().zip(raw).filter(|(p, raw)| near(p) && [50, 71, 80].contains(&(raw & 0xffff)));
        kept.map(|(p, _)| map_from_sensor * Point3::new(p[0].into(), p[1].into(), p[2].into())).collect()
    };
    let (first, last) = (standing(0), standing(5));
    let shifts = |by: f64| -> f64 {
        let mut nearest: Vec<f64> = first
            .iter()
            .step_by(41)
            .map(|p| {
                let p = p + nalgebra::Vector3::new(by, 0.0, by);
                last.iter().map(|q| (p - q).norm_squared()).fold(f64::MAX, f64::min).sqrt()
            })
            .collect();
        nearest.sort_by(f64::total_cmp);
        nearest[nearest.len() / 2]
    };
    let aligned = shifts(0.0);
    assert!(aligned < 0.06, "median distance {aligned} m");
    assert!(shifts(0.2) > 2.0 * aligned, "{} against {aligned}", shifts(0.2));
}

#[test]
fn folder_of_another_drive_is_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let options = Options { frames: 3, ..small() };
    drive(&options, folder.path());
    let again = |options: &Options| simulate(options, folder.path(), &mut |_, _| {});
    assert!(matches!(again(&options), Err(SimulateError::Exists { .. })));
    let shorter = Options { frames: 2, overwrite: true, ..options.clone() };
    let error = again(&shorter).expect_err("a scan would be left over");
    assert!(error.to_string().contains("000002"), "{error}");
    assert!(again(&Options { overwrite: true, ..options }).is_ok());
}

#[test]
fn unwritable_place_is_named() {
    let folder = tempfile::tempdir().expect("folder");
    let blocked = folder.path().join("file");
    fs::write(&blocked, "").expect("writes");
    let error = simulate(&small(), &blocked, &mut |_, _| {}).expect_err("no folder can be made there");
    assert!(error.to_string().contains("file"), "{error}");
}

#[test]
fn randomised_drives_differ_and_show_what_a_network_has_to_tell_apart() {
    let folder = tempfile::tempdir().expect("folder");
    let mut seen: BTreeMap<u32, usize> = BTreeMap::new();
    let mut heights = vec![];
    for seed in 1..4 {
        let mut options = Options { frames: 5, threads: 2, ..Options::randomised(seed) };
        options.sensor.columns = 500;
        drive(&options, folder.path());
        let sequence = Sequence::open(folder.path(), &options.sequence, None).expect("opens");
        assert!((sequence.stamp_s(4) - 4.0).abs() < 1e-9);
        let poses = sequence.ground_truth().expect("reads").expect("has poses");
        let step_m = (poses[1].translation.vector - poses[0].translation.vector).norm();
        assert!((3.0..12.0).contains(&step_m), "{step_m}");
        for frame in 0..5 {
            let scan = sequence.read(frame).expect("reads");
            let ground = scan.points.iter().zip(scan.labels.as_ref().expect("has labels"));
            heights
                .push(ground.filter(|(_, label)| **label == 40).map(|(p, _)| p[2]).fold(f32::MAX, f32::min));
            for label in scan.labels.expect("has labels") {
                *seen.entry(label & 0xffff).or_default() += 1;
            }
        }
    }
    for id in [10, 11, 30, 40, 48, 50, 70, 71, 72, 80, 81] {
        assert!(seen.contains_key(&id), "no point of class {id}: {seen:?}");
    }
    let spread =
        heights.iter().copied().fold(f32::MIN, f32::max) - heights.iter().copied().fold(f32::MAX, f32::min);
    assert!(spread > 0.05, "all sensors at the same height: {heights:?}");
}
