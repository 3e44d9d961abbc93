//! Stage 6, section 3.4, on the odometry's own buffers: hulls against the submap, the ground, the dense refinement.

use nalgebra::{Matrix6, Point3, Translation3, Vector3};

use super::{Odometry, group_of};
use crate::estimate::{DenseEvidence, Evidence, Fallback, FrameStatus};
use crate::landmarks::{Landmark, MotionState};
use crate::pose::{self, PlanarPose, Pose};
use crate::precise_pose::dense::{self, SourcePoint};
use crate::precise_pose::vertical;
use crate::preliminary_pose;
use crate::preliminary_pose::{hull_registration, pairing};

/// When the speed is not known, starts of the dense refinement are tried this far apart along the vehicle's axis [m],
const RECOVERY_STEP_M: f32 = 0.4;
/// and this many of them in each direction: enough for 40 m/s at 10 scans a second.
const RECOVERY_STEPS: u32 = 10;

/// A start farther away must explain the scan this much better: ground alone fits everywhere.
const RECOVERY_MARGIN: f32 = 1.02;

impl<
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
    const RANGE_COLUMNS: usize,
> Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS, RANGE_COLUMNS>
{
    /// Section 3.4. Gives the pose, how it came about, and its information matrix.
    pub(super) fn precise_pose(
        &mut self,
        predicted: &Pose,
        preliminary: &Pose,
        evidence: &mut Evidence,
    ) -> (Pose, FrameStatus, Matrix6<f32>) {
        let config = self.config.precise_pose;
        if self.frame == 0 {
            return (*predicted, FrameStatus::First, Matrix6::identity() * 1e8);
        }
        if self.cells.cells().is_empty() {
            return (*predicted, FrameStatus::Predicted(Fallback::EmptyScan), Matrix6::zeros());
        }
        let mut start = *preliminary;
        if config.horizontal {
            start = self.horizontal_pose(preliminary, evidence);
        }
        if config.dense.enabled {
            return self.dense_pose(predicted, &start, evidence);
        }
        let (ground, ground_evidence) = vertical::fit(&config.vertical, self.cells.cells());
        evidence.ground = ground_evidence;
        let pose = match ground {
            Some(ground) => self.with_vertical(&start, &ground),
            None => start,
        };
        let status = match evidence.horizontal.pairs {
            0 => FrameStatus::Predicted(Fallback::NoLandmarks),
            _ => FrameStatus::Registered,
        };
        (pose, status, Matrix6::identity() * 1e3)
    }

    /// Section 3.4.1: hulls of the scan against those of the submap.
    fn horizontal_pose(&mut self, start: &Pose, evidence: &mut Evidence) -> Pose {
        let config = self.config.precise_pose;
        let usable = |l: &Landmark| matches!(l.state, MotionState::PureStatic | MotionState::SemiStatic);
        pairing::pair(
            &config.pairing,
            self.map_landmarks.iter().map(|m| &m.landmark),
            &self.landmarks,
            start,
            usable,
            &mut self.candidates,
        );
        hull_registration::pair_hulls(
            &config.hulls,
            |i| self.map_landmarks.get(i).map(|m| &m.landmark),
            &self.landmarks,
            start,
            &self.candidates,
            &mut self.pairs,
        );
        let from = PlanarPose::from_pose(start);
        let seed = 1 << 32 | u64::from(self.frame);
        let (to, horizontal) = hull_registration::register(&config.hulls, seed, from, &self.pairs);
        evidence.horizontal = horizontal;
        preliminary_pose::with_planar(start, &from, &to)
    }

    /// Section 3.4.2, with the paper's zero roll.
    fn with_vertical(&self, horizontal: &Pose, ground: &vertical::Ground) -> Pose {
        let before = &self.motion.local_from_sensor;
        let moved = before.inverse_transform_point(&horizontal.translation.vector.into());
        let along = moved.x * ground.mean.slope_x + moved.y * ground.mean.slope_y;
        let (_, pitch_before, _) = pose::roll_pitch_yaw(&before.rotation);
        // Pitch is positive nose down; a road that bends upwards lifts the nose.
        let pitch = pitch_before - ground.bend_rad * moved.x / ground.apart_m;
        let yaw = PlanarPose::from_pose(horizontal).yaw;
        let step = before * Point3::new(moved.x, moved.y, along);
        let t = horizontal.translation.vector;
        Pose::from_parts(Vector3::new(t.x, t.y, step.z).into(), pose::from_roll_pitch_yaw(0.0, pitch, yaw))
    }

    /// Dense refinement, from the better of two starts.
    fn dense_pose(
        &mut self,
        predicted: &Pose,
        start: &Pose,
        evidence: &mut Evidence,
    ) -> (Pose, FrameStatus, Matrix6<f32>) {
        let config = self.config.precise_pose;
        self.gather_source();
        let path_m = self.motion.path_m;
        let score =
            |p: &Pose| dense::score(&config.dense, &config.voxels, &self.voxels, path_m, &self.source, p);
        let mut best = (score(predicted), *predicted);
        let mut consider = |candidate: Pose, margin: f32| {
            let value = score(&candidate);
            if value > margin * best.0 {
                best = (value, candidate);
            }
        };
        consider(*start, 1.0);
        if self.motion.lost > 0 {
            // The speed is not known: at the start, or after frames that were not registered.
            for step in 1..=RECOVERY_STEPS {
                for x in [RECOVERY_STEP_M, -RECOVERY_STEP_M] {
                    consider(predicted * Translation3::new(x * step as f32, 0.0, 0.0), RECOVERY_MARGIN);
                }
            }
        }
        let start = best.1;
        let result =
            dense::register(&config.dense, &config.voxels, &self.voxels, path_m, &self.source, &start);
        evidence.dense = result.evidence;
        let corrected_m = (result.local_from_sensor.translation.vector - start.translation.vector).norm();
        let DenseEvidence { inliers, upright_inliers, .. } = result.evidence;
        if inliers < config.dense.min_inliers || dense::misfits(&config.dense, &result.evidence) {
            return (*predicted, FrameStatus::Predicted(Fallback::TooFewInliers), Matrix6::zeros());
        }
        if upright_inliers < config.dense.min_upright_inliers {
            return (*predicted, FrameStatus::Predicted(Fallback::Degenerate), Matrix6::zeros());
        }
        if !(corrected_m <= config.dense.max_correction_m) {
            return (*predicted, FrameStatus::Predicted(Fallback::Degenerate), Matrix6::zeros());
        }
        if !dense::determines(&config.dense, &result.information) {
            // What is not determined was held at the prediction; the rest is better than it.
            return (
                result.local_from_sensor,
                FrameStatus::Predicted(Fallback::Degenerate),
                Matrix6::zeros(),
            );
        }
        (result.local_from_sensor, FrameStatus::Registered, result.information)
    }

    /// The cells that stand still: ground without far grass, pure static, and semi-static landmarks.
    fn gather_source(&mut self) {
        self.source.clear();
        let far_m = self.max_terrain_range_m();
        for cell in self.cells.cells() {
            if let Some(group) = group_of(far_m, cell, &self.landmarks) {
                // As many source points as cells fit.
                let _ = self.source.push(SourcePoint { position: cell.mean(), group });
            }
        }
    }
}
