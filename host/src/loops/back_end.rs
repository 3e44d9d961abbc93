//! The back end at work.

use std::collections::BTreeMap;

use nalgebra::Matrix6;
use sdslam_core::capacity::{FullScanFeatureExtractor, HostLoopDetector};
use sdslam_core::loop_closure::Features;
use sdslam_core::{Config as CoreConfig, FrameEstimate, FrameStatus, LabelledPoint, MapPose};

use super::agreement::agree;
use super::correction::corrected_trajectory;
use super::keyframe::{Keyframe, OdometryError};
use super::nearness::reachable_within;
use super::proposal::{Proposal, Source};
use super::table::{self, LoopRow};
use super::{PLACE_RANGE_M, Place, Refiner, Verdict};
use crate::config::{HostConfig, LoopConfig};
use crate::heap::on_heap;
use crate::pose_graph::{Edge, EdgeKind, PoseGraph, g2o};
use crate::run::RunError;
use crate::saved_map::SavedPlace;
use crate::semantic_map::{RangeImage, SemanticMap, StaticMap};

/// Two places this near along the graph are fixed to each other by less than a voxel \[m\].
const RIGID_WITHIN_M: f64 = 120.0;
/// A loop counts this much along the graph \[m\].
const LOOP_LENGTH_M: f64 = 10.0;
/// Length of a submap along the path \[m\].
const SUBMAP_M: f64 = 30.0;
/// Path between two keyframes whose scans look for free space \[m\].
const FREE_SPACE_EVERY_M: f64 = 4.0;
/// The corrected trajectory comes near an old place within this \[m\]: the other carriageway is seen from here.
const NEARBY_M: f64 = 20.0;
/// One scan as the back end takes it.
pub(crate) struct BackEndScan {
    /// Points with their classes.
    pub points: Vec<LabelledPoint>,
    /// Intensity of every point.
    pub intensities: Vec<f32>,
    /// What the odometry says.
    pub estimate: FrameEstimate,
}

/// What the back end made of a drive.
pub(crate) struct BackEndResult {
    /// Corrected pose of every frame; where no loop was accepted, the very bits of the odometry.
    pub map_from_sensor: Vec<MapPose>,
    /// The map.
    pub map: StaticMap,
    /// loops.csv.
    pub loops_csv: String,
    /// graph.g2o.
    pub graph_g2o: String,
    /// Keyframes with their features, by which a later drive finds itself; none without loop closure.
    pub places: Vec<SavedPlace>,
    /// For the summary.
    pub counts: LoopCounts,
}

/// What became of the proposed loops, and the size of it all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LoopCounts {
    /// Keyframes in the graph.
    pub keyframes: usize,
    /// Loops proposed and refined.
    pub proposed: usize,
    /// Loops in the graph.
    pub accepted: usize,
    /// Voxels in memory at the end.
    pub voxels_in_memory: usize,
    /// Voxels left out of the map because they were seen through.
    pub voxels_seen_through: usize,
}

/// The back end with its memory.
pub(crate) struct BackEnd {
    config: LoopConfig,
    core: CoreConfig,
    map: SemanticMap,
    graph: PoseGraph,
    keyframes: Vec<Keyframe>,
    since_keyframe: OdometryError,
    submap_began_m: f64,
    free_space_m: f64,
    /// Of every frame: the pose by the odometry and the keyframe at or before it.
    frames: Vec<(MapPose, usize)>,
    path_m: f64,
    detector: Box<HostLoopDetector>,
    extractor: Box<FullScanFeatureExtractor>,
    refiner: Refiner,
    /// Scan of the last keyframe: its features are complete when the next one begins.
    last_scan: Vec<LabelledPoint>,
    /// Row of the last proposal that passed and is not in the graph: it waits for another that agrees.
    unconfirmed: Option<(usize, Edge)>,
    /// The last loop that went into the graph.
    last_loop: Option<(usize, Edge)>,
    rows: Vec<LoopRow>,
    /// Features of the completed keyframes.
    features: Vec<Features>,
    /// The row of every loop in the graph.
    row_of_edge: BTreeMap<usize, usize>,
    /// The keyframes that loops join each keyframe with.
    loops_at: BTreeMap<usize, Vec<usize>>,
}

