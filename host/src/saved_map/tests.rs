//! A file gives back what went in, and nothing else is taken for a map.

use std::path::Path;

use proptest::prelude::*;
use sdslam_core::SemanticClass;
use sdslam_core::loop_closure::Keypoint;

use super::*;
use crate::semantic_map::MapCell;

fn saved() -> SavedMap {
    let cell = |k: u8| MapCell {
        position: [0.2 * f32::from(k), -1.0, 0.5],
        class: SemanticClass::ALL[usize::from(k)],
        confidence: 0.75,
        intensity: 0.3,
        count: 7 + u32::from(k),
    };
    let place = |k: u8| SavedPlace {
        map_from_place: MapPose::new(
            nalgebra::Vector3::new(2.0 * f64::from(k), 0.1, 0.0),
            nalgebra::Vector3::new(0.0, 0.01, 0.3 * f64::from(k)),
        ),
        features: Features::from_keypoints((1..=k).map(|i| Keypoint {
            position: [f32::from(i), 1.0, 2.0],
            class: SemanticClass::Pole,
            points: 20,
        })),
    };
    SavedMap::new(StaticMap::from_cells(0.2, (0..20).map(cell).collect()), (0..5).map(place))
}

fn refused(bytes: &[u8]) -> SavedMapError {
    SavedMap::parse(bytes, Path::new("a.map")).expect_err("no intact map")
}

#[test]
fn a_map_survives_its_file() {
    let map = saved();
    let read = SavedMap::parse(&map.to_bytes(), Path::new("a.map")).expect("our own file");
    assert_eq!(read, map);
    assert_eq!(read.to_bytes(), map.to_bytes());
}

#[test]
fn places_seen_again_are_kept_once() {
    let map = saved();
    let twice = map.places.iter().chain(&map.places).cloned();
    assert_eq!(SavedMap::new(map.map.clone(), twice).places.len(), map.places.len());
}

#[test]
fn poses_of_single_precision_are_read_back() {
    let mut map = saved();
    let place = &mut map.places[2];
    place.map_from_place = place.map_from_place.cast::<f32>().cast();
    place.map_from_place.rotation.as_mut_unchecked().coords *= 1.0 + 3e-6;
    let map = SavedMap::new(map.map, map.places);
    assert_eq!(SavedMap::parse(&map.to_bytes(), Path::new("a.map")).expect("our own file"), map);
}

#[test]
fn each_fault_has_its_name() {
    let bytes = saved().to_bytes();
    assert!(matches!(refused(b"ply\nformat"), SavedMapError::Foreign { .. }));
    assert!(matches!(refused(&[]), SavedMapError::Foreign { .. }));
    assert!(matches!(refused(&bytes[..bytes.len() - 1]), SavedMapError::Truncated { .. }));
    assert!(matches!(refused(&[&bytes[..], b"x"].concat()), SavedMapError::Truncated { .. }));
    let mut other = bytes.clone();
    other[8] = 9;
    assert!(matches!(refused(&other), SavedMapError::Version { found: 9, expected: VERSION, .. }));
    let mut damaged = bytes.clone();
    *damaged.last_mut().expect("not empty") ^= 1;
    assert!(refused(&damaged).to_string().contains("a.map is damaged: its checksum"));
}

#[test]
fn a_right_checksum_does_not_make_a_map() {
    let mut content = vec![0xff; 40];
    content[0] = 0;
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((content.len() as u64).to_le_bytes());
    bytes.extend(crc32fast::hash(&content).to_le_bytes());
    bytes.extend(content);
    assert!(matches!(refused(&bytes), SavedMapError::Damaged { .. }));
}

proptest! {
    #[test]
    fn a_changed_or_cut_file_is_refused(at in 0usize..400, change in 1u8.., cut in 0usize..400) {
        let bytes = saved().to_bytes();
        let mut changed = bytes.clone();
        changed[at % bytes.len()] ^= change;
        prop_assert!(SavedMap::parse(&changed, Path::new("a.map")).is_err());
        prop_assert!(SavedMap::parse(&bytes[..cut % bytes.len()], Path::new("a.map")).is_err());
    }
}
