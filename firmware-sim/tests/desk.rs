//! The desk program on a simulated drive: the same pose as the host's, clear words about damaged files.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use sdslam::config::HostConfig;
use sdslam::run::{self, ClassSource, Request};
use sdslam::simulate::{self, Options};
use sdslam_firmware_sim::wire::HEADER_BYTES;
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
        let folder = self.folder.path().to_str().expect("a name in UTF-8");
        desk(&["replay", folder, "--sequence", &self.sequence])
    }

    /// Where a run of the host records.
    fn recording(&self) -> PathBuf {
        self.folder.path().join("drive.sdr")
    }

    /// The last line of the trajectory that the host finds; it records.
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
            save_map: None,
            overwrite: false,
            record: Some(self.recording()),
            out: self.folder.path().join("out"),
        };
        let summary = run::run(&request, |_, _| ()).expect("a run");
        let poses = read(&summary.folder.join("poses_tum.txt"));
        poses.lines().last().expect("a pose").into()
    }
}

/// Success, what the desk program prints, and what it complains about.
fn desk(arguments: &[&str]) -> (bool, String, String) {
    let mut desk = Command::cargo_bin("sdslam-firmware-sim").expect("the program");
    let output = desk.args(arguments).output().expect("it runs");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (output.status.success(), text(output.stdout), text(output.stderr))
}

fn text_of(path: &Path) -> &str {
    path.to_str().expect("a name in UTF-8")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).expect("a text file")
}

#[test]
fn the_pose_is_the_hosts_to_the_last_digit() {
    let drive = SimulatedDrive::new();
    let (ok, report, errors) = drive.replay();
    assert!(ok && errors.is_empty(), "{errors}");
    let last_pose = drive.last_pose_of_the_host();
    assert_eq!(report.lines().last(), Some(last_pose.as_str()));
    assert!(report.contains("10 scans, 0 missed, 10 estimates, 0 of them predicted, 0 faults"), "{report}");
    // The recording holds the same scans as the drive.
    let (ok, of_recording, errors) = desk(&["replay", text_of(&drive.recording())]);
    assert!(ok && errors.is_empty(), "{errors}");
    assert_eq!(of_recording.lines().last(), Some(last_pose.as_str()));
}

