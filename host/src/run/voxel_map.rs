//! The static semantic map: voxels with a class by majority, from ground and pure static points only.
//!
//! A voxel takes about 44 bytes however often it is seen, so the memory is bounded by the area driven through.

use std::collections::HashMap;

use sdslam_core::{LabelledPoint, MapPose, MotionClass, SemanticClass};

use super::motion::in_map;
use crate::config::MapConfig;
use crate::dataset::labels;

/// Classes counted at once in a voxel; one more takes the place of the rarest (the space-saving method).
const CLASSES_PER_VOXEL: usize = 4;

/// One voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Voxel {
    /// Points.
    count: u32,
    /// Sum of the points' offsets from the voxel's corner \[m\].
    offset: [f32; 3],
    /// Points per class; unused places have none.
    classes: [(u8, u16); CLASSES_PER_VOXEL],
}

impl Voxel {
    fn add(&mut self, offset: [f32; 3], class: SemanticClass) {
        self.count += 1;
        for (sum, value) in self.offset.iter_mut().zip(offset) {
            *sum += value;
        }
        let class = class as u8;
        let place = self.classes.iter().position(|&(known, n)| n > 0 && known == class);
        let rarest = || (0..CLASSES_PER_VOXEL).min_by_key(|&i| self.classes[i].1).unwrap_or(0);
        let place = place.unwrap_or_else(rarest);
        self.classes[place] = (class, self.classes[place].1.saturating_add(1));
    }

    /// The commonest class; of two as common, the one with the smaller number.
    fn class(&self) -> SemanticClass {
        let most = self.classes.iter().max_by_key(|&&(class, n)| (n, u8::MAX - class));
        most.map_or(SemanticClass::Unlabelled, |&(class, _)| SemanticClass::ALL[usize::from(class)])
    }
}

/// The map of a run.
pub(super) struct VoxelMap {
    config: MapConfig,
    voxels: HashMap<[i32; 3], Voxel>,
}

impl VoxelMap {
    pub(super) fn new(config: MapConfig) -> Self {
        Self { config, voxels: HashMap::new() }
    }

    /// Adds the ground and pure static points of a scan.
    pub(super) fn add(&mut self, points: &[LabelledPoint], map_from_sensor: &MapPose) {
        let max_range2 = (self.config.max_range_m * self.config.max_range_m) as f32;
        for point in points {
            let never_moves = matches!(point.class.motion(), MotionClass::Ground | MotionClass::PureStatic);
            let range2: f32 = point.position.iter().map(|v| v * v).sum();
            // Not-a-number and the zeros of missing returns fail the comparison.
            if never_moves && range2 > 1e-6 && range2 <= max_range2 {
                self.add_point(in_map(map_from_sensor, point.position), point.class);
            }
        }
    }

    fn add_point(&mut self, position: [f64; 3], class: SemanticClass) {
        let edge = self.config.voxel_m;
        let corner = position.map(|v| (v / edge).floor());
        let offset = std::array::from_fn(|i| (position[i] - corner[i] * edge) as f32);
        self.voxels.entry(corner.map(|v| v as i32)).or_default().add(offset, class);
    }

    /// Number of voxels that the file holds.
    pub(super) fn len(&self) -> usize {
        self.voxels.values().filter(|voxel| voxel.count >= self.config.min_points).count()
    }

    /// Binary PLY: mean position \[m\], colour, SemanticKITTI's raw id and number of points of every voxel.
    pub(super) fn to_ply(&self) -> Vec<u8> {
        let mut kept: Vec<_> =
            self.voxels.iter().filter(|(_, v)| v.count >= self.config.min_points).collect();
        kept.sort_unstable_by_key(|(key, _)| **key);
        let mut ply = self.header(kept.len()).into_bytes();
        for (key, voxel) in kept {
            for (corner, offset) in key.iter().zip(voxel.offset) {
                let mean_offset = f64::from(offset) / f64::from(voxel.count);
                let mean = f64::from(*corner) * self.config.voxel_m + mean_offset;
                ply.extend((mean as f32).to_le_bytes());
            }
            let class = voxel.class();
            ply.extend(labels::colour(class));
            ply.extend((labels::raw_id(class) as u16).to_le_bytes());
            ply.extend(voxel.count.to_le_bytes());
        }
        ply
    }

    fn header(&self, voxels: usize) -> String {
        format!(
            "ply\nformat binary_little_endian 1.0\n\
             comment sdslam static semantic map, {} m voxels, map frame (sensor frame of the first scan)\n\
             comment class: SemanticKITTI raw id; count: points in the voxel\n\
             element vertex {voxels}\n\
             property float x\nproperty float y\nproperty float z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\n\
             property ushort class\nproperty uint count\nend_header\n",
            self.config.voxel_m
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map_of(points: &[([f32; 3], SemanticClass)]) -> VoxelMap {
        let config = MapConfig { min_points: 1, ..MapConfig::default() };
        let mut map = VoxelMap::new(config);
        let points: Vec<_> = points.iter().map(|&(p, class)| LabelledPoint::new(p, class)).collect();
        map.add(&points, &MapPose::identity());
        map
    }

    #[test]
    fn only_ground_and_pure_static_points_enter() {
        let classes = SemanticClass::ALL;
        let points: Vec<_> = classes.iter().map(|&c| ([c as u8 as f32 + 1.05, 0.0, 0.0], c)).collect();
        let fixed =
            classes.iter().filter(|c| matches!(c.motion(), MotionClass::Ground | MotionClass::PureStatic));
        assert_eq!(map_of(&points).len(), fixed.count());
    }

    #[test]
    fn missing_returns_and_far_points_stay_out() {
        let road = SemanticClass::Road;
        let points = [([0.0; 3], road), ([f32::NAN, 1.0, 0.0], road), ([61.0, 0.0, 0.0], road)];
        assert_eq!(map_of(&points).len(), 0);
    }

    #[test]
    fn the_majority_names_the_voxel_whatever_the_order() {
        let at = |x: f32, class| ([5.0 + x, 0.1, 0.1], class);
        let (pole, wall) = (SemanticClass::Pole, SemanticClass::Building);
        let mut points = vec![at(0.01, pole), at(0.02, wall), at(0.03, wall)];
        for _ in 0..3 {
            points.rotate_left(1);
            let map = map_of(&points);
            assert_eq!(map.voxels.values().map(Voxel::class).collect::<Vec<_>>(), [wall]);
        }
    }

    #[test]
    fn a_voxel_below_the_minimum_is_not_written() {
        let mut map = map_of(&[([5.0, 0.0, 0.0], SemanticClass::Road)]);
        map.config.min_points = 2;
        assert_eq!(map.len(), 0);
        assert!(String::from_utf8_lossy(&map.to_ply()).contains("element vertex 0\n"));
    }

    #[test]
    fn the_file_holds_mean_colour_class_and_count() {
        let map = map_of(&[([5.0, -1.0, 0.1], SemanticClass::Road), ([5.1, -0.9, 0.1], SemanticClass::Road)]);
        let ply = map.to_ply();
        let body = ply.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
        assert_eq!(ply.len() - body, 21);
        let float =
            |i: usize| f32::from_le_bytes(ply[body + i..body + i + 4].try_into().expect("four bytes"));
        assert!(
            (float(0) - 5.05).abs() < 1e-5 && (float(4) + 0.95).abs() < 1e-5 && (float(8) - 0.1).abs() < 1e-5
        );
        assert_eq!(ply[body + 12..body + 15], labels::colour(SemanticClass::Road));
        assert_eq!(ply[body + 15..], [40, 0, 2, 0, 0, 0]);
    }
}
