//! Against closed forms, and with wrong loops.

use std::f64::consts::TAU;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3, Vector6};

use super::*;

fn pose(translation: [f64; 3], rotation: [f64; 3]) -> MapPose {
    MapPose::from_parts(
        Vector3::from(translation).into(),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
    )
}

fn edge(from: usize, to: usize, from_from_to: MapPose, kind: EdgeKind, sigma: f64) -> Edge {
    Edge { from, to, from_from_to, information: isotropic_information(sigma, sigma), kind }
}

/// A drive twice around a circle of 60 keyframes, with errors that repeat (no random numbers), the true poses, and loops
/// from the second round to the first.
fn two_rounds() -> (PoseGraph, Vec<MapPose>) {
    const ROUND: usize = 60;
    let at = |k: usize| {
        let angle = TAU * k as f64 / ROUND as f64;
        pose([30.0 * angle.sin(), 30.0 - 30.0 * angle.cos(), 0.1 * angle.sin()], [0.0, 0.0, angle])
    };
    let truth: Vec<MapPose> = (0..2 * ROUND).map(at).collect();
    let mut graph = PoseGraph::new();
    graph.add_keyframe(truth[0]);
    for k in 1..truth.len() {
        let wobble = (k as f64 * 2.4).sin();
        let off = pose([0.02 * wobble, 0.01, 0.005], [0.001 * wobble, 0.0005, 0.002]);
        let measured = truth[k - 1].inv_mul(&truth[k]) * off;
        graph.add_keyframe(graph.poses[k - 1] * measured);
        graph.add_edge(edge(k - 1, k, measured, EdgeKind::Odometry, 0.02)).expect("neighbours");
    }
    for k in (ROUND + 2..2 * ROUND).step_by(4) {
        let measured = truth[k - ROUND].inv_mul(&truth[k]);
        graph.add_edge(edge(k - ROUND, k, measured, EdgeKind::Loop, 0.02)).expect("in the graph");
    }
    (graph, truth)
}

fn largest_distance(a: &[MapPose], b: &[MapPose]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a.translation.vector - b.translation.vector).norm()).fold(0.0, f64::max)
}

#[test]
fn a_gap_on_a_line_is_shared_out_evenly() {
    // Four steps of 1 m measured, the loop says 4.4 m in all: with equal weights every edge takes a fifth of the gap.
    let mut graph = PoseGraph::new();
    for k in 0..5 {
        graph.add_keyframe(pose([k as f64, 0.0, 0.0], [0.0; 3]));
    }
    for k in 0..4 {
        let step = pose([1.0, 0.0, 0.0], [0.0; 3]);
        graph.add_edge(edge(k, k + 1, step, EdgeKind::Odometry, 0.1)).expect("neighbours");
    }
    graph.add_edge(edge(0, 4, pose([4.4, 0.0, 0.0], [0.0; 3]), EdgeKind::Loop, 0.1)).expect("in the graph");
    graph.optimise().expect("determined");
    for (k, pose) in graph.poses().iter().enumerate() {
        let expected = Vector3::new(1.08 * k as f64, 0.0, 0.0);
        assert!((pose.translation.vector - expected).norm() < 1e-9, "{k}: {pose}");
    }
}

#[test]
fn the_derivatives_are_those_of_the_error() {
    let (from, to) = (pose([1.0, -2.0, 0.5], [0.1, 0.2, 1.0]), pose([3.0, 1.0, -0.5], [-0.3, 0.1, 2.0]));
    let measured = pose([2.5, 1.5, -0.2], [0.2, -0.3, 0.6]);
    let edge = edge(0, 1, measured, EdgeKind::Loop, 1.0);
    let linear = edge.linearise(&from, &to);
    for k in 0..6 {
        let mut step = Vector6::zeros();
        step[k] = 1e-6;
        let moved = |pose: &MapPose, sign: f64| super::edge::moved(pose, &(step * sign));
        let numeric = |plus: Vector6<f64>, minus: Vector6<f64>| (plus - minus) / 2e-6;
        let by_from = numeric(edge.error(&moved(&from, 1.0), &to), edge.error(&moved(&from, -1.0), &to));
        let by_to = numeric(edge.error(&from, &moved(&to, 1.0)), edge.error(&from, &moved(&to, -1.0)));
        assert!((by_from - linear.by_from.column(k)).norm() < 1e-8, "{k}");
        assert!((by_to - linear.by_to.column(k)).norm() < 1e-8, "{k}");
    }
}

