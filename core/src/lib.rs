//! SD-SLAM on the vehicle: labelled LiDAR points in; pose, tracks and landmarks out.
#![no_std]

// What the caller sees
pub mod capacity;
pub mod config;
pub mod error;
pub mod estimate;
pub mod odometry;
pub mod pose;
pub mod scan;
#[cfg(feature = "snapshot")]
pub mod snapshot;

// The stages, in the paper's order
pub mod calibration;
pub mod label_filter;
pub mod scan_cells;

pub mod instances;

pub mod landmarks;

pub mod preliminary_pose;

pub mod motion_state;

pub mod precise_pose;

pub mod loop_closure;

mod ego_motion;

// Mathematics without a word of SLAM
pub mod clustering;
pub mod estimation;
pub mod geometry;
pub mod math;
pub mod optimise;
pub mod total;

pub use capacity::FullScanOdometry;
pub use config::Config;
pub use error::{OdometryError, ParameterError};
pub use estimate::{FrameEstimate, FrameStatus, Stage, StageObserver, TrackReport};
pub use landmarks::{Landmark, MotionState};
pub use odometry::Odometry;
pub use pose::{MapPose, Pose};
pub use scan::{LabelledPoint, LabelledScan, MotionClass, SemanticClass};
