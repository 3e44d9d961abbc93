//! SD-SLAM on a host: KITTI drives in; trajectory, tracks and a static semantic map out.

pub mod cli;
pub mod config;
pub mod dataset;
pub mod evaluate;
pub mod run;
pub mod segmentation;
pub mod simulate;
