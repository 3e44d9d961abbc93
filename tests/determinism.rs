//! The same scans give the same bits: again, on another thread at the same time, and as recorded.

use std::fmt::Write as _;
use std::path::PathBuf;

use sdslam_core::{Config, FrameEstimate};
use sdslam_tests::drive::Drive;
use sdslam_tests::odometry::{Answer, full_scan, process_fully};

const FRAMES: usize = 24;

fn drive() -> Drive {
    let mut drive = Drive::down_the_street(FRAMES, 8.0);
    // A gap, so that the prediction is part of it.
    drive.frames[15].points.clear();
    drive
}

fn run(drive: &Drive, config: Config) -> Vec<Answer> {
    let mut odometry = full_scan(config);
    drive.frames.iter().map(|f| process_fully(&mut odometry, f.stamp_s, &f.points)).collect()
}

/// `==` takes 0 for -0 and no NaN for itself; the text of the numbers shows every bit.
fn assert_same_bits(a: &[Answer], b: &[Answer]) {
    assert_eq!(a.len(), b.len());
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        assert_eq!(a, b, "frame {k}");
        assert_eq!(
            format!("{:?}{:?}", a.estimate, a.tracks),
            format!("{:?}{:?}", b.estimate, b.tracks),
            "frame {k}"
        );
    }
}

#[test]
fn a_second_run_gives_the_same_bits() {
    let drive = drive();
    for config in [Config::accurate(), Config::paper()] {
        assert_same_bits(&run(&drive, config), &run(&drive, config));
    }
}

#[test]
fn two_runs_at_the_same_time_give_the_same_bits() {
    let drive = drive();
    let alone = run(&drive, Config::accurate());
    let (with_another, paper) = std::thread::scope(|scope| {
        let accurate = scope.spawn(|| run(&drive, Config::accurate()));
        let paper = scope.spawn(|| run(&drive, Config::paper()));
        (accurate.join().expect("no panic"), paper.join().expect("no panic"))
    });
    assert_same_bits(&alone, &with_another);
    assert_ne!(alone[FRAMES - 1].estimate, paper[FRAMES - 1].estimate, "the presets differ");
}

#[test]
fn another_scan_gives_other_bits() {
    // Or the comparisons above would prove nothing.
    let (mut other, drive) = (drive(), drive());
    other.frames[10].points[5000].position[0] += 0.01;
    let [a, b] = [&drive, &other].map(|d| run(d, Config::accurate()));
    assert_same_bits(&a[..10], &b[..10]);
    assert_ne!(a[12].estimate.map_from_sensor, b[12].estimate.map_from_sensor);
}

// ---- the recorded run ----

/// FNV-1a, 64 bit.
fn fnv(values: impl IntoIterator<Item = f64>) -> u64 {
    let bytes = values.into_iter().flat_map(|v| v.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn pose_values(estimate: &FrameEstimate) -> Vec<f64> {
    let pose = estimate.map_from_sensor;
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).copied().collect()
}

/// The poses of both presets as a table: preset, frame, x, y, z, and the hash of all the bits of pose.
fn table() -> String {
    let mut table = String::from(
        "# preset frame x y z hash; remade by\n# SDSLAM_REMAKE_GOLDEN=1 cargo test -p sdslam-tests --test determinism\n",
    );
    for (name, config) in [("accurate", Config::accurate()), ("paper", Config::paper())] {
        for answer in run(&drive(), config) {
            let (values, frame) = (pose_values(&answer.estimate), answer.estimate.frame);
            let hash = fnv(values.iter().copied());
            writeln!(table, "{name} {frame} {:.4} {:.4} {:.4} {hash:016x}", values[0], values[1], values[2])
                .expect("text grows");
        }
    }
    table
}

#[test]
fn poses_are_those_recorded() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden/street_poses.txt");
    let found = table();
    if std::env::var_os("SDSLAM_REMAKE_GOLDEN").is_some() {
        std::fs::write(&path, &found).expect("the table is written");
    }
    let recorded = std::fs::read_to_string(&path).expect("the table is in the repository");
    for (found, recorded) in found.lines().zip(recorded.lines()) {
        assert_eq!(found, recorded, "the table tells how to remake it, if the change is meant");
    }
    assert_eq!(found.lines().count(), recorded.lines().count());
}
