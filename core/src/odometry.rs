//! The story of one frame, in the paper's order. Only this file knows the order of the stages.

mod precise;
#[cfg(feature = "snapshot")]
mod snapshot;

use heapless::Vec;
use nalgebra::{Point3, Vector3};

use crate::calibration::Calibration;
use crate::capacity::PAIRS;
use crate::config::Config;
use crate::ego_motion::EgoMotion;
use crate::error::{OdometryError, ParameterError};
use crate::estimate::{
    BufferUse, Evidence, FrameEstimate, FrameStatus, MotionEvidence, Stage, StageObserver, TrackReport,
};
use crate::instances::Instances;
use crate::label_filter;
use crate::landmarks::{self, Landmark, MotionState};
use crate::motion_state::{
    tracker::{self, Track},
    visibility::Visibility,
};
use crate::pose::{Pose, compose};
use crate::precise_pose::dense::{self, SourcePoint};
use crate::precise_pose::landmark_map::{self, MapLandmark};
use crate::precise_pose::voxel_map::{Group, VoxelMap};
use crate::preliminary_pose;
use crate::preliminary_pose::hull_registration::HullPair;
use crate::preliminary_pose::pairing::Candidate;
use crate::scan::{LabelledScan, MotionClass, SemanticClass};
use crate::scan_cells::{Cell, ScanCells};

/// The origin of the local frame follows the vehicle in steps of about this length [m], so that single precision does.
const ANCHOR_STEP_M: f32 = 160.0;

/// Frames in a row that do not fit before the submap is given up,
const RESTART_FRAMES: u32 = 5;
/// and before one is that no frame has fitted yet: it may have been made of a bad scan.
const RESTART_UNCONFIRMED_FRAMES: u32 = 2;

/// The odometry with its memory: no allocation, a bounded cost per scan. The capacities are explained in [`crate::capacity`].
///
/// It is large (11 MiB for full scans): build it on a thread with a large stack and box it.
pub struct Odometry<
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
    const RANGE_COLUMNS: usize = { crate::capacity::RANGE_COLUMNS },