#[test]
fn loops_take_out_the_drift() {
    let (mut graph, truth) = two_rounds();
    let drifted = largest_distance(graph.poses(), &truth);
    graph.optimise().expect("determined");
    let corrected = largest_distance(graph.poses(), &truth);
    assert!(drifted > 3.0 && corrected < 0.3 * drifted, "{drifted} m, then {corrected} m");
    assert!(graph.weights().iter().all(|&weight| weight == 1.0));
}

#[test]
fn loops_at_once_and_one_by_one_give_the_same_poses() {
    let (mut at_once, _) = two_rounds();
    let (odometry, loops): (Vec<Edge>, Vec<Edge>) =
        at_once.edges.iter().partition(|edge| edge.kind == EdgeKind::Odometry);
    at_once.optimise().expect("determined");
    let mut growing = PoseGraph { poses: vec![at_once.poses[0]], ..PoseGraph::new() };
    for step in odometry {
        // As in a drive: a keyframe, and the loops from it, which the graph hears of at once.
        growing.add_keyframe(growing.poses[step.from] * step.from_from_to);
        growing.add_edge(step).expect("neighbours");
        for edge in loops.iter().filter(|edge| edge.to == step.to) {
            growing.add_edge(*edge).expect("in the graph");
            growing.optimise().expect("determined");
        }
    }
    assert!(growing.weights().iter().all(|&weight| weight == 1.0));
    let apart = largest_distance(growing.poses(), at_once.poses());
    assert!(apart < 1e-4, "{apart} m");
}

#[test]
fn wrong_loops_do_not_bend_the_map() {
    let (mut clean, _) = two_rounds();
    clean.optimise().expect("determined");
    let (mut graph, _) = two_rounds();
    let good = graph.edges().len();
    // Wrong by metres and in many directions, among them three that agree with each other.
    for k in 0..12 {
        let off = pose([5.0 - k as f64, 3.0, 0.2 * k as f64], [0.0, 0.1, 0.3 * k as f64]);
        let (from, to) = (3 + 4 * k, 118 - 5 * k);
        graph.add_edge(edge(from, to, off, EdgeKind::Loop, 0.02)).expect("in the graph");
    }
    for k in 0..3 {
        let off = pose([2.0, 0.0, 0.0], [0.0; 3]);
        graph.add_edge(edge(10 + k, 90 + k, off, EdgeKind::Loop, 0.02)).expect("in the graph");
    }
    graph.optimise().expect("determined");
    let bent = largest_distance(graph.poses(), clean.poses());
    assert!(bent < 1e-3, "{bent} m");
    assert!(graph.weights()[..good].iter().all(|&weight| weight == 1.0));
    assert!(graph.weights()[good..].iter().all(|&weight| weight == 0.0));
}

#[test]
fn a_wrong_loop_added_later_does_not_either() {
    let (mut graph, _) = two_rounds();
    graph.optimise().expect("determined");
    let before = graph.poses().to_vec();
    graph
        .add_edge(edge(5, 100, pose([9.0, 9.0, 0.0], [0.0; 3]), EdgeKind::Loop, 0.02))
        .expect("in the graph");
    graph.optimise().expect("determined");
    assert!(largest_distance(graph.poses(), &before) < 1e-4);
    assert_eq!(graph.weights().last(), Some(&0.0));
}

