//! `sdslam segment`, and runs without label files.

use std::fs;

use crate::support::*;

/// A small random network; its classes mean nothing, but they are classes.
fn network() -> String {
    format!("{}/../tests/networks/squeezesegv2.onnx", env!("CARGO_MANIFEST_DIR"))
}

fn segment(drive: &Drive, options: &[&str]) -> assert_cmd::assert::Assert {
    let (data, out) = (drive.data(""), drive.data("../out"));
    let network = network();
    let contract =
        ["segment", "--dataset", path(&data), "--sequence", "00", "--out", path(&out), "--model", &network];
    sdslam(contract.iter().chain(options).copied())
}

/// The line of run.log that says where the classes come from.
fn source_of_classes(drive: &Drive) -> String {
    let log = drive.read("run.log");
    log.lines().find(|line| line.starts_with("classes: ")).expect("a line about the classes").into()
}

#[test]
fn segment_writes_a_label_for_every_point_and_pictures_when_asked() {
    let drive = Drive::new();
    let table = text(segment(&drive, &["--png", "--frames", "0..3"]).success());
    for row in ["classes", "frames", "network, CPU ms", "scans per second", "files"] {
        assert!(table.lines().any(|line| line.starts_with(row)), "no row {row} in\n{table}");
    }
    assert_eq!(entries(&drive.result("labels")), ["000000.label", "000001.label", "000002.label"]);
    for frame in 0..3 {
        let labels = fs::read(drive.result(&format!("labels/{frame:06}.label"))).expect("labels");
        assert_eq!(labels.len(), fs::read(drive.label(frame)).expect("labels").len());
        for folder in ["range", "birds_eye"] {
            let png = fs::read(drive.result(&format!("{folder}/{frame:06}.png"))).expect("a picture");
            assert!(png.starts_with(b"\x89PNG"), "{folder}");
        }
    }
    let (truth, found) = (drive.data("sequences/00/labels"), drive.result("labels"));
    let scores = text(
        sdslam(["evaluate", "--labels-truth", path(&truth), "--labels-estimate", path(&found)]).success(),
    );
    assert!(scores.contains("mean IoU of groups") && scores.contains("3 of 6 scans"), "{scores}");
}

#[test]
fn a_drive_without_labels_runs_on_a_network_and_the_threads_do_not_matter() {
    let drive = Drive::new();
    remove(&drive.data("sequences/00/labels"));
    let network = network();
    let table = text(drive.run(&["--model", &network, "--threads", "1"]).success());
    assert!(table.lines().any(|line| line.starts_with("network, CPU ms")), "{table}");
    assert_eq!(source_of_classes(&drive), "classes: network squeezesegv2.onnx, range image of 16 x 64");
    let alone = drive.reproducible_bytes();
    for threads in ["2", "3", "9"] {
        drive.run(&["--model", &network, "--threads", threads, "--overwrite"]).success();
        assert_eq!(drive.reproducible_bytes(), alone, "{threads} threads");
    }
}

#[test]
fn what_segment_writes_runs_like_the_network_itself() {
    let drive = Drive::new();
    let network = network();
    drive
        .run(&[
            "--model",
            &network,
            "--config",
            path(&drive.file("sure.toml", "[label_filter]\nmin_confidence = 0\nmin_ground_confidence = 0\n")),
        ])
        .success();
    let poses = drive.read("poses_tum.txt");
    segment(&drive, &["--overwrite"]).success();
    fs::rename(drive.result("labels"), drive.data("sequences/00/found")).expect("renamed");
    drive.run(&["--labels", "found", "--overwrite"]).success();
    assert_eq!(drive.read("poses_tum.txt"), poses);
}

#[test]
fn labels_are_used_where_they_are_and_the_built_in_network_where_not() {
    let drive = Drive::new();
    drive.run(&["--frames", "0..2"]).success();
    assert_eq!(source_of_classes(&drive), "classes: label files in the folder labels");
    drive.run(&["--frames", "0..2", "--segment", "--overwrite"]).success();
    assert!(source_of_classes(&drive).starts_with("classes: network default.onnx"));
    fs::rename(drive.data("sequences/00/labels"), drive.data("sequences/00/mine")).expect("renamed");
    drive.run(&["--frames", "0..2", "--overwrite"]).success();
    assert!(source_of_classes(&drive).starts_with("classes: network default.onnx"));
    drive.run(&["--frames", "0..2", "--labels", "mine", "--overwrite"]).success();
    assert_eq!(source_of_classes(&drive), "classes: label files in the folder mine");
    drive.run(&["--labels", "mine", "--segment", "--overwrite"]).code(USAGE);
}

#[test]
fn a_scan_with_nothing_in_view_is_named_and_the_drive_goes_on() {
    let drive = Drive::new();
    drive.write_scan(3, &[[1.0, 0.0, 9.0, 0.0], [0.0, 1.0, 9.0, 0.0]], &[0, 0]);
    drive.run(&["--model", &network()]).success();
    let log = drive.read("run.log");
    let line = log.lines().find(|line| line.starts_with("frame 000003: cannot segment")).expect("a line");
    assert!(line.contains("none of the 2 points") && line.contains("-25 to 3 deg"), "{line}");
    assert_eq!(drive.lines("poses_tum.txt"), FRAMES);
    let refusal = errors(drive.run(&["--model", &network(), "--frames", "3..6", "--overwrite"]).code(INPUT));
    assert!(refusal.contains("none of the 2 points"), "{refusal}");

    let table = text(segment(&drive, &["--overwrite"]).success());
    assert!(table.lines().any(|line| line.starts_with("without labels") && line.contains(" 1 ")), "{table}");
    assert!(drive.read("segment.log").contains("frame 000003: cannot segment"));
    assert_eq!(entries(&drive.result("labels")).len(), FRAMES - 1);
}

#[test]
fn a_network_that_cannot_be_used_is_refused_in_a_sentence() {
    let drive = Drive::new();
    let text_file = drive.file("net.onnx", "this is no network");
    for (model, said) in
        [(text_file, "net.onnx is not a whole ONNX model"), (drive.data("nowhere.onnx"), "nowhere.onnx")]
    {
        let refusal = errors(drive.run(&["--model", path(&model)]).code(INPUT));
        assert!(refusal.contains(said), "{refusal}");
        assert!(!drive.result("").exists());
    }
}
