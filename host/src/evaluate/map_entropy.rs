//! How crisp a map a trajectory makes: needs no reference.
//!
//! The scans of a window are put together with their poses. Around a sample of their points the covariance of the
//! neighbours is taken; its entropy, 0.5 ln |2 pi e S|, is lower where surfaces are thinner. Windows overlap by half:
//! drift over the whole drive is not what this measures.

use std::collections::{HashSet, VecDeque};
use std::f64::consts::{E, TAU};
use std::fmt;
use std::ops::Range;

use nalgebra::{Matrix3, Point3, Vector3};
use sdslam_core::{MapPose, MotionClass};
use serde::Serialize;

use super::EvaluateError;
use super::grid::Grid;
use crate::dataset::{self, DatasetError, RawScan, Sequence, labels};

/// Nearer points are the vehicle itself [m].
const MIN_RANGE_M: f64 = 3.0;
/// Every scan is thinned to one point in such a voxel [m].
const VOXEL_M: f64 = 0.15;
/// Places looked at per window, about.
const SAMPLES: usize = 20_000;
/// Neighbours that a covariance needs.
const MIN_NEIGHBOURS: usize = 15;

/// What the map is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct MapEntropyOptions {
    /// Radius of a neighbourhood [m].
    pub radius_m: f64,
    /// Farther points are left out [m].
    pub max_range_m: f64,
    /// Scans a local map.
    pub window: usize,
    /// Frames used; all where not given.
    pub frames: Option<Range<usize>>,
    /// Whether the points get [`dataset::correct_elevation`].
    pub correct_elevation: bool,
}

impl Default for MapEntropyOptions {
    fn default() -> Self {
        Self { radius_m: 0.3, max_range_m: 35.0, window: 40, frames: None, correct_elevation: false }
    }
}

/// Crispness of the map; lower is better throughout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapEntropy {
    /// Mean map entropy.
    pub mean_map_entropy: f64,
    /// Mean variance of the points across their local plane [mm^2].
    pub mean_plane_variance_mm2: f64,
    /// Median of the same [mm^2].
    pub median_plane_variance_mm2: f64,
    /// Places with enough points, in all windows.
    pub neighbourhoods: usize,
    /// Frames that were read.
    pub frames: usize,
    /// Frames whose scan is missing.
    pub missing_frames: usize,
}

/// Measures the map that the scans of a drive make with the given sensor poses (see [`map_from_sensor`]): one for each frame
/// of the drive, or one for each of the frames in the options.
///
/// Points of classes that can move, and unlabelled ones, are left out where the sequence has labels.
pub fn map_entropy(
    sequence: &Sequence,
    map_from_sensor: &[MapPose],
    options: &MapEntropyOptions,
) -> Result<MapEntropy, EvaluateError> {
    let frames = check(sequence, map_from_sensor, options)?;
    let first_pose = if map_from_sensor.len() == sequence.len() { 0 } else { frames.start };
    let mut places = Places::default();
    let mut window = VecDeque::new();
    let mut next = frames.start;
    for start in frames.clone().step_by(options.window / 2) {
        let end = frames.end.min(start + options.window);
        if end - start < options.window / 2 {
            break;
        }
        while window.front().is_some_and(|(frame, _)| *frame < start) {
            window.pop_front();
        }
        for frame in next..end {
            match thinned_scan(sequence, frame, options)? {
                Some(points) => {
                    places.frames += 1;
                    window.push_back((frame, points));
                }
                None => places.missing_frames += 1,
            }
        }
        next = end;
        places.measure(&local_map(&window, map_from_sensor, first_pose), options.radius_m);
    }
    places.summary(options)
}

/// Sensor poses from camera poses: those of KITTI's files are of the camera.
pub fn map_from_sensor(map_from_camera: &[MapPose], camera_from_sensor: &MapPose) -> Vec<MapPose> {
    let sensor_from_camera = camera_from_sensor.inverse();
    map_from_camera.iter().map(|pose| sensor_from_camera * pose * camera_from_sensor).collect()
}

fn check(
    sequence: &Sequence,
    poses: &[MapPose],
    options: &MapEntropyOptions,
) -> Result<Range<usize>, EvaluateError> {
    let require = |good: bool, option: &'static str, expected: &'static str| {
        if good { Ok(()) } else { Err(EvaluateError::Option { option, expected }) }
    };
    require((0.01..=10.0).contains(&options.radius_m), "radius", "between 0.01 and 10 m")?;
    require(options.max_range_m > MIN_RANGE_M, "range", "more than 3 m")?;
    require(options.window >= 2, "window", "at least 2 frames")?;
    let all = sequence.len();
    let frames = options.frames.clone().unwrap_or(0..all);
    let frames = frames.start..frames.end.min(all);
    require(!frames.is_empty(), "frames", "a range with frames of the drive")?;
    if poses.len() != all && poses.len() != frames.len() {
        return Err(EvaluateError::PoseCount { poses: poses.len(), frames: frames.len(), all });
    }
    Ok(frames)
}

