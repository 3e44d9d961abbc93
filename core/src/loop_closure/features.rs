//! Keypoints from pure static points (LinK3D's aggregation keypoints, section 3.5).
//!
//! LinK3D groups edge points of the rings of one sensor. The points here come in any order, from any sensor, from one
//! scan or several, and have classes: what LinK3D's edges are there to find, thin upright things, is found by its class.
//! The points of trunks, poles, signs and other objects are gathered in columns on a horizontal grid; columns that
//! touch are one thing, whatever mixture of these classes the segmentation saw in it; the majority names it.

use heapless::Vec;

use super::Config;
use crate::capacity::KEYPOINTS;
use crate::math::{self, floor_i32};
use crate::pose::Pose;
use crate::scan::{LabelledPoint, SemanticClass};

/// The classes that keypoints are made of.
pub const KEYPOINT_CLASSES: [SemanticClass; 4] =
    [SemanticClass::Trunk, SemanticClass::Pole, SemanticClass::TrafficSign, SemanticClass::OtherObject];

/// One thin upright thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Mean of its points [m], keyframe frame.
    pub position: [f32; 3],
    /// Class of most of its points, one of [`KEYPOINT_CLASSES`].
    pub class: SemanticClass,
    /// Points it was made of.
    pub points: u16,
}

impl Keypoint {
    /// Horizontal distance from the origin of the keyframe [m].
    pub(super) fn range_m(&self) -> f32 {
        math::sqrt(self.position[0] * self.position[0] + self.position[1] * self.position[1])
    }
}

/// The features of a keyframe: plain data, all that needs to be kept to find the place again.
///
/// Everything else (triangles, descriptors, words) follows from the keypoints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Keypoints, nearest to the origin of the keyframe first, as LinK3D sorts them.
    pub keypoints: Vec<Keypoint, KEYPOINTS>,
    /// Keypoints that did not fit; the farthest are left out.
    pub left_out: u32,
}

impl Features {
    /// Features from keypoints in any order, as read from a saved map. Those that are not finite are passed over.
    pub fn from_keypoints(keypoints: impl IntoIterator<Item = Keypoint>) -> Self {
        let mut features = Self::default();
        let finite = |keypoint: &Keypoint| keypoint.position.iter().all(|v| v.is_finite());
        for keypoint in keypoints.into_iter().filter(finite) {
            features.insert(keypoint);
        }
        features
    }

    /// Horizontal range up to which the keypoints are complete [m].
    pub(super) fn reach_m(&self, config: &Config) -> f32 {
        match self.keypoints.last() {
            Some(farthest) if self.keypoints.is_full() => farthest.range_m(),
            _ => config.max_range_m,
        }
    }

    /// Keeps the nearest [`KEYPOINTS`].
    fn insert(&mut self, keypoint: Keypoint) {
        let range_m = keypoint.range_m();
        let at = self.keypoints.iter().position(|k| k.range_m() > range_m).unwrap_or(self.keypoints.len());
        if self.keypoints.is_full() {
            self.left_out += 1;
            if at == self.keypoints.len() {
                return;
            }
            self.keypoints.pop();
        }
        // There is room for one.
        let _ = self.keypoints.insert(at, keypoint);
    }
}

/// A column of the horizontal grid: the points in it.
#[derive(Clone, Copy, Debug)]
struct Column {
    at: [i16; 2],
    /// Column of the same thing, towards its root; the root points at itself.
    parent: u16,
    /// Smallest and largest column of the thing.
    extent: [[i16; 2]; 2],
    votes: [u32; KEYPOINT_CLASSES.len()],
    /// Sums of the offsets from the column's corner, and of the heights [m].
    sum: [f32; 3],
    low_m: f32,
    high_m: f32,
}

const EMPTY: u16 = u16::MAX;

/// Gathers the points of a keyframe, one scan or several, and finds the keypoints in them.
///
/// At most `COLUMNS` columns (a power of two, at most 32768); points of further columns are left out and counted.
pub struct FeatureExtractor<const COLUMNS: usize> {
    columns: Vec<Column, COLUMNS>,
    slots: [[u16; 2]; COLUMNS],
    left_out: u32,
}

impl<const COLUMNS: usize> FeatureExtractor<COLUMNS> {
    /// No points.
    pub const fn new() -> Self {
        const {
            assert!(
                COLUMNS.is_power_of_two() && COLUMNS <= 32768,
                "COLUMNS must be a power of two, at most 32768"
            )
        };
        Self { columns: Vec::new(), slots: [[EMPTY; 2]; COLUMNS], left_out: 0 }
    }

    /// Forgets all points: the next keyframe begins.
    pub fn clear(&mut self) {
        self.columns.clear();
        self.slots.fill([EMPTY; 2]);
        self.left_out = 0;
    }

    /// Adds the points of a scan that was taken at `keyframe_from_sensor`. Only pure static classes are looked at.
    pub fn add(&mut self, config: &Config, points: &[LabelledPoint], keyframe_from_sensor: &Pose) {
        let rotation = keyframe_from_sensor.rotation.to_rotation_matrix();
        let per_metre = 1.0 / config.column_m;
        for point in points {
            let Some(class) = KEYPOINT_CLASSES.iter().position(|c| *c == point.class) else { continue };
            let p =
                rotation * nalgebra::Vector3::from(point.position) + keyframe_from_sensor.translation.vector;
            let range2 = p.x * p.x + p.y * p.y;
            if range2 <= config.max_range_m * config.max_range_m && p.z.is_finite() {
                self.add_point(p.into(), class, per_metre, config.column_m);
            }
        }
    }