> {
    config: Config,
    frame: u32,
    stamp_s: f64,
    motion: EgoMotion,
    next_track: u32,
    evicted_landmarks: u32,
    cells: ScanCells<CELLS>,
    instances: Instances<CELLS, INSTANCES>,
    order: Vec<u16, INSTANCES>,
    landmarks: Vec<Landmark, LANDMARKS>,
    previous_landmarks: Vec<Landmark, LANDMARKS>,
    candidates: Vec<Candidate, LANDMARKS>,
    pairs: Vec<HullPair, PAIRS>,
    tracks: Vec<Track, TRACKS>,
    visibility: Visibility<RANGE_COLUMNS>,
    source: Vec<SourcePoint, CELLS>,
    calibration: Calibration,
    voxels: VoxelMap<VOXEL_SETS>,
    map_landmarks: Vec<MapLandmark, MAP_LANDMARKS>,
}

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
    /// An odometry at the origin of its map.
    pub const fn new(config: Config) -> Result<Self, ParameterError> {
        if let Err(error) = config.check() {
            return Err(error);
        }
        Ok(Self {
            config,
            frame: 0,
            stamp_s: 0.0,
            motion: EgoMotion::START,
            next_track: 0,
            evicted_landmarks: 0,
            cells: ScanCells::new(),
            instances: Instances::new(),
            order: Vec::new(),
            landmarks: Vec::new(),
            previous_landmarks: Vec::new(),
            candidates: Vec::new(),
            pairs: Vec::new(),
            tracks: Vec::new(),
            visibility: Visibility::new(),
            source: Vec::new(),
            calibration: Calibration::new(),
            voxels: VoxelMap::new(),
            map_landmarks: Vec::new(),
        })
    }

    /// Back to the origin with another configuration, everything forgotten: as [`Self::new`], but in place, whatever
    /// was there before.
    ///
    /// # Errors
    /// A parameter that is out of range; nothing has changed then.
    pub fn restart(&mut self, config: Config) -> Result<(), ParameterError> {
        config.check()?;
        self.config = config;
        self.reset();
        Ok(())
    }

    /// Back to the origin, everything forgotten but the configuration.
    pub fn reset(&mut self) {
        (self.frame, self.stamp_s, self.motion) = (0, 0.0, EgoMotion::START);
        (self.next_track, self.evicted_landmarks) = (0, 0);
        self.landmarks.clear();
        self.previous_landmarks.clear();
        self.tracks.clear();
        self.visibility.clear();
        self.calibration.clear();
        self.voxels.clear();
        self.map_landmarks.clear();
    }

    /// Registers one scan and writes each point's landmark.
    ///
    /// # Errors
    /// A stamp that is not finite or not after the previous one; the state is then as before the call. A scan that
    /// cannot be registered is no error: see [`FrameStatus::Predicted`].
    pub fn process_scan(&mut self, scan: &mut LabelledScan<'_>) -> Result<FrameEstimate, OdometryError> {
        self.process_scan_observed(scan, &mut ())
    }

    /// [`Self::process_scan`], telling `observer` when each stage is done.
    pub fn process_scan_observed(
        &mut self,
        scan: &mut LabelledScan<'_>,
        observer: &mut impl StageObserver,
    ) -> Result<FrameEstimate, OdometryError> {
        let period_s = self.period(scan.stamp_s)?;
        let mut evidence = Evidence::default();
        let predicted = self.motion.predict(period_s);

        // 3.1.2: what each point is
        evidence.points = label_filter::filter(&self.config.label_filter, scan.points, &mut self.cells);
        self.calibration.apply(&self.config.calibration, self.cells.cells_mut());
        observer.finished(Stage::LabelFilter);

        // 3.1.2: instances
        let local_from_predicted = self.motion.local_from_sensor * predicted;
        self.instances.find(&self.config.instances, &mut self.cells, &local_from_predicted);
        evidence.instances = self.instances.all_mut().len() as u32;
        observer.finished(Stage::Instances);

        // 3.2.1: landmarks
        core::mem::swap(&mut self.landmarks, &mut self.previous_landmarks);
        let landmarks_refused = landmarks::extract(
            &self.config.instances,
            self.instances.all_mut(),
            self.cells.cells_mut(),
            &mut self.order,
            &mut self.landmarks,
        );
        observer.finished(Stage::Landmarks);

        // 3.2: preliminary pose, scan to scan
        let (previous_from_current, preliminary) = self.preliminary_pose(&predicted);
        evidence.preliminary = preliminary;
        let preliminary_pose = compose(&self.motion.local_from_sensor, &previous_from_current);
        observer.finished(Stage::PreliminaryPose);

        // 3.3: what moves
        self.visibility.add(scan.points, &preliminary_pose);
        let tracks_refused = tracker::update(
            &self.config.motion_state,
            period_s as f32,
            &preliminary_pose,
            &mut self.landmarks,
            &self.visibility,
            &mut self.next_track,
            &mut self.tracks,
        );
        evidence.motion = self.motion_evidence();
        observer.finished(Stage::MotionState);

        // 3.4: precise pose, scan to submap
        let precise = self.precise_pose(&local_from_predicted, &preliminary_pose, &mut evidence);
        let (local_from_sensor, status, information) = precise;
        self.visibility.set_newest_pose(&local_from_sensor);
        observer.finished(Stage::PrecisePose);

        // the submap takes the scan in
        self.motion.advance(&local_from_sensor, period_s, status);
        let restarts = self.restarts_submap(&evidence);
        if restarts || !matches!(status, FrameStatus::Predicted(_)) {
            self.extend_submap();
        }
        label_filter::assign_landmarks(scan.points, &self.cells);
        evidence.buffers = self.buffers(landmarks_refused, tracks_refused, evidence.points.over_capacity);
        let estimate = FrameEstimate {
            frame: self.frame,
            stamp_s: scan.stamp_s,
            map_from_sensor: self.motion.map_from_sensor(),
            covariance: dense::covariance(&information, &local_from_sensor),
            status,
            evidence,
        };
        (self.frame, self.stamp_s) = (self.frame + 1, scan.stamp_s);
        self.keep_near_anchor();
        observer.finished(Stage::Submap);
        Ok(estimate)
    }

    /// Landmarks of the last scan; a point's `landmark` field is an index into them.
    pub fn landmarks(&self) -> &[Landmark] {
        &self.landmarks
    }

    /// Living tracks after the last scan.
    pub fn tracks(&self) -> impl Iterator<Item = TrackReport> {
        self.tracks.iter().map(|track| {
            let (p, v) = (track.motion.position(), track.motion.velocity());
            let local = [p.x, p.y, track.height];
            TrackReport {
                id: track.id,
                class: track.class,
                state: track.state,
                position: [0, 1, 2].map(|k| self.motion.anchor_m[k] + f64::from(local[k])),
                velocity: [v.x, v.y],
                landmark: track.landmark,
                hits: track.hits,
                evidence: track.cues,
            }
        })
    }

    fn period(&self, stamp_s: f64) -> Result<f64, OdometryError> {
        if !stamp_s.is_finite() {
            return Err(OdometryError::StampNotFinite);
        }
        if self.frame > 0 && stamp_s <= self.stamp_s {
            return Err(OdometryError::TimeWentBack { previous_s: self.stamp_s, current_s: stamp_s });
        }
        Ok(if self.frame > 0 { stamp_s - self.stamp_s } else { 0.0 })
    }

    /// Widens the searches after frames that were not registered.
    fn search_scale(&self) -> f32 {
        if self.motion.lost > 0 { 4.0 } else { 1.0 }
    }

    fn preliminary_pose(&mut self, predicted: &Pose) -> (Pose, crate::estimate::HullEvidence) {
        let mut config = self.config.preliminary_pose;
        config.hulls.search_m *= self.search_scale();
        config.pairing.gate_m *= self.search_scale();
        preliminary_pose::estimate(
            &config,
            u64::from(self.frame),
            &self.previous_landmarks,
            &self.landmarks,
            predicted,
            &mut self.candidates,
            &mut self.pairs,
        )
    }

    fn motion_evidence(&self) -> MotionEvidence {
        let count = |state| self.landmarks.iter().filter(|l| l.state == state).count() as u32;
        MotionEvidence {
            tracks: self.tracks.len() as u32,
            dynamic: count(MotionState::Dynamic),
            semi_static: count(MotionState::SemiStatic),
            undecided: count(MotionState::Undecided),
        }
    }

    /// The submap does not cover this place (empty scans before it, a long gap), or has not fitted for long: the scan
    /// starts it anew where the prediction has it.
    fn restarts_submap(&mut self, evidence: &Evidence) -> bool {
        let dense = &evidence.dense;
        let usable = dense.source_points >= self.config.precise_pose.dense.min_inliers;
        let misfit = usable && dense::misfits(&self.config.precise_pose.dense, dense);
        self.motion.misfits = if misfit { self.motion.misfits + 1 } else { 0 };
        let patience = if self.motion.confirmed { RESTART_FRAMES } else { RESTART_UNCONFIRMED_FRAMES };
        let stale = self.motion.misfits >= patience;
        if stale {
            self.motion.confirmed = false;
            self.voxels.clear();
            self.map_landmarks.clear();
        }
        usable && (stale || dense.partners < dense.source_points / 10)
    }

    /// Terrain farther away is not registered [m]. While the motion is being found, everything counts.
    fn max_terrain_range_m(&self) -> f32 {
        if self.motion.confirmed { self.config.precise_pose.dense.max_terrain_range_m } else { f32::INFINITY }
    }

    fn extend_submap(&mut self) {
        let config = &self.config.precise_pose;
        let (pose, path_m) = (self.motion.local_from_sensor, self.motion.path_m);
        if config.dense.enabled {
            let heights = dense::ground_heights(&config.voxels, &self.voxels, path_m, &self.source, &pose);
            self.calibration.learn(&self.config.calibration, heights);
            let rotation = *pose.rotation.to_rotation_matrix().matrix();
            let far_m = self.max_terrain_range_m();
            for cell in self.cells.cells() {
                let Some(group) = group_of(far_m, cell, &self.landmarks) else { continue };
                let seen = cell.mean();
                let mean = (pose * Point3::from(seen)).coords;
                let partner = self.voxels.partner(&config.voxels, &mean, group, path_m);
                let group = partner.map_or(group, |(_, _, group)| group);
                let covariance = rotation * cell.covariance() * rotation.transpose();
                let weight = cell.count() as f32 * config.voxels.point_weight(group, seen.norm_squared());
                self.voxels.merge(&config.voxels, group, path_m, &mean, &covariance, weight);
            }
        }
        if config.horizontal {
            let still = |l: &Landmark| matches!(l.state, MotionState::PureStatic | MotionState::SemiStatic);
            self.evicted_landmarks += landmark_map::merge(
                &mut self.map_landmarks,
                &self.landmarks,
                &pose,
                path_m,
                config.voxels.window_m,
                still,
            );
        }
    }

    /// Moves the origin of the local frame, and all that is written in it, when the vehicle is far from it.
    fn keep_near_anchor(&mut self) {
        let voxel_m = self.config.precise_pose.voxels.voxel_m;
        let step = crate::math::floor_i32(ANCHOR_STEP_M / voxel_m).max(1);
        let at = self.motion.local_from_sensor.translation.vector;
        let voxels = [at.x, at.y, at.z].map(|v| (v / (step as f32 * voxel_m)) as i32 * step);
        if voxels == [0; 3] {
            return;
        }
        let by = Vector3::new(voxels[0] as f32, voxels[1] as f32, voxels[2] as f32) * voxel_m;
        for k in 0..3 {
            self.motion.anchor_m[k] += f64::from(by[k]);
        }
        self.motion.local_from_sensor.translation.vector -= by;
        self.motion.registered.translation.vector -= by;
        self.voxels.shift_anchor(voxels);
        self.visibility.shift(&by);
        landmark_map::shift(&mut self.map_landmarks, &by);
        for track in &mut self.tracks {
            track.shift(&by);
        }
    }

    fn buffers(&self, landmarks_refused: u32, tracks_refused: u32, cells_refused: u32) -> BufferUse {
        let (voxels, voxels_evicted) = self.voxels.usage();
        BufferUse {
            cells: self.cells.cells().len() as u32,
            cells_refused,
            landmarks: self.landmarks.len() as u32,
            landmarks_refused: landmarks_refused + self.instances.refused(),
            tracks: self.tracks.len() as u32,
            tracks_refused,
            voxels,
            voxels_evicted,
            submap_landmarks: self.map_landmarks.len() as u32,
            submap_landmarks_evicted: self.evicted_landmarks,
        }
    }
}

/// The group in which a cell is registered; `None` for what may move and is not known to stand still, and for terrain
/// farther away than `far_m`.
fn group_of(far_m: f32, cell: &Cell, landmarks: &[Landmark]) -> Option<Group> {
    if cell.class == SemanticClass::Terrain && cell.mean().norm_squared() > far_m * far_m {
        return None;
    }
    match cell.class.motion() {
        MotionClass::UnknownMotion => {
            let state = landmarks.get(cell.landmark as usize)?.state;
            (state == MotionState::SemiStatic).then_some(Group::Movable)
        }
        MotionClass::Dropped => None,
        _ => Some(Group::of(cell.class)),
    }
}
