//! The dense part of the local submap: voxels that hold the distribution of the points seen in them.
//!
//! A set-associative store: a voxel has `WAYS` possible places, all in one bucket. Finding, adding and replacing
//! cost the same however long the drive is. What is replaced first: a voxel outside the window, then the one seen
//! longest ago.

#[cfg(feature = "snapshot")]
mod snapshot;

use nalgebra::{Matrix3, Vector3};

use crate::error::ParameterError;
use crate::geometry::eigen;
use crate::math::{self, floor_i32};
use crate::scan::{MotionClass, SemanticClass};

/// Places of a voxel.
pub const WAYS: usize = 8;

/// Groups of classes that may be registered with each other: labels inside a group are easily confused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs, reason = "plain words")]
pub enum Group {
    Ground = 1,
    Structure,
    Vegetation,
    Thin,
    Movable,
}

impl Group {
    /// The group of a class that stands still.
    pub const fn of(class: SemanticClass) -> Self {
        use SemanticClass::*;
        match class {
            Building | Fence | OtherStructure | OtherObject => Self::Structure,
            Vegetation => Self::Vegetation,
            Trunk | Pole | TrafficSign => Self::Thin,
            other => match other.motion() {
                MotionClass::Ground => Self::Ground,
                _ => Self::Movable,
            },
        }
    }
}

/// What a voxel knows about a surface.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Voxel {
    /// Mean of the points [m], relative to the centre of the voxel.
    mean: [f32; 3],
    /// Covariance xx, xy, xz, yy, yz, zz [m2].
    covariance: [f32; 6],
    /// Weight of the points so far, bounded by `max_weight`.
    weight: f32,
    /// Weight when `across` was computed.
    weight_at_shape: f32,
    /// Path driven [m] when last seen.
    seen_at_m: f32,
    /// Directions in which the surface fixes a position, each divided by its standard deviation [1/m]; zero where none is.
    across: [[f32; 3]; 2],
}

impl Voxel {
    const EMPTY: Self = Self {
        mean: [0.0; 3],
        covariance: [0.0; 6],
        weight: 0.0,
        weight_at_shape: 0.0,
        seen_at_m: f32::NEG_INFINITY,
        across: [[0.0; 3]; 2],
    };

    /// Directions in which the surface fixes a position, each divided by its standard deviation [1/m]: one for a plane,
    /// two for a rod.
    #[inline]
    pub fn across(&self) -> impl Iterator<Item = Vector3<f32>> {
        self.across.iter().filter(|a| **a != [0.0; 3]).map(|a| Vector3::from(*a))
    }

    /// The surface is an upright rod: it fixes a position in two directions.
    #[inline]
    pub fn is_rod(&self) -> bool {
        self.across[1] != [0.0; 3]
    }

    /// The voxel says something about position.
    #[inline]
    pub fn is_informative(&self) -> bool {
        self.across[0] != [0.0; 3]
    }
}

fn symmetric(m: &[f32; 6]) -> Matrix3<f32> {
    Matrix3::new(m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5])
}

fn packed(m: &Matrix3<f32>) -> [f32; 6] {
    [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)]]
}

/// Parameters of the submap's voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Side of a voxel [m].
    pub voxel_m: f32,
    /// A voxel is part of the submap for this much path after it was last seen [m].
    pub window_m: f32,
    /// Standard deviation of a range measurement [m].
    pub noise_m: f32,
    /// Standard deviation of what the calibration leaves in a beam's elevation [rad], times the square root of the number
    /// of cells that share the error.
    pub elevation_noise_rad: f32,
    /// Points a voxel remembers; later ones displace earlier ones.
    pub max_weight: f32,
    /// Points before a voxel is used.
    pub min_weight: f32,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        voxel_m: 1.0,
        window_m: 60.0,
        noise_m: 0.03,
        elevation_noise_rad: 0.001,
        max_weight: 2000.0,
        min_weight: 8.0,
    };

    /// Weight of a point of a group, seen from a distance whose square is given [m2], against one nearby.
    pub fn point_weight(&self, group: Group, distance2_m2: f32) -> f32 {
        let ratio = self.elevation_noise_rad / self.noise_m;
        if group == Group::Ground { 1.0 / (1.0 + ratio * ratio * distance2_m2) } else { 1.0 }
    }

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if !(self.voxel_m >= 0.1 && self.voxel_m <= 5.0) {
            return Err(ParameterError { parameter: "precise_pose.voxels.voxel_m", expected: "0.1 to 5 m" });
        }
        if !(self.elevation_noise_rad >= 0.0) {
            let parameter = "precise_pose.voxels.elevation_noise_rad";
            return Err(ParameterError { parameter, expected: "zero or positive" });
        }
        if !(self.window_m > 0.0 && self.noise_m > 0.0 && self.max_weight >= 1.0 && self.min_weight >= 1.0) {
            let parameter = "precise_pose.voxels.window_m, noise_m, max_weight and min_weight";
            return Err(ParameterError { parameter, expected: "positive, the weights at least 1" });
        }
        Ok(())
    }
}

