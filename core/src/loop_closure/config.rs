//! Parameters of the loop detection.

use super::words::MAX_NEIGHBOURS;
use crate::error::{ParameterError, all_within};

/// What a word of the table is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Rule {
    /// A triangle of keypoints with their classes.
    Triangles,
    /// The paper's: a value in one dimension of a LinK3D descriptor.
    Bow3d,
}

/// Parameters of LinK3D and BoW3D, for [`Rule::Bow3d`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Bow3dConfig {
    /// Keypoints, nearest first, whose descriptors make words.
    pub descriptors: u32,
    /// Words with more than this many times the mean of entries are not looked up (Th_r).
    pub max_ratio: f32,
    /// Words that one descriptor must have in common with a place (Th_f).
    pub min_votes: u32,
    /// Sectors that two descriptors must have in common to match.
    pub min_similarity: u32,
    /// Matches that a place must have to be verified, at least 3.
    pub min_matches: u32,
    /// Draws of RANSAC, at most 10000.
    pub draws: u32,
}

/// Parameters of the loop detection.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// What a word of the table is.
    pub rule: Rule,
    /// Points farther from the keyframe than this, horizontally, make no keypoints [m].
    pub max_range_m: f32,
    /// Side of the columns that points are gathered in [m].
    pub column_m: f32,
    /// Points that make a keypoint.
    pub min_points: u32,
    /// Height that makes a keypoint [m].
    pub min_height_m: f32,
    /// Things wider than this are no keypoints [m].
    pub max_width_m: f32,
    /// Nearest keypoints that each keypoint forms triangles with, 2 to 12.
    pub neighbours: u32,
    /// Keypoints nearer to each other than this form no triangle [m].
    pub min_side_m: f32,
    /// Sides of triangles are rounded to multiples of this [m].
    pub side_step_m: f32,
    /// Sides of the same triangle, seen twice, differ by at most this [m].
    pub side_tolerance_m: f32,
    /// Words that this many times more entries than the mean have are not looked up (BoW3D's ratio test).
    pub max_ratio: f32,
    /// Triangles in common that make a place a candidate (BoW3D's frequency test).
    pub min_votes: u32,
    /// A keypoint lies on another one when they are nearer than this, horizontally [m].
    pub inlier_radius_m: f32,
    /// Keypoints that must lie on keypoints of the old place.
    pub min_inliers: u32,
    /// Score that makes a loop, 0..1: share of the keypoints that lie on keypoints of the old place, each weighed by
    /// 1 - (distance / inlier_radius_m)^2.
    pub min_score: f32,
    /// Another transform to the same place may lay this share of the inliers on keypoints at most, 0..1: a street whose
    /// trees stand at equal distances fits itself in many ways.
    pub max_runner_up: f32,
    /// A loop along the same direction is no farther than this [m].
    pub max_distance_m: f32,
    /// A loop against the old direction, in the other lane, is no farther than this [m].
    pub max_reverse_distance_m: f32,
    /// Places younger than this are not asked for [s].
    pub min_gap_s: f32,
    /// LinK3D and BoW3D.
    pub bow3d: Bow3dConfig,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        rule: Rule::Triangles,
        max_range_m: 45.0,
        column_m: 0.3,
        min_points: 8,
        min_height_m: 0.3,
        max_width_m: 2.0,
        neighbours: 8,
        min_side_m: 2.0,
        side_step_m: 0.4,
        side_tolerance_m: 0.15,
        max_ratio: 20.0,
        min_votes: 4,
        inlier_radius_m: 0.3,
        min_inliers: 10,
        min_score: 0.3,
        max_runner_up: 0.75,
        max_distance_m: 2.98,
        max_reverse_distance_m: 9.9,
        min_gap_s: 30.0,
        bow3d: Bow3dConfig {
            descriptors: 5,
            max_ratio: 3.5,
            min_votes: 5,
            min_similarity: 4,
            min_matches: 12,
            draws: 400,
        },
    };

    /// The paper's words.
    pub const PAPER: Self = Self { rule: Rule::Bow3d, ..Self::DEFAULT };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if let Err(error) = self.check_words() {
            return Err(error);
        }
        self.check_thresholds()
    }

    /// Keypoints and words.
    const fn check_words(&self) -> Result<(), ParameterError> {
        if !all_within(&[self.max_range_m], 10.0, 200.0) {
            return refuse("loop_closure.max_range_m", "10 to 200 m");
        }
        if !all_within(&[self.column_m], 0.05, 2.0) {
            return refuse("loop_closure.column_m", "0.05 to 2 m");
        }
        if !all_within(&[self.min_height_m, self.max_width_m], 0.0, 10.0) {
            return refuse("loop_closure.min_height_m, max_width_m", "0 to 10 m");
        }
        if self.neighbours < 2 || self.neighbours as usize > MAX_NEIGHBOURS {
            return refuse("loop_closure.neighbours", "2 to 12");
        }
        if !all_within(&[self.min_side_m], 0.1, 50.0) {
            return refuse("loop_closure.min_side_m", "0.1 to 50 m");
        }
        if !all_within(&[self.side_step_m], 0.05, 5.0) {
            return refuse("loop_closure.side_step_m", "0.05 to 5 m");
        }
        if !(self.side_tolerance_m >= 0.0 && self.side_tolerance_m <= self.side_step_m) {
            return refuse("loop_closure.side_tolerance_m", "0 to side_step_m");
        }
        Ok(())
    }

    /// What makes a candidate, and what a loop.
    const fn check_thresholds(&self) -> Result<(), ParameterError> {
        if !all_within(&[self.max_ratio, self.bow3d.max_ratio], 1.0, 1000.0) {
            return refuse("loop_closure.max_ratio, loop_closure.bow3d.max_ratio", "1 to 1000");
        }
        if !all_within(&[self.inlier_radius_m], 0.05, 5.0) {
            return refuse("loop_closure.inlier_radius_m", "0.05 to 5 m");
        }
        if self.min_inliers < 3 {
            return refuse("loop_closure.min_inliers", "at least 3");
        }
        if self.bow3d.min_matches < 3 {
            return refuse("loop_closure.bow3d.min_matches", "at least 3");
        }
        if self.bow3d.draws > 10_000 {
            return refuse("loop_closure.bow3d.draws", "at most 10000");
        }
        if !all_within(&[self.min_score, self.max_runner_up], 0.0, 1.0) {
            return refuse("loop_closure.min_score, max_runner_up", "0 to 1");
        }
        if !all_within(&[self.max_distance_m, self.max_reverse_distance_m, self.min_gap_s], 0.0, f32::MAX) {
            return refuse("loop_closure.max_distance_m, max_reverse_distance_m, min_gap_s", "at least 0");
        }
        Ok(())
    }
}

const fn refuse(parameter: &'static str, expected: &'static str) -> Result<(), ParameterError> {
    Err(ParameterError { parameter, expected })
}
