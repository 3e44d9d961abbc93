//! Sections 3.2.2 to 3.2.4: hulls of the pairs, the overlap objective, and its solution by the particle swarm.
//! The precise pose uses the same steps against the submap (section 3.4.1).

use heapless::VecView;
use nalgebra::Point3;

use super::pairing::Candidate;
use crate::error::{self, ParameterError};
use crate::estimate::HullEvidence;
use crate::geometry::polygon;
use crate::landmarks::{Hull, Landmark, Layers, layers};
use crate::math;
use crate::optimise::pso;
use crate::pose::{PlanarPose, Pose};
use crate::total;

/// Parameters of hulls and swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Weigh each pair by the inverse of its smaller area, so that a facade does not outweigh three hundred poles;
    /// the paper sums the raw areas (eq. 2).
    pub weigh_by_area: bool,
    /// Weight of the turning functions' difference in the similarity index.
    pub shape_weight: f32,
    /// Weight of the Hausdorff distance in the similarity index.
    pub size_weight: f32,
    /// Half width of the search along x and y [m].
    pub search_m: f32,
    /// Half width of the search about z [rad].
    pub search_rad: f32,
    /// The swarm.
    pub swarm: pso::Config,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        weigh_by_area: true,
        shape_weight: 0.5,
        size_weight: 0.5,
        search_m: 0.5,
        search_rad: 0.03,
        swarm: pso::Config::SMALL,
    };
    /// Nothing but the paper.
    pub const PAPER: Self = Self { weigh_by_area: false, swarm: pso::Config::PAPER, ..Self::DEFAULT };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if !(self.search_m > 0.0 && self.search_rad > 0.0) {
            return Err(ParameterError { parameter: "hulls.search_m and search_rad", expected: "positive" });
        }
        if !error::all_within(&[self.shape_weight, self.size_weight], 0.0, 1000.0) {
            let parameter = "hulls.shape_weight and size_weight";
            return Err(ParameterError { parameter, expected: "0 to 1000" });
        }
        self.swarm.check()
    }
}

/// The convex hull features of a landmark pair (section 3.2.2).
#[derive(Clone, Debug)]
pub struct HullPair {
    /// Hull in the target frame.
    target: Hull,
    /// Hull in the source frame.
    source: Hull,
    weight: f32,
    /// Largest overlap possible [m2].
    possible: f32,
    /// Centre and radius of each hull's circle, to pass over pairs that cannot overlap.
    target_circle: ([f32; 2], f32),
    source_circle: ([f32; 2], f32),
}

/// Smallest area of a hull that is used [m2].
const MIN_AREA: f32 = 1e-3;

/// Takes the hulls of each candidate pair and keeps the layer with the more similar ones.
pub fn pair_hulls<'a>(
    config: &Config,
    target: impl Fn(usize) -> Option<&'a Landmark>,
    source: &[Landmark],
    target_from_source: &Pose,
    candidates: &[Candidate],
    pairs: &mut VecView<HullPair>,
) {
    pairs.clear();
    let planar = PlanarPose::from_pose(target_from_source);
    let sin_cos = (math::sin(planar.yaw), math::cos(planar.yaw));
    for candidate in candidates {
        let pair = (target(candidate.target as usize), source.get(candidate.source as usize));
        let (Some(t), Some(s)) = pair else { continue };
        // One split height for the pair, each in its own frame: the mean of both centres.
        let lift = (target_from_source * Point3::from(s.centre)).z - s.centre[2];
        let split = 0.5 * (t.centre[2] + s.centre[2] + lift);
        let (of_target, of_source) = (layers(t, split), layers(s, split - lift));
        let Some((a, b)) = more_similar(config, of_target, of_source, |p| planar.apply(sin_cos, p)) else {
            continue;
        };
        if pairs.push(HullPair::new(config, a, b)).is_err() {
            break;
        }
    }
}

