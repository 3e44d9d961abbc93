//! A proposed loop is refined by the core's dense registration: the scan of the new keyframe against the map of the old
//! place, first with large voxels for reach, then with small ones.

use nalgebra::{Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use sdslam_core::label_filter;
use sdslam_core::precise_pose::dense::{self, Registration, SourcePoint};
use sdslam_core::precise_pose::voxel_map::{self, Group, VoxelMap};
use sdslam_core::scan_cells::ScanCells;
use sdslam_core::{Config as CoreConfig, LabelledPoint, MapPose, Pose, SemanticClass};

use super::keyframe::covariance_of;
use crate::heap::on_heap;
use crate::pose_graph::{Edge, EdgeKind};
use crate::run::RunError;
use crate::semantic_map::{RangeImage, enters};

/// Points of the new scan farther than this are not registered \[m\].
const SOURCE_RANGE_M: f32 = 40.0;
/// Map around a place that is registered against \[m\].
pub(crate) const PLACE_RANGE_M: f64 = 50.0;
/// Edges of the voxels \[m\]: large ones reach farther, small ones are exact.
const COARSE_M: f32 = 2.0;
const FINE_M: f32 = 1.0;
/// Points of the map a voxel counts at most: near places must not outweigh far ones.
const MAX_COUNT: u32 = 10;
/// Old points within this range of the new sensor are asked whether they were seen through \[m\],
const SEEN_THROUGH_RANGE_M: f32 = 25.0;
/// by this much \[m\].
const SEEN_THROUGH_MARGIN_M: f32 = 1.0;

/// The map of the old place is off by about this, which the covariance of a registration does not know: standard
/// deviations \[m\], \[rad\] (measured along simulated drives).
const PLACE_M: f64 = 0.008;
const PLACE_RAD: f64 = 0.000_25;

type Cells = ScanCells<32768>;
type Voxels = VoxelMap<8192>;

/// The static map around an old place, in the frame of the place.
#[derive(Clone, Debug, Default)]
pub(crate) struct Place {
    points: Vec<(Vector3<f32>, SemanticClass, u32)>,
}

impl Place {
    /// Adds the mean \[m, frame of the place\] of `count` points, if it is near.
    pub(crate) fn add(&mut self, position: [f64; 3], class: SemanticClass, count: u32) {
        let position = Vector3::from(position);
        if position.norm_squared() <= PLACE_RANGE_M * PLACE_RANGE_M {
            self.points.push((position.map(|v| v as f32), class, count));
        }
    }
}

/// Outcome of a refinement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Refined {
    /// Pose of the new sensor in the frame of the old place.
    pub place_from_sensor: MapPose,
    /// Its covariance, sensor frame.
    pub covariance: [[f32; 6]; 6],
    /// Points that fit.
    pub inliers: u32,
    /// Share that fits, of the points above ground that lie on something of their kind, 0..1.
    pub fit: f32,
    /// Share of the points above ground that lie on something of their kind, 0..1.
    pub overlap: f32,
    /// Share of the old place's near points above ground that the new scan saw through, 0..1.
    pub seen_through: f32,
    /// Distance from the proposal \[m\].
    pub moved_m: f32,
    /// All six degrees of freedom are fixed.
    pub determined: bool,
}

impl Refined {
    /// What the graph is told: the registration's covariance, and what it does not know added.
    pub(crate) fn edge(&self, old: usize, new: usize, from_from_to: MapPose) -> Option<Edge> {
        let (p, r) = (PLACE_M * PLACE_M, PLACE_RAD * PLACE_RAD);
        let unknown = Matrix6::from_diagonal(&Vector6::new(p, p, p, r, r, r));
        let information = (covariance_of(&self.covariance) + unknown).cholesky()?.inverse();
        Some(Edge { from: old, to: new, from_from_to, information, kind: EdgeKind::Loop })
    }
}

/// The buffers of the registration.
pub(crate) struct Refiner {
    core: CoreConfig,
    cells: Box<Cells>,
    voxels: Box<Voxels>,
    source: Vec<SourcePoint>,
}

impl Refiner {
    pub(crate) fn new(core: CoreConfig) -> Result<Self, RunError> {
        Ok(Self {
            core,
            cells: on_heap(|| Ok::<_, RunError>(Cells::new()))?,
            voxels: on_heap(|| Ok::<_, RunError>(Voxels::new()))?,
            source: Vec::new(),
        })
    }

