//! Precision, recall and F1max of the loop detection on a drive with true poses, by BoW3D's protocol.
//!
//! Every frame that is a metre or more from the last one taken is asked, then added as a place. A place is true when it
//! lies within 3 m, or within 10 m where the street was driven the other way, and is older than 30 s. The curve runs over
//! the score of the best candidate; the detector's own thresholds are measured beside it.

use std::path::Path;
use std::process::ExitCode;

use cpu_time::ThreadTime;
use nalgebra::{Rotation3, Vector3};
use sdslam::dataset::{DatasetError, Sequence, labels};
use sdslam_core::capacity::{FullScanFeatureExtractor, HostLoopDetector};
use sdslam_core::loop_closure::{Config, LoopCandidate};
use sdslam_core::{LabelledPoint, MapPose, pose};

const GAP_S: f64 = 30.0;
const SPACING_M: f64 = 1.0;

/// The best candidate of a question, and the truth about it.
struct Answer {
    /// A true place exists.
    exists: bool,
    /// A true place exists, all of them in the other direction.
    reverse: bool,
    candidate: Option<LoopCandidate>,
    /// The candidate is a true place.
    correct: bool,
    /// How far the candidate's transform is from the truth \[m\], \[deg\].
    error: [f64; 2],
}

/// CPU milliseconds of one step: sum and largest.
#[derive(Default)]
struct Time([f64; 2]);

impl Time {
    fn measure<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = ThreadTime::now();
        let result = work();
        let ms = 1e3 * start.elapsed().as_secs_f64();
        self.0 = [self.0[0] + ms, self.0[1].max(ms)];
        result
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dataset, sequence, rule] = &arguments[..] else {
        eprintln!("usage: loops DATASET SEQUENCE triangles|bow3d");
        return ExitCode::from(2);
    };
    let config = if rule == "bow3d" { Config::PAPER } else { Config::DEFAULT };
    match drive(Path::new(dataset), sequence, config) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Builds something large on a thread with a large stack, and moves it to the heap.
fn on_heap<T: Send + 'static>(build: impl FnOnce() -> T + Send + 'static) -> Box<T> {
    let builder = std::thread::Builder::new().stack_size(4 * size_of::<T>() + (1 << 20));
    builder.spawn(move || Box::new(build())).expect("a thread starts").join().expect("it is built")
}

fn drive(dataset: &Path, name: &str, config: Config) -> Result<(), DatasetError> {
    let sequence = Sequence::open(dataset, name, None)?;
    let poses = sequence.ground_truth()?.unwrap_or_default();
    let camera_from_sensor = sequence.camera_from_sensor();
    let poses: Vec<MapPose> =
        poses.iter().map(|p| camera_from_sensor.inverse() * p * camera_from_sensor).collect();
    // Candidates below the thresholds are wanted too, for the curve.
    let open = Config { min_inliers: 4, min_score: 0.0, max_runner_up: 1.0, ..config };
    let mut detector = on_heap(move || HostLoopDetector::new(open).expect("the configuration is valid"));
    let mut extractor = on_heap(FullScanFeatureExtractor::new);
    let (mut places, mut answers) = (Vec::<usize>::new(), Vec::new());
    let mut times = [Time::default(), Time::default(), Time::default()];
    let mut keypoints = 0;
    for frame in 0..sequence.len().min(poses.len()) {
        let step = |last: &usize| (poses[*last].translation.vector - poses[frame].translation.vector).norm();
        if places.last().is_some_and(|last| step(last) < SPACING_M) {
            continue;
        }
        // A drive may hold every other scan only.
        let Ok(points) = labelled_points(&sequence, frame) else { continue };
        let features = times[0].measure(|| {
            extractor.clear();
            extractor.add(&config, &points, &pose::IDENTITY);
            extractor.finish(&config)
        });
        keypoints += features.keypoints.len();
        let stamp_s = sequence.stamp_s(frame);
        let found = times[1].measure(|| detector.query(&features, Some(stamp_s)));
        times[2].measure(|| detector.add(frame as u32, stamp_s, &features));
        let old = places.iter().filter(|p| stamp_s - sequence.stamp_s(**p) > GAP_S);
        let old: Vec<MapPose> = old.map(|p| poses[*p].inv_mul(&poses[frame])).collect();
        answers.push(answer(&old, found.first(), &poses, frame));
        places.push(frame);
    }
    report(name, &config, &answers, &times, keypoints);
    Ok(())
}

fn labelled_points(sequence: &Sequence, frame: usize) -> Result<Vec<LabelledPoint>, DatasetError> {
    let scan = sequence.read(frame)?;
    let labels = scan.labels.unwrap_or_default();
    let point = |(p, raw): (&[f32; 4], &u32)| LabelledPoint::new([p[0], p[1], p[2]], labels::class_of(*raw));
    Ok(scan.points.iter().zip(&labels).map(point).collect())
}

