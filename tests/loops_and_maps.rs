//! Twice round a block of the simulated town: the loop is closed, the map is saved, and a later drive finds itself in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use sdslam::config::HostConfig;
use sdslam::dataset::trajectory;
use sdslam::localise::Start;
use sdslam::run::{self, LocaliseRequest, LocaliseSummary, Request, Summary};
use sdslam::simulate::{Options, SensorOptions, simulate};
use sdslam_core::MapPose;
use tempfile::TempDir;

/// Once round takes about 28 s.
const FRAMES: usize = 380;

/// The drive and what was made of it.
struct Town {
    folder: PathBuf,
    summary: Summary,
}

fn config() -> HostConfig {
    let mut config = HostConfig::default();
    config.input.elevation_correction_deg = 0.0;
    config.core.loop_closure.min_gap_s = 15.0;
    config
}

impl Town {
    fn request(folder: &Path, out: &str, threads: usize) -> Request {
        Request {
            dataset: folder.join("data"),
            sequence: Options::demo().sequence,
            classes: Default::default(),
            record: None,
            first_frame: 0,
            end_frame: None,
            config: config(),
            threads,
            save_map: Some(folder.join(out).join("town.map")),
            overwrite: false,
            out: folder.join(out),
        }
    }

    fn map(&self) -> PathBuf {
        self.folder.join("one/town.map")
    }

    fn results(&self, out: &str) -> PathBuf {
        self.folder.join(out).join(&self.summary.sequence)
    }

    fn localise(&self, out: &str, start: Start, first: usize, end: usize) -> LocaliseSummary {
        let mut drive = Self::request(&self.folder, out, 2);
        (drive.first_frame, drive.end_frame, drive.save_map) = (first, Some(end), None);
        let request = LocaliseRequest { drive, map: self.map(), start };
        run::localise(&request, |_, _| ()).expect("the map is intact")
    }

    /// Largest distance \[m\] and angle \[deg\] between the poses of a localisation and those of the run that made the map.
    fn off(&self, localised: &LocaliseSummary) -> (f64, f64) {
        let mapped = tum(&self.results("one").join("poses_tum.txt"));
        let found = tum(&localised.folder.join("poses_tum.txt"));
        assert!(!found.is_empty());
        let off = found.iter().map(|(stamp, pose)| {
            let same = mapped.iter().find(|(s, _)| (s - stamp).abs() < 1e-3).expect("the frame was mapped");
            let off = same.1.inv_mul(pose);
            (off.translation.vector.norm(), off.rotation.angle().to_degrees())
        });
        off.fold((0.0, 0.0), |worst, off| (worst.0.max(off.0), worst.1.max(off.1)))
    }
}

fn tum(file: &Path) -> Vec<(f64, MapPose)> {
    trajectory::read_tum(file).expect("our own file")
}

fn town() -> &'static Town {
    static TOWN: OnceLock<Town> = OnceLock::new();
    TOWN.get_or_init(|| {
        // Half a gigabyte that no drop would clear away: a fixed place, emptied by the next run.
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("loops_and_maps");
        let _ = fs::remove_dir_all(&folder);
        let options = Options {
            frames: FRAMES,
            sensor: SensorOptions { columns: 720, ..SensorOptions::default() },
            ..Options::demo()
        };
        simulate(&options, &folder.join("data"), &mut |_, _| {}).expect("the drive is simulated");
        let summary = run::run(&Town::request(&folder, "one", 1), |_, _| ()).expect("a run");
        Town { folder, summary }
    })
}

#[test]
fn the_loop_is_closed_and_no_wrong_one() {
    let town = town();
    let loops = fs::read_to_string(town.results("one").join("loops.csv")).expect("loops");
    assert!(town.summary.loops.accepted >= 5, "{:?}\n{loops}", town.summary.loops);
    let truth = town.folder.join("data/poses").join(format!("{}.txt", town.summary.sequence));
    let truth = trajectory::read_kitti(&truth).expect("the simulator writes the truth");
    let away = |a: usize, b: usize| (truth[a].translation.vector - truth[b].translation.vector).norm();
    for line in loops.lines().skip(1).filter(|line| line.contains(",true,")) {
        let mut words = line.split(',').map(|word| word.parse::<f64>().unwrap_or(f64::NAN));
        let (new, old) = (words.next().unwrap_or(0.0) as usize, words.next().unwrap_or(0.0) as usize);
        let measured = words.skip(2).take(3).map(|v| v * v).sum::<f64>().sqrt();
        assert!((measured - away(new, old)).abs() < 0.1, "{line}: {} m by the truth", away(new, old));
    }
}