#[test]
fn a_wrong_loop_that_came_first_is_found_out() {
    let (clean, _) = two_rounds();
    let (mut graph, mut reference) = (PoseGraph::new(), clean.clone());
    reference.optimise().expect("determined");
    for pose in clean.poses() {
        graph.add_keyframe(*pose);
    }
    let (odometry, loops): (Vec<Edge>, Vec<Edge>) =
        clean.edges().iter().partition(|edge| edge.kind == EdgeKind::Odometry);
    odometry.into_iter().for_each(|edge| graph.add_edge(edge).expect("neighbours"));
    // Off by 1 m, which the drift of a whole round makes believable.
    let mut wrong = loops[0];
    wrong.from_from_to.translation.vector += Vector3::new(0.6, 0.6, 0.5);
    graph.add_edge(wrong).expect("in the graph");
    graph.optimise().expect("determined");
    assert_eq!(graph.weights().last(), Some(&1.0));
    for edge in loops {
        graph.add_edge(edge).expect("in the graph");
        graph.optimise().expect("determined");
    }
    let bent = largest_distance(graph.poses(), reference.poses());
    assert!(bent < 1e-3, "{bent} m");
}

#[test]
fn what_cannot_be_an_edge_is_refused() {
    let mut graph = two_rounds().0;
    let step = pose([1.0, 0.0, 0.0], [0.0; 3]);
    assert!(matches!(graph.add_edge(edge(3, 3, step, EdgeKind::Loop, 1.0)), Err(GraphError::Ends { .. })));
    assert!(matches!(graph.add_edge(edge(3, 999, step, EdgeKind::Loop, 1.0)), Err(GraphError::Ends { .. })));
    let nan = pose([f64::NAN, 0.0, 0.0], [0.0; 3]);
    assert!(graph.add_edge(edge(3, 50, nan, EdgeKind::Loop, 1.0)).is_err());
    let mut flat = edge(3, 50, step, EdgeKind::Loop, 1.0);
    flat.information[(5, 5)] = 0.0;
    assert!(graph.add_edge(flat).is_err());
}

#[test]
fn a_keyframe_that_nothing_holds_is_reported() {
    for is_solved in [false, true] {
        let mut graph = two_rounds().0;
        if is_solved {
            graph.optimise().expect("determined");
        }
        graph.add_keyframe(MapPose::identity());
        let before = graph.poses().to_vec();
        assert!(matches!(graph.optimise(), Err(GraphError::NotDetermined)));
        assert_eq!(graph.poses(), before);
    }
}

#[test]
fn a_graph_survives_its_file() {
    let (graph, _) = two_rounds();
    let read = g2o::parse(&g2o::to_text(&graph), Path::new("graph.g2o")).expect("our own file");
    assert_eq!(read.edges().len(), graph.edges().len());
    assert!(largest_distance(read.poses(), graph.poses()) < 1e-12);
    for (a, b) in read.edges().iter().zip(graph.edges()) {
        assert_eq!((a.from, a.to, a.kind), (b.from, b.to, b.kind));
        assert!((a.information - b.information).norm() < 1e-9 * b.information.norm());
    }
}

#[test]
fn faults_of_a_file_name_the_line() {
    let vertex = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
    let faults = [
        ("VERTEX_SE2 0 0 0 0\n".to_string(), 1, "unknown entry VERTEX_SE2"),
        (format!("{vertex}{vertex}"), 2, "there twice"),
        (format!("{vertex}VERTEX_SE3:QUAT 1 0 0 0 0 0 0\n"), 2, "7 values after the tag, expected 8"),
        (format!("{vertex}VERTEX_SE3:QUAT 1 0 inf 0 0 0 0 1\n"), 2, "'inf' is not a finite number"),
        (format!("{vertex}VERTEX_SE3:QUAT 1 0 0 0 0 0 0 3\n"), 2, "length 3"),
        (format!("# drive\n{vertex}EDGE_SE3:QUAT 0 7{}\n", " 0".repeat(28)), 3, "vertex 7 is not"),
        (format!("{vertex}FIX\n"), 2, "0 values after the tag, expected 1"),
    ];
    for (text, line, fault) in faults {
        let message = g2o::parse(&text, Path::new("a.g2o")).expect_err("a fault").to_string();
        assert!(
            message.starts_with(&format!("a.g2o, line {line}: ")) && message.contains(fault),
            "{message}"
        );
    }
}
