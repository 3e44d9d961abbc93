//! The static semantic map (section 3.6): voxels with a class by majority, from ground and pure static points only.
//!
//! The map is kept in submaps, each fixed to a keyframe, so that it bends with the corrected trajectory. All of them
//! count their voxels on one lattice in the frame of the odometry. A finished submap gives what lies in voxels of older
//! ones, as far as the graph fixes the two to each other, to those: the memory is bounded by the area, not by the time.
//!
//! What was mapped and later seen through (something that left, a wrong label) is not part of the finished map.

mod assembled;
mod range_image;
mod submap;
mod voxel;

use nalgebra::Point3;
use sdslam_core::{LabelledPoint, MapPose, MotionClass, SemanticClass};

use crate::config::MapConfig;
pub use assembled::{MapCell, ObstacleGrid, StaticMap};
pub(crate) use range_image::RangeImage;
use submap::{Submap, Voxels, column_of};
pub(crate) use voxel::Voxel;
use voxel::part;

/// Free space is looked for this far from the sensor \[m\].
const FREE_SPACE_RANGE_M: f32 = 25.0;
/// What lies this far behind a voxel was seen through it \[m\]: more than two voxels and the noise.
const FREE_SPACE_MARGIN_M: f32 = 0.6;

/// Place of a voxel on the lattice of the odometry frame.
pub(crate) type Key = [i32; 3];

/// The map in the making.
pub(crate) struct SemanticMap {
    config: MapConfig,
    submaps: Vec<Submap>,
    scans: u32,
}

impl SemanticMap {
    pub(crate) fn new(config: MapConfig) -> Self {
        Self { config, submaps: Vec::new(), scans: 0 }
    }

    /// Begins the next submap, which moves with the keyframe `anchor`.
    pub(crate) fn begin_submap(&mut self, anchor: usize) {
        self.submaps.push(Submap::new(anchor));
    }

    /// Keyframe of the present submap.
    pub(crate) fn present_anchor(&self) -> Option<usize> {
        self.submaps.last().map(|submap| submap.anchor)
    }

    /// Adds the ground and pure static points of a scan to the present submap; `odometry_from_sensor` is not corrected.
    pub(crate) fn add_scan(
        &mut self,
        points: &[LabelledPoint],
        intensities: &[f32],
        odometry_from_sensor: &MapPose,
    ) {
        let Some(submap) = self.submaps.last_mut() else { return };
        let (edge, scan) = (self.config.voxel_m, self.scans);
        let max_range2 = (self.config.max_range_m * self.config.max_range_m) as f32;
        // Points that follow each other lie in the same column most of the time.
        let mut present = None;
        for (point, intensity) in points.iter().zip(intensities) {
            let range2: f32 = point.position.iter().map(|v| v * v).sum();
            // Not-a-number and the zeros of missing returns fail the comparison.
            if enters(point.class) && range2 > 1e-6 && range2 <= max_range2 {
                let (key, offset) = split(odometry_from_sensor, point.position.map(f64::from), edge);
                let intensity = if intensity.is_finite() { *intensity } else { 0.0 };
                let column = column_of(&key);
                let voxels = match present.take() {
                    Some((known, voxels)) if known == column => voxels,
                    _ => submap.column(column),
                };
                let part = part(offset, edge as f32);
                voxels.entry(key).or_default().add(offset, part, point.class, intensity, scan);
                present = Some((column, voxels));
            }
        }
        self.scans += 1;
    }

    /// Counts the voxels that a scan saw through. `sensor_pose` gives the sensor's pose in the odometry frame as the submap of
    /// an anchor has it, or none where the two are not fixed to each other.
    pub(crate) fn add_free_space(
        &mut self,
        image: &RangeImage,
        sensor_pose: impl Fn(usize) -> Option<MapPose>,
    ) {
        let edge = self.config.voxel_m;
        let reach = (f64::from(FREE_SPACE_RANGE_M) / edge) as i32;
        for submap in &mut self.submaps {
            let Some(pose) = sensor_pose(submap.anchor) else { continue };
            let at: Key = pose.translation.vector.map(|v| (v / edge).floor() as i32).into();
            let sensor_from_submap = pose.inverse();
            for (key, voxel) in submap.near_mut(at, reach) {
                if (0..3).any(|i| (key[i] - at[i]).abs() > reach) {
                    continue;
                }
                let place: Point3<f64> = sensor_from_submap * mean_of(key, voxel, edge);
                let place = place.coords.map(|v| v as f32);
                if place.norm_squared() <= FREE_SPACE_RANGE_M * FREE_SPACE_RANGE_M
                    && image.sees_through(place.into(), FREE_SPACE_MARGIN_M)
                {
                    voxel.seen_through = voxel.seen_through.saturating_add(1);
                }
            }
        }
    }