impl BackEnd {
    pub(crate) fn new(config: &HostConfig) -> Result<Self, RunError> {
        let core = config.core;
        Ok(Self {
            config: config.loops,
            core,
            map: SemanticMap::new(config.map),
            graph: PoseGraph::new(),
            keyframes: Vec::new(),
            since_keyframe: OdometryError::start(),
            submap_began_m: 0.0,
            free_space_m: f64::NEG_INFINITY,
            frames: Vec::new(),
            path_m: 0.0,
            detector: on_heap(move || HostLoopDetector::new(core.loop_closure))?,
            extractor: on_heap(|| Ok::<_, RunError>(FullScanFeatureExtractor::new()))?,
            refiner: Refiner::new(core)?,
            last_scan: Vec::new(),
            unconfirmed: None,
            last_loop: None,
            loops_at: BTreeMap::new(),
            rows: Vec::new(),
            features: Vec::new(),
            row_of_edge: BTreeMap::new(),
        })
    }

    /// Takes the next scan of the drive.
    pub(crate) fn add(&mut self, scan: BackEndScan) -> Result<(), RunError> {
        let odometry = scan.estimate.map_from_sensor;
        let step_m = |(before, _): &(MapPose, usize)| before.inv_mul(&odometry).translation.vector.norm();
        self.path_m += self.frames.last().map_or(0.0, step_m);
        self.since_keyframe.add(&scan.estimate);
        let registered = !matches!(scan.estimate.status, FrameStatus::Predicted(_));
        let spacing_m = self.config.keyframe_m;
        let is_due = self.keyframes.last().is_none_or(|last| last.is_left_behind(&odometry, spacing_m));
        if is_due && (registered || self.keyframes.is_empty()) {
            self.complete_keyframe()?;
            self.begin_keyframe(&scan)?;
        }
        let keyframe = self.keyframes.len() - 1;
        self.frames.push((odometry, keyframe));
        if registered {
            self.map.add_scan(&scan.points, &scan.intensities, &odometry);
            if self.config.enabled {
                let keyframe_from_sensor = self.keyframes[keyframe].odometry.inv_mul(&odometry);
                self.extractor.add(&self.core.loop_closure, &scan.points, &keyframe_from_sensor.cast());
            }
        }
        Ok(())
    }

    /// All scans are in.
    pub(crate) fn finish(mut self: Box<Self>) -> Result<BackEndResult, RunError> {
        self.complete_keyframe()?;
        let unmoved = self.row_of_edge.is_empty();
        let poses = self.graph.poses();
        let map_from_sensor = match unmoved {
            true => self.frames.iter().map(|(odometry, _)| *odometry).collect(),
            false => corrected_trajectory(&self.frames, &self.keyframes, poses),
        };
        let correction = |anchor: usize| match unmoved {
            true => MapPose::identity(),
            false => poses[anchor] * self.keyframes[anchor].odometry.inverse(),
        };
        let map = self.map.assemble(correction);
        let counts = LoopCounts {
            keyframes: self.keyframes.len(),
            proposed: self.rows.len(),
            accepted: self.rows.iter().filter(|row| row.verdict == Verdict::Accepted).count(),
            voxels_in_memory: self.map.voxels_in_memory(),
            voxels_seen_through: map.seen_through(),
        };
        let lines = self.rows.iter().map(LoopRow::line);
        let loops_csv = std::iter::once(table::HEADER.to_string()).chain(lines).collect();
        let graph_g2o = g2o::to_text(&self.graph);
        let place = |(pose, features): (&MapPose, &Features)| SavedPlace {
            map_from_place: *pose,
            features: features.clone(),
        };
        let places = poses.iter().zip(&self.features).map(place).collect();
        Ok(BackEndResult { map_from_sensor, map, loops_csv, graph_g2o, places, counts })
    }

