//! What the core says about a frame: the pose and the evidence for it.

use crate::landmarks::MotionState;
use crate::motion_state::recognition::MotionCues;
use crate::pose::{MapPose, PlanarPose};
use crate::scan::SemanticClass;

/// The answer to one scan.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FrameEstimate {
    /// Number of the frame since the start or the last reset, from 0.
    pub frame: u32,
    /// Stamp of the scan [s].
    pub stamp_s: f64,
    /// Pose of the sensor in the map; the map frame is the sensor frame of the first scan.
    pub map_from_sensor: MapPose,
    /// Covariance of the pose's error in the sensor frame, order x, y, z [m], roll, pitch, yaw [rad].
    pub covariance: [[f32; 6]; 6],
    /// How the pose came about.
    pub status: FrameStatus,
    /// What it rests on.
    pub evidence: Evidence,
}

/// How a pose came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FrameStatus {
    /// The first frame: the origin of the map.
    First,
    /// Registered against the local submap.
    Registered,
    /// Not registered: the pose is the prediction.
    Predicted(Fallback),
}

/// Why a frame could not be registered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Fallback {
    /// The scan holds no usable point.
    EmptyScan,
    /// Too few points found a partner in the submap, or fitted it.
    TooFewInliers,
    /// Neither landmarks nor ground were found to register.
    NoLandmarks,
    /// The registration ran away from the prediction, or the scan does not determine all six degrees of freedom.
    Degenerate,
}

impl Fallback {
    /// The reason in words.
    pub const fn reason(self) -> &'static str {
        match self {
            Self::EmptyScan => "the scan holds no usable point",
            Self::TooFewInliers => "too few points found a partner in the submap or fitted it",
            Self::NoLandmarks => "no landmarks were found",
            Self::Degenerate => "the registration is degenerate",
        }
    }
}

/// Counts of the label filter (section 3.1.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PointCounts {
    /// Points handed in.
    pub received: u32,
    /// Dropped: a coordinate is not finite.
    pub not_finite: u32,
    /// Dropped: nearer or farther than the configured range (zeros are among them).
    pub out_of_range: u32,
    /// Dropped: unlabelled or outlier.
    pub unlabelled: u32,
    /// Dropped: class less certain than the configured confidence.
    pub unsure: u32,
    /// Dropped: more points than the profile holds.
    pub over_capacity: u32,
    /// Kept as ground.
    pub ground: u32,
    /// Kept as pure static.
    pub pure_static: u32,
    /// Kept with unknown motion.
    pub unknown_motion: u32,
}

/// Which landmarks the preliminary pose used (section 3.2, second paragraph).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LandmarkInput {
    /// No landmark pair was found; the prediction stands.
    #[default]
    None,
    /// Pure static landmarks only: there were enough of them.
    PureStatic,
    /// All landmarks.
    All,
}

/// Evidence of a registration by convex hulls (sections 3.2 and 3.4.1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HullEvidence {
    /// Which landmarks were used.
    pub input: LandmarkInput,
    /// Planar pose found: of the sensor in the previous scan (section 3.2) or in the submap's frame (section 3.4.1).
    pub pose: PlanarPose,
    /// Landmark pairs.
    pub pairs: u32,
    /// Weighted overlap reached, 0..1 of the possible.
    pub overlap: f32,
    /// Evaluations of the objective (eq. 2).
    pub evaluations: u32,
}

/// Evidence of the dense registration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DenseEvidence {
    /// Points offered.
    pub source_points: u32,
    /// Points that found a partner in the submap.
    pub partners: u32,
    /// Those of them that fit it.
    pub inliers: u32,
    /// Partners found by points that are not ground.
    pub upright_partners: u32,
    /// Those of them that fit.
    pub upright_inliers: u32,
    /// Root mean square of the residuals along the surface normals [m].
    pub residual_m: f32,
    /// Iterations used.
    pub iterations: u32,
    /// The iteration ended before its limit.
    pub converged: bool,
}

/// Evidence of the vertical pose (section 3.4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GroundEvidence {
    /// Ground points in front of the vehicle in the plane fit.
    pub front: u32,
    /// Ground points behind the vehicle in the plane fit.
    pub rear: u32,
    /// Pitch of the ground ahead and behind in the sensor frame [rad].
    pub pitch_rad: f32,
}

