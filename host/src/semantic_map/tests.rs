//! What enters, what is removed, what the files hold, and how much memory it takes.

use sdslam_core::MapPose;

use super::*;

fn config() -> MapConfig {
    MapConfig { min_points: 1, ..MapConfig::default() }
}

fn points_of(points: &[([f32; 3], SemanticClass)]) -> Vec<LabelledPoint> {
    points.iter().map(|&(position, class)| LabelledPoint::new(position, class)).collect()
}

fn map_of(points: &[([f32; 3], SemanticClass)]) -> StaticMap {
    let mut map = SemanticMap::new(config());
    map.begin_submap(0);
    map.add_scan(&points_of(points), &vec![0.5; points.len()], &MapPose::identity());
    map.assemble(|_| MapPose::identity())
}

#[test]
fn only_ground_and_pure_static_points_enter() {
    let classes = SemanticClass::ALL;
    let points: Vec<_> = classes.iter().map(|&c| ([c as u8 as f32 + 1.05, 0.0, 0.0], c)).collect();
    let fixed = classes.iter().filter(|&&class| enters(class)).count();
    let map = map_of(&points);
    assert_eq!(map.cells().len(), fixed);
    assert!(map.cells().iter().all(|cell| enters(cell.class)));
}

#[test]
fn missing_returns_and_far_points_stay_out() {
    let road = SemanticClass::Road;
    let points = [([0.0; 3], road), ([f32::NAN, 1.0, 0.0], road), ([61.0, 0.0, 0.0], road)];
    assert_eq!(map_of(&points).cells().len(), 0);
}

#[test]
fn a_voxel_below_the_minimum_is_left_out() {
    let mut map = SemanticMap::new(MapConfig { min_points: 2, ..config() });
    map.begin_submap(0);
    let points = points_of(&[([5.0, 0.0, 0.0], SemanticClass::Road)]);
    map.add_scan(&points, &[0.0], &MapPose::identity());
    let map = map.assemble(|_| MapPose::identity());
    assert!(map.cells().is_empty());
    assert!(String::from_utf8_lossy(&map.to_ply()).contains("element vertex 0\n"));
    assert!(map.to_png().starts_with(b"\x89PNG") && map.to_pcd().ends_with(b"DATA binary\n"));
}

#[test]
fn the_ply_holds_mean_colour_class_confidence_intensity_and_count() {
    let map = map_of(&[([5.0, -1.0, 0.1], SemanticClass::Road), ([5.1, -0.9, 0.1], SemanticClass::Road)]);
    let ply = map.to_ply();
    let body = ply.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    assert_eq!(ply.len() - body, 29);
    let float = |i: usize| f32::from_le_bytes(ply[body + i..body + i + 4].try_into().expect("four bytes"));
    for (place, expected) in [(0, 5.05), (4, -0.95), (8, 0.1), (17, 1.0), (21, 0.5)] {
        assert!((float(place) - expected).abs() < 1e-5, "{place}");
    }
    assert_eq!(ply[body + 12..body + 15], crate::dataset::labels::colour(SemanticClass::Road));
    assert_eq!(ply[body + 15..body + 17], [40, 0]);
    assert_eq!(ply[body + 25..], [2, 0, 0, 0]);
}

/// A street with walls on both sides, as points that a scan at `x_m` sees, sensor frame.
fn street(x_m: f64) -> Vec<LabelledPoint> {
    let mut points = Vec::new();
    for step in -150..150 {
        let along = ((x_m * 10.0).round() + f64::from(step)) * 0.1;
        let x = (along - x_m) as f32;
        for k in 0..30 {
            points.push(([x, 4.9, -1.4 + 0.1 * k as f32], SemanticClass::Building));
            points.push(([x, -4.9, -1.4 + 0.1 * k as f32], SemanticClass::Building));
        }
        points.extend((0..60).map(|k| ([x, -4.45 + 0.15 * k as f32, -1.63], SemanticClass::Road)));
    }
    points_of(&points)
}

/// Drives along the street, a submap every 30 m, submaps fixed to each other.
fn drive(map: &mut SemanticMap, extra: &[([f64; 3], SemanticClass)], free_space: bool) {
    for k in 0..60 {
        if k % 15 == 0 {
            map.finish_submap(|_| Some(MapPose::identity()));
            map.begin_submap(k);
        }
        let pose = MapPose::translation(2.0 * f64::from(k as u32), 0.0, 0.0);
        let mut points = street(2.0 * k as f64);
        for (place, class) in extra {
            let seen = pose.inverse() * Point3::from(*place);
            points.push(LabelledPoint::new(seen.coords.map(|v| v as f32).into(), *class));
        }
        map.add_scan(&points, &vec![0.0; points.len()], &pose);
        if free_space {
            map.add_free_space(&RangeImage::of(&points), |_| Some(pose));
        }
    }
}

