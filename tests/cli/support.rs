//! A tiny drive between two house fronts, and how the program is called on it.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use tempfile::TempDir;

pub const USAGE: i32 = 2;
pub const INPUT: i32 = 3;
pub const OUTPUT: i32 = 4;
pub const CONFIGURATION: i32 = 5;

pub const FRAMES: usize = 6;
/// Every file of a run besides the motion labels.
pub const FILES: [&str; 18] = [
    "poses_kitti.txt",
    "poses_odometry.txt",
    "poses_tum.txt",
    "loops.csv",
    "graph.g2o",
    "metrics.json",
    "landmarks.csv",
    "map.ply",
    "map.pcd",
    "map.png",
    "grid.pgm",
    "grid.yaml",
    "trajectory.svg",
    "config.toml",
    "run.log",
    "ms.txt",
    "cpu_ms.txt",
    "back_end_cpu_ms.txt",
];

/// A data set of one sequence, `00`, in a folder of its own, and a place for results.
pub struct Drive(TempDir);

impl Drive {
    pub fn new() -> Self {
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

    pub fn write_scan(&self, frame: usize, points: &[[f32; 4]], labels: &[u32]) {
        let points: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let labels: Vec<u8> = labels.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(self.scan(frame), points).expect("writable");
        fs::write(self.label(frame), labels).expect("writable");
    }

    pub fn data(&self, part: &str) -> PathBuf {
        self.0.path().join("data").join(part)
    }

    pub fn scan(&self, frame: usize) -> PathBuf {
        self.data(&format!("sequences/00/velodyne/{frame:06}.bin"))
    }

    pub fn label(&self, frame: usize) -> PathBuf {
        self.data(&format!("sequences/00/labels/{frame:06}.label"))
    }

    pub fn result(&self, file: &str) -> PathBuf {
        let folder = self.0.path().join("out/00");
        if file.is_empty() { folder } else { folder.join(file) }
    }

    /// Writes a file beside the data.
    pub fn file(&self, name: &str, content: &str) -> PathBuf {
        let file = self.0.path().join(name);
        fs::write(&file, content).expect("writable");
        file
    }

    pub fn run(&self, options: &[&str]) -> Assert {
        self.run_to(&self.0.path().join("out"), options)
    }

    pub fn run_to(&self, out: &Path, options: &[&str]) -> Assert {
        let data = self.data("");
        let contract = ["run", "--dataset", path(&data), "--sequence", "00", "--out", path(out)];
        sdslam(contract.iter().chain(options).copied())
    }

    pub fn read(&self, file: &str) -> String {
        fs::read_to_string(self.result(file)).expect("a result")
    }

    pub fn lines(&self, file: &str) -> usize {
        self.read(file).lines().count()
    }

    /// Everything that holds no times of this machine.
    pub fn reproducible_bytes(&self) -> Vec<(String, Vec<u8>)> {
        let timeless = FILES.iter().filter(|file| !file.ends_with("ms.txt") && *file != &"metrics.json");
        let motion = entries(&self.result("motion")).into_iter().map(|name| format!("motion/{name}"));
        let names = timeless.map(ToString::to_string).chain(motion);
        names.map(|name| (name.clone(), fs::read(self.result(&name)).expect("a result"))).collect()
    }
}

/// Road between two house fronts with poles before them, as seen after some metres.
pub fn street(travelled_m: f32) -> (Vec<[f32; 4]>, Vec<u32>) {
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

pub fn sdslam<'a>(arguments: impl IntoIterator<Item = &'a str>) -> Assert {
    Command::new(env!("CARGO_BIN_EXE_sdslam")).args(arguments).assert()
}

pub fn text(assert: Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).expect("UTF-8")
}

pub fn errors(assert: Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).expect("UTF-8")
}

pub fn metrics(folder: &Path) -> serde_json::Value {
    let text = fs::read_to_string(folder.join("metrics.json")).expect("metrics");
    serde_json::from_str(&text).expect("JSON")
}

pub fn path(path: &Path) -> &str {
    path.to_str().expect("a UTF-8 path")
}

pub fn entries(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

pub fn remove(path: &Path) {
    if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.expect("removable");
}

/// Cuts bytes off the end of a file.
pub fn cut(file: &Path, bytes: usize) {
    let mut content = fs::read(file).expect("a file");
    content.truncate(content.len() - bytes);
    fs::write(file, content).expect("writable");
}

pub fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

pub fn first_number(line: &str) -> f64 {
    line.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
}