/// L-LO's comprehensive similarity index S = alpha |shape difference| + beta Hausdorff, smaller is more similar; the
/// layer with the smaller one supplies the features. `None` when neither layer has an area in both.
fn more_similar(
    config: &Config,
    target: Layers,
    source: Layers,
    moved: impl Fn([f32; 2]) -> [f32; 2],
) -> Option<(Hull, Hull)> {
    let index = |a: &Hull, b: &Hull| {
        if polygon::area(a) < MIN_AREA || polygon::area(b) < MIN_AREA {
            return None;
        }
        let b: Hull = total::collect(b.iter().map(|p| moved(*p)));
        let shape = math::abs(polygon::turning_area(a) - polygon::turning_area(&b));
        Some(config.shape_weight * shape + config.size_weight * polygon::hausdorff(a, &b))
    };
    match (index(&target.lower, &source.lower), index(&target.upper, &source.upper)) {
        (Some(lower), Some(upper)) if upper < lower => Some((target.upper, source.upper)),
        (Some(_), _) => Some((target.lower, source.lower)),
        (None, Some(_)) => Some((target.upper, source.upper)),
        (None, None) => None,
    }
}

fn circle(hull: &Hull) -> ([f32; 2], f32) {
    let n = 1.0 / hull.len().max(1) as f32;
    let centre = hull.iter().fold([0.0, 0.0], |c, p| [c[0] + n * p[0], c[1] + n * p[1]]);
    let radius2 =
        hull.iter().map(|p| square(p[0] - centre[0]) + square(p[1] - centre[1])).fold(0.0, f32::max);
    (centre, math::sqrt(radius2))
}

fn square(v: f32) -> f32 {
    v * v
}

impl HullPair {
    fn new(config: &Config, target: Hull, source: Hull) -> Self {
        let possible = polygon::area(&target).min(polygon::area(&source));
        let weight = if config.weigh_by_area { 1.0 / possible } else { 1.0 };
        Self {
            target_circle: circle(&target),
            source_circle: circle(&source),
            target,
            source,
            weight,
            possible,
        }
    }

    /// Eq. 1: area [m2] that the hulls share when the source is moved by `motion`.
    fn overlap(&self, motion: &PlanarPose, sin_cos: (f32, f32)) -> f32 {
        let centre = motion.apply(sin_cos, self.source_circle.0);
        let apart2 =
            square(centre[0] - self.target_circle.0[0]) + square(centre[1] - self.target_circle.0[1]);
        if apart2 > square(self.source_circle.1 + self.target_circle.1) {
            return 0.0;
        }
        let moved: Hull = total::collect(self.source.iter().map(|p| motion.apply(sin_cos, *p)));
        polygon::intersection_area(&moved, &self.target)
    }
}

/// Eq. 2: weighted sum of the overlaps.
fn objective(pairs: &[HullPair], motion: &PlanarPose) -> f32 {
    let sin_cos = (math::sin(motion.yaw), math::cos(motion.yaw));
    pairs.iter().map(|p| p.weight * p.overlap(motion, sin_cos)).sum()
}

/// Section 3.2.4: the motion that maximises the overlap, searched around `start`.
pub fn register(
    config: &Config,
    seed: u64,
    start: PlanarPose,
    pairs: &[HullPair],
) -> (PlanarPose, HullEvidence) {
    if pairs.is_empty() {
        return (start, HullEvidence { pose: start, ..HullEvidence::default() });
    }
    let found = pso::maximise(
        &config.swarm,
        seed,
        [start.x, start.y, start.yaw],
        [config.search_m, config.search_m, config.search_rad],
        |p| objective(pairs, &PlanarPose { x: p[0], y: p[1], yaw: p[2] }),
    );
    let possible: f32 = pairs.iter().map(|p| p.weight * p.possible).sum();
    let [x, y, yaw] = found.position;
    let pose = PlanarPose { x, y, yaw };
    let evidence = HullEvidence {
        pose,
        pairs: pairs.len() as u32,
        overlap: found.value / possible.max(f32::MIN_POSITIVE),
        evaluations: found.evaluations,
        ..HullEvidence::default()
    };
    (pose, evidence)
}
