//! Stage 6: vertical pose, voxels and dense registration.

use nalgebra::{Matrix3, Point3, Vector3, Vector6};
use sdslam_core::pose::{self, Pose};
use sdslam_core::precise_pose::dense::{self, SourcePoint};
use sdslam_core::precise_pose::vertical;
use sdslam_core::precise_pose::voxel_map::{self, Group, VoxelMap};
use sdslam_core::scan_cells::ScanCells;
use sdslam_core::{LabelledPoint, SemanticClass};
use sdslam_tests::world::unit;

use crate::filtered;

fn ground_cells(height_at: impl Fn(f32) -> f32) -> Box<ScanCells<4096>> {
    let mut points = Vec::new();
    for i in -60..=60 {
        for j in -15..=15 {
            let (x, y) = (0.4 * i as f32, 0.4 * j as f32);
            points.push(LabelledPoint::new([x, y, height_at(x)], SemanticClass::Road));
        }
    }
    filtered::<4096>(&mut points).0
}

#[test]
fn the_ground_ahead_and_behind_gives_slope_and_bend() {
    let cells = ground_cells(|x| -1.7 + 0.02 * x + 0.03 * x.max(0.0));
    let (ground, evidence) = vertical::fit(&vertical::Config::DEFAULT, cells.cells());
    let ground = ground.expect("both patches are seen");
    assert!((ground.bend_rad - (0.05f32.atan() - 0.02f32.atan())).abs() < 1e-3, "{ground:?}");
    assert!((ground.mean.slope_x - 0.035).abs() < 1e-3 && ground.mean.slope_y.abs() < 1e-3, "{ground:?}");
    assert!(evidence.front > 100 && evidence.rear > 100);
    assert!((evidence.pitch_rad - 0.035).abs() < 1e-3);
}

#[test]
fn ground_on_one_side_only_gives_no_vertical_pose() {
    let mut points: Vec<LabelledPoint> = (0..4000)
        .map(|i| {
            LabelledPoint::new(
                [4.0 + 0.01 * i as f32 % 15.0, (i % 9) as f32 - 4.0, -1.7],
                SemanticClass::Road,
            )
        })
        .collect();
    let cells = filtered::<4096>(&mut points).0;
    let (ground, evidence) = vertical::fit(&vertical::Config::DEFAULT, cells.cells());
    assert!(ground.is_none() && evidence.rear == 0 && evidence.front > 30, "{evidence:?}");
}

/// Points of a floor, two walls and some posts.
fn room(seed: u64) -> Vec<(Vector3<f32>, Group)> {
    let draw = |i, k| unit(seed, i, k) as f32;
    (0..30_000)
        .map(|i| {
            let (u, v) = (40.0 * draw(i, 0) - 20.0, 40.0 * draw(i, 1) - 20.0);
            let noise = 0.01 * (draw(i, 2) - 0.5);
            match (4.0 * draw(i, 3)) as u32 {
                0 | 1 => (Vector3::new(u, v, -1.7 + noise), Group::Ground),
                2 => (Vector3::new(u, 12.0 + noise, 0.1 * v), Group::Structure),
                _ => (Vector3::new(15.0 + noise, u, 0.1 * v), Group::Structure),
            }
        })
        .collect()
}

fn map_of(points: &[(Vector3<f32>, Group)]) -> Box<VoxelMap<512>> {
    let mut map = Box::new(VoxelMap::new());
    for (p, group) in points {
        map.merge(&voxel_map::Config::DEFAULT, *group, 0.0, p, &Matrix3::zeros(), 1.0);
    }
    map
}

fn source_of(points: &[(Vector3<f32>, Group)], seen_from: &Pose) -> Vec<SourcePoint> {
    let source = |(p, group): &(Vector3<f32>, Group)| SourcePoint {
        position: seen_from.inverse_transform_point(&Point3::from(*p)).coords,
        group: *group,
    };
    points.iter().map(source).collect()
}

fn register(map: &VoxelMap<512>, source: &[SourcePoint], start: &Pose) -> dense::Registration {
    let (config, voxels) = (dense::Config::DEFAULT, voxel_map::Config::DEFAULT);
    dense::register(&config, &voxels, map, 0.0, source, start)
}