    /// Points that were left out for want of columns.
    pub fn left_out(&self) -> u32 {
        self.left_out
    }

    fn add_point(&mut self, p: [f32; 3], class: usize, per_metre: f32, side_m: f32) {
        let at = [0, 1].map(|k| floor_i32(p[k] * per_metre) as i16);
        let Some(column) = self.find_or_add(at) else {
            self.left_out += 1;
            return;
        };
        let column = &mut self.columns[column];
        column.votes[class] += 1;
        column.sum[0] += p[0] - f32::from(at[0]) * side_m;
        column.sum[1] += p[1] - f32::from(at[1]) * side_m;
        column.sum[2] += p[2];
        column.low_m = column.low_m.min(p[2]);
        column.high_m = column.high_m.max(p[2]);
    }

    /// The slot of a column, or the empty one where it belongs.
    fn slot(&self, at: [i16; 2]) -> usize {
        let key = u64::from(at[0] as u16) << 16 | u64::from(at[1] as u16);
        let mask = 2 * COLUMNS - 1;
        let mut slot = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as usize & mask;
        loop {
            let index = self.slots[slot / 2][slot % 2];
            if index == EMPTY || self.columns[index as usize].at == at {
                return slot;
            }
            slot = (slot + 1) & mask;
        }
    }

    fn find(&self, at: [i16; 2]) -> Option<usize> {
        let slot = self.slot(at);
        let index = self.slots[slot / 2][slot % 2];
        (index != EMPTY).then_some(index as usize)
    }

    fn find_or_add(&mut self, at: [i16; 2]) -> Option<usize> {
        let slot = self.slot(at);
        let index = self.slots[slot / 2][slot % 2];
        if index != EMPTY {
            return Some(index as usize);
        }
        let index = self.columns.len();
        let column = Column {
            at,
            parent: index as u16,
            extent: [at; 2],
            votes: [0; KEYPOINT_CLASSES.len()],
            sum: [0.0; 3],
            low_m: f32::INFINITY,
            high_m: f32::NEG_INFINITY,
        };
        self.columns.push(column).ok()?;
        self.slots[slot / 2][slot % 2] = index as u16;
        Some(index)
    }

    /// The features of the points added since the last [`Self::clear`].
    pub fn finish(&mut self, config: &Config) -> Features {
        self.join_columns();
        self.gather_in_roots(config.column_m);
        let mut features = Features::default();
        for index in 0..self.columns.len() {
            let column = &self.columns[index];
            if column.parent as usize == index
                && let Some(keypoint) = keypoint(config, column)
            {
                features.insert(keypoint);
            }
        }
        features
    }

    /// Columns that touch, corners included, are one thing.
    fn join_columns(&mut self) {
        for index in 0..self.columns.len() {
            let at = self.columns[index].at;
            for (x, y) in [(1, -1), (1, 0), (1, 1), (0, 1)] {
                if let Some(other) = self.find([at[0].wrapping_add(x), at[1].wrapping_add(y)]) {
                    let (a, b) = (self.root(index), self.root(other));
                    self.columns[a.max(b)].parent = a.min(b) as u16;
                }
            }
        }
    }

    fn root(&mut self, index: usize) -> usize {
        let mut at = index;
        while self.columns[at].parent as usize != at {
            let above = self.columns[at].parent as usize;
            self.columns[at].parent = self.columns[above].parent;
            at = self.columns[at].parent as usize;
        }
        at
    }

    /// Adds each column to its root: sums relative to the root's corner.
    fn gather_in_roots(&mut self, side_m: f32) {
        for index in 0..self.columns.len() {
            let root = self.root(index);
            if root == index {
                continue;
            }
            let part = self.columns[index];
            let whole = &mut self.columns[root];
            let count = part.count() as f32;
            for k in 0..2 {
                whole.extent[0][k] = whole.extent[0][k].min(part.at[k]);
                whole.extent[1][k] = whole.extent[1][k].max(part.at[k]);
                let corner = i32::from(part.at[k]) - i32::from(whole.at[k]);
                whole.sum[k] += part.sum[k] + count * corner as f32 * side_m;
            }
            whole.sum[2] += part.sum[2];
            whole.low_m = whole.low_m.min(part.low_m);
            whole.high_m = whole.high_m.max(part.high_m);
            for (votes, more) in whole.votes.iter_mut().zip(part.votes) {
                *votes += more;
            }
        }
    }
}

impl Column {
    fn count(&self) -> u32 {
        self.votes.iter().sum()
    }
}

/// The keypoint of a thing, if it has enough points and height, and is thin.
fn keypoint(config: &Config, thing: &Column) -> Option<Keypoint> {
    let count = thing.count();
    let columns = [0, 1].map(|k| i32::from(thing.extent[1][k]) - i32::from(thing.extent[0][k]));
    let width_m = columns[0].max(columns[1]) as f32 * config.column_m;
    let height_m = thing.high_m - thing.low_m;
    if count < config.min_points || height_m < config.min_height_m || width_m > config.max_width_m {
        return None;
    }
    let corner = [f32::from(thing.at[0]) * config.column_m, f32::from(thing.at[1]) * config.column_m, 0.0];
    let winner = (0..KEYPOINT_CLASSES.len()).rev().max_by_key(|c| thing.votes[*c])?;
    Some(Keypoint {
        position: [0, 1, 2].map(|k| corner[k] + thing.sum[k] / count as f32),
        class: KEYPOINT_CLASSES[winner],
        points: count.min(u32::from(u16::MAX)) as u16,
    })
}
