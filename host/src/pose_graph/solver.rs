//! Gauss-Newton over all keyframes but the first. The factorisation is nalgebra-sparse's; the order is ours, because it
//! reduces no fill-in.

use std::collections::BTreeSet;

use nalgebra::{DVector, Matrix6, Vector6};
use nalgebra_sparse::factorization::{CscCholesky, CscSymbolicCholesky};
use nalgebra_sparse::pattern::SparsityPattern;
use sdslam_core::MapPose;

use super::{Edge, GraphError, edge};

const MAX_ITERATIONS: usize = 20;
/// Steps below this end the iteration \[m, rad\].
const MIN_STEP: f64 = 1e-6;
/// Shorter steps tried when a whole one makes it worse.
const MAX_HALVINGS: usize = 6;
const BLOCK: usize = 6;

/// The structure of the normal equations of a graph; the numbers change, the structure stays while no edge is added.
pub(super) struct Structure {
    /// Place of every keyframe among the blocks; none for the first, which is held.
    block_of: Vec<Option<usize>>,
    /// Neighbours of a block, itself among them, in rising order: its non-zero blocks.
    rows: Vec<Vec<usize>>,
    /// Where the first scalar column of a block begins among the values.
    starts: Vec<usize>,
    symbolic: CscSymbolicCholesky,
}

impl Structure {
    pub(super) fn of(keyframes: usize, edges: &[Edge]) -> Self {
        let mut neighbours = vec![BTreeSet::new(); keyframes.saturating_sub(1)];
        // Keyframe k is node k - 1: the first is not among them.
        for &Edge { from, to, .. } in edges.iter().filter(|edge| edge.from.min(edge.to) > 0) {
            neighbours[from - 1].insert(to - 1);
            neighbours[to - 1].insert(from - 1);
        }
        let order = super::ordering::minimum_degree(neighbours.clone());
        let mut block_of = vec![None; keyframes];
        for (block, &node) in order.iter().enumerate() {
            block_of[node + 1] = Some(block);
        }
        let place = |&node: &usize| block_of[node + 1];
        let rows: Vec<Vec<usize>> = order
            .iter()
            .map(|node| {
                let blocks: BTreeSet<usize> =
                    neighbours[*node].iter().chain([node]).filter_map(place).collect();
                blocks.into_iter().collect()
            })
            .collect();
        let (starts, pattern) = scalar_pattern(&rows);
        Self { block_of, rows, starts, symbolic: CscSymbolicCholesky::factor(pattern) }
    }

    fn scalars(&self) -> usize {
        BLOCK * self.rows.len()
    }

    /// Adds `matrix` to the block at (`row`, `column`).
    fn add(&self, values: &mut [f64], row: usize, column: usize, matrix: &Matrix6<f64>) {
        let rows = &self.rows[column];
        let Ok(place) = rows.binary_search(&row) else { return };
        for c in 0..BLOCK {
            let start = self.starts[column] + BLOCK * (c * rows.len() + place);
            for (value, term) in values[start..start + BLOCK].iter_mut().zip(matrix.column(c).iter()) {
                *value += term;
            }
        }
    }

    /// One Gauss-Newton step, block by block.
    fn step(&self, poses: &[MapPose], edges: &[Edge], weights: &[f64]) -> Result<DVector<f64>, GraphError> {
        let mut values = vec![0.0; BLOCK * BLOCK * self.rows.iter().map(Vec::len).sum::<usize>()];
        let mut gradient = DVector::zeros(self.scalars());
        for (edge, &weight) in edges.iter().zip(weights) {
            // A loop taken for wrong stays in the structure with no weight.
            let linear = edge.linearise(&poses[edge.from], &poses[edge.to]);
            let information = edge.information * weight;
            let ends = [(edge.from, &linear.by_from), (edge.to, &linear.by_to)];
            for (keyframe, by) in ends {
                let Some(column) = self.block_of[keyframe] else { continue };
                let weighted = information * by;
                let mut part = gradient.fixed_rows_mut::<BLOCK>(BLOCK * column);
                part += weighted.transpose() * linear.error;
                for (other, by_other) in ends {
                    let Some(row) = self.block_of[other] else { continue };
                    self.add(&mut values, row, column, &(by_other.transpose() * weighted));
                }
            }
        }
        let cholesky = CscCholesky::factor_numerical(self.symbolic.clone(), &values)
            .map_err(|_| GraphError::NotDetermined)?;
        let solution = cholesky.solve(&gradient);
        let step = -solution.column(0);
        if step.iter().all(|v| v.is_finite()) { Ok(step) } else { Err(GraphError::NotDetermined) }
    }

    fn moved(&self, poses: &[MapPose], step: &DVector<f64>, share: f64) -> Vec<MapPose> {
        let moved = |(pose, block): (&MapPose, &Option<usize>)| match block {
            Some(block) => {
                let own: Vector6<f64> = step.fixed_rows::<BLOCK>(BLOCK * block) * share;
                edge::moved(pose, &own)
            }
            None => *pose,
        };
        poses.iter().zip(&self.block_of).map(moved).collect()
    }
}

/// Column starts per block, and the pattern over scalars, of blocks of 6 by 6.
fn scalar_pattern(rows: &[Vec<usize>]) -> (Vec<usize>, SparsityPattern) {
    let (mut starts, mut offsets, mut indices) = (Vec::new(), vec![0], Vec::new());
    for blocks in rows {
        starts.push(indices.len());
        for _ in 0..BLOCK {
            indices.extend(blocks.iter().flat_map(|block| BLOCK * block..BLOCK * (block + 1)));
            offsets.push(indices.len());
        }
    }
    let scalars = BLOCK * rows.len();
    let pattern = SparsityPattern::try_from_offsets_and_indices(scalars, scalars, offsets, indices)
        .expect("blocks in rising order make a valid pattern");
    (starts, pattern)
}

/// Weighted sum of squared errors.
pub(super) fn cost(poses: &[MapPose], edges: &[Edge], weights: &[f64]) -> f64 {
    let weighted =
        |(edge, weight): (&Edge, &f64)| weight * edge.squared_error(&poses[edge.from], &poses[edge.to]);
    edges.iter().zip(weights).map(weighted).sum()
}

/// The poses that minimise the weighted squared errors, starting from `poses`.
pub(super) fn solve(
    structure: &Structure,
    mut poses: Vec<MapPose>,
    edges: &[Edge],
    weights: &[f64],
) -> Result<Vec<MapPose>, GraphError> {
    let mut present = cost(&poses, edges, weights);
    for _ in 0..MAX_ITERATIONS {
        let step = structure.step(&poses, edges, weights)?;
        let shares = (0..=MAX_HALVINGS).map(|halvings| 0.5f64.powi(halvings as i32));
        let better = shares
            .map(|share| structure.moved(&poses, &step, share))
            .map(|poses| (cost(&poses, edges, weights), poses))
            .find(|(cost, _)| *cost <= present);
        let Some((lower, nearer)) = better else { break };
        (present, poses) = (lower, nearer);
        if step.amax() < MIN_STEP {
            break;
        }
    }
    Ok(poses)
}
