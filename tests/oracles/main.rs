//! The mathematics of the core against other people's: geo for hulls and clipping, linfa for DBSCAN, nalgebra in double
//! precision for filters, rotations and planes.

mod dbscan;
mod eigen;
mod filter_and_poses;
mod planes;
mod polygons;
mod sorting;
