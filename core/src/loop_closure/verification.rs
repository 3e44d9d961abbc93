//! Verification: is there one rigid transform that lays enough keypoints of the new place on keypoints of the old one,
//! each of its own class (sections 3.5 and BoW3D's loop correction)?
//!
//! BoW3D draws triples by RANSAC; here every triangle that was looked up gives one hypothesis already, so that nothing
//! is drawn: the hypotheses that most others agree with are tried. The transform is the closed-form solution by
//! singular value decomposition, with the guard that keeps it a rotation.

use heapless::Vec;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::Config;
use super::features::Features;
use super::place_table::Place;
use crate::capacity::{HYPOTHESES, KEYPOINTS};
use crate::math;
use crate::pose::{PlanarPose, Pose};

/// Hypotheses that are tried for a place, the best supported first.
const TRIED: usize = 4;

/// Rounds of pairing and closed-form solution.
const ROUNDS: usize = 3;

/// Means of the same thing, seen twice, differ in height by less than this [m]: one view may hide its lower half.
const MAX_HEIGHT_DIFFERENCE_M: f32 = 1.5;

/// Height [m] of the second point that every upright thing has for the closed form.
const UPRIGHT_M: f32 = 1.5;

/// A verified transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verified {
    /// Pose of the new keyframe in the frame of the old place.
    pub old_from_new: Pose,
    /// Pairs of keypoints that the transform lays on each other.
    pub inliers: u32,
    /// Inliers of the best other transform.
    pub runner_up: u32,
    /// Inliers, each weighed by how close its two keypoints are, as a share of the keypoints that both views should
    /// show, 0..1.
    pub score: f32,
    /// Root mean square horizontal distance of the pairs [m].
    pub residual_m: f32,
}

/// The planar transform that lays three points on three others, and the largest distance left [m].
pub fn planar_from_triples(new: [[f32; 3]; 3], old: [[f32; 3]; 3]) -> (PlanarPose, f32) {
    let mean = |p: &[[f32; 3]; 3], k: usize| (p[0][k] + p[1][k] + p[2][k]) / 3.0;
    let (mn, mo) = ([mean(&new, 0), mean(&new, 1)], [mean(&old, 0), mean(&old, 1)]);
    let (mut dot, mut cross) = (0.0, 0.0);
    for (n, o) in new.iter().zip(&old) {
        let (a, b) = ([n[0] - mn[0], n[1] - mn[1]], [o[0] - mo[0], o[1] - mo[1]]);
        dot += a[0] * b[0] + a[1] * b[1];
        cross += a[0] * b[1] - a[1] * b[0];
    }
    let length = math::sqrt(dot * dot + cross * cross).max(1e-9);
    let (s, c) = (cross / length, dot / length);
    let pose = PlanarPose {
        x: mo[0] - (c * mn[0] - s * mn[1]),
        y: mo[1] - (s * mn[0] + c * mn[1]),
        yaw: math::atan2(s, c),
    };
    let mut worst = 0.0_f32;
    for (n, o) in new.iter().zip(&old) {
        let [x, y] = pose.apply((s, c), [n[0], n[1]]);
        worst = worst.max((x - o[0]) * (x - o[0]) + (y - o[1]) * (y - o[1]));
    }
    (pose, math::sqrt(worst))
}

/// Tries the hypotheses with the most support; the best verified transform, if any.
pub fn verify(
    config: &Config,
    new: &Features,
    old: &Place,
    hypotheses: &Vec<PlanarPose, HYPOTHESES>,
) -> Option<Verified> {
    let mut ranked: Vec<(u32, u16), HYPOTHESES> = Vec::new();
    for (i, h) in hypotheses.iter().enumerate() {
        let support = hypotheses.iter().filter(|other| agree(h, other)).count() as u32;
        let _ = ranked.push((support, i as u16));
    }
    ranked.sort_unstable_by_key(|r| (core::cmp::Reverse(r.0), r.1));
    let mut tried: Vec<PlanarPose, TRIED> = Vec::new();
    let mut best: Option<Verified> = None;
    for (_, i) in ranked {
        let hypothesis = hypotheses[i as usize];
        if tried.iter().any(|t| agree(t, &hypothesis)) {
            continue;
        }
        if tried.push(hypothesis).is_err() {
            break;
        }
        if let Some(found) = refine(config, new, old, &hypothesis) {
            best = Some(match best {
                Some(best) => better(best, found),
                None => found,
            });
        }
    }
    best
}

/// The one with more inliers, which remembers the other where it is another transform.
fn better(a: Verified, b: Verified) -> Verified {
    let (winner, loser) = if b.inliers > a.inliers { (b, a) } else { (a, b) };
    let planar = |v: &Verified| PlanarPose::from_pose(&v.old_from_new);
    let other = if agree(&planar(&winner), &planar(&loser)) { 0 } else { loser.inliers };
    Verified { runner_up: winner.runner_up.max(loser.runner_up).max(other), ..winner }
}

