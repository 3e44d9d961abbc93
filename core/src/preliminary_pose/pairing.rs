//! Section 3.2.1: landmark pairs by the distance criterion and the semantic criterion.
//!
//! Deviation: centres are moved by the predicted motion first (at 10 m/s they shift by a metre a scan). The paper's rule
//! accepts a nearest neighbour nearer than the mean of all nearest distances; the default asks for mutual nearest
//! neighbours within a gate, which does not throw away half of the pairs.

use heapless::VecView;
use nalgebra::Point3;

use crate::error::ParameterError;
use crate::landmarks::Landmark;
use crate::pose::Pose;
use crate::scan::SemanticClass;
use crate::total;

/// Rule that accepts a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Rule {
    /// Nearer than the mean of the nearest distances (the paper).
    MeanDistance,
    /// Mutual nearest neighbours within the gate.
    Mutual,
}

/// Parameters of the pairing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Rule that accepts a pair.
    pub rule: Rule,
    /// Centres farther apart than this never pair [m].
    pub gate_m: f32,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self { rule: Rule::Mutual, gate_m: 1.5 };
    /// The paper's rule.
    pub const PAPER: Self = Self { rule: Rule::MeanDistance, gate_m: 5.0 };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if self.gate_m > 0.0 {
            Ok(())
        } else {
            Err(ParameterError { parameter: "pairing.gate_m", expected: "positive" })
        }
    }
}

/// A possible pair: indices of landmarks and the distance of their centres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Index into the target's landmarks.
    pub target: u16,
    /// Index into the source's landmarks.
    pub source: u16,
    /// Distance of the centres [m].
    pub distance_m: f32,
}

/// Pairs the landmarks of `source` with those of `target`, nearest first.
pub fn pair<'a>(
    config: &Config,
    target: impl Iterator<Item = &'a Landmark> + Clone,
    source: &'a [Landmark],
    target_from_source: &Pose,
    usable: impl Fn(&Landmark) -> bool,
    pairs: &mut VecView<Candidate>,
) {
    pairs.clear();
    let moved = |l: &Landmark| -> [f32; 3] { (target_from_source * Point3::from(l.centre)).coords.into() };
    let (mut sum, mut found) = (0.0, 0u32);
    for (t, landmark) in target.clone().enumerate().filter(|(_, l)| usable(l)) {
        let nearest_source = nearest(landmark.family, &landmark.centre, source.iter(), moved, &usable);
        let Some((s, distance_m)) = nearest_source.filter(|n| n.1 < config.gate_m) else { continue };
        (sum, found) = (sum + distance_m, found + 1);
        let Some(partner) = source.get(s) else { continue };
        let back = || nearest(landmark.family, &moved(partner), target.clone(), |l| l.centre, &usable);
        if config.rule == Rule::Mutual && back().is_none_or(|(b, _)| b != t) {
            continue;
        }
        let _ = pairs.push(Candidate { target: t as u16, source: s as u16, distance_m });
    }
    if config.rule == Rule::MeanDistance {
        let mean = sum / found.max(1) as f32;
        pairs.retain(|p| p.distance_m < mean);
    }
    total::sort_by(pairs, |a, b| a.distance_m.total_cmp(&b.distance_m).then(a.target.cmp(&b.target)).is_lt());
}

fn distance2(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

/// The landmark of a family nearest to a place, with its distance [m].
fn nearest<'a>(
    family: SemanticClass,
    place: &[f32; 3],
    among: impl Iterator<Item = &'a Landmark>,
    centre_of: impl Fn(&Landmark) -> [f32; 3],
    usable: &impl Fn(&Landmark) -> bool,
) -> Option<(usize, f32)> {
    among
        .enumerate()
        .filter(|(_, l)| l.family == family && usable(l))
        .map(|(i, l)| (i, distance2(&centre_of(l), place)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, d2)| (i, crate::math::sqrt(d2)))
}
