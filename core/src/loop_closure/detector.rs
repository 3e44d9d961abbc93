//! What the caller holds: the places seen so far, and what finds them again.

use heapless::Vec;
use nalgebra::Vector3;

use super::features::Features;
use super::place_table::PlaceTable;
use super::words::{Triangle, triangles};
use super::{Config, Rule, link3d, verification};
use crate::capacity::{CANDIDATES, HYPOTHESES, KEYPOINTS, WORDS};
use crate::error::ParameterError;
use crate::pose::{PlanarPose, Pose};

/// A place that was recognised, with the transform to it: to be refined and checked by the caller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopCandidate {
    /// The old place, by the number it was added with.
    pub place: u32,
    /// Pose of the new keyframe in the frame of the old place.
    pub old_from_new: Pose,
    /// What the two have in common: triangles; with [`Rule::Bow3d`] matched keypoints.
    pub matches: u32,
    /// Pairs of keypoints of one class that the transform lays on each other.
    pub inliers: u32,
    /// Pairs that the best other transform to the same place lays on each other.
    pub runner_up: u32,
    /// Inliers, each weighed by 1 - (distance / inlier radius)^2, as a share of the keypoints that both should show, 0..1.
    pub score: f32,
    /// Root mean square horizontal distance of the pairs [m].
    pub residual_m: f32,
}

impl LoopCandidate {
    /// The street is driven the other way this time.
    pub fn is_reverse(&self) -> bool {
        let forward = self.old_from_new.rotation * Vector3::x();
        forward.x < -0.5
    }

    /// Distance from the old place [m].
    pub fn distance_m(&self) -> f32 {
        self.old_from_new.translation.vector.norm()
    }
}

/// A place under examination.
struct Examined {
    place: u16,
    votes: u16,
    matches: u32,
    hypotheses: Vec<PlanarPose, HYPOTHESES>,
}

/// A word to look up, and the keypoints it is made of.
type Word = (u32, [u8; 3]);

/// The places seen so far, and what finds them again: no allocation, a bounded cost per question.
///
/// When all `PLACES` are taken, the place that was added first is forgotten. The capacities are explained in
/// [`crate::capacity`]. It is large: build it on a thread with a large stack and box it, or in a static.
pub struct LoopDetector<const PLACES: usize, const BUCKETS: usize> {
    config: Config,
    table: PlaceTable<PLACES, BUCKETS>,
    votes: [u16; PLACES],
    counts: [u16; PLACES],
    examined: Vec<Examined, CANDIDATES>,
}

impl<const PLACES: usize, const BUCKETS: usize> LoopDetector<PLACES, BUCKETS> {
    /// A detector that knows no place.
    ///
    /// # Errors
    /// A parameter out of range.
    pub const fn new(config: Config) -> Result<Self, ParameterError> {
        if let Err(error) = config.check() {
            return Err(error);
        }
        Ok(Self {
            config,
            table: PlaceTable::new(),
            votes: [0; PLACES],
            counts: [0; PLACES],
            examined: Vec::new(),
        })
    }

    /// Forgets all places.
    pub fn clear(&mut self) {
        self.table.clear();
    }

    /// Places in the table.
    pub fn len(&self) -> usize {
        self.table.places().len()
    }

    /// No places in the table.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Places that were forgotten because the table was full.
    pub fn forgotten(&self) -> u32 {
        self.table.forgotten()
    }

    /// Adds a keyframe as a place; `place` is the caller's number for it. When the table is full, the place that was
    /// added first is forgotten.
    pub fn add(&mut self, place: u32, stamp_s: f64, features: &Features) {
        let words: Vec<Word, WORDS> = match self.config.rule {
            Rule::Triangles => {
                let step_m = self.config.side_step_m;
                triangles(&self.config, features).iter().map(|t| (t.word(step_m), t.corners)).collect()
            }
            Rule::Bow3d => link3d::words(&self.config.bow3d, features),
        };
        self.table.add(place, stamp_s, features.reach_m(&self.config), features, &words);
    }

    /// The old places that `features` fit, best first. `stamp_s` keeps out places younger than
    /// [`Config::min_gap_s`]; without it, as in a saved map, every place is asked for.
    pub fn query(&mut self, features: &Features, stamp_s: Option<f64>) -> Vec<LoopCandidate, CANDIDATES> {
        let newest_s = stamp_s.map_or(f64::INFINITY, |s| s - f64::from(self.config.min_gap_s));
        self.votes.fill(0);
        match self.config.rule {
            Rule::Triangles => {
                let triangles = triangles(&self.config, features);
                self.vote_by_triangles(&triangles);
                self.choose(self.config.min_votes, newest_s);
                self.collect(&triangles, features);
            }
            Rule::Bow3d => {
                self.vote_by_descriptors(features);
                self.choose(self.config.bow3d.min_votes, newest_s);
                self.match_descriptors(features);
            }
        }
        self.verify(features)
    }