#[test]
fn revisiting_does_not_grow_the_map() {
    let mut map = SemanticMap::new(config());
    let sizes: Vec<usize> = (0..4)
        .map(|_| {
            drive(&mut map, &[], true);
            map.finish_submap(|_| Some(MapPose::identity()));
            map.voxels_in_memory()
        })
        .collect();
    assert!(sizes[0] > 10_000);
    assert!(sizes[1..].iter().all(|&size| size == sizes[0]), "{sizes:?}");
}

#[test]
fn what_left_leaves_no_ghost_and_what_stays_remains() {
    let mut map = SemanticMap::new(config());
    // Something labelled static stands on the road during the first round only.
    let ghost: Vec<_> = (0..20)
        .flat_map(|i| (0..10).map(move |k| [40.0 + 0.1 * f64::from(i), 1.0, -1.0 + 0.1 * f64::from(k)]))
        .map(|place| (place, SemanticClass::OtherObject))
        .collect();
    let objects = |map: &SemanticMap| {
        let map = map.assemble(|_| MapPose::identity());
        map.cells().iter().filter(|cell| cell.class == SemanticClass::OtherObject).count()
    };
    drive(&mut map, &ghost, false);
    let standing = map.assemble(|_| MapPose::identity()).cells().len();
    let with_ghost = objects(&map);
    for _ in 0..3 {
        drive(&mut map, &[], true);
    }
    let after = map.assemble(|_| MapPose::identity());
    assert!(with_ghost > 40);
    assert_eq!(objects(&map), 0);
    assert_eq!(after.cells().len(), standing - with_ghost, "the street itself stays");
    assert_eq!(after.seen_through(), with_ghost);
}

#[test]
fn the_map_bends_with_its_keyframes() {
    let mut map = SemanticMap::new(config());
    drive(&mut map, &[], false);
    let lift = |anchor: usize| MapPose::translation(0.0, 0.0, if anchor >= 30 { 4.0 } else { 0.0 });
    let roads = |cell: &&MapCell| cell.class == SemanticClass::Road;
    let bent = map.assemble(lift);
    for cell in bent.cells().iter().filter(roads) {
        // Each submap reaches 15 m back, where the one before keeps what it has.
        let (x, z) = (cell.position[0], cell.position[2]);
        assert!((x < 75.5 || (z - 2.37).abs() < 0.1) && (x > 42.5 || (z + 1.63).abs() < 0.1), "{cell:?}");
    }
}

#[test]
fn a_turned_lattice_leaves_no_holes() {
    let mut map = SemanticMap::new(config());
    // A wall, rough by 8 cm.
    let points: Vec<[f32; 3]> = (0..10_000)
        .map(|k| [5.0 + 0.05 * (k % 200) as f32, 0.02 * (k % 5) as f32, 0.06 * (k / 200) as f32])
        .collect();
    let scan = points_of(&points.iter().map(|p| (*p, SemanticClass::Building)).collect::<Vec<_>>());
    map.begin_submap(0);
    map.add_scan(&scan, &vec![0.0; scan.len()], &MapPose::identity());
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.02, -0.03, 0.4);
    let pose = MapPose::from_parts([3.07, -1.31, 0.53].into(), turn);
    let turned = map.assemble(|_| pose);
    let edge = turned.voxel_m();
    let key_of = |p: [f64; 3]| p.map(|v| (v / edge).floor() as i32);
    let kept: std::collections::HashSet<Key> =
        turned.cells().iter().map(|cell| key_of(cell.position.map(f64::from))).collect();
    let is_kept =
        |p: &&[f32; 3]| kept.contains(&key_of((pose * Point3::from(p.map(f64::from))).coords.into()));
    let found = points.iter().filter(is_kept).count();
    assert!(found * 100 >= 95 * points.len(), "{found} of {} points have a cell", points.len());
    let upright = map.assemble(|_| MapPose::identity());
    let size = |map: &StaticMap| map.cells().len();
    assert!(size(&turned) < 2 * size(&upright), "{} cells, {} before", size(&turned), size(&upright));
}

#[test]
fn the_grid_tells_walls_from_road() {
    let mut map = SemanticMap::new(config());
    drive(&mut map, &[], false);
    let grid = map.assemble(|_| MapPose::identity()).obstacle_grid();
    let at = |x: f32, y: f32| grid.pixel([x, y, 0.0]).map(|pixel| grid.pixels[pixel]);
    assert_eq!((at(30.05, 4.9), at(30.05, -4.9), at(30.05, -4.45)), (Some(0), Some(0), Some(254)));
    assert_eq!(at(30.05, 400.0), None);
    let (pgm, yaml) = (grid.to_pgm(), grid.to_yaml("grid.pgm"));
    assert!(pgm.starts_with(format!("P5\n{} {}\n255\n", grid.width, grid.height).as_bytes()));
    assert!(yaml.starts_with("image: grid.pgm\nresolution: 0.2\norigin: ["));
}

#[test]
fn an_empty_map_has_files_too() {
    let map = SemanticMap::new(config()).assemble(|_| MapPose::identity());
    assert!(map.to_png().starts_with(b"\x89PNG"));
    assert_eq!(map.obstacle_grid().pixels.len(), 1);
}
