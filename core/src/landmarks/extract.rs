//! Instances to landmarks.

use heapless::{Vec, VecView};

use super::{Landmark, MotionState, OUTLINE, SAMPLES};
use crate::instances::{Config, Instance};
use crate::scan::{MotionClass, SemanticClass};
use crate::scan_cells::Cell;
use crate::total;

/// Unit vectors of the outline's directions, 22.5 degrees apart.
const DIRECTIONS: [[f32; 2]; OUTLINE] = {
    const A: f32 = 0.923_879_5;
    const B: f32 = core::f32::consts::FRAC_1_SQRT_2;
    const C: f32 = 0.382_683_43;
    [
        [1.0, 0.0],
        [A, C],
        [B, B],
        [C, A],
        [0.0, 1.0],
        [-C, A],
        [-B, B],
        [-A, C],
        [-1.0, 0.0],
        [-A, -C],
        [-B, -B],
        [-C, -A],
        [0.0, -1.0],
        [C, -A],
        [B, -B],
        [A, -C],
    ]
};

/// Makes the landmarks of the instances that are large enough, and turns each cell's instance into its landmark.
///
/// When they do not all fit, those of unknown motion come first, then small things, then the largest; gives the number
/// that did not fit. `order` is scratch, as long as `instances`.
pub fn extract(
    config: &Config,
    instances: &mut [Instance],
    cells: &mut [Cell],
    order: &mut VecView<u16>,
    landmarks: &mut VecView<Landmark>,
) -> u32 {
    let refused = choose(config, instances, order, landmarks);
    for cell in cells.iter_mut() {
        cell.landmark = instances.get(cell.landmark as usize).map_or(Cell::NO_LANDMARK, |i| i.landmark);
    }
    measure(cells, landmarks);
    outline(cells, order, landmarks);
    refused
}

/// Ranks the instances and opens a landmark for each that fits.
fn choose(
    config: &Config,
    instances: &mut [Instance],
    order: &mut VecView<u16>,
    landmarks: &mut VecView<Landmark>,
) -> u32 {
    landmarks.clear();
    order.clear();
    for (i, instance) in instances.iter_mut().enumerate() {
        instance.landmark = Cell::NO_LANDMARK;
        if instance.points >= config.of(instance.family).min_size {
            let _ = order.push(i as u16);
        }
    }
    let rank = |i: u16| {
        let Some(instance) = instances.get(i as usize) else { return (3, 0, i) };
        let group = match (instance.family.motion(), config.of(instance.family).tile_m > 0.0) {
            (MotionClass::UnknownMotion, _) => 0,
            (_, false) => 1,
            (_, true) => 2,
        };
        (group, u32::MAX - instance.points, i)
    };
    total::sort_by(order, |a, b| rank(*a) < rank(*b));
    let kept = order.len().min(landmarks.capacity());
    for (landmark, i) in order.iter().take(kept).enumerate() {
        let Some(instance) = instances.get_mut(*i as usize) else { break };
        instance.landmark = landmark as u16;
        let _ = landmarks.push(Landmark::empty(instance.family));
    }
    (order.len() - kept) as u32
}

/// Class, centre, extent and size of each landmark.
fn measure(cells: &[Cell], landmarks: &mut VecView<Landmark>) {
    for cell in cells {
        let Some(landmark) = landmarks.get_mut(cell.landmark as usize) else { continue };
        let (mean, count) = (cell.mean(), cell.count());
        landmark.point_count += count;
        landmark.votes[cell.class as usize] += count;
        for k in 0..3 {
            landmark.centre[k] += mean[k] * count as f32;
            landmark.min[k] = landmark.min[k].min(mean[k]);
            landmark.max[k] = landmark.max[k].max(mean[k]);
        }
        landmark.cells += 1;
    }
    for landmark in landmarks.iter_mut() {
        landmark.centre = landmark.centre.map(|v| v / landmark.point_count.max(1) as f32);
        let winner = (0..SemanticClass::COUNT).rev().max_by_key(|c| landmark.votes[*c]);
        landmark.class = winner.map_or(landmark.family, |c| SemanticClass::ALL[c]);
    }
}

/// Outermost points per layer and direction, and samples of the whole surface.
fn outline(cells: &[Cell], seen: &mut VecView<u16>, landmarks: &mut VecView<Landmark>) {
    // `seen` counts the cells met so far, per landmark.
    seen.clear();
    let _ = seen.resize(landmarks.len(), 0);
    for cell in cells {
        let Some(landmark) = landmarks.get_mut(cell.landmark as usize) else { continue };
        let p: [f32; 3] = cell.mean().into();
        let Some(nth) = seen.get_mut(cell.landmark as usize) else { continue };
        if (*nth as usize).is_multiple_of(landmark.cells as usize / SAMPLES + 1) {
            let _ = landmark.samples.push(p);
        }
        *nth += 1;
        let layer = &mut landmark.outline[usize::from(p[2] > landmark.centre[2])];
        for (direction, best) in DIRECTIONS.iter().zip(layer) {
            let reach = |q: &[f32; 3]| direction[0] * q[0] + direction[1] * q[1];
            if best.as_ref().is_none_or(|b| reach(&p) > reach(b)) {
                *best = Some(p);
            }
        }
    }
}

impl Landmark {
    const fn empty(family: SemanticClass) -> Self {
        Self {
            class: family,
            family,
            centre: [0.0; 3],
            min: [f32::INFINITY; 3],
            max: [f32::NEG_INFINITY; 3],
            point_count: 0,
            state: match family.motion() {
                MotionClass::UnknownMotion => MotionState::Undecided,
                _ => MotionState::PureStatic,
            },
            track: None,
            cells: 0,
            votes: [0; SemanticClass::COUNT],
            outline: [[None; OUTLINE]; 2],
            samples: Vec::new(),
        }
    }
}
