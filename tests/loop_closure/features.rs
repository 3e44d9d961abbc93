//! Keypoints and descriptors: what must not change when the view does.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use sdslam_core::loop_closure::{Config, FeatureExtractor, Features, Keypoint, link3d};
use sdslam_core::{LabelledPoint, Pose, SemanticClass, pose};
use sdslam_tests::drive::pose_on_street;
use sdslam_tests::loops::{drive_lane, features_of, on_heap};
use sdslam_tests::street::street;
use sdslam_tests::world::Lidar;

fn scan() -> Vec<LabelledPoint> {
    let lidar = Lidar { beams: 32, columns: 900, noise_m: 0.015 };
    street(60.0, 7).scan(&lidar, &pose_on_street(30.0, -1.5, 0.1), 0.0, 5)
}

fn moved(points: &[LabelledPoint], by: &Pose) -> Vec<LabelledPoint> {
    let point = |p: &LabelledPoint| {
        let position = by * Point3::from(p.position);
        LabelledPoint { position: position.coords.into(), ..*p }
    };
    points.iter().map(point).collect()
}

fn yaw(degrees: f32) -> Pose {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
    Pose::from_parts(Vector3::zeros().into(), rotation)
}

/// Share of the keypoints of `a`, moved, that have one of their class in `b` within `radius_m`, horizontally.
fn repeated(a: &Features, b: &Features, by: &Pose, radius_m: f32) -> f32 {
    let near = |k: &&Keypoint| {
        let p = by * Point3::from(k.position);
        let distance = |q: &Keypoint| (p.x - q.position[0]).hypot(p.y - q.position[1]);
        b.keypoints.iter().any(|q| q.class == k.class && distance(q) < radius_m)
    };
    a.keypoints.iter().filter(near).count() as f32 / a.keypoints.len() as f32
}

#[test]
fn keypoints_move_with_the_points() {
    let (points, by) = (scan(), yaw(73.0));
    let (before, after) = (features_of(&points), features_of(&moved(&points, &by)));
    assert!(before.keypoints.len() >= 12, "{}", before.keypoints.len());
    // The grid cuts things elsewhere: one that hangs together by a corner may fall apart.
    let share = repeated(&before, &after, &by, 0.02);
    assert!(share >= 0.9, "{share}");
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    let points = scan();
    let mut shuffled = points.clone();
    shuffled.reverse();
    let (a, b) = (features_of(&points), features_of(&shuffled));
    assert_eq!(a.keypoints.len(), b.keypoints.len());
    assert_eq!(repeated(&a, &b, &pose::IDENTITY, 1e-3), 1.0);
}

#[test]
fn keypoints_are_where_the_posts_are() {
    let world = street(60.0, 7);
    let keyframe = &drive_lane(&world, &[30.0], -1.5, 1.0, 0.0)[0];
    let features = features_of(&keyframe.points);
    for keypoint in &features.keypoints {
        let at = keyframe.world_from_sensor * Point3::from(keypoint.position.map(f64::from));
        let nearest = world.solids.iter().filter(|s| s.class == keypoint.class);
        let distance = nearest.map(|s| (at.x - s.at[0]).hypot(at.y - s.at[1])).fold(f64::MAX, f64::min);
        // Only the near side of a post is seen.
        assert!(distance < 0.25, "{keypoint:?} is {distance} m from any {}", keypoint.class.name());
    }
}

#[test]
fn what_moves_or_lies_on_the_ground_makes_no_keypoint() {
    let points = scan();
    let expected = features_of(&points);
    let others: Vec<LabelledPoint> = SemanticClass::ALL
        .into_iter()
        .filter(|class| class.motion() != sdslam_core::MotionClass::PureStatic)
        .flat_map(|class| {
            (0..40).map(move |k| LabelledPoint::new([6.0, class as u8 as f32, 0.05 * k as f32], class))
        })
        .collect();
    assert_eq!(features_of(&[points, others].concat()), expected);
}

