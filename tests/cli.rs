//! The command line as its users meet it: what it says, what it writes, what it refuses and with which exit code.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use tempfile::TempDir;

const USAGE: i32 = 2;
const INPUT: i32 = 3;
const OUTPUT: i32 = 4;
const CONFIGURATION: i32 = 5;

const FRAMES: usize = 6;
/// Every file of a run besides the motion labels.
const FILES: [&str; 10] = [
    "poses_kitti.txt",
    "poses_tum.txt",
    "metrics.json",
    "landmarks.csv",
    "map.ply",
    "trajectory.svg",
    "config.toml",
    "run.log",
    "ms.txt",
    "cpu_ms.txt",
];

// ---- what it says ----

#[test]
fn help_explains_every_subcommand_with_an_example() {
    let help = text(sdslam(["--help"]).success());
    for command in ["run", "evaluate", "simulate", "demo", "config", "completions"] {
        assert!(help.contains(&format!("\n  {command} ")), "{command} is not in the help");
        let own = text(sdslam([command, "--help"]).success());
        assert!(own.contains(&format!("sdslam {command}")) && own.contains("Example"), "{own}");
    }
}

#[test]
fn help_lists_the_exit_codes() {
    let help = text(sdslam(["--help"]).success());
    for code in ["2 the command line", "3 the input data", "4 an output", "5 the configuration"] {
        assert!(help.contains(code), "{code}");
    }
}

#[test]
fn wrong_command_lines_exit_with_2() {
    let wrong: [&[&str]; 6] = [
        &[],
        &["fly"],
        &["run"],
        &["run", "--dataset", ".", "--sequence", "00", "--out", "x", "--frames", "3..2"],
        &["run", "--dataset", ".", "--sequence", "00", "--out", "x", "--threads", "0"],
        &["evaluate"],
    ];
    for arguments in wrong {
        sdslam(arguments.iter().copied()).code(USAGE);
    }
}

#[test]
fn completions_are_for_this_program() {
    for shell in ["bash", "zsh", "fish"] {
        assert!(text(sdslam(["completions", shell]).success()).contains("sdslam"));
    }
}

// ---- a run ----

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

// ---- input that is wrong from the start ----

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

// ---- input that goes wrong in the middle ----

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

// ---- configuration ----

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

// ---- output ----

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

// ---- evaluation ----

#[test]
fn a_trajectory_compared_with_itself_has_no_error() {
    let drive = Drive::new();
    let truth = drive.data("poses/00.txt");
    let table =
        text(sdslam(["evaluate", "--ground-truth", path(&truth), "--estimate", path(&truth)]).success());
    assert!(table.contains("0.0000"), "{table}");
}

#[test]
fn labels_compared_with_themselves_agree() {
    let drive = Drive::new();
    let labels = drive.data("sequences/00/labels");
    let arguments =
        ["evaluate", "--json", "--labels-truth", path(&labels), "--labels-estimate", path(&labels)];
    let json = text(sdslam(arguments).success());
    assert!(json.contains("\"accuracy\": 1.0"), "{json}");
}

#[test]
fn the_map_entropy_of_a_run_is_measured_in_either_pose_format() {
    let drive = Drive::new();
    drive.run(&[]).success();
    let dataset = drive.data("");
    let drive_arguments = ["evaluate", "--map-entropy", "--dataset", path(&dataset), "--sequence", "00"];
    let measure = |poses: &str| {
        let poses = drive.result(poses);
        let options = ["--window", "6", "--radius", "0.8", "--poses", path(&poses)];
        text(sdslam(drive_arguments.into_iter().chain(options)).success())
    };
    let entropy = measure("poses_kitti.txt");
    assert!(entropy.contains("mean map entropy"), "{entropy}");
    assert_eq!(first_line(&entropy), first_line(&measure("poses_tum.txt")));
}