#[test]
fn ground_taken_for_vegetation_still_holds_the_height() {
    let map = map_of(&room(1));
    let seen_from =
        Pose::from_parts(Vector3::new(0.0, 0.0, 0.1).into(), pose::from_roll_pitch_yaw(0.0, 0.01, 0.0));
    let mut source = source_of(&room(2), &seen_from);
    for point in source.iter_mut().filter(|point| point.group == Group::Ground) {
        point.group = Group::Vegetation;
    }
    let found = register(&map, &source, &Pose::identity());
    let off = found.local_from_sensor.inv_mul(&seen_from);
    assert!(off.translation.vector.norm() < 0.01 && off.rotation.angle() < 1e-3, "{off}");
    let upright = source.iter().filter(|point| point.group == Group::Structure).count() as u32;
    assert!(found.evidence.upright_partners <= upright, "{:?}", found.evidence);
}

#[test]
fn bushes_are_not_ground() {
    let map = map_of(&room(1));
    let config = voxel_map::Config::DEFAULT;
    let group_at =
        |z: f32| map.partner(&config, &Vector3::new(3.2, 4.3, z), Group::Vegetation, 0.0).map(|p| p.2);
    assert_eq!(group_at(-1.7), Some(Group::Ground));
    assert_eq!(group_at(-1.5), None);
}

#[test]
fn vegetation_that_fits_a_known_wall_is_wall() {
    let map = map_of(&room(1));
    let config = voxel_map::Config::DEFAULT;
    let (wall, _) = *room(2).iter().find(|(_, group)| *group == Group::Structure).expect("a room has walls");
    let (voxel, mean, _) = map.partner(&config, &wall, Group::Structure, 0.0).expect("it was seen before");
    let normal = voxel.across().next().expect("a wall is a plane").normalize();
    let group_at = |p: &Vector3<f32>, group| map.partner(&config, p, group, 0.0).map(|found| found.2);
    assert_eq!(group_at(&mean, Group::Vegetation), Some(Group::Structure));
    assert_eq!(group_at(&mean, Group::Thin), None);
    assert_eq!(group_at(&(mean + 0.3 * normal), Group::Vegetation), None);
}

/// A street along x: floor, wall, hedge, and trunks that were taken for vegetation; the hedge across it moved by `leaves_m`.
fn street_with_trunks(seed: u64, leaves_m: f32) -> Vec<(Vector3<f32>, Group)> {
    let draw = |i, k| unit(seed, i, k) as f32;
    let kind = |i| match (8.0 * draw(i, 3)) as u32 {
        0..4 => (Vector3::new(40.0 * draw(i, 0) - 20.0, 20.0 * draw(i, 1) - 10.0, -1.7), Group::Ground),
        4 | 5 => (Vector3::new(40.0 * draw(i, 0) - 20.0, 12.0, 2.0 * draw(i, 1)), Group::Structure),
        6 => (Vector3::new(15.5 + leaves_m, -8.0 + 6.0 * draw(i, 0), 2.0 * draw(i, 1)), Group::Vegetation),
        _ => (
            Vector3::new(4.5 * ((6.0 * draw(i, 0)) as i32 - 3) as f32 + 0.5, 6.5, 3.0 * draw(i, 1)),
            Group::Vegetation,
        ),
    };
    (0..20_000).map(kind).collect()
}

#[test]
fn trunks_that_were_taken_for_vegetation_weigh_as_trunks() {
    let map = map_of(&street_with_trunks(1, 0.0));
    let source = source_of(&street_with_trunks(2, 0.1), &pose::IDENTITY);
    let along_with = |vegetation_rod_weight| {
        let config = dense::Config { vegetation_rod_weight, ..dense::Config::DEFAULT };
        let found =
            dense::register(&config, &voxel_map::Config::DEFAULT, &map, 0.0, &source, &pose::IDENTITY);
        found.local_from_sensor.translation.x.abs()
    };
    let (alike, more) = (along_with(1.0), along_with(dense::Config::DEFAULT.vegetation_rod_weight));
    assert!(alike > 0.01, "the hedge pulls: {alike} m");
    assert!(more < 0.5 * alike, "{more} m, {alike} m with the weight of leaves");
}

#[test]
fn dense_registration_finds_a_known_pose() {
    let map = map_of(&room(1));
    for (k, twist) in
        [[0.3, -0.2, 0.1, 0.01, -0.02, 0.03], [-0.4, 0.3, -0.1, -0.01, 0.01, -0.04]].into_iter().enumerate()
    {
        let truth = pose::exp(&Vector6::from(twist));
        let source = source_of(&room(2 + k as u64)[..6000], &truth);
        let found = register(&map, &source, &pose::IDENTITY);
        let off = pose::log(&(truth.inverse() * found.local_from_sensor));
        assert!(off.fixed_rows::<3>(0).norm() < 0.005, "{off}");
        assert!(off.fixed_rows::<3>(3).norm() < 0.0005, "{off}");
        assert!(found.evidence.converged && found.evidence.inliers > 4500, "{:?}", found.evidence);
        assert!(found.information.cholesky().is_some());
    }
}

