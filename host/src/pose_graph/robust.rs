//! Which loops to believe (in the spirit of RRR, Latif, Cadena, Neira 2013). Odometry is always believed.
//!
//! A loop is believed when the graph can follow it: the cost of all believed edges rises by no more than the drift
//! explains, and no believed loop is torn. When loops are left over, a second hypothesis is made that begins with them;
//! the one that believes more loops stands, so that one wrong loop that came first does not keep out the right ones.

use sdslam_core::MapPose;

use super::solver::{self, Structure};
use super::{Edge, EdgeKind, GraphError, PoseGraph};

/// A believed loop's squared error stays below this: 99.9 % quantile of chi-square with 6 degrees of freedom.
pub const MAX_SQUARED_ERROR: f64 = 22.5;
/// The cost may rise by this much for a loop: the drift may be twice what the covariance of the odometry says.
const MAX_RISE: f64 = 4.0 * MAX_SQUARED_ERROR;

pub(super) fn optimise(graph: &mut PoseGraph) -> Result<(), GraphError> {
    let structure = Structure::of(graph.poses.len(), &graph.edges);
    let loops: Vec<usize> =
        (0..graph.edges.len()).filter(|&e| graph.edges[e].kind == EdgeKind::Loop).collect();
    let is_new = |edge: &usize| *edge >= graph.judged_edges;
    let mut judge = Judge::start(&structure, graph)?;
    judge.consider(loops.iter().copied().filter(is_new))?;
    judge.recover(&loops)?;
    let left_over: Vec<usize> = loops.iter().copied().filter(|&e| judge.weights[e] == 0.0).collect();
    let believed = loops.len() - left_over.len();
    if left_over.len() > believed.min(MIN_LEFT_OVER) {
        let mut other = Judge::without_loops(&structure, graph)?;
        other.consider(
            left_over.into_iter().chain(loops.iter().copied().filter(|&e| judge.weights[e] > 0.0)),
        )?;
        if other.believed() > believed as f64 {
            judge = other;
        }
    }
    (graph.poses, graph.weights, graph.judged_edges) = (judge.poses, judge.weights, graph.edges.len());
    Ok(())
}

/// Fewer loops left over than this do not make a second hypothesis worth its time, unless they are the majority.
const MIN_LEFT_OVER: usize = 3;

/// A hypothesis: which loops are believed, and the poses that follow.
struct Judge<'a> {
    structure: &'a Structure,
    edges: &'a [Edge],
    poses: Vec<MapPose>,
    weights: Vec<f64>,
    cost: f64,
}

impl<'a> Judge<'a> {
    /// From the graph as it was left, new loops not yet believed.
    fn start(structure: &'a Structure, graph: &'a PoseGraph) -> Result<Self, GraphError> {
        let weight = |(index, edge): (usize, &Edge)| match edge.kind {
            EdgeKind::Loop if index >= graph.judged_edges => 0.0,
            _ => graph.weights[index],
        };
        let weights: Vec<f64> = graph.edges.iter().enumerate().map(weight).collect();
        if !graph.is_settled() {
            return Self::solved(structure, graph, weights);
        }
        let (edges, poses) = (&graph.edges, graph.poses.clone());
        let cost = solver::cost(&poses, edges, &weights);
        Ok(Self { structure, edges, poses, weights, cost })
    }

    fn without_loops(structure: &'a Structure, graph: &'a PoseGraph) -> Result<Self, GraphError> {
        let weights = graph.edges.iter().map(|edge| f64::from(edge.kind == EdgeKind::Odometry)).collect();
        Self::solved(structure, graph, weights)
    }

    fn solved(structure: &'a Structure, graph: &'a PoseGraph, weights: Vec<f64>) -> Result<Self, GraphError> {
        let edges = &graph.edges;
        let poses = solver::solve(structure, graph.poses.clone(), edges, &weights)?;
        let cost = solver::cost(&poses, edges, &weights);
        Ok(Self { structure, edges, poses, weights, cost })
    }

    /// Tries the loops one by one; those that agree with the poses as they are wait for a common solution, for no single
    /// one of them could fail but by tearing another.
    fn consider(&mut self, loops: impl Iterator<Item = usize>) -> Result<(), GraphError> {
        let mut agreeing = Vec::new();
        for edge in loops {
            if self.error(&self.poses, edge) <= MAX_SQUARED_ERROR {
                agreeing.push(edge);
                continue;
            }
            self.believe_all(&mut agreeing)?;
            self.believe(&[edge])?;
        }
        self.believe_all(&mut agreeing)
    }

    /// Believes loops together, or, where that tears one, as many of them as can be believed one after the other.
    fn believe_all(&mut self, loops: &mut Vec<usize>) -> Result<(), GraphError> {
        if !loops.is_empty() && !self.believe(loops)? && loops.len() > 1 {
            for edge in loops.iter() {
                self.believe(&[*edge])?;
            }
        }
        loops.clear();
        Ok(())
    }

    /// Believes loops if the graph can follow all of them; whether it can.
    fn believe(&mut self, loops: &[usize]) -> Result<bool, GraphError> {
        loops.iter().for_each(|&edge| self.weights[edge] = 1.0);
        let poses = solver::solve(self.structure, self.poses.clone(), self.edges, &self.weights)?;
        let cost = solver::cost(&poses, self.edges, &self.weights);
        let follows = cost - self.cost <= MAX_RISE * loops.len() as f64 && !self.tears(&poses);
        if follows {
            (self.poses, self.cost) = (poses, cost);
        } else {
            loops.iter().for_each(|&edge| self.weights[edge] = 0.0);
        }
        Ok(follows)
    }

    /// Loops that were not believed, but agree with the poses as they are now, get another chance.
    fn recover(&mut self, loops: &[usize]) -> Result<(), GraphError> {
        let agrees = |e: &usize| self.weights[*e] == 0.0 && self.error(&self.poses, *e) <= MAX_SQUARED_ERROR;
        let again: Vec<usize> = loops.iter().copied().filter(agrees).collect();
        self.consider(again.into_iter())
    }

    fn error(&self, poses: &[MapPose], edge: usize) -> f64 {
        let edge = &self.edges[edge];
        edge.squared_error(&poses[edge.from], &poses[edge.to])
    }

    /// A believed loop does not fit these poses.
    fn tears(&self, poses: &[MapPose]) -> bool {
        let torn = |e: usize| {
            self.edges[e].kind == EdgeKind::Loop
                && self.weights[e] > 0.0
                && self.error(poses, e) > MAX_SQUARED_ERROR
        };
        (0..self.edges.len()).any(torn)
    }

    fn believed(&self) -> f64 {
        let loops = self.edges.iter().zip(&self.weights).filter(|(edge, _)| edge.kind == EdgeKind::Loop);
        loops.map(|(_, weight)| weight).sum()
    }
}