#[test]
fn a_stamp_that_goes_back_is_reported_and_the_replay_goes_on() {
    let drive = SimulatedDrive::new();
    let times = read(&drive.path("times.txt"));
    let mut times: Vec<&str> = times.lines().collect();
    times[5] = "0.05";
    fs::write(drive.path("times.txt"), times.join("\n")).expect("a writable folder");
    let (ok, report, errors) = drive.replay();
    assert!(ok && errors.is_empty(), "{errors}");
    assert!(report.contains("scan 5: the sensor's clock was set by -0.450 s"), "{report}");
    assert!(report.contains("scan 6: the sensor's clock was set by 0.450 s"), "{report}");
    assert!(report.contains("10 scans, 0 missed, 10 estimates, 0 of them predicted, 2 faults"), "{report}");
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

/// Flips the lowest bit of the frame number in the last message of a file, and mends the checksum.
fn flip_a_bit_of_the_last_answer(bytes: &mut [u8]) {
    let mut begin = 0;
    let content_bytes =
        |at: usize| u32::from_le_bytes(*bytes[at + 12..].first_chunk().expect("a header")) as usize;
    let end = |at: usize| at + HEADER_BYTES + content_bytes(at) + 4;
    while end(begin) < bytes.len() {
        begin = end(begin);
    }
    let content = begin + HEADER_BYTES..bytes.len() - 4;
    // It comes first, and is one byte while it is small.
    bytes[content.start] ^= 1;
    let checksum = crc32fast::hash(&bytes[content.clone()]);
    bytes[content.end..].copy_from_slice(&checksum.to_le_bytes());
}

#[test]
fn answers_compare_bit_for_bit() {
    let folder = TempDir::new().expect("a temporary folder");
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    for file in [&a, &b] {
        let (ok, ..) = desk(&["replay", "--scans", "6", "--answers", text_of(file)]);
        assert!(ok);
    }
    let (ok, equal, _) = desk(&["compare", text_of(&a), text_of(&b)]);
    assert!(ok && equal.starts_with("6 answers with"), "{equal}");
    // Other parameters, other answers.
    assert!(desk(&["replay", "--scans", "6", "--profile", "landmark", "--answers", text_of(&b)]).0);
    let (ok, differs, _) = desk(&["compare", text_of(&a), text_of(&b)]);
    assert!(!ok && differs.starts_with("scan 0: the estimates differ"), "{differs}");
    // One bit of the last answer, its checksum mended: what a processor that rounds otherwise would give.
    let mut bytes = fs::read(&a).expect("answers");
    flip_a_bit_of_the_last_answer(&mut bytes);
    fs::write(&b, bytes).expect("a writable folder");
    let (ok, differs, errors) = desk(&["compare", text_of(&a), text_of(&b)]);
    assert!(!ok && differs.starts_with("scan 5: "), "{differs}{errors}");
    // One bit on the way is an error, not a difference.
    let mut bytes = fs::read(&a).expect("answers");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    fs::write(&b, bytes).expect("a writable folder");
    let (ok, _, errors) = desk(&["compare", text_of(&a), text_of(&b)]);
    assert!(!ok && errors.contains("is damaged at byte"), "{errors}");
}

#[test]
fn a_board_that_is_too_slow_reads_too_late() {
    let (ok, _, errors) = desk(&["replay", "--busy-ms", "130"]);
    assert!(!ok && errors.contains("late read"), "{errors}");
    assert!(desk(&["replay", "--busy-ms", "90"]).0);
}

#[test]
fn every_fault_is_survived() {
    let (ok, table, errors) = desk(&["faults", "--scenarios", "60"]);
    assert!(ok && errors.is_empty(), "{table}{errors}");
    assert!(table.contains("60 scenarios, 0 panics, 0 not well again within 5 good scans"), "{table}");
    for row in table.lines().skip(1).take(10) {
        let injected = row.split_whitespace().find_map(|word| word.parse::<u32>().ok());
        assert!(injected.is_some_and(|n| n > 0), "every kind of fault is injected: {row}");
    }
}

#[test]
fn a_drive_that_does_not_fit_says_what_and_when() {
    let (ok, small, _) = desk(&["fit", "--profile", "landmark"]);
    assert!(ok && small.contains("cells") && small.contains("1 (0.100 s)"), "{small}");
    let (ok, full, _) = desk(&["fit", "--profile", "full"]);
    assert!(ok && full.contains("the drive fits") && full.contains("0.000 m and 0.000 deg"), "{full}");
}

#[test]
fn one_scenario_tells_its_story() {
    let (ok, story, errors) = desk(&["faults", "--only", "3"]);
    assert!(ok && errors.is_empty(), "{story}{errors}");
    assert!(story.contains("1 scenarios, 0 panics"), "{story}");
    assert!(
        story.contains("scan 0: First") && story.contains("scan 15: Registered, step off by 0.0"),
        "{story}"
    );
}

#[test]
fn the_profiles_name_every_part_and_its_bytes() {
    let (ok, table, _) = desk(&["profiles"]);
    assert!(ok, "{table}");
    let bytes = |line: &str| line.split_whitespace().last().and_then(|n| n.parse::<u64>().ok());
    for (profile, limit) in table.split("\n\n").zip([16 << 20, 1 << 20]) {
        let rows: Vec<u64> = profile.lines().skip(1).filter_map(bytes).collect();
        let (all, parts) = rows.split_last().expect("a table");
        assert_eq!(parts.iter().sum::<u64>(), *all, "{profile}");
        assert!(*all <= limit, "{profile}");
        assert!(
            ["points of a scan", "tracks", "submap voxels", "loop places"]
                .iter()
                .all(|n| profile.contains(n))
        );
    }
}

#[test]
fn damaged_recordings_end_with_their_name() {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("x.sdr");
    for bytes in [&b"no recording at all, but long enough for a header"[..], &[0xD5; 5]] {
        fs::write(&file, bytes).expect("a writable folder");
        let (ok, _, errors) = desk(&["replay", text_of(&file)]);
        assert!(!ok && errors.contains("x.sdr") && errors.contains("damaged recording"), "{errors}");
    }
}