#[test]
fn dense_registration_is_robust_against_a_third_of_outliers() {
    let map = map_of(&room(1));
    let truth = pose::exp(&Vector6::new(0.2, 0.1, 0.0, 0.0, 0.0, 0.02));
    let mut source = source_of(&room(5)[..6000], &truth);
    let outliers = source.iter_mut().enumerate().filter(|(i, _)| unit(8, *i as u64, 0) < 0.33);
    outliers.for_each(|(_, p)| p.position += Vector3::new(0.3, 0.4, 0.35));
    let found = register(&map, &source, &pose::IDENTITY);
    let off = pose::log(&(truth.inverse() * found.local_from_sensor));
    assert!(off.norm() < 0.02, "{off}");
}

#[test]
fn groups_are_registered_with_their_own_kind_only() {
    let map = map_of(&room(1));
    let mut source = source_of(&room(2)[..2000], &pose::IDENTITY);
    source.iter_mut().for_each(|p| p.group = Group::Movable);
    assert_eq!(register(&map, &source, &pose::IDENTITY).evidence.inliers, 0);
}

#[test]
fn voxels_keep_their_place_when_the_anchor_moves() {
    let mut map = map_of(&room(1));
    let config = voxel_map::Config::DEFAULT;
    let place = Vector3::new(3.4, 2.2, -1.7);
    let (_, before) = map.find(&config, &place, Group::Ground, 0.0).expect("ground is there");
    map.shift_anchor([160, -160, 3]);
    let by = Vector3::new(160.0, -160.0, 3.0);
    let (_, after) = map.find(&config, &(place - by), Group::Ground, 0.0).expect("the same ground");
    assert!((after + by - before).norm() < 1e-4);
    assert!(map.find(&config, &place, Group::Ground, 0.0).is_none());
}

#[test]
fn voxels_outside_the_window_are_gone_and_start_anew() {
    let mut map = map_of(&room(1));
    let config = voxel_map::Config::DEFAULT;
    let place = Vector3::new(3.4, 2.2, -1.7);
    assert!(map.find(&config, &place, Group::Ground, config.window_m).is_some());
    let later = config.window_m + 1.0;
    assert!(map.find(&config, &place, Group::Ground, later).is_none());
    // One point of new ground, a hand higher: the old points must not speak.
    for k in 0..20 {
        let p = place + Vector3::new(0.02 * (k % 5) as f32, 0.02 * (k / 5) as f32, 0.2);
        map.merge(&config, Group::Ground, later, &p, &Matrix3::zeros(), 1.0);
    }
    let (_, mean) = map.find(&config, &place, Group::Ground, later).expect("new ground");
    assert!((mean.z - (place.z + 0.2)).abs() < 1e-4, "{mean}");
}

#[test]
fn a_full_bucket_replaces_the_voxel_seen_longest_ago() {
    let config = voxel_map::Config { min_weight: 1.0, ..voxel_map::Config::DEFAULT };
    let mut map = Box::new(VoxelMap::<1>::new());
    let place = |k: usize| Vector3::new(k as f32 + 0.5, 0.5, 0.5);
    let flat = Matrix3::from_diagonal(&Vector3::new(0.05, 0.05, 0.0));
    for k in 0..voxel_map::WAYS {
        map.merge(&config, Group::Ground, k as f32, &place(k), &flat, 20.0);
    }
    assert_eq!(map.usage(), (voxel_map::WAYS as u32, 0));
    map.merge(&config, Group::Ground, 9.0, &place(20), &flat, 20.0);
    assert_eq!(map.usage(), (voxel_map::WAYS as u32, 1));
    let known = |k: usize| map.find(&config, &place(k), Group::Ground, 9.0).is_some();
    assert!(!known(0) && known(1) && known(20));
}

#[test]
fn what_lies_flat_holds_a_height_as_ground_only() {
    let config = voxel_map::Config::DEFAULT;
    let place = Vector3::new(0.5, 0.5, 0.5);
    let told = |group, across: Vector3<f32>| {
        let mut map = Box::new(VoxelMap::<1>::new());
        let thin = Matrix3::from_diagonal(&across.map(|v| 0.05 * (1.0 - v)));
        map.merge(&config, group, 0.0, &place, &thin, 20.0);
        map.find(&config, &place, group, 0.0).is_some()
    };
    assert!(told(Group::Ground, Vector3::z()) && told(Group::Vegetation, Vector3::z()));
    for group in [Group::Structure, Group::Movable] {
        assert!(!told(group, Vector3::z()) && told(group, Vector3::x()), "{group:?}");
    }
}
