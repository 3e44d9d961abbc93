//! Drives in KITTI odometry layout with SemanticKITTI labels:
//!
//! ```text
//! DATASET/sequences/NN/velodyne/NNNNNN.bin   float32 x y z remission, sensor frame (x forward, y left, z up) [m]
//! DATASET/sequences/NN/labels/NNNNNN.label   uint32 a point: class in the low half, instance in the high half
//! DATASET/sequences/NN/calib.txt             the line `Tr:` is the camera's pose of the sensor
//! DATASET/sequences/NN/times.txt             one time stamp [s] a scan
//! DATASET/poses/NN.txt                       ground truth, camera frame
//! ```

mod correction;
mod error;
pub mod labels;
mod sequence;
mod text;
pub mod trajectory;

pub use correction::{
    ELEVATION_CORRECTION_DEG, correct_elevation, deskew, time_in_scan, with_corrected_elevation,
};
pub use error::DatasetError;
pub(crate) use sequence::files_in;
pub use sequence::{RawScan, Sequence, read_labels, read_scan};