/// The voxels: `SETS` (a power of two) buckets of [`WAYS`].
///
/// Invariant: a key is 0 (free) or unique in its bucket; lattice coordinates are absolute, metres are relative to
/// the anchor, so that re-anchoring moves no voxel.
pub struct VoxelMap<const SETS: usize> {
    keys: [[u64; WAYS]; SETS],
    voxels: [[Voxel; WAYS]; SETS],
    anchor: [i32; 3],
    used: u32,
    evicted: u32,
}

impl<const SETS: usize> VoxelMap<SETS> {
    /// An empty map.
    pub const fn new() -> Self {
        const { assert!(SETS.is_power_of_two(), "SETS must be a power of two") };
        Self {
            keys: [[0; WAYS]; SETS],
            voxels: [[Voxel::EMPTY; WAYS]; SETS],
            anchor: [0; 3],
            used: 0,
            evicted: 0,
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.keys.fill([0; WAYS]);
        (self.anchor, self.used, self.evicted) = ([0; 3], 0, 0);
    }

    /// Places ever used, and voxels replaced while still within the window.
    pub fn usage(&self) -> (u32, u32) {
        (self.used, self.evicted)
    }

    /// Moves the origin of the local frame by whole voxels.
    pub fn shift_anchor(&mut self, voxels: [i32; 3]) {
        for (a, v) in self.anchor.iter_mut().zip(voxels) {
            *a += v;
        }
    }

    /// Key, bucket and centre [m, local frame] of the voxel around a point of the local frame.
    #[inline]
    fn locate(
        &self,
        voxel_m: f32,
        inverse: f32,
        p: &Vector3<f32>,
        group: Group,
    ) -> (u64, usize, Vector3<f32>) {
        let at = [floor_i32(p.x * inverse), floor_i32(p.y * inverse), floor_i32(p.z * inverse)];
        let bits = |i: usize, mask: u64| (at[i].wrapping_add(self.anchor[i])) as u32 as u64 & mask;
        let key =
            (group as u64) << 60 | bits(0, 0x3F_FFFF) << 38 | bits(1, 0x3F_FFFF) << 16 | bits(2, 0xFFFF);
        let set = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & (SETS - 1);
        let centre = Vector3::new(at[0] as f32 + 0.5, at[1] as f32 + 0.5, at[2] as f32 + 0.5) * voxel_m;
        (key, set, centre)
    }

    /// The voxel around a point, if it is part of the submap and informative; with the mean of its points [m, local frame].
    #[inline]
    pub fn find(
        &self,
        config: &Config,
        p: &Vector3<f32>,
        group: Group,
        path_m: f32,
    ) -> Option<(&Voxel, Vector3<f32>)> {
        let (key, set, centre) = self.locate(config.voxel_m, 1.0 / config.voxel_m, p, group);
        let way = self.keys[set].iter().position(|k| *k == key)?;
        let voxel = &self.voxels[set][way];
        let usable = path_m - voxel.seen_at_m <= config.window_m && voxel.is_informative();
        usable.then(|| (voxel, centre + Vector3::from(voxel.mean)))
    }

    /// What a point is registered with: a voxel, its mean [m, local frame], and the voxel's group. What is called vegetation
    /// and lies in the ground (3 standard deviations) is ground: the feet of bushes, and grass with a wrong label. If it fits
    /// no voxel of vegetation, but one of structure, it is structure. Not the other way: vegetation holds height.
    #[inline]
    pub fn partner(
        &self,
        config: &Config,
        p: &Vector3<f32>,
        group: Group,
        path_m: f32,
    ) -> Option<(&Voxel, Vector3<f32>, Group)> {
        let find = |group| self.find(config, p, group, path_m).map(|(voxel, mean)| (voxel, mean, group));
        let fits = |(voxel, mean, _): &(&Voxel, Vector3<f32>, Group)| {
            voxel.across().all(|a| math::abs(a.dot(&(p - mean))) < 3.0)
        };
        let own = || find(group);
        if group != Group::Vegetation {
            return own();
        }
        let fitting = |group| find(group).filter(fits);
        fitting(Group::Ground)
            .or_else(|| fitting(Group::Vegetation))
            .or_else(|| fitting(Group::Structure))
            .or_else(own)
    }

    /// Merges points of weight `count` with the given mean [m] and covariance [m2] (local frame) into their voxel.
    pub fn merge(
        &mut self,
        config: &Config,
        group: Group,
        path_m: f32,
        mean: &Vector3<f32>,
        covariance: &Matrix3<f32>,
        count: f32,
    ) {
        let (key, set, centre) = self.locate(config.voxel_m, 1.0 / config.voxel_m, mean, group);
        let way = self.claim(config, set, key, path_m);
        let voxel = &mut self.voxels[set][way];
        let total = voxel.weight + count;
        let (old, new) = (voxel.weight / total, count / total);
        let delta = mean - centre - Vector3::from(voxel.mean);
        let spread = delta * delta.transpose() * (old * new);
        let merged = symmetric(&voxel.covariance) * old + covariance * new + spread;
        voxel.mean = (Vector3::from(voxel.mean) + delta * new).into();
        voxel.covariance = packed(&merged);
        voxel.weight = total.min(config.max_weight);
        voxel.seen_at_m = path_m;
        if total >= config.min_weight && total >= 1.25 * voxel.weight_at_shape {
            voxel.weight_at_shape = voxel.weight;
            voxel.across = across(config, group, merged);
        }
    }

    /// The place of a key: its own, a free or outlived one, or that of the voxel seen longest ago.
    fn claim(&mut self, config: &Config, set: usize, key: u64, path_m: f32) -> usize {
        if let Some(way) = self.keys[set].iter().position(|k| *k == key) {
            if path_m - self.voxels[set][way].seen_at_m > config.window_m {
                self.voxels[set][way] = Voxel::EMPTY;
            }
            return way;
        }
        let way = match self.keys[set].iter().position(|k| *k == 0) {
            Some(free) => {
                self.used += 1;
                free
            }
            None => {
                let seen = |w: &usize| self.voxels[set][*w].seen_at_m;
                let oldest = (0..WAYS).min_by(|a, b| seen(a).total_cmp(&seen(b))).unwrap_or(0);
                if path_m - seen(&oldest) <= config.window_m {
                    self.evicted += 1;
                }
                oldest
            }
        };
        self.keys[set][way] = key;
        self.voxels[set][way] = Voxel::EMPTY;
        way
    }
}

/// What a distribution of points says about the position of a surface.
///
/// Across a plane: the inverse of the variance. Along it: nothing. A single scan line on a plane looks like a rod and
/// would seem to fix two directions; only upright rods (poles, trunks) are believed. What is more than 17 degrees off
/// upright in structures and in what may move fixes nothing: ground with a wrong label would hold the height.
fn across(config: &Config, group: Group, covariance: Matrix3<f32>) -> [[f32; 3]; 2] {
    const NOTHING: [f32; 3] = [0.0; 3];
    let eigen = eigen::symmetric(&covariance);
    let value = eigen.map(|(value, _)| value.max(0.0));
    let axis = eigen.map(|(_, axis)| axis);
    let weighted = |k: usize| (axis[k] / math::sqrt(value[k] + config.noise_m * config.noise_m)).into();
    let rod = value[1] < 0.1 * value[2] && value[1] < 0.02;
    let upright = axis[2].z * axis[2].z > 0.8;
    match (rod, group) {
        (true, Group::Ground) => [NOTHING; 2],
        (true, _) if upright => [weighted(0), weighted(1)],
        (true, _) => [NOTHING; 2],
        (false, Group::Ground) if axis[0].z * axis[0].z < 0.6 => [NOTHING; 2],
        (false, Group::Structure | Group::Movable) if axis[0].z * axis[0].z > 0.09 => [NOTHING; 2],
        (false, _) => [weighted(0), NOTHING],
    }
}
