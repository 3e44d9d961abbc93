//! SD-SLAM on the vehicle: labelled LiDAR points in; pose, tracks and landmarks out.
#![no_std]

pub mod error;
pub mod estimate;
pub mod landmarks;
pub mod math;
pub mod odometry;
pub mod pose;
pub mod scan;

pub use error::{OdometryError, ParameterError};
pub use estimate::{FrameEstimate, FrameStatus, Stage, StageObserver, TrackReport};
pub use landmarks::{Landmark, MotionState};
pub use odometry::{Config, FullScanOdometry, Odometry};
pub use pose::{MapPose, Pose};
pub use scan::{LabelledPoint, LabelledScan, MotionClass, SemanticClass};