    /// Registers the static points of a scan against a place, from `start`, which may be off by a metre.
    pub(crate) fn refine(&mut self, points: &[LabelledPoint], place: &Place, start: &MapPose) -> Refined {
        self.gather_source(points);
        let proposed: Pose = start.cast();
        self.load(place, COARSE_M);
        let coarse = self.register(COARSE_M, &proposed);
        self.load(place, FINE_M);
        let fine = self.register(FINE_M, &coarse.local_from_sensor);
        let seen_through = seen_through(points, place, &fine.local_from_sensor);
        self.judge(&proposed, &fine, seen_through)
    }

    /// Makes a place the one that [`Self::track`] registers against.
    pub(crate) fn load_place(&mut self, place: &Place) {
        self.load(place, FINE_M);
    }

    /// Registers the static points of a scan against the place loaded last, from `start`, which is good to some
    /// decimetres.
    pub(crate) fn track(&mut self, points: &[LabelledPoint], start: &MapPose) -> Refined {
        self.gather_source(points);
        let proposed: Pose = start.cast();
        let result = self.register(FINE_M, &proposed);
        self.judge(&proposed, &result, 0.0)
    }

    fn gather_source(&mut self, points: &[LabelledPoint]) {
        let mut points: Vec<LabelledPoint> = points.iter().copied().filter(|p| enters(p.class)).collect();
        let filter = label_filter::Config { max_range_m: SOURCE_RANGE_M, ..self.core.label_filter };
        label_filter::filter(&filter, &mut points, &mut self.cells);
        self.source.clear();
        let cells = self.cells.cells().iter();
        self.source.extend(cells.map(|c| SourcePoint { position: c.mean(), group: Group::of(c.class) }));
    }

    fn load(&mut self, place: &Place, voxel_m: f32) {
        let voxels = self.voxel_config(voxel_m);
        self.voxels.clear();
        for (position, class, count) in &place.points {
            let weight = (*count).min(MAX_COUNT) as f32;
            self.voxels.merge(&voxels, Group::of(*class), 0.0, position, &Matrix3::zeros(), weight);
        }
    }

    fn voxel_config(&self, voxel_m: f32) -> voxel_map::Config {
        voxel_map::Config { voxel_m, window_m: f32::MAX, ..self.core.precise_pose.voxels }
    }

    fn dense_config(&self) -> dense::Config {
        dense::Config { max_iterations: 30, hold_m: 1.0, hold_rad: 0.1, ..self.core.precise_pose.dense }
    }

    fn register(&self, voxel_m: f32, start: &Pose) -> Registration {
        let dense = self.dense_config();
        let config = dense::Config { kernel_start: dense.kernel_start * voxel_m, ..dense };
        dense::register(&config, &self.voxel_config(voxel_m), &self.voxels, 0.0, &self.source, start)
    }

    fn judge(&self, proposed: &Pose, result: &Registration, seen_through: f32) -> Refined {
        let pose = result.local_from_sensor;
        let evidence = &result.evidence;
        let upright = self.source.iter().filter(|point| point.group != Group::Ground).count() as f32;
        let share = |part: u32, all: f32| part as f32 / all.max(1.0);
        let rotation = UnitQuaternion::new_normalize(pose.rotation.cast::<f64>().into_inner());
        Refined {
            place_from_sensor: MapPose::from_parts(pose.translation.vector.cast::<f64>().into(), rotation),
            covariance: dense::covariance(&result.information, &pose),
            inliers: evidence.inliers,
            fit: share(evidence.upright_inliers, evidence.upright_partners as f32),
            overlap: share(evidence.upright_partners, upright),
            seen_through,
            moved_m: (pose.translation.vector - proposed.translation.vector).norm(),
            determined: dense::determines(&self.dense_config(), &result.information),
        }
    }
}

/// Share of the old place's near points above ground that a scan at `place_from_sensor` saw through.
fn seen_through(points: &[LabelledPoint], place: &Place, place_from_sensor: &Pose) -> f32 {
    let image = RangeImage::of(points);
    let (mut asked, mut through) = (0u32, 0u32);
    for (position, class, _) in &place.points {
        let seen = place_from_sensor.inverse_transform_point(&Point3::from(*position)).coords;
        let is_near = seen.norm_squared() <= SEEN_THROUGH_RANGE_M * SEEN_THROUGH_RANGE_M;
        if is_near && Group::of(*class) != Group::Ground {
            asked += 1;
            through += u32::from(image.sees_through(seen.into(), SEEN_THROUGH_MARGIN_M));
        }
    }
    through as f32 / asked.max(1) as f32
}
