//! Poses of all frames from the corrected poses of the keyframes.

use sdslam_core::MapPose;

use super::keyframe::Keyframe;

/// Corrected pose of every frame. Between two keyframes the correction passes over from one to the other with the path.
/// `frames` holds each frame's pose by the odometry and the keyframe at or before it.
pub(crate) fn corrected_trajectory(
    frames: &[(MapPose, usize)],
    keyframes: &[Keyframe],
    corrected: &[MapPose],
) -> Vec<MapPose> {
    let from = |keyframe: usize, odometry: &MapPose| {
        corrected[keyframe] * keyframes[keyframe].odometry.inv_mul(odometry)
    };
    let pose = |(odometry, keyframe): &(MapPose, usize)| {
        let before = from(*keyframe, odometry);
        let Some(next) = keyframes.get(keyframe + 1) else { return before };
        let way = |a: &MapPose, b: &MapPose| (a.translation.vector - b.translation.vector).norm();
        let (done, left) = (way(&keyframes[*keyframe].odometry, odometry), way(odometry, &next.odometry));
        if done + left < 1e-6 {
            return before;
        }
        before.lerp_slerp(&from(keyframe + 1, odometry), done / (done + left))
    };
    frames.iter().map(pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_correction_passes_over_along_the_path() {
        let keyframe = |x: f64| Keyframe {
            frame: 0,
            stamp_s: 0.0,
            odometry: MapPose::translation(x, 0.0, 0.0),
            path_m: x,
        };
        let keyframes = [keyframe(0.0), keyframe(4.0)];
        let corrected = [MapPose::identity(), MapPose::translation(4.0, 0.8, 0.0)];
        let frames: Vec<_> = [0.0, 1.0, 3.0, 4.0, 5.0]
            .map(|x| (MapPose::translation(x, 0.0, 0.0), usize::from(x >= 4.0)))
            .into();
        let y: Vec<f64> =
            corrected_trajectory(&frames, &keyframes, &corrected).iter().map(|p| p.translation.y).collect();
        let expected = [0.0, 0.2, 0.6, 0.8, 0.8];
        assert!(y.iter().zip(expected).all(|(y, e)| (y - e).abs() < 1e-12), "{y:?}");
    }
}
