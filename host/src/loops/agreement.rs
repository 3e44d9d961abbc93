//! Whether two loops say the same: no loop is believed alone.

use super::keyframe::Keyframe;
use crate::pose_graph::Edge;

/// Two loops agree when one predicts the other this well \[m\], \[rad\],
const AGREE_M: f64 = 0.3;
const AGREE_RAD: f64 = 0.02;
/// and their keyframes lie no farther apart than this \[m\].
const AGREE_WITHIN_M: f64 = 20.0;

/// One loop predicts the other by the odometry of both visits.
pub(super) fn agree(keyframes: &[Keyframe], earlier: &Edge, later: &Edge) -> bool {
    let odometry = |k: usize| &keyframes[k].odometry;
    let way_m = |a: usize, b: usize| (keyframes[a].path_m - keyframes[b].path_m).abs();
    if way_m(earlier.from, later.from).max(way_m(earlier.to, later.to)) > AGREE_WITHIN_M {
        return false;
    }
    let old_between = odometry(later.from).inv_mul(odometry(earlier.from));
    let new_between = odometry(earlier.to).inv_mul(odometry(later.to));
    let predicted = old_between * earlier.from_from_to * new_between;
    let off = predicted.inv_mul(&later.from_from_to);
    off.translation.vector.norm() <= AGREE_M && off.rotation.angle() <= AGREE_RAD
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use sdslam_core::MapPose;

    use super::*;
    use crate::pose_graph::{EdgeKind, isotropic_information};

    #[test]
    fn loops_agree_when_odometry_leads_from_one_to_the_other() {
        let pose =
            |x: f64, y: f64, yaw: f64| MapPose::new(Vector3::new(x, y, 0.0), Vector3::new(0.0, 0.0, yaw));
        // Two keyframes there and, a long drive later, two keyframes the other way in the next lane.
        let there = [pose(0.0, 0.0, 0.0), pose(4.0, 0.0, 0.1)];
        let back = [pose(4.5, 3.0, 3.1), pose(0.5, 3.0, 3.2)];
        let drift = pose(30.0, -7.0, 0.4);
        let keyframe = |(k, pose): (usize, MapPose)| Keyframe {
            frame: k,
            stamp_s: 0.0,
            odometry: pose,
            path_m: [0.0, 4.0, 500.0, 504.0][k],
        };
        let all = [there[0], there[1], drift * back[0], drift * back[1]];
        let keyframes: Vec<Keyframe> = all.into_iter().enumerate().map(keyframe).collect();
        let edge = |from: usize, to: usize, off_m: f64| Edge {
            from,
            to,
            from_from_to: there[from].inv_mul(&back[to - 2]) * pose(off_m, 0.0, 0.0),
            information: isotropic_information(1.0, 1.0),
            kind: EdgeKind::Loop,
        };
        assert!(agree(&keyframes, &edge(1, 2, 0.0), &edge(0, 3, 0.0)));
        assert!(agree(&keyframes, &edge(1, 2, 0.0), &edge(0, 3, 0.25)));
        assert!(!agree(&keyframes, &edge(1, 2, 0.0), &edge(0, 3, 0.35)));
    }
}