/// The static points of a frame, one a voxel, in the sensor frame; none where the scan is missing.
fn thinned_scan(
    sequence: &Sequence,
    frame: usize,
    options: &MapEntropyOptions,
) -> Result<Option<Vec<Point3<f64>>>, EvaluateError> {
    let mut scan = match sequence.read(frame) {
        Err(DatasetError::MissingFrame { .. }) => return Ok(None),
        scan => scan?,
    };
    keep_static(&mut scan, options.max_range_m);
    let corrected =
        |p: [f64; 3]| if options.correct_elevation { dataset::with_corrected_elevation(p) } else { p };
    let points = scan.points.iter().map(|&[x, y, z, _]| Point3::from(corrected([x, y, z].map(f64::from))));
    let mut taken = HashSet::new();
    let first_in_voxel = |point: &Point3<f64>| taken.insert((point / VOXEL_M).map(|v| v.floor() as i32));
    Ok(Some(points.filter(first_in_voxel).collect()))
}

fn keep_static(scan: &mut RawScan, max_range_m: f64) {
    let in_range = |p: &[f32; 4]| {
        let range_m = Vector3::new(p[0], p[1], p[2]).cast::<f64>().norm();
        range_m > MIN_RANGE_M && range_m < max_range_m
    };
    let stays = |raw: u32| {
        let motion = labels::class_of(raw).motion();
        !labels::is_moving(raw) && matches!(motion, MotionClass::Ground | MotionClass::PureStatic)
    };
    let labels = scan.labels.take();
    let mut index = 0;
    scan.points.retain(|point| {
        let keep = in_range(point) && labels.as_ref().is_none_or(|labels| stays(labels[index]));
        index += 1;
        keep
    });
}

fn local_map(
    window: &VecDeque<(usize, Vec<Point3<f64>>)>,
    poses: &[MapPose],
    first_pose: usize,
) -> Vec<Point3<f64>> {
    let moved = |(frame, points): &(usize, Vec<Point3<f64>>)| {
        let pose = poses[frame - first_pose];
        points.iter().map(move |point| pose * point).collect::<Vec<_>>()
    };
    window.iter().flat_map(moved).collect()
}

/// Entropies and plane variances of all places looked at.
#[derive(Default)]
struct Places {
    entropy: f64,
    plane_variances_m2: Vec<f64>,
    frames: usize,
    missing_frames: usize,
}

impl Places {
    fn measure(&mut self, map: &[Point3<f64>], radius_m: f64) {
        let grid = Grid::new(map, radius_m);
        let mut neighbours = Vec::new();
        for place in map.iter().step_by((map.len() / SAMPLES).max(1)) {
            grid.neighbours(place, &mut neighbours);
            if neighbours.len() < MIN_NEIGHBOURS {
                continue;
            }
            let covariance = covariance(&neighbours);
            let thinnest = covariance.symmetric_eigenvalues().min();
            if thinnest > 0.0 {
                self.entropy += 0.5 * (covariance * TAU * E).determinant().ln();
                self.plane_variances_m2.push(thinnest);
            }
        }
    }

    fn summary(mut self, options: &MapEntropyOptions) -> Result<MapEntropy, EvaluateError> {
        let neighbourhoods = self.plane_variances_m2.len();
        if neighbourhoods == 0 {
            let (frames, window, radius_m) = (self.frames, options.window, options.radius_m);
            return Err(EvaluateError::EmptyMap { frames, window, radius_m });
        }
        let mean = self.plane_variances_m2.iter().sum::<f64>() / neighbourhoods as f64;
        self.plane_variances_m2.sort_by(f64::total_cmp);
        let variances = &self.plane_variances_m2;
        let median = (variances[(neighbourhoods - 1) / 2] + variances[neighbourhoods / 2]) / 2.0;
        Ok(MapEntropy {
            mean_map_entropy: self.entropy / neighbourhoods as f64,
            mean_plane_variance_mm2: mean * 1e6,
            median_plane_variance_mm2: median * 1e6,
            neighbourhoods,
            frames: self.frames,
            missing_frames: self.missing_frames,
        })
    }
}

/// Sample covariance, of at least two points.
fn covariance(points: &[Vector3<f64>]) -> Matrix3<f64> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    points.iter().map(|point| (point - mean) * (point - mean).transpose()).sum::<Matrix3<f64>>() / (n - 1.0)
}

impl fmt::Display for MapEntropy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "mean map entropy        {:.4}", self.mean_map_entropy)?;
        let (mean, median) = (self.mean_plane_variance_mm2, self.median_plane_variance_mm2);
        writeln!(f, "plane variance          {mean:.1} mm2, median {median:.1} mm2")?;
        write!(f, "places                  {} in {} frames", self.neighbourhoods, self.frames)?;
        if self.missing_frames > 0 {
            write!(f, ", {} more missing", self.missing_frames)?;
        }
        writeln!(f)
    }
}
