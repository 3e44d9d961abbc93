//! The desk program on a simulated drive: the same pose as the host's, clear words about damaged files.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use sdslam::config::HostConfig;
use sdslam::run::{self, ClassSource, Request};
use sdslam::simulate::{self, Options};
use tempfile::TempDir;

const FRAMES: usize = 10;

struct SimulatedDrive {
    folder: TempDir,
    sequence: String,
}

impl SimulatedDrive {
    fn new() -> Self {
        let folder = TempDir::new().expect("a temporary folder");
        let mut options = Options { frames: FRAMES, ..Options::demo() };
        options.sensor.columns = 256;
        simulate::simulate(&options, folder.path(), &mut |_, _| ()).expect("a simulated drive");
        Self { folder, sequence: options.sequence }
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join("sequences").join(&self.sequence).join(file)
    }

    /// What the desk program prints, and what it complains about.
    fn replay(&self) -> (bool, String, String) {
        let mut desk = Command::cargo_bin("sdslam-firmware-sim").expect("the program");
        let output = desk.arg(self.folder.path()).arg(&self.sequence).output().expect("it runs");
        let text = |bytes| String::from_utf8(bytes).expect("text");
        (output.status.success(), text(output.stdout), text(output.stderr))
    }

    /// The last line of the trajectory that the host finds.
    fn last_pose_of_the_host(&self) -> String {
        let mut config = HostConfig::default();
        config.input.elevation_correction_deg = 0.0;
        let request = Request {
            dataset: self.folder.path().into(),
            sequence: self.sequence.clone(),
            classes: ClassSource::default(),
            first_frame: 0,
            end_frame: None,
            config,
            threads: 1,
            overwrite: false,
            out: self.folder.path().join("out"),
        };
        let summary = run::run(&request, |_, _| ()).expect("a run");
        let poses = read(&summary.folder.join("poses_tum.txt"));
        poses.lines().last().expect("a pose").into()
    }
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).expect("a text file")
}

#[test]
fn the_pose_is_the_hosts_to_the_last_digit() {
    let drive = SimulatedDrive::new();
    let (ok, report, errors) = drive.replay();
    assert!(ok && errors.is_empty(), "{errors}");
    assert_eq!(report.lines().last(), Some(drive.last_pose_of_the_host().as_str()));
    assert!(report.contains("10 scans, 10 estimates, 0 of them predicted, 0 faults"), "{report}");
}

#[test]
fn a_stamp_that_goes_back_is_reported_and_the_replay_goes_on() {
    let drive = SimulatedDrive::new();
    let times = read(&drive.path("times.txt"));
    let mut times: Vec<&str> = times.lines().collect();
    times[5] = "0.05";
    fs::write(drive.path("times.txt"), times.join("\n")).expect("a writable folder");
    let (ok, report, errors) = drive.replay();
    assert!(ok && errors.contains("scan 5: scan refused: time stamp 0.05 s is not after"), "{errors}");
    assert!(report.contains("10 scans, 9 estimates, 0 of them predicted, 1 faults"), "{report}");
}

#[test]
fn damaged_drives_end_with_the_name_of_the_file() {
    let drive = SimulatedDrive::new();
    let (scan, label, times) =
        (drive.path("velodyne/000003.bin"), drive.path("labels/000003.label"), drive.path("times.txt"));
    let damages: [(&Path, Vec<u8>, &str); 3] = [
        (&scan, vec![0; 17], "000003.bin has 17 bytes"),
        (&label, vec![0; 8], "000003.label has 2 labels for"),
        (&times, b"0.0\nsoon\n".to_vec(), "times.txt line 2: \"soon\""),
    ];
    for (path, damage, words) in damages {
        let good = fs::read(path).expect("a file of the drive");
        fs::write(path, damage).expect("a writable folder");
        let (ok, _, errors) = drive.replay();
        assert!(!ok && errors.contains(words), "{errors}");
        fs::write(path, good).expect("a writable folder");
    }
    assert!(drive.replay().0, "the repaired drive");
}