    /// The features of the last keyframe are complete: looks for loops from it, then makes it a place.
    fn complete_keyframe(&mut self) -> Result<(), RunError> {
        let Some(&last) = self.keyframes.last().filter(|_| self.config.enabled) else { return Ok(()) };
        let new = self.keyframes.len() - 1;
        let features = self.extractor.finish(&self.core.loop_closure);
        self.extractor.clear();
        let last_loop_m =
            self.last_loop.map_or(f64::NEG_INFINITY, |(_, edge)| self.keyframes[edge.to].path_m);
        if last.path_m - last_loop_m >= self.config.spacing_m || self.unconfirmed.is_some() {
            let candidates = self.detector.query(&features, Some(last.stamp_s));
            let proposals = candidates.iter().map(|candidate| Proposal {
                old: candidate.place as usize,
                old_from_new: candidate.old_from_new.cast(),
                source: Source::Features,
                keypoint_inliers: candidate.inliers,
            });
            let mut proposals: Vec<Proposal> = proposals.take(self.config.max_candidates as usize).collect();
            proposals.extend(self.nearby(new));
            for proposal in proposals {
                if self.try_loop(new, &proposal)? {
                    break;
                }
            }
        }
        self.detector.add(new as u32, last.stamp_s, &features);
        self.features.push(features);
        Ok(())
    }

    fn begin_keyframe(&mut self, scan: &BackEndScan) -> Result<(), RunError> {
        let odometry = scan.estimate.map_from_sensor;
        let keyframe = Keyframe {
            frame: self.frames.len(),
            stamp_s: scan.estimate.stamp_s,
            odometry,
            path_m: self.path_m,
        };
        match self.keyframes.last() {
            None => {
                self.graph.add_keyframe(odometry);
            }
            Some(last) => {
                let last_from_new = last.odometry.inv_mul(&odometry);
                let from = self.keyframes.len() - 1;
                let to = self.graph.add_keyframe(self.graph.poses()[from] * last_from_new);
                let information = self.since_keyframe.information().unwrap_or_else(Matrix6::identity);
                let kind = EdgeKind::Odometry;
                self.graph.add_edge(Edge { from, to, from_from_to: last_from_new, information, kind })?;
            }
        }
        self.keyframes.push(keyframe);
        self.since_keyframe = OdometryError::start();
        self.last_scan.clone_from(&scan.points);
        self.extend_map(scan);
        Ok(())
    }

    /// The submap ends, if it is long enough, and the scan of the new keyframe looks for free space.
    fn extend_map(&mut self, scan: &BackEndScan) {
        let new = self.keyframes.len() - 1;
        let path_m = self.path_m;
        let begins = new == 0 || path_m - self.submap_began_m >= SUBMAP_M;
        let looks = path_m - self.free_space_m >= FREE_SPACE_EVERY_M;
        if !begins && !looks {
            return;
        }
        let rigid = self.rigid_with(new);
        if begins {
            let to_older = |ended: usize| {
                let rigid = &rigid;
                let (keyframes, poses) = (&self.keyframes, self.graph.poses());
                move |older: usize| {
                    rigid.contains_key(&older).then(|| between(keyframes, poses, older, ended))
                }
            };
            let ended = self.map.present_anchor().unwrap_or(0);
            self.map.finish_submap(to_older(ended));
            self.map.begin_submap(new);
            self.submap_began_m = path_m;
        }
        if looks {
            let image = RangeImage::of(&scan.points);
            let (keyframes, poses) = (&self.keyframes, self.graph.poses());
            let odometry = scan.estimate.map_from_sensor;
            self.map.add_free_space(&image, |anchor| {
                rigid.contains_key(&anchor).then(|| between(keyframes, poses, anchor, new) * odometry)
            });
            self.free_space_m = path_m;
        }
    }

    /// Keyframes that the graph fixes to `keyframe`, with the length of the way \[m\].
    fn rigid_with(&self, keyframe: usize) -> BTreeMap<usize, f64> {
        let path_m = |k: usize| self.keyframes[k].path_m;
        reachable_within(keyframe, RIGID_WITHIN_M, |k| {
            let before = k.checked_sub(1).map(|other| (other, path_m(k) - path_m(other)));
            let after = (k + 1 < self.keyframes.len()).then(|| (k + 1, path_m(k + 1) - path_m(k)));
            let others = self.loops_at.get(&k).into_iter().flatten().map(|&other| (other, LOOP_LENGTH_M));
            before.into_iter().chain(after).chain(others).collect::<Vec<_>>()
        })
    }

