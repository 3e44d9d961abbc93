//! SD-SLAM on a host: KITTI drives in; trajectory, tracks and a static semantic map out.

pub mod cli;
pub mod config;
pub mod dataset;
pub mod evaluate;
mod heap;
pub mod localise;
pub mod loops;
pub mod pose_graph;
pub mod run;
pub mod saved_map;
pub mod semantic_map;
pub mod simulate;