#[test]
fn several_scans_make_one_keyframe() {
    let world = street(60.0, 7);
    let scans = drive_lane(&world, &[28.0, 30.0, 32.0], -1.5, 1.0, 0.0);
    let mut extractor = on_heap(FeatureExtractor::<4096>::new);
    for scan in &scans {
        let keyframe_from_sensor = scans[1].world_from_sensor.inv_mul(&scan.world_from_sensor);
        extractor.add(&Config::DEFAULT, &scan.points, &keyframe_from_sensor.cast());
    }
    let (all, one) = (extractor.finish(&Config::DEFAULT), features_of(&scans[1].points));
    assert!(all.keypoints.len() >= one.keypoints.len());
    assert!(repeated(&one, &all, &pose::IDENTITY, 0.2) >= 0.9);
}

#[test]
fn the_farthest_keypoints_are_left_out_first() {
    let post = |k: usize| Keypoint {
        position: [(k * 37 % 80) as f32, 0.0, 0.0],
        class: SemanticClass::Pole,
        points: 10,
    };
    let features = Features::from_keypoints((0..80).map(post));
    assert_eq!((features.keypoints.len(), features.left_out), (64, 16));
    let ranges: Vec<f32> = features.keypoints.iter().map(|k| k.position[0]).collect();
    assert_eq!(ranges, (0..64).map(|k| k as f32).collect::<Vec<f32>>());
}

#[test]
fn too_many_columns_are_counted_and_the_rest_stays_valid() {
    let points = scan();
    let mut small = on_heap(FeatureExtractor::<16>::new);
    small.add(&Config::DEFAULT, &points, &pose::IDENTITY);
    let features = small.finish(&Config::DEFAULT);
    assert!(small.left_out() > 0);
    assert!(features.keypoints.len() < features_of(&points).keypoints.len());
    small.clear();
    assert_eq!((small.left_out(), small.finish(&Config::DEFAULT)), (0, Features::default()));
}

/// LinK3D's own example: a keypoint, its neighbour ahead, one at right angles to the left and one behind.
#[test]
fn a_descriptor_written_out() {
    let keypoints = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 5.0, 0.0], [-7.0, 0.0, 0.0]];
    let descriptor = link3d::descriptor(&keypoints, 0);
    let filled: Vec<(usize, u16)> =
        descriptor.into_iter().enumerate().filter(|(_, value)| *value != 0).collect();
    // From the nearest neighbour: itself, 90 degrees, 180 degrees. The second's axis adds what lies 90 and 270 degrees
    // from it, the third's what lies 180 and 270: sectors already filled keep the first.
    assert_eq!(filled, [(0, 20), (45, 50), (90, 70), (135, 20)]);
}

fn scattered() -> impl Strategy<Value = Vec<[f32; 3]>> {
    let coordinate = -40.0_f32..40.0;
    prop::collection::vec((coordinate.clone(), coordinate, -1.0_f32..3.0), 4..24)
        .prop_map(|points| points.into_iter().map(|(x, y, z)| [x, y, z]).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn descriptors_stay_when_the_view_turns(points in scattered(), degrees in 0.0_f32..360.0) {
        let by = Pose::from_parts(Vector3::new(3.0, -2.0, 0.5).into(), yaw(degrees).rotation);
        let turned: Vec<[f32; 3]> = points.iter().map(|p| (by * Point3::from(*p)).coords.into()).collect();
        let mut same = 0;
        let mut all = 0;
        for i in 0..points.len() {
            let (a, b) = (link3d::descriptor(&points, i), link3d::descriptor(&turned, i));
            let filled = a.iter().filter(|v| **v != 0).count() as u32;
            all += filled;
            same += link3d::similarity(&a, &b);
        }
        // A direction on the border of two sectors may round to either.
        prop_assert!(f64::from(same) >= 0.97 * f64::from(all) - 2.0, "{same} of {all}");
    }
}
