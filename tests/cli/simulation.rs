//! Simulated drives and the demo.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use sdslam::dataset::{self, labels};
use sdslam_core::{MotionClass, SemanticClass};
use tempfile::TempDir;

use crate::support::*;

/// Two seconds through traffic, simulated and run once for all tests.
fn simulated() -> &'static Simulated {
    static DRIVE: LazyLock<Simulated> = LazyLock::new(|| {
        // A fixed place, emptied by the next run: no drop would clear it away.
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli_simulation");
        let _ = fs::remove_dir_all(&folder);
        let (data, out) = (folder.join("data"), folder.join("out"));
        let small = ["--frames", "20", "--columns", "700", "--sequence", "42", "--traffic", "heavy"];
        sdslam(["simulate", "--out", path(&data)].into_iter().chain(small)).success();
        let contract = ["run", "--dataset", path(&data), "--sequence", "42", "--out", path(&out)];
        let table = text(sdslam(contract.into_iter().chain(["--no-elevation-correction"])).success());
        Simulated { labels: data.join("sequences/42/labels"), results: out.join("42"), table }
    });
    &DRIVE
}

struct Simulated {
    labels: PathBuf,
    results: PathBuf,
    table: String,
}

#[test]
fn the_pose_of_a_simulated_drive_is_found_in_bounded_memory() {
    let metrics = metrics(&simulated().results);
    assert_eq!((&metrics["frames"], &metrics["lost"]), (&20.into(), &0.into()));
    let ate_m = metrics["trajectory"]["ate_m"].as_f64().expect("an error");
    assert!(ate_m < 0.1, "ATE {ate_m} m over about fifteen metres");
    assert!(metrics["core_memory_bytes"].as_u64() <= Some(16 << 20));
}

#[test]
fn motion_labels_keep_everything_but_whether_it_moves() {
    let mut moving = 0;
    for name in entries(&simulated().labels) {
        let truth = dataset::read_labels(&simulated().labels.join(&name)).expect("labels");
        let found = dataset::read_labels(&simulated().results.join("motion").join(&name)).expect("labels");
        assert_eq!(truth.len(), found.len());
        for (truth, found) in truth.into_iter().zip(found) {
            let still = labels::static_id(truth);
            let may_move = labels::class_of(truth).motion() == MotionClass::UnknownMotion;
            assert!(
                found == still || (may_move && found == labels::moving_id(still)),
                "{truth} became {found}"
            );
            moving += usize::from(labels::is_moving(found));
        }
    }
    assert!(moving > 0, "nothing was recognised as moving in heavy traffic");
}

#[test]
fn the_score_of_moving_points_is_that_of_the_written_labels() {
    let Simulated { labels, results, table, .. } = simulated();
    let motion = results.join("motion");
    let arguments =
        ["evaluate", "--json", "--labels-truth", path(labels), "--labels-estimate", path(&motion)];
    let written: serde_json::Value = serde_json::from_str(&text(sdslam(arguments).success())).expect("JSON");
    assert_eq!(metrics(results)["moving"]["points_iou"], written["moving_iou"]);
    assert!(table.contains("recall, precision"), "{table}");
}

#[test]
fn the_table_of_landmarks_is_complete_and_plain() {
    let table = fs::read_to_string(simulated().results.join("landmarks.csv")).expect("a table");
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("frame,track,class,state,x,y,z,vx,vy"));
    let mut states = BTreeSet::new();
    for line in lines {
        let fields: Vec<_> = line.split(',').collect();
        let [frame, track, class, state, numbers @ ..] = &fields[..] else { panic!("{line}") };
        assert!(frame.parse::<usize>().is_ok_and(|frame| frame < 20), "{line}");
        assert_eq!(track.is_empty(), *state == "pure-static", "{line}");
        assert!(SemanticClass::ALL.iter().any(|known| known.name() == *class), "{line}");
        let finite = |number: &&str| number.parse::<f64>().is_ok_and(f64::is_finite);
        assert!(numbers.len() == 5 && numbers.iter().all(finite), "{line}");
        states.insert(*state);
    }
    assert!(states.contains("pure-static") && states.contains("dynamic"), "{states:?}");
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
