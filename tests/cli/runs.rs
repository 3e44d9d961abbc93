//! Runs that go well, and their configuration.

use std::fs;
use std::path::PathBuf;

use tempfile::TempDir;

use crate::support::*;

#[test]
fn a_run_writes_every_file_of_the_contract_and_a_table() {
    let drive = Drive::new();
    let table = text(drive.run(&[]).success());
    for row in ["frames", "lost", "t_rel", "core, ms per scan", "tracks", "map", "files"] {
        assert!(table.lines().any(|line| line.starts_with(row)), "no row {row} in\n{table}");
    }
    for file in FILES {
        assert!(drive.result(file).is_file(), "{file}");
    }
    assert_eq!(drive.lines("poses_kitti.txt"), FRAMES);
    assert_eq!(drive.lines("poses_tum.txt"), FRAMES);
    assert_eq!(drive.lines("ms.txt"), FRAMES);
    for frame in 0..FRAMES {
        let motion = fs::read(drive.result(&format!("motion/{frame:06}.label"))).expect("motion labels");
        assert_eq!(motion.len(), fs::read(drive.label(frame)).expect("labels").len());
    }
    let leftovers = entries(&drive.result("")).into_iter().filter(|name| name.contains("partial"));
    assert_eq!(leftovers.collect::<Vec<_>>(), Vec::<String>::new());
}

#[test]
fn two_runs_write_the_same_bytes_with_one_thread_and_with_two() {
    let drive = Drive::new();
    drive.run(&["--threads", "1"]).success();
    let first = drive.reproducible_bytes();
    drive.run(&["--threads", "2", "--overwrite"]).success();
    assert_eq!(drive.reproducible_bytes(), first);
}

#[test]
fn a_range_of_frames_keeps_their_numbers() {
    let drive = Drive::new();
    drive.run(&["--frames", "2..5"]).success();
    assert_eq!(drive.lines("poses_kitti.txt"), 3);
    assert_eq!(entries(&drive.result("motion")), ["000002.label", "000003.label", "000004.label"]);
    let refusal = errors(Drive::new().run(&["--frames", "4..99"]).code(USAGE));
    assert!(refusal.contains("4..99") && refusal.contains("6 frames"), "{refusal}");
}

#[test]
fn switches_reach_the_effective_configuration() {
    let drive = Drive::new();
    drive.run(&["--no-elevation-correction", "--deskew", "--preset", "paper"]).success();
    let config = drive.read("config.toml");
    for line in ["preset = \"paper\"", "elevation_correction_deg = 0.0", "deskew = true"] {
        assert!(config.lines().any(|there| there == line), "{line}");
    }
}

#[test]
fn the_printed_configuration_runs_and_is_what_the_run_reports() {
    for preset in ["accurate", "paper"] {
        let drive = Drive::new();
        let printed = text(sdslam(["config", "--preset", preset]).success());
        let file = drive.file("my.toml", &printed);
        drive.run(&["--config", path(&file)]).success();
        assert_eq!(drive.read("config.toml"), printed);
    }
}

#[test]
fn an_existing_run_is_kept_unless_overwriting_is_asked_for() {
    let drive = Drive::new();
    drive.run(&[]).success();
    let poses = drive.read("poses_kitti.txt");
    fs::write(drive.result("notes.txt"), "mine").expect("writable");
    let refusal = errors(drive.run(&["--frames", "0..2"]).code(OUTPUT));
    assert!(refusal.contains("--overwrite") && refusal.contains(path(&drive.result(""))), "{refusal}");
    assert_eq!(drive.read("poses_kitti.txt"), poses);
    drive.run(&["--frames", "0..2", "--overwrite"]).success();
    assert_eq!(drive.lines("poses_kitti.txt"), 2);
    assert_eq!(drive.read("notes.txt"), "mine");
}

#[test]
fn a_wrong_configuration_names_file_and_key() {
    for (content, said) in [
        ("[map]\nvoxel = 0.2\n", "map.voxel"),
        ("[no_stage]\n", "no_stage"),
        ("[map]\nvoxel_m = -1.0\n", "map.voxel_m"),
        ("[map\n", "line 1"),
    ] {
        let drive = Drive::new();
        let file = drive.file("wrong.toml", content);
        let refusal = errors(drive.run(&["--config", path(&file)]).code(CONFIGURATION));
        assert!(refusal.contains("wrong.toml") && refusal.contains(said), "{refusal}");
        assert!(!drive.result("").exists());
    }
}

#[test]
fn a_missing_configuration_is_named() {
    let refusal = errors(Drive::new().run(&["--config", "nowhere.toml"]).code(CONFIGURATION));
    assert!(refusal.contains("nowhere.toml"), "{refusal}");
}

#[test]
fn sixteen_scans_of_kitti_are_registered_without_a_loss() {
    let Some(data) = std::env::var_os("SDSLAM_TEST_DATA").map(PathBuf::from) else {
        println!("skipped: SDSLAM_TEST_DATA does not name the folder of the unpacked test data");
        return;
    };
    let out = TempDir::new().expect("a temporary folder");
    let contract = ["run", "--dataset", path(&data), "--sequence", "91", "--out", path(out.path())];
    sdslam(contract).success();
    let metrics = metrics(&out.path().join("91"));
    assert_eq!((&metrics["frames"], &metrics["lost"]), (&16.into(), &0.into()));
    let ate_m = metrics["trajectory"]["ate_m"].as_f64().expect("an error");
    assert!(ate_m < 0.05, "ATE {ate_m} m; the reference itself is good to a few centimetres");
}