/// Landmarks and tracks of the frame (section 3.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MotionEvidence {
    /// Living tracks.
    pub tracks: u32,
    /// Landmarks of this frame recognised as dynamic.
    pub dynamic: u32,
    /// Landmarks of this frame recognised as semi-static.
    pub semi_static: u32,
    /// Landmarks of this frame not decided yet.
    pub undecided: u32,
}

/// How full the buffers are, and what did not fit. Capacities are in [`crate::capacity`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BufferUse {
    /// Scan cells in use (one cell holds the points of one class in one voxel).
    pub cells: u32,
    /// Points whose cell did not fit.
    pub cells_refused: u32,
    /// Landmarks in use.
    pub landmarks: u32,
    /// Instances that did not fit among the landmarks (the smallest are dropped).
    pub landmarks_refused: u32,
    /// Tracks in use.
    pub tracks: u32,
    /// Landmarks that found no free track.
    pub tracks_refused: u32,
    /// Submap voxels in use.
    pub voxels: u32,
    /// Submap voxels that were replaced while still within the window.
    pub voxels_evicted: u32,
    /// Submap landmarks in use.
    pub submap_landmarks: u32,
    /// Submap landmarks dropped while still within the window.
    pub submap_landmarks_evicted: u32,
}

/// Everything a plot or a gate may want to know.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Evidence {
    /// Label filter.
    pub points: PointCounts,
    /// Instances found by DBSCAN.
    pub instances: u32,
    /// Preliminary pose, scan to scan (section 3.2).
    pub preliminary: HullEvidence,
    /// Motion states (section 3.3).
    pub motion: MotionEvidence,
    /// Horizontal pose, scan to submap (section 3.4.1).
    pub horizontal: HullEvidence,
    /// Vertical pose (section 3.4.2); zero where the dense refinement carries it.
    pub ground: GroundEvidence,
    /// Dense refinement (`accurate` preset).
    pub dense: DenseEvidence,
    /// Buffers.
    pub buffers: BufferUse,
}

/// A track as the caller sees it (section 3.3).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TrackReport {
    /// Identity, never reused.
    pub id: u32,
    /// Class.
    pub class: SemanticClass,
    /// Motion state.
    pub state: MotionState,
    /// Centre in the map frame [m].
    pub position: [f64; 3],
    /// Velocity in the map frame [m/s], x and y.
    pub velocity: [f32; 2],
    /// Index of its landmark in this frame, `None` while the track coasts.
    pub landmark: Option<u16>,
    /// Landmarks associated so far.
    pub hits: u32,
    /// What spoke for or against motion in this frame.
    pub evidence: MotionCues,
}

/// The stages of one frame, in the order of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Stage {
    /// Label filter and scan cells (section 3.1.2).
    LabelFilter,
    /// DBSCAN instances (section 3.1.2).
    Instances,
    /// Landmarks (section 3.2.1, 3.2.2).
    Landmarks,
    /// Preliminary pose (section 3.2).
    PreliminaryPose,
    /// Motion states (section 3.3).
    MotionState,
    /// Precise pose (section 3.4).
    PrecisePose,
    /// Submap update.
    Submap,
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Stage; 7] = [
        Self::LabelFilter,
        Self::Instances,
        Self::Landmarks,
        Self::PreliminaryPose,
        Self::MotionState,
        Self::PrecisePose,
        Self::Submap,
    ];

    /// Name for tables and file keys.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LabelFilter => "label_filter",
            Self::Instances => "instances",
            Self::Landmarks => "landmarks",
            Self::PreliminaryPose => "preliminary_pose",
            Self::MotionState => "motion_state",
            Self::PrecisePose => "precise_pose",
            Self::Submap => "submap",
        }
    }
}

/// Called at the end of each stage: the core has no clock, the caller may read one here.
pub trait StageObserver {
    /// `stage` is done.
    fn finished(&mut self, stage: Stage);
}

/// An observer that does nothing.
impl StageObserver for () {
    fn finished(&mut self, _: Stage) {}
}
