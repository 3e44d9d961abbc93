//! Loop detection, section 3.5: has the vehicle been here before, and where does it stand with respect to then?
//!
//! The caller makes a keyframe every metre or two, extracts its features from the pure static points
//! ([`FeatureExtractor`]), asks ([`LoopDetector::query`]) and adds the keyframe as a place ([`LoopDetector::add`]). An
//! answer names an old place and the transform from the new keyframe to it, to be refined and checked against the map by
//! the caller. [`Features`] are plain data: kept in a map, they find the place again in another run.
//!
//! | step | file | LinK3D and BoW3D | here |
//! | --- | --- | --- | --- |
//! | keypoints | `features.rs` | clusters of edge points on rings | things of the classes trunk, pole, sign, object |
//! | words | `words.rs`, `link3d.rs` | (value, dimension) of a descriptor | triangles of keypoints with their classes |
//! | places | `place_table.rs` | hash table of words, ratio and frequency test | the same, of fixed size |
//! | transform | `verification.rs` | RANSAC and closed form | consensus of the triangles and closed form |
//!
//! Why not LinK3D's words: they hold while the nearest neighbour of a keypoint is seen again. With the labels of a
//! network on real scans (KITTI raw drive 0005, the same street from 5 m farther or more, F1max 0.64 against 1.00) and
//! with one label in five wrong on simulated drives (08, driven the other way: 0.85 against 0.99) that is not often
//! enough. They are there as [`Rule::Bow3d`], with this verification.
//!
//! Ground, what moves and what may move never make a keypoint; keypoints are paired with those of their own class only.

mod features;
pub mod link3d;
mod place_table;
mod verification;
mod words;

use heapless::Vec;

pub use features::{FeatureExtractor, Features, KEYPOINT_CLASSES, Keypoint};

use crate::capacity::{CANDIDATES, HYPOTHESES, KEYPOINTS, WORDS};
use crate::error::{ParameterError, all_within};
use crate::pose::{PlanarPose, Pose};
use place_table::PlaceTable;
use words::{MAX_NEIGHBOURS, Triangle, triangles};

/// What a word of the table is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Rule {
    /// A triangle of keypoints with their classes.
    Triangles,
    /// The paper's: a value in one dimension of a LinK3D descriptor.
    Bow3d,
}

/// Parameters of LinK3D and BoW3D, for [`Rule::Bow3d`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Bow3dConfig {
    /// Keypoints, nearest first, whose descriptors make words.
    pub descriptors: u32,
    /// Words with more than this many times the mean of entries are not looked up (Th_r).
    pub max_ratio: f32,
    /// Words that one descriptor must have in common with a place (Th_f).
    pub min_votes: u32,
    /// Sectors that two descriptors must have in common to match.
    pub min_similarity: u32,
    /// Matches that a place must have to be verified, at least 3.
    pub min_matches: u32,
    /// Draws of RANSAC, at most 10000.
    pub draws: u32,
}

