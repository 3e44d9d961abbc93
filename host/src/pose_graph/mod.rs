//! Pose graph over SE(3): keyframes joined by odometry and by loops, solved by Gauss-Newton on a sparse Cholesky
//! factorisation, robust against wrong loops (section 3.5).
//!
//! Sequential and without a clock or random numbers: the same graph gives the same bits.

mod edge;
mod error;
pub mod g2o;
mod ordering;
mod robust;
mod solver;

use nalgebra::Matrix6;
use sdslam_core::MapPose;

pub use edge::{Edge, EdgeKind};
pub use error::GraphError;
pub use robust::MAX_SQUARED_ERROR;

/// Squared error that is rounding.
const SETTLED: f64 = 1e-9;

/// Keyframe poses and what is measured between them. The first pose stays where it is.
///
/// Invariants: every edge joins two different keyframes of the graph; weights go with edges, 1 for odometry.
#[derive(Clone, Debug, Default)]
pub struct PoseGraph {
    poses: Vec<MapPose>,
    edges: Vec<Edge>,
    /// 0 (taken for wrong) to 1 of every edge.
    weights: Vec<f64>,
    /// Edges before this one have been through [`Self::optimise`].
    judged_edges: usize,
}

impl PoseGraph {
    /// A graph without keyframes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a keyframe at `map_from_keyframe`; gives its index.
    pub fn add_keyframe(&mut self, map_from_keyframe: MapPose) -> usize {
        self.poses.push(map_from_keyframe);
        self.poses.len() - 1
    }

    /// Adds a measurement.
    ///
    /// # Errors
    /// An end that is not in the graph, an edge from a keyframe to itself, a number that is not finite, an information
    /// matrix that is not positive definite.
    pub fn add_edge(&mut self, edge: Edge) -> Result<(), GraphError> {
        edge.check(self.poses.len())?;
        self.edges.push(edge);
        self.weights.push(1.0);
        Ok(())
    }

    /// Poses of the keyframes in the map.
    pub fn poses(&self) -> &[MapPose] {
        &self.poses
    }

    /// All edges, in the order in which they were added.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Weight of every edge, 0 (a loop taken for wrong) to 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Squared error of an edge at the present poses, in its own standard deviations.
    pub fn squared_error(&self, edge: usize) -> f64 {
        let edge = &self.edges[edge];
        edge.squared_error(&self.poses[edge.from], &self.poses[edge.to])
    }

    /// The poses are those of the last solution, and what came since only carries it on.
    fn is_settled(&self) -> bool {
        let odometry = |edge: &usize| self.edges[*edge].kind == EdgeKind::Odometry;
        let steps = |from: usize| (from..self.edges.len()).filter(odometry);
        let is_held = steps(0).count() + 1 >= self.poses.len();
        let off: f64 = steps(self.judged_edges).map(|edge| self.squared_error(edge)).sum();
        self.judged_edges > 0 && is_held && off < SETTLED
    }

    /// Finds the poses that agree best with the edges; loops that disagree with the rest end with a weight of 0.
    ///
    /// # Errors
    /// A keyframe that no edge holds. The poses are then as before.
    pub fn optimise(&mut self) -> Result<(), GraphError> {
        robust::optimise(self)
    }
}

/// Information matrix (x, y, z, rotation vector) from standard deviations of position \[m\] and rotation \[rad\].
pub fn isotropic_information(position_m: f64, rotation_rad: f64) -> Matrix6<f64> {
    let (p, r) = (position_m.powi(-2), rotation_rad.powi(-2));
    Matrix6::from_diagonal(&nalgebra::Vector6::new(p, p, p, r, r, r))
}

#[cfg(test)]
mod tests;