/// Driven the other way.
fn is_reverse(old_from_new: &MapPose) -> bool {
    let rotation: Rotation3<f64> = old_from_new.rotation.to_rotation_matrix();
    (rotation * Vector3::x()).x < -0.5
}

fn is_true(old_from_new: &MapPose) -> bool {
    old_from_new.translation.vector.norm() < if is_reverse(old_from_new) { 10.0 } else { 3.0 }
}

/// `old` are the true transforms to the places that are old enough.
fn answer(old: &[MapPose], found: Option<&LoopCandidate>, poses: &[MapPose], frame: usize) -> Answer {
    let mut near = old.iter().filter(|p| is_true(p)).peekable();
    let exists = near.peek().is_some();
    let reverse = exists && near.all(is_reverse);
    let truth = found.map(|c| poses[c.place as usize].inv_mul(&poses[frame]));
    let error = found.zip(truth).map_or([0.0; 2], |(c, truth)| {
        let wrong = truth.inverse() * c.old_from_new.cast::<f64>();
        [wrong.translation.vector.norm(), wrong.rotation.angle().to_degrees()]
    });
    Answer { exists, reverse, candidate: found.copied(), correct: truth.is_some_and(|t| is_true(&t)), error }
}

fn report(name: &str, config: &Config, answers: &[Answer], times: &[Time; 3], keypoints: usize) {
    let questions = answers.len().max(1) as f64;
    let loops = answers.iter().filter(|a| a.exists).count();
    let reverse = answers.iter().filter(|a| a.reverse).count();
    println!(
        "{name}, {:?}: {} keyframes, {loops} with a true loop, {reverse} of them reverse only; {:.1} keypoints",
        config.rule,
        answers.len(),
        keypoints as f64 / questions
    );
    let [extract, query, add] = [0, 1, 2].map(|k| times[k].0[0] / questions);
    println!(
        "  extract {extract:.2} ms, query {query:.2} ms (largest {:.1}), add {add:.2} ms",
        times[1].0[1]
    );
    curve(answers, loops);
    accepted(config, answers, loops, reverse);
}

/// F1max over the score, and the recall before the first false place.
fn curve(answers: &[Answer], loops: usize) {
    let scored = answers.iter().filter_map(|a| a.candidate.map(|c| (c.score, a.correct)));
    let mut scored: Vec<(f32, bool)> = scored.collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut right, mut best, mut clean) = (0, [0.0; 4], 0.0);
    for (k, (score, correct)) in scored.iter().enumerate() {
        right += usize::from(*correct);
        let (precision, recall) = (right as f64 / (k + 1) as f64, right as f64 / loops.max(1) as f64);
        let f1 = 2.0 * precision * recall / (precision + recall).max(1e-9);
        if f1 > best[0] {
            best = [f1, precision, recall, f64::from(*score)];
        }
        if right == k + 1 {
            clean = recall;
        }
    }
    let [f1, precision, recall, score] = best;
    println!(
        "  F1max {f1:.3} (precision {precision:.3}, recall {recall:.3} at score {score:.2}); recall at precision 1: {clean:.3}"
    );
}

/// What the detector's own thresholds accept.
fn accepted(config: &Config, answers: &[Answer], loops: usize, reverse: usize) {
    let passes = |a: &&Answer| {
        a.candidate.is_some_and(|c| {
            c.score >= config.min_score
                && c.inliers >= config.min_inliers
                && c.runner_up as f32 <= config.max_runner_up * c.inliers as f32
        })
    };
    let accepted: Vec<&Answer> = answers.iter().filter(passes).collect();
    let right: Vec<&&Answer> = accepted.iter().filter(|a| a.correct).collect();
    let right_reverse = right.iter().filter(|a| a.reverse).count();
    let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
    println!(
        "  accepted {}, false {}; recall {:.3}, reverse only {:.3}",
        accepted.len(),
        accepted.len() - right.len(),
        share(right.len(), loops),
        share(right_reverse, reverse),
    );
    for (what, k) in [("m", 0), ("deg", 1)] {
        let mut errors: Vec<f64> = right.iter().map(|a| a.error[k]).collect();
        errors.sort_by(f64::total_cmp);
        let at = |q: f64| errors.get((q * (errors.len() as f64 - 1.0)) as usize).copied().unwrap_or(0.0);
        println!(
            "  transform error [{what}]: median {:.2}, 95 % {:.2}, largest {:.2}",
            at(0.5),
            at(0.95),
            at(1.0)
        );
    }
}