#[test]
fn loops_do_not_make_it_worse() {
    let ate = |errors: &Option<sdslam::evaluate::TrajectoryErrors>| {
        errors.as_ref().and_then(|errors| errors.ate_m).expect("there is a ground truth")
    };
    let (with, without) = (ate(&town().summary.trajectory), ate(&town().summary.trajectory_odometry));
    assert!(with <= without && with < 0.05, "{with} m with loops, {without} m without");
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let town = town();
    run::run(&Town::request(&town.folder, "three", 3), |_, _| ()).expect("a run");
    for file in ["poses_kitti.txt", "loops.csv", "graph.g2o", "map.ply", "grid.pgm"] {
        let [one, three] =
            ["one", "three"].map(|out| fs::read(town.results(out).join(file)).expect("a file"));
        assert!(one == three, "{file}");
    }
    let [one, three] = ["one", "three"].map(|out| fs::read(town.folder.join(out).join("town.map")));
    assert!(one.expect("a map") == three.expect("a map"));
}

#[test]
fn without_loops_the_odometry_stands_to_the_bit() {
    let town = town();
    let mut request = Town::request(&town.folder, "open", 2);
    request.config.loops.enabled = false;
    request.end_frame = Some(60);
    let summary = run::run(&request, |_, _| ()).expect("a run");
    assert_eq!((summary.loops.proposed, summary.loops.accepted), (0, 0));
    let read = |file: &str| fs::read(town.results("open").join(file)).expect("poses");
    assert_eq!(read("poses_kitti.txt"), read("poses_odometry.txt"));
    let first =
        |text: Vec<u8>| String::from_utf8_lossy(&text).lines().take(60).map(String::from).collect::<Vec<_>>();
    let with_loops = fs::read(town.results("one").join("poses_odometry.txt")).expect("poses");
    assert_eq!(first(read("poses_kitti.txt")), first(with_loops));
}

#[test]
fn a_later_drive_finds_itself_anywhere_and_stays_in_the_map() {
    let town = town();
    let before = fs::read(town.map()).expect("a map");
    for (k, first) in [40, 130, 210].into_iter().enumerate() {
        let found = town.localise(&format!("global{k}"), Start::Global, first, first + 40);
        let after = found.found_after.expect("the street is in the map");
        assert!(after <= 20 && found.predicted == 0, "{found}");
        let (m, deg) = town.off(&found);
        assert!(m < 0.15 && deg < 0.3, "{m} m, {deg} deg\n{found}");
    }
    assert!(fs::read(town.map()).expect("a map") == before, "the map is not changed");
}

#[test]
fn an_initial_pose_is_enough() {
    let town = town();
    let (_, pose) = tum(&town.results("one").join("poses_tum.txt"))[100];
    let (x, y) = (pose.translation.x + 0.5, pose.translation.y - 0.4);
    let yaw = pose.rotation.euler_angles().2 + 0.05;
    let found = town.localise("near", Start::Near { position: [x, y], yaw }, 100, 120);
    assert!(found.found_after.is_some_and(|frames| frames <= 5), "{found}");
    let (m, deg) = town.off(&found);
    assert!(m < 0.15 && deg < 0.3, "{m} m, {deg} deg\n{found}");
}

#[test]
fn another_town_is_not_taken_for_this_one() {
    let town = town();
    let folder = TempDir::new().expect("a temporary folder");
    let options = Options {
        frames: 40,
        seed: 77,
        sensor: SensorOptions { columns: 720, ..SensorOptions::default() },
        ..Options::demo()
    };
    simulate(&options, &folder.path().join("data"), &mut |_, _| {}).expect("the drive is simulated");
    let mut drive = Town::request(folder.path(), "elsewhere", 2);
    drive.save_map = None;
    let request = LocaliseRequest { drive, map: town.map(), start: Start::Global };
    let found = run::localise(&request, |_, _| ()).expect("the map is intact");
    assert_eq!((found.found_after, found.searching), (None, 40), "{found}");
}