#[test]
fn an_evaluation_of_missing_files_names_them() {
    let refusal = errors(sdslam(["evaluate", "--ground-truth", "a.txt", "--estimate", "b.txt"]).code(INPUT));
    assert!(refusal.contains("a.txt"), "{refusal}");
    sdslam(["evaluate", "--estimate", "b.txt"]).code(USAGE);
    sdslam(["evaluate", "--map-entropy", "--dataset", "."]).code(USAGE);
}

// ---- real scans ----

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

// ---- simulation and demo ----

#[test]
fn a_simulated_drive_runs_and_its_pose_is_found() {
    let folder = TempDir::new().expect("a temporary folder");
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    let small = ["--frames", "12", "--columns", "512", "--sequence", "42"];
    let table = text(sdslam(["simulate", "--out", path(&data)].into_iter().chain(small)).success());
    assert!(table.contains("frames                 12"), "{table}");
    let contract = ["run", "--dataset", path(&data), "--sequence", "42", "--out", path(&out)];
    sdslam(contract.into_iter().chain(["--no-elevation-correction"])).success();
    let metrics = metrics(&out.join("42"));
    assert_eq!((&metrics["frames"], &metrics["lost"]), (&12.into(), &0.into()));
    let ate_m = metrics["trajectory"]["ate_m"].as_f64().expect("an error");
    assert!(ate_m < 0.1, "ATE {ate_m} m over about ten metres");
    assert!(metrics["core_memory_bytes"].as_u64() <= Some(16 << 20));
}

#[test]
fn a_simulation_is_not_replaced_unasked_and_refuses_nonsense() {
    let folder = TempDir::new().expect("a temporary folder");
    let small = ["simulate", "--frames", "2", "--columns", "64", "--out", path(folder.path())];
    sdslam(small).success();
    let refusal = errors(sdslam(small).code(OUTPUT));
    assert!(refusal.contains(path(folder.path())), "{refusal}");
    sdslam(small.into_iter().chain(["--overwrite"])).success();
    let refusal = errors(sdslam(["simulate", "--frames", "0", "--out", path(folder.path())]).code(USAGE));
    assert!(refusal.contains("frames"), "{refusal}");
}

#[test]
fn the_demo_prints_the_table_and_where_the_pictures_are() {
    let folder = TempDir::new().expect("a temporary folder");
    let small = ["--frames", "8", "--columns", "360"];
    let table = text(sdslam(["demo", "--out", path(folder.path())].into_iter().chain(small)).success());
    for said in ["ATE", "moving landmarks", "map", "trajectory.svg", "map.ply"] {
        assert!(table.contains(said), "{said} is not in\n{table}");
    }
    assert!(folder.path().join("results/80/trajectory.svg").is_file());
}

// ---- a tiny drive between two walls ----

/// A data set of one sequence, `00`, in a folder of its own, and a place for results.
struct Drive(TempDir);

impl Drive {
    fn new() -> Self {
        let drive = Self(TempDir::new().expect("a temporary folder"));
        for folder in ["sequences/00/velodyne", "sequences/00/labels", "poses"] {
            fs::create_dir_all(drive.data(folder)).expect("writable");
        }
        let (mut times, mut poses) = (String::new(), String::new());
        for frame in 0..FRAMES {
            let travelled_m = 0.5 * frame as f32;
            let (points, labels) = street(travelled_m);
            drive.write_scan(frame, &points, &labels);
            times.push_str(&format!("{}\n", 0.1 * frame as f64));
            // The camera looks along its z axis.
            poses.push_str(&format!("1 0 0 0 0 1 0 0 0 0 1 {travelled_m}\n"));
        }
        fs::write(drive.data("sequences/00/times.txt"), times).expect("writable");
        fs::write(drive.data("poses/00.txt"), poses).expect("writable");
        let calib = "Tr: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27\n";
        fs::write(drive.data("sequences/00/calib.txt"), calib).expect("writable");
        drive
    }

    fn write_scan(&self, frame: usize, points: &[[f32; 4]], labels: &[u32]) {
        let points: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let labels: Vec<u8> = labels.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(self.scan(frame), points).expect("writable");
        fs::write(self.label(frame), labels).expect("writable");
    }