    /// Ends the present submap: what lies in voxels of older ones goes there. `correction` is the transform from the odometry frame
    /// as the present submap has it to that of an older anchor, or none where the two are not fixed to each other.
    pub(crate) fn finish_submap(&mut self, correction: impl Fn(usize) -> Option<MapPose>) {
        let Some(mut ended) = self.submaps.pop() else { return };
        let edge = self.config.voxel_m;
        for older in &mut self.submaps {
            let Some(older_from_ended) = correction(older.anchor) else { continue };
            let unmoved = older_from_ended == MapPose::identity();
            ended.retain(|key, voxel| {
                let (target, offset) = match unmoved {
                    true => (*key, voxel.mean_offset()),
                    false => split(&older_from_ended, mean_of(key, voxel, edge).coords.into(), edge),
                };
                let Some(known) = older.get_mut(&target) else { return true };
                let parts = if unmoved { voxel.parts } else { 1 << part(offset, edge as f32) };
                known.merge(&Voxel { parts, ..voxel.share(1, 1, 0, offset) });
                false
            });
        }
        ended.shrink();
        self.submaps.push(ended);
    }

    /// Calls `visit` with the mean \[m, target frame\], class and number of points of every voxel within `reach_m` of the
    /// target's origin, and of some beyond; `target_from_submap` takes places of the odometry frame, as the submap of an anchor
    /// has them, to the target frame.
    pub(crate) fn for_voxels_near(
        &self,
        reach_m: f64,
        target_from_submap: impl Fn(usize) -> Option<MapPose>,
        mut visit: impl FnMut([f64; 3], SemanticClass, u32),
    ) {
        let edge = self.config.voxel_m;
        let reach = (reach_m / edge).ceil() as i32;
        for submap in &self.submaps {
            let Some(transform) = target_from_submap(submap.anchor) else { continue };
            let at = split(&transform.inverse(), [0.0; 3], edge).0;
            for (key, voxel) in submap.near(at, reach) {
                let place = transform * mean_of(key, voxel, edge);
                visit(place.coords.into(), voxel.class().0, voxel.count);
            }
        }
    }

    /// Voxels in memory.
    pub(crate) fn voxels_in_memory(&self) -> usize {
        self.submaps.iter().map(Submap::len).sum()
    }

    /// The whole map; `correction` takes the odometry frame of an anchor to the map.
    pub(crate) fn assemble(&self, correction: impl Fn(usize) -> MapPose) -> StaticMap {
        let mut all = Voxels::default();
        for submap in &self.submaps {
            let map_from_submap = correction(submap.anchor);
            let unmoved = map_from_submap == MapPose::identity();
            for (key, voxel) in submap.iter() {
                if unmoved {
                    all.entry(*key).or_default().merge(voxel);
                    continue;
                }
                for (target, part) in moved(key, voxel, &map_from_submap, &self.config) {
                    all.entry(target).or_default().merge(&part);
                }
            }
        }
        StaticMap::of(&self.config, all.iter())
    }
}

/// Classes that the map takes.
pub(crate) fn enters(class: SemanticClass) -> bool {
    matches!(class.motion(), MotionClass::Ground | MotionClass::PureStatic)
}

/// Voxel of a moved point, and the point's offset from the voxel's corner \[m\].
fn split(pose: &MapPose, point: [f64; 3], edge: f64) -> (Key, [f32; 3]) {
    let at: [f64; 3] = (pose * Point3::from(point)).coords.into();
    let corner = at.map(|v| (v / edge).floor());
    let offset = std::array::from_fn(|i| (at[i] - corner[i] * edge) as f32);
    (corner.map(|v| v as i32), offset)
}

/// The voxels in which the parts of a moved voxel lie, and what falls to each: its mean alone would leave holes where the
/// lattice turns.
fn moved(key: &Key, voxel: &Voxel, pose: &MapPose, config: &MapConfig) -> Vec<(Key, Voxel)> {
    let edge = config.voxel_m;
    let mut targets: Vec<(Key, [f32; 3], u32)> = Vec::with_capacity(8);
    for offset in voxel.places(edge as f32) {
        let place = std::array::from_fn(|i| f64::from(key[i]) * edge + f64::from(offset[i]));
        let (target, offset) = split(pose, place, edge);
        match targets.iter_mut().find(|(known, ..)| *known == target) {
            Some((_, sum, parts)) => {
                (0..3).for_each(|i| sum[i] += offset[i]);
                *parts += 1;
            }
            None => targets.push((target, offset, 1)),
        }
    }
    let of = voxel.parts.count_ones();
    let share =
        |sum: [f32; 3], parts: u32| voxel.share(parts, of, config.min_points, sum.map(|v| v / parts as f32));
    targets.into_iter().map(|(target, sum, parts)| (target, share(sum, parts))).collect()
}

/// Mean of the points of a voxel \[m\].
fn mean_of(key: &Key, voxel: &Voxel, edge: f64) -> Point3<f64> {
    let offset = voxel.mean_offset();
    Point3::from(std::array::from_fn::<f64, 3, _>(|i| f64::from(key[i]) * edge + f64::from(offset[i])))
}

#[cfg(test)]
mod tests;