    /// Counts the triangles that each place has in common with the new keyframe.
    fn vote_by_triangles(&mut self, triangles: &[Triangle]) {
        let (table, votes, config) = (&self.table, &mut self.votes, &self.config);
        let limit = table.entry_limit(config.max_ratio);
        for triangle in triangles {
            triangle.for_words(config.side_step_m, config.side_tolerance_m, |word| {
                if table.is_rare(word, limit) {
                    table.for_entries(word, |place, _| votes[place] = votes[place].saturating_add(1));
                }
            });
        }
    }

    /// BoW3D's retrieval: the words that one descriptor of the new keyframe has in common with each place, the most of
    /// any of its descriptors.
    fn vote_by_descriptors(&mut self, features: &Features) {
        let (table, votes, counts) = (&self.table, &mut self.votes, &mut self.counts);
        let limit = table.entry_limit(self.config.bow3d.max_ratio);
        let words = link3d::words(&self.config.bow3d, features);
        for descriptor in words.chunk_by(|a, b| a.1 == b.1) {
            counts.fill(0);
            for (word, _) in descriptor {
                if table.is_rare(*word, limit) {
                    table.for_entries(*word, |place, _| counts[place] += 1);
                }
            }
            for (most, count) in votes.iter_mut().zip(counts.iter()) {
                *most = (*most).max(*count);
            }
        }
    }

    /// The places with the most votes.
    fn choose(&mut self, min_votes: u32, newest_s: f64) {
        self.examined.clear();
        for (index, (place, votes)) in self.table.places().iter().zip(&self.votes).enumerate() {
            if u32::from(*votes) < min_votes || place.stamp_s > newest_s {
                continue;
            }
            let at = self.examined.iter().position(|e| *votes > e.votes).unwrap_or(self.examined.len());
            if at < CANDIDATES {
                self.examined.truncate(CANDIDATES - 1);
                let examined =
                    Examined { place: index as u16, votes: *votes, matches: 0, hypotheses: Vec::new() };
                // There is room: the last one was dropped.
                let _ = self.examined.insert(at, examined);
            }
        }
    }

    /// The transforms that the common triangles of the chosen places propose.
    fn collect(&mut self, triangles: &[Triangle], features: &Features) {
        // From here on, `votes` holds each place's rank among the examined, from 1.
        self.votes.fill(0);
        for (rank, examined) in self.examined.iter_mut().enumerate() {
            examined.matches = u32::from(examined.votes);
            self.votes[examined.place as usize] = rank as u16 + 1;
        }
        let (table, votes, examined, config) = (&self.table, &self.votes, &mut self.examined, &self.config);
        let limit = table.entry_limit(config.max_ratio);
        for triangle in triangles {
            let new = triangle.corners.map(|i| features.keypoints[i as usize].position);
            triangle.for_words(config.side_step_m, config.side_tolerance_m, |word| {
                if !table.is_rare(word, limit) {
                    return;
                }
                table.for_entries(word, |place, corners| {
                    let Some(rank) = votes[place].checked_sub(1) else { return };
                    let old = corners.map(|i| table.places()[place].position(i));
                    let (pose, worst_m) = verification::planar_from_triples(new, old);
                    if worst_m < 1.5 * config.inlier_radius_m {
                        // More hypotheses than fit say the same again.
                        let _ = examined[rank as usize].hypotheses.push(pose);
                    }
                });
            });
        }
    }

    /// The transforms that matched descriptors of the chosen places propose.
    fn match_descriptors(&mut self, features: &Features) {
        let positions: Vec<[f32; 3], KEYPOINTS> = features.keypoints.iter().map(|k| k.position).collect();
        let descriptors: Vec<_, KEYPOINTS> =
            (0..positions.len()).map(|i| link3d::descriptor(&positions, i)).collect();
        for examined in &mut self.examined {
            let place = &self.table.places()[examined.place as usize];
            let hypotheses = &mut examined.hypotheses;
            examined.matches = link3d::propose(&self.config, features, &descriptors, place, hypotheses);
        }
    }

    fn verify(&self, features: &Features) -> Vec<LoopCandidate, CANDIDATES> {
        let mut candidates: Vec<LoopCandidate, CANDIDATES> = Vec::new();
        for examined in &self.examined {
            let place = &self.table.places()[examined.place as usize];
            let Some(found) = verification::verify(&self.config, features, place, &examined.hypotheses)
            else {
                continue;
            };
            let candidate = LoopCandidate {
                place: place.id,
                old_from_new: found.old_from_new,
                matches: examined.matches,
                inliers: found.inliers,
                runner_up: found.runner_up,
                score: found.score,
                residual_m: found.residual_m,
            };
            if self.accepts(&candidate) {
                let at =
                    candidates.iter().position(|c| candidate.score > c.score).unwrap_or(candidates.len());
                // As many as were examined.
                let _ = candidates.insert(at, candidate);
            }
        }
        candidates
    }

    fn accepts(&self, candidate: &LoopCandidate) -> bool {
        let config = &self.config;
        let reach_m =
            if candidate.is_reverse() { config.max_reverse_distance_m } else { config.max_distance_m };
        candidate.inliers >= config.min_inliers
            && candidate.score >= config.min_score
            && candidate.runner_up as f32 <= config.max_runner_up * candidate.inliers as f32
            && candidate.distance_m() < reach_m
    }
}
