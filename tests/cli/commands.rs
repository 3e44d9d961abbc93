//! What the commands say, and evaluations.

use crate::support::*;

#[test]
fn help_explains_every_subcommand_with_an_example() {
    let help = text(sdslam(["--help"]).success());
    for command in ["run", "localize", "evaluate", "simulate", "demo", "config", "completions"] {
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
    let wrong: [&[&str]; 7] = [
        &[],
        &["fly"],
        &["run"],
        &["run", "--dataset", ".", "--sequence", "00", "--out", "x", "--frames", "3..2"],
        &["run", "--dataset", ".", "--sequence", "00", "--out", "x", "--threads", "0"],
        &["evaluate"],
        &[
            "localize",
            "--map",
            "m",
            "--dataset",
            ".",
            "--sequence",
            "00",
            "--out",
            "x",
            "--initial-pose",
            "1,2",
        ],
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