/// Two hypotheses are the same place: origins within a metre and directions within 3 degrees.
fn agree(a: &PlanarPose, b: &PlanarPose) -> bool {
    let (x, y) = (a.x - b.x, a.y - b.y);
    x * x + y * y < 1.0 && math::abs(math::wrap(a.yaw - b.yaw)) < 0.05
}

/// Pairs of keypoint indices: new, old.
type Pairs = Vec<([f32; 3], [f32; 3]), KEYPOINTS>;

/// Pairs keypoints and solves, in turn.
fn refine(config: &Config, new: &Features, old: &Place, start: &PlanarPose) -> Option<Verified> {
    let mut pose = Pose::from_parts(
        Vector3::new(start.x, start.y, 0.0).into(),
        crate::pose::from_roll_pitch_yaw(0.0, 0.0, start.yaw),
    );
    let mut pairs = Pairs::new();
    let mut expected = 0.0;
    for round in 0..=ROUNDS {
        // The first pairs are those of a rough transform.
        let radius_m = if round == 0 { 2.0 } else { 1.0 } * config.inlier_radius_m;
        expected = pair(config, radius_m, new, old, &pose, &mut pairs);
        if pairs.len() < 3 {
            return None;
        }
        if round < ROUNDS {
            pose = closed_form(&pairs)?;
        }
    }
    let squares: f32 = pairs.iter().map(|(n, o)| horizontal2(&pose, n, o)).sum();
    let residual_m = math::sqrt(squares / pairs.len() as f32);
    // Pairs by chance are spread all over the radius, true ones lie near its centre.
    let radius_m = config.inlier_radius_m;
    let closeness = (pairs.len() as f32 - squares / (radius_m * radius_m)).max(0.0);
    let score = closeness / expected;
    Some(Verified { old_from_new: pose, inliers: pairs.len() as u32, runner_up: 0, score, residual_m })
}

fn horizontal2(pose: &Pose, new: &[f32; 3], old: &[f32; 3]) -> f32 {
    let p = pose * nalgebra::Point3::from(*new);
    (p.x - old[0]) * (p.x - old[0]) + (p.y - old[1]) * (p.y - old[1])
}

/// One-to-one pairs of equal class within `radius_m`; gives the number that both views should show, at least 1.
fn pair(config: &Config, radius_m: f32, new: &Features, old: &Place, pose: &Pose, pairs: &mut Pairs) -> f32 {
    pairs.clear();
    let mut taken = [false; KEYPOINTS];
    let mut expected_new = 0;
    let reach2 = old.reach_m() * old.reach_m();
    for keypoint in &new.keypoints {
        let p = pose * nalgebra::Point3::from(keypoint.position);
        expected_new += u32::from(p.x * p.x + p.y * p.y <= reach2);
        let mut nearest = (radius_m * radius_m, None);
        for (j, (q, class)) in old.keypoints().enumerate() {
            let distance2 = (p.x - q[0]) * (p.x - q[0]) + (p.y - q[1]) * (p.y - q[1]);
            let level = math::abs(p.z - q[2]) < MAX_HEIGHT_DIFFERENCE_M;
            if level && class == keypoint.class && !taken[j] && distance2 < nearest.0 {
                nearest = (distance2, Some((j, q)));
            }
        }
        if let Some((j, q)) = nearest.1 {
            taken[j] = true;
            let _ = pairs.push((keypoint.position, q));
        }
    }
    let back = pose.inverse();
    let reach2 = new.reach_m(config) * new.reach_m(config);
    let seen = |q: &[f32; 3]| {
        let p = back * nalgebra::Point3::from(*q);
        p.x * p.x + p.y * p.y <= reach2
    };
    let expected_old = old.keypoints().filter(|(q, _)| seen(q)).count() as u32;
    0.5 * (expected_new + expected_old).max(2) as f32
}

/// Closed-form rigid transform of the pairs (BoW3D's eq. 5 to 7), with the determinant guard.
fn closed_form(pairs: &Pairs) -> Option<Pose> {
    let scale = 1.0 / pairs.len() as f32;
    let (mut mean_new, mut mean_old) = (Vector3::zeros(), Vector3::zeros());
    for (n, o) in pairs {
        mean_new += Vector3::from(*n) * scale;
        mean_old += Vector3::from(*o) * scale;
    }
    let mut w = Matrix3::zeros();
    for (n, o) in pairs {
        w += (Vector3::from(*n) - mean_new) * (Vector3::from(*o) - mean_old).transpose();
    }
    // Keypoints stand upright: a point of each, this far above it, corresponds too. Holds roll and pitch where the
    // keypoints lie along one line.
    w[(2, 2)] += UPRIGHT_M * UPRIGHT_M * pairs.len() as f32;
    let svd = w.try_svd(true, true, f32::EPSILON, 50)?;
    let (u, v) = (svd.u?, svd.v_t?.transpose());
    // Keeps it a rotation when the points lie in a plane or are mirrored.
    let guard = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (v * u.transpose()).determinant().signum()));
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(v * guard * u.transpose()));
    Some(Pose::from_parts((mean_old - rotation * mean_new).into(), rotation))
}