    /// An old keyframe that the new one comes near by the corrected poses.
    fn nearby(&self, new: usize) -> Option<Proposal> {
        let poses = self.graph.poses();
        let here = self.keyframes[new];
        let gap_s = f64::from(self.core.loop_closure.min_gap_s);
        let apart_m = |old: usize| (poses[old].translation.vector - poses[new].translation.vector).norm();
        let is_old = |old: &usize| here.stamp_s - self.keyframes[*old].stamp_s >= gap_s;
        let nearest = (0..new).filter(is_old).min_by(|a, b| apart_m(*a).total_cmp(&apart_m(*b)))?;
        (apart_m(nearest) <= NEARBY_M).then(|| Proposal {
            old: nearest,
            old_from_new: poses[nearest].inv_mul(&poses[new]),
            source: Source::Position,
            keypoint_inliers: 0,
        })
    }

    /// The map around where the proposal says the new keyframe is, in the frame of that; what was mapped since the gap
    /// began stays out.
    fn place(&self, new: usize, proposal: &Proposal) -> Place {
        let old = proposal.old;
        let rigid = self.rigid_with(old);
        let gap_s = f64::from(self.core.loop_closure.min_gap_s);
        let (keyframes, poses) = (&self.keyframes, self.graph.poses());
        let is_old = |anchor: usize| keyframes[new].stamp_s - keyframes[anchor].stamp_s >= 0.5 * gap_s;
        let place_from_odometry = (keyframes[old].odometry * proposal.old_from_new).inverse();
        let mut place = Place::default();
        let place_from_submap = |anchor: usize| {
            let usable = rigid.contains_key(&anchor) && is_old(anchor);
            usable.then(|| place_from_odometry * between(keyframes, poses, old, anchor))
        };
        self.map.for_voxels_near(PLACE_RANGE_M, place_from_submap, |mean, class, count| {
            place.add(mean, class, count)
        });
        place
    }

    /// Refines and tests a proposal; whether it passed the tests of its own.
    fn try_loop(&mut self, new: usize, proposal: &Proposal) -> Result<bool, RunError> {
        let place = self.place(new, proposal);
        let refined = self.refiner.refine(&self.last_scan, &place, &MapPose::identity());
        let old_from_new = proposal.old_from_new * refined.place_from_sensor;
        let against = Verdict::against(&self.config, &refined);
        let row = self.rows.len();
        self.rows.push(LoopRow {
            frame: self.keyframes[new].frame,
            old_frame: self.keyframes[proposal.old].frame,
            source: proposal.source,
            keypoint_inliers: proposal.keypoint_inliers,
            refined,
            old_from_new,
            verdict: against.unwrap_or(Verdict::Unconfirmed),
        });
        let edge = refined.edge(proposal.old, new, old_from_new);
        let Some(edge) = edge.filter(|_| against.is_none()) else { return Ok(false) };
        let waiting = self.unconfirmed.take();
        let confirms = |(_, earlier): &(usize, Edge)| agree(&self.keyframes, earlier, &edge);
        let is_accepted = |(row, _): &(usize, Edge)| self.rows[*row].verdict == Verdict::Accepted;
        match waiting.filter(confirms) {
            Some(waiting) => self.close(&[waiting, (row, edge)])?,
            None if self.last_loop.filter(is_accepted).as_ref().is_some_and(confirms) => {
                self.close(&[(row, edge)])?
            }
            None => self.unconfirmed = Some((row, edge)),
        }
        Ok(true)
    }

    /// Puts loops into the graph and corrects the poses.
    fn close(&mut self, loops: &[(usize, Edge)]) -> Result<(), RunError> {
        for (row, edge) in loops {
            self.row_of_edge.insert(self.graph.edges().len(), *row);
            self.graph.add_edge(*edge)?;
            self.loops_at.entry(edge.from).or_default().push(edge.to);
            self.loops_at.entry(edge.to).or_default().push(edge.from);
        }
        self.graph.optimise()?;
        for (&edge, &row) in &self.row_of_edge {
            let believed = self.graph.weights()[edge] > 0.5;
            self.rows[row].verdict = if believed { Verdict::Accepted } else { Verdict::Disbelieved };
        }
        self.last_loop = loops.last().copied();
        Ok(())
    }
}

/// From the odometry frame as the submap of `from` has it to that of `to`.
fn between(keyframes: &[Keyframe], poses: &[MapPose], to: usize, from: usize) -> MapPose {
    let correction = |k: usize| poses[k] * keyframes[k].odometry.inverse();
    let unmoved = poses[to] == keyframes[to].odometry && poses[from] == keyframes[from].odometry;
    if unmoved || to == from { MapPose::identity() } else { correction(to).inv_mul(&correction(from)) }
}
