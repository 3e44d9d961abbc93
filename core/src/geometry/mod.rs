//! Pure shapes: convex hulls, polygons and planes. No word of SLAM.

pub mod convex_hull;
pub mod eigen;
pub mod plane;
pub mod polygon;
