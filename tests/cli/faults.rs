//! Broken input and unwritable output.

use std::fs;

use crate::support::*;

#[test]
fn a_missing_part_of_the_data_set_is_named() {
    for part in [
        "sequences",
        "sequences/00",
        "sequences/00/velodyne",
        "sequences/00/calib.txt",
        "sequences/00/labels",
    ] {
        let drive = Drive::new();
        remove(&drive.data(part));
        let refusal = errors(drive.run(&[]).code(INPUT));
        assert!(refusal.contains(path(&drive.data(part))), "{part}: {refusal}");
        assert!(!drive.result("").exists(), "{part}: nothing may be written");
    }
}

#[test]
fn another_label_folder_is_looked_for_by_its_name() {
    let drive = Drive::new();
    let refusal = errors(drive.run(&["--labels", "predictions"]).code(INPUT));
    assert!(refusal.contains("predictions"), "{refusal}");
    fs::rename(drive.data("sequences/00/labels"), drive.data("sequences/00/predictions")).expect("renamed");
    drive.run(&["--labels", "predictions"]).success();
}

#[test]
fn a_first_scan_that_cannot_be_read_is_an_error_that_names_it() {
    let faults: [fn(&Drive); 2] = [|drive| cut(&drive.scan(0), 7), |drive| cut(&drive.label(0), 8)];
    for (fault, said) in faults.into_iter().zip(["000000.bin", "000000.label"]) {
        let drive = Drive::new();
        fault(&drive);
        let refusal = errors(drive.run(&[]).code(INPUT));
        assert!(refusal.contains("first scan") && refusal.contains(said), "{refusal}");
        assert!(!drive.result("").exists(), "nothing may be written");
    }
}

#[test]
fn a_calibration_without_the_sensor_is_refused() {
    let drive = Drive::new();
    fs::write(drive.data("sequences/00/calib.txt"), "P0: 1 2 3\n").expect("writable");
    let refusal = errors(drive.run(&[]).code(INPUT));
    assert!(refusal.contains("calib.txt") && refusal.contains("Tr"), "{refusal}");
}

#[test]
fn a_scan_that_breaks_in_the_middle_is_predicted_counted_and_logged() {
    type Fault = (fn(&Drive), &'static str);
    let faults: [Fault; 4] = [
        (|drive| remove(&drive.scan(3)), "000003.bin"),
        (|drive| cut(&drive.scan(3), 7), "000003.bin"),
        (|drive| cut(&drive.label(3), 8), "000003.label"),
        (|drive| remove(&drive.label(3)), "000003.label"),
    ];
    for (fault, named) in faults {
        let drive = Drive::new();
        fault(&drive);
        let table = text(drive.run(&[]).success());
        assert!(table.contains("1 scans could not be read"), "{table}");
        assert!(drive.read("run.log").contains(named), "{named}");
        assert_eq!(drive.lines("poses_kitti.txt"), FRAMES);
        assert!(!drive.result("motion/000003.label").exists());
    }
}

#[test]
fn empty_scans_and_broken_points_do_not_stop_a_run() {
    let drive = Drive::new();
    fs::write(drive.scan(2), []).expect("writable");
    fs::write(drive.label(2), []).expect("writable");
    let strange = [f32::NAN, f32::INFINITY, 0.0, 1e30].map(|v| [v; 4]);
    drive.write_scan(4, &strange, &[50; 4]);
    drive.run(&[]).success();
    assert_eq!(drive.lines("poses_kitti.txt"), FRAMES);
    assert!(!drive.read("poses_kitti.txt").contains("NaN"));
    assert!(drive.read("run.log").contains("points not finite"));
}

#[test]
fn a_time_stamp_that_goes_back_is_replaced_and_reported() {
    let drive = Drive::new();
    fs::write(drive.data("sequences/00/times.txt"), "0.0\n0.1\n0.2\n0.1\n0.4\n0.5\n").expect("writable");
    let table = text(drive.run(&[]).success());
    assert!(table.contains("time stamps replaced"), "{table}");
    assert!(drive.read("run.log").contains("frame 000003: time stamp 0.1 s"));
    let tum = drive.read("poses_tum.txt");
    let stamps: Vec<f64> = tum.lines().map(first_number).collect();
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]), "{stamps:?}");
}

#[test]
fn a_drive_without_times_or_ground_truth_runs_and_says_so() {
    let drive = Drive::new();
    remove(&drive.data("sequences/00/times.txt"));
    remove(&drive.data("poses"));
    assert!(text(drive.run(&[]).success()).contains("ground truth           none"));
    assert!(drive.read("run.log").contains("times.txt is missing"));
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let drive = Drive::new();
    let file = drive.file("occupied", "a file, not a folder");
    let out = file.join("results");
    let refusal = errors(drive.run_to(&out, &[]).code(OUTPUT));
    assert!(refusal.contains(path(&out)), "{refusal}");
}

#[cfg(unix)]
#[test]
fn a_read_only_output_folder_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let drive = Drive::new();
    let folder = drive.result("");
    fs::create_dir_all(&folder).expect("writable");
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o555)).expect("owned");
    if fs::write(folder.join("probe"), "").is_ok() {
        println!("skipped: this user may write to read-only folders");
        return;
    }
    let refusal = errors(drive.run(&[]).code(OUTPUT));
    assert!(refusal.contains(path(&folder)), "{refusal}");
}

#[test]
fn a_map_is_saved_once_and_read_back_only_intact() {
    let drive = Drive::new();
    let map = drive.file("street.map", "not a map");
    let refusal = errors(drive.run(&["--save-map", path(&map)]).code(OUTPUT));
    assert!(refusal.contains("street.map") && refusal.contains("--overwrite"), "{refusal}");
    drive.run(&["--save-map", path(&map), "--overwrite"]).success();

    let whole = fs::read(&map).expect("a map");
    let data = drive.data("");
    let out = drive.file("later", "");
    fs::remove_file(&out).expect("removable");
    let localize = || {
        let place = ["--sequence", "00", "--initial-pose", "0,0,0"];
        let files = ["localize", "--map", path(&map), "--dataset", path(&data), "--out", path(&out)];
        sdslam(files.into_iter().chain(place))
    };
    let faults: [(&str, Vec<u8>); 3] = [
        ("no map of sdslam", b"ply\n".to_vec()),
        ("cut short", whole[..whole.len() - 9].to_vec()),
        ("checksum", whole.iter().rev().skip(1).rev().copied().chain([!whole[whole.len() - 1]]).collect()),
    ];
    for (said, bytes) in faults {
        fs::write(&map, bytes).expect("writable");
        let refusal = errors(localize().code(INPUT));
        assert!(refusal.contains("street.map") && refusal.contains(said), "{refusal}");
        assert!(!out.exists(), "nothing may be written");
    }
    fs::write(&map, &whole).expect("writable");
    let table = text(localize().success());
    assert!(table.contains("tracked"), "{table}");
    assert_eq!(fs::read(&map).expect("a map"), whole);
}