/// Parameters of the loop detection.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// What a word of the table is.
    pub rule: Rule,
    /// Points farther from the keyframe than this, horizontally, make no keypoints [m].
    pub max_range_m: f32,
    /// Side of the columns that points are gathered in [m].
    pub column_m: f32,
    /// Points that make a keypoint.
    pub min_points: u32,
    /// Height that makes a keypoint [m].
    pub min_height_m: f32,
    /// Things wider than this are no keypoints [m].
    pub max_width_m: f32,
    /// Nearest keypoints that each keypoint forms triangles with, 2 to 12.
    pub neighbours: u32,
    /// Keypoints nearer to each other than this form no triangle [m].
    pub min_side_m: f32,
    /// Sides of triangles are rounded to multiples of this [m].
    pub side_step_m: f32,
    /// Sides of the same triangle, seen twice, differ by at most this [m].
    pub side_tolerance_m: f32,
    /// Words that this many times more entries than the mean have are not looked up (BoW3D's ratio test).
    pub max_ratio: f32,
    /// Triangles in common that make a place a candidate (BoW3D's frequency test).
    pub min_votes: u32,
    /// A keypoint lies on another one when they are nearer than this, horizontally [m].
    pub inlier_radius_m: f32,
    /// Keypoints that must lie on keypoints of the old place.
    pub min_inliers: u32,
    /// Score that makes a loop, 0..1: share of the keypoints that lie on keypoints of the old place, each weighed by
    /// 1 - (distance / inlier_radius_m)^2.
    pub min_score: f32,
    /// Another transform to the same place may lay this share of the inliers on keypoints at most, 0..1: a street whose
    /// trees stand at equal distances fits itself in many ways.
    pub max_runner_up: f32,
    /// A loop along the same direction is no farther than this [m].
    pub max_distance_m: f32,
    /// A loop against the old direction, in the other lane, is no farther than this [m].
    pub max_reverse_distance_m: f32,
    /// Places younger than this are not asked for [s].
    pub min_gap_s: f32,
    /// LinK3D and BoW3D.
    pub bow3d: Bow3dConfig,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        rule: Rule::Triangles,
        max_range_m: 45.0,
        column_m: 0.3,
        min_points: 8,
        min_height_m: 0.3,
        max_width_m: 2.0,
        neighbours: 8,
        min_side_m: 2.0,
        side_step_m: 0.4,
        side_tolerance_m: 0.15,
        max_ratio: 20.0,
        min_votes: 4,
        inlier_radius_m: 0.3,
        min_inliers: 10,
        min_score: 0.3,
        max_runner_up: 0.75,
        max_distance_m: 2.98,
        max_reverse_distance_m: 9.9,
        min_gap_s: 30.0,
        bow3d: Bow3dConfig {
            descriptors: 5,
            max_ratio: 3.5,
            min_votes: 5,
            min_similarity: 4,
            min_matches: 12,
            draws: 400,
        },
    };

    /// The paper's words.
    pub const PAPER: Self = Self { rule: Rule::Bow3d, ..Self::DEFAULT };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        const fn refuse(parameter: &'static str, expected: &'static str) -> Result<(), ParameterError> {
            Err(ParameterError { parameter, expected })
        }
        if !all_within(&[self.max_range_m], 10.0, 200.0) {
            return refuse("loop_closure.max_range_m", "10 to 200 m");
        }
        if !all_within(&[self.column_m], 0.05, 2.0) {
            return refuse("loop_closure.column_m", "0.05 to 2 m");
        }
        if !all_within(&[self.min_height_m, self.max_width_m], 0.0, 10.0) {
            return refuse("loop_closure.min_height_m, max_width_m", "0 to 10 m");
        }
        if self.neighbours < 2 || self.neighbours as usize > MAX_NEIGHBOURS {
            return refuse("loop_closure.neighbours", "2 to 12");
        }
        if !all_within(&[self.min_side_m], 0.1, 50.0) {
            return refuse("loop_closure.min_side_m", "0.1 to 50 m");
        }
        if !all_within(&[self.side_step_m], 0.05, 5.0) {
            return refuse("loop_closure.side_step_m", "0.05 to 5 m");
        }
        if !(self.side_tolerance_m >= 0.0 && self.side_tolerance_m <= self.side_step_m) {
            return refuse("loop_closure.side_tolerance_m", "0 to side_step_m");
        }
        if !all_within(&[self.max_ratio, self.bow3d.max_ratio], 1.0, 1000.0) {
            return refuse("loop_closure.max_ratio, loop_closure.bow3d.max_ratio", "1 to 1000");
        }
        if !all_within(&[self.inlier_radius_m], 0.05, 5.0) {
            return refuse("loop_closure.inlier_radius_m", "0.05 to 5 m");
        }
        if self.min_inliers < 3 {
            return refuse("loop_closure.min_inliers", "at least 3");
        }
        if self.bow3d.min_matches < 3 {
            return refuse("loop_closure.bow3d.min_matches", "at least 3");
        }
        if self.bow3d.draws > 10_000 {
            return refuse("loop_closure.bow3d.draws", "at most 10000");
        }
        if !all_within(&[self.min_score, self.max_runner_up], 0.0, 1.0) {
            return refuse("loop_closure.min_score, max_runner_up", "0 to 1");
        }
        if !all_within(&[self.max_distance_m, self.max_reverse_distance_m, self.min_gap_s], 0.0, f32::MAX) {
            return refuse("loop_closure.max_distance_m, max_reverse_distance_m, min_gap_s", "at least 0");
        }
        Ok(())
    }
}

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
        let forward = self.old_from_new.rotation * nalgebra::Vector3::x();
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