    fn data(&self, part: &str) -> PathBuf {
        self.0.path().join("data").join(part)
    }

    fn scan(&self, frame: usize) -> PathBuf {
        self.data(&format!("sequences/00/velodyne/{frame:06}.bin"))
    }

    fn label(&self, frame: usize) -> PathBuf {
        self.data(&format!("sequences/00/labels/{frame:06}.label"))
    }

    fn result(&self, file: &str) -> PathBuf {
        let folder = self.0.path().join("out/00");
        if file.is_empty() { folder } else { folder.join(file) }
    }

    /// Writes a file beside the data.
    fn file(&self, name: &str, content: &str) -> PathBuf {
        let file = self.0.path().join(name);
        fs::write(&file, content).expect("writable");
        file
    }

    fn run(&self, options: &[&str]) -> Assert {
        self.run_to(&self.0.path().join("out"), options)
    }

    fn run_to(&self, out: &Path, options: &[&str]) -> Assert {
        let data = self.data("");
        let contract = ["run", "--dataset", path(&data), "--sequence", "00", "--out", path(out)];
        sdslam(contract.iter().chain(options).copied())
    }

    fn read(&self, file: &str) -> String {
        fs::read_to_string(self.result(file)).expect("a result")
    }

    fn lines(&self, file: &str) -> usize {
        self.read(file).lines().count()
    }

    /// Everything that holds no times of this machine.
    fn reproducible_bytes(&self) -> Vec<(String, Vec<u8>)> {
        let timeless = FILES.iter().filter(|file| !["metrics.json", "ms.txt", "cpu_ms.txt"].contains(file));
        let motion = entries(&self.result("motion")).into_iter().map(|name| format!("motion/{name}"));
        let names = timeless.map(ToString::to_string).chain(motion);
        names.map(|name| (name.clone(), fs::read(self.result(&name)).expect("a result"))).collect()
    }
}

/// Road between two house fronts with poles before them, as seen after some metres.
fn street(travelled_m: f32) -> (Vec<[f32; 4]>, Vec<u32>) {
    let (mut points, mut labels) = (Vec::new(), Vec::new());
    let mut add = |x: f32, y: f32, z: f32, label: u32| {
        points.push([x - travelled_m, y, z, 0.3]);
        labels.push(label);
    };
    for i in -60i32..=60 {
        let x = 0.25 * i as f32;
        for j in -12..=12 {
            add(x, 0.4 * j as f32, -1.73, 40);
        }
        for j in 0..12 {
            let z = -1.5 + 0.4 * j as f32;
            // House fronts with steps, so that the way along the street shows.
            let depth = if i.rem_euclid(24) < 12 { 0.0 } else { 1.0 };
            add(x, 6.0 + depth, z, 50);
            add(x, -6.5 - depth, z, 50);
            if i % 20 == 0 {
                add(x, 5.0, z, 80);
                add(x + 0.1, -5.5, z, 80);
            }
        }
    }
    (points, labels)
}

// ---- small helpers ----

fn sdslam<'a>(arguments: impl IntoIterator<Item = &'a str>) -> Assert {
    Command::new(env!("CARGO_BIN_EXE_sdslam")).args(arguments).assert()
}

fn text(assert: Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).expect("UTF-8")
}

fn errors(assert: Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).expect("UTF-8")
}

fn metrics(folder: &Path) -> serde_json::Value {
    let text = fs::read_to_string(folder.join("metrics.json")).expect("metrics");
    serde_json::from_str(&text).expect("JSON")
}

fn path(path: &Path) -> &str {
    path.to_str().expect("a UTF-8 path")
}

fn entries(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn remove(path: &Path) {
    if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.expect("removable");
}

/// Cuts bytes off the end of a file.
fn cut(file: &Path, bytes: usize) {
    let mut content = fs::read(file).expect("a file");
    content.truncate(content.len() - bytes);
    fs::write(file, content).expect("writable");
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

fn first_number(line: &str) -> f64 {
    line.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
}
