//! What is in the file, in plain types.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use sdslam_core::loop_closure::{Features, Keypoint};
use sdslam_core::{MapPose, SemanticClass};
use serde::{Deserialize, Serialize};

use super::{SavedMap, SavedPlace};
use crate::semantic_map::{MapCell, StaticMap};

/// Position, class, its share, intensity and number of points.
#[derive(Serialize, Deserialize)]
struct Cell([f32; 3], u8, f32, f32, u32);

/// Translation and quaternion (x, y, z, w), then position, class and points of every keypoint.
#[derive(Serialize, Deserialize)]
struct Place([f64; 3], [f64; 4], Vec<([f32; 3], u8, u16)>);

#[derive(Serialize, Deserialize)]
pub(super) struct Content {
    voxel_m: f64,
    cells: Vec<Cell>,
    places: Vec<Place>,
}

impl Content {
    pub(super) fn of(saved: &SavedMap) -> Self {
        let cell = |c: &MapCell| Cell(c.position, c.class as u8, c.confidence, c.intensity, c.count);
        let keypoint = |k: &Keypoint| (k.position, k.class as u8, k.points);
        let place = |place: &SavedPlace| {
            let pose = &place.map_from_place;
            let keypoints = place.features.keypoints.iter().map(keypoint).collect();
            Place(pose.translation.vector.into(), pose.rotation.coords.into(), keypoints)
        };
        Self {
            voxel_m: saved.map.voxel_m(),
            cells: saved.map.cells().iter().map(cell).collect(),
            places: saved.places.iter().map(place).collect(),
        }
    }

    pub(super) fn encode(&self) -> Vec<u8> {
        postcard::to_stdvec(self).expect("numbers in vectors of known length always have an encoding")
    }

    pub(super) fn decode(bytes: &[u8]) -> Result<Self, &'static str> {
        match postcard::take_from_bytes(bytes) {
            Ok((content, [])) => Ok(content),
            Ok(_) => Err("there is more in it than a map"),
            Err(_) => Err("its content cannot be decoded"),
        }
    }

    pub(super) fn into_map(self) -> Result<SavedMap, &'static str> {
        if !(0.01..=10.0).contains(&self.voxel_m) {
            return Err("the edge of its voxels is not between 0.01 and 10 m");
        }
        let cells: Result<Vec<MapCell>, _> = self.cells.iter().map(cell).collect();
        let places: Result<Vec<SavedPlace>, _> = self.places.iter().map(place).collect();
        Ok(SavedMap { map: StaticMap::from_cells(self.voxel_m, cells?), places: places? })
    }
}

fn class(index: u8) -> Result<SemanticClass, &'static str> {
    SemanticClass::ALL.get(usize::from(index)).copied().ok_or("it holds a class that is not known")
}

fn finite<const N: usize, T: Copy + Into<f64>>(values: [T; N]) -> Result<[T; N], &'static str> {
    let all = values.iter().all(|&v| v.into().is_finite());
    all.then_some(values).ok_or("it holds a number that is not finite")
}

fn cell(&Cell(position, index, confidence, intensity, count): &Cell) -> Result<MapCell, &'static str> {
    let [confidence, intensity] = finite([confidence, intensity])?;
    Ok(MapCell { position: finite(position)?, class: class(index)?, confidence, intensity, count })
}

fn place(Place(translation, rotation, keypoints): &Place) -> Result<SavedPlace, &'static str> {
    let [x, y, z, w] = finite(*rotation)?;
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > 1e-6 {
        return Err("it holds a rotation that is none");
    }
    // Written from a unit quaternion: kept to the bit.
    let rotation = UnitQuaternion::new_unchecked(quaternion);
    let keypoint = |&(position, index, points): &([f32; 3], u8, u16)| {
        Ok::<_, &'static str>(Keypoint { position: finite(position)?, class: class(index)?, points })
    };
    let keypoints: Result<Vec<Keypoint>, _> = keypoints.iter().map(keypoint).collect();
    Ok(SavedPlace {
        map_from_place: MapPose::from_parts(Vector3::from(finite(*translation)?).into(), rotation),
        features: Features::from_keypoints(keypoints?),
    })
}
