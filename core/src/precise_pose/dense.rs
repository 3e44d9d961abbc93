//! Dense refinement: 6-DoF registration of the static and ground cells of a scan against the voxels of the submap,
//! point to distribution, robust, same group of classes only (vegetation also with the ground and the walls that it lies
//! in). Not in the paper: hulls alone end at 1.5 to 4 % (our benchmarks, and others who built them), and a roll of zero
//! costs 0.8 %.

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

use super::voxel_map::{self, Group, VoxelMap};
use crate::error::ParameterError;
use crate::estimate::DenseEvidence;
use crate::geometry::eigen;
use crate::math;
use crate::pose::{self, Pose};

/// Parameters of the dense refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Use the dense refinement; the `paper` preset does not.
    pub enabled: bool,
    /// Most iterations.
    pub max_iterations: u32,
    /// The iteration ends behind a step of less translation [m], and of less rotation over a lever arm of 20 m. The next
    /// would be about a tenth of it.
    pub min_step_m: f32,
    /// Scale of the robust kernel in standard deviations, at the first iteration.
    pub kernel_start: f32,
    /// The same at the last; it halves from iteration to iteration.
    pub kernel_end: f32,
    /// Fewest points that fit their partner.
    pub min_inliers: u32,
    /// Fewest of them that are not ground: level ground says nothing of x, y and yaw.
    pub min_upright_inliers: u32,
    /// Fewest of the points above ground with a partner that fit it, as a share.
    pub min_inlier_share: f32,
    /// Standard deviation of the start's position [m]: holds what the scan does not determine.
    pub hold_m: f32,
    /// The same of its rotation [rad].
    pub hold_rad: f32,
    /// A result farther than this from the start is refused [m].
    pub max_correction_m: f32,
    /// Terrain farther from the sensor is not registered once the motion is known [m]: flat rays meet the tips of grass, steep
    /// ones the ground below, and pitch would give in to the difference. Infinite for no bound.
    pub max_terrain_range_m: f32,
    /// Weight of a point in an upright rod of vegetation: a trunk, pole or sign with a wrong label, whose cells are larger
    /// and fewer than they would be with the right one.
    pub vegetation_rod_weight: f32,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        enabled: true,
        max_iterations: 12,
        min_step_m: 0.003,
        kernel_start: 12.0,
        kernel_end: 2.5,
        min_inliers: 150,
        min_upright_inliers: 40,
        min_inlier_share: 0.5,
        hold_m: 0.1,
        hold_rad: 0.01,
        max_correction_m: 3.0,
        max_terrain_range_m: 20.0,
        vegetation_rod_weight: 6.0,
    };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if self.max_iterations == 0 || self.max_iterations > 100 {
            return Err(ParameterError {
                parameter: "precise_pose.dense.max_iterations",
                expected: "1 to 100",
            });
        }
        if !(self.min_step_m > 0.0 && self.hold_m > 0.0 && self.hold_rad > 0.0 && self.max_correction_m > 0.0)
        {
            let parameter = "precise_pose.dense.min_step_m, hold_m, hold_rad and max_correction_m";
            return Err(ParameterError { parameter, expected: "positive" });
        }
        if !(self.min_inlier_share >= 0.0 && self.min_inlier_share <= 1.0) {
            return Err(ParameterError {
                parameter: "precise_pose.dense.min_inlier_share",
                expected: "0 to 1",
            });
        }
        if !(self.max_terrain_range_m >= 0.0) {
            let parameter = "precise_pose.dense.max_terrain_range_m";
            return Err(ParameterError { parameter, expected: "zero or positive" });
        }
        if !(self.vegetation_rod_weight >= 0.0 && self.vegetation_rod_weight <= 100.0) {
            let parameter = "precise_pose.dense.vegetation_rod_weight";
            return Err(ParameterError { parameter, expected: "0 to 100" });
        }
        if !(self.kernel_end > 0.0 && self.kernel_start >= self.kernel_end) {
            let expected = "positive, and not above kernel_start";
            return Err(ParameterError { parameter: "precise_pose.dense.kernel_end", expected });
        }
        Ok(())
    }
}

/// While the robust kernel is still wide, every fourth point of a large scan is enough.
const COARSE_STRIDE: usize = 4;
/// A scan is large above this number of points.
const COARSE_POINTS: usize = 4000;

/// A point of the scan to register: the mean of a cell [m, sensor frame].
#[derive(Clone, Copy, Debug)]
pub struct SourcePoint {
    /// Position [m], sensor frame.
    pub position: Vector3<f32>,
    /// Group of its class.
    pub group: Group,
}

/// Result of the refinement.
#[derive(Clone, Copy, Debug)]
pub struct Registration {
    /// Pose of the sensor in the local frame.
    pub local_from_sensor: Pose,
    /// Information about the pose's error (x, y, z, rotation vector; axes of the local frame, rotation about the sensor).
    pub information: Matrix6<f32>,
    /// Evidence.
    pub evidence: DenseEvidence,
}

/// Sum over all residuals: normal equations of one iteration.
struct NormalEquations {
    /// Upper triangle.
    h: [[f32; 6]; 6],
    g: [f32; 6],
    squared_m2: f32,
    weight: f32,
    /// Partners and inliers among the ground, and among the rest.
    partners: [u32; 2],
    inliers: [u32; 2],
}

/// Registers `source` against `map`, starting from `start`.
pub fn register<const SETS: usize>(
    config: &Config,
    map_config: &voxel_map::Config,
    map: &VoxelMap<SETS>,
    path_m: f32,
    source: &[SourcePoint],
    start: &Pose,
) -> Registration {
    let mut local_from_sensor = *start;
    let mut kernel = config.kernel_start;
    let mut evidence = DenseEvidence { source_points: source.len() as u32, ..DenseEvidence::default() };
    let mut information = Matrix6::zeros();
    for iteration in 1..=config.max_iterations {
        let coarse = kernel > config.kernel_end && source.len() > COARSE_POINTS;
        let stride = if coarse { COARSE_STRIDE } else { 1 };
        let points = source.iter().step_by(stride);
        let mut sum = accumulate(config, map_config, map, path_m, points, &local_from_sensor, kernel);
        sum.hold(config, &difference(&local_from_sensor, start));
        evidence.iterations = iteration;
        evidence.partners = sum.partners[0] + sum.partners[1];
        evidence.inliers = sum.inliers[0] + sum.inliers[1];
        (evidence.upright_partners, evidence.upright_inliers) = (sum.partners[1], sum.inliers[1]);
        evidence.residual_m = math::sqrt(sum.squared_m2 / sum.weight.max(1e-6));
        information = Matrix6::from_fn(|r, c| sum.h[r.min(c)][r.max(c)]);
        let Some(cholesky) = information.cholesky() else { break };
        let step = -cholesky.solve(&Vector6::from(sum.g));
        local_from_sensor = apply(&step, &local_from_sensor);
        let translation = step.fixed_rows::<3>(0).norm();
        let rotation = step.fixed_rows::<3>(3).norm();
        let at_end = kernel <= config.kernel_end;
        if at_end && translation.max(20.0 * rotation) < config.min_step_m {
            evidence.converged = true;
            break;
        }
        kernel = (0.5 * kernel).max(config.kernel_end);
    }
    Registration { local_from_sensor, information, evidence }
}

/// Too many of the points above ground that found a partner do not fit it.
pub fn misfits(config: &Config, evidence: &DenseEvidence) -> bool {
    (evidence.upright_inliers as f32) < config.min_inlier_share * evidence.upright_partners as f32
}

/// The scan itself, and not what was held, determines the position.
pub fn determines(config: &Config, information: &Matrix6<f32>) -> bool {
    let Some(cholesky) = information.cholesky() else { return false };
    let covariance = cholesky.inverse().fixed_view::<3, 3>(0, 0).into_owned();
    // With nothing but the hold a direction has the variance hold_m^2.
    let [_, _, (largest, _)] = eigen::symmetric(&covariance);
    largest < 0.2 * config.hold_m * config.hold_m
}

/// Moves a pose by a small step: translation, and rotation about the sensor, in the axes of the local frame.
fn apply(step: &Vector6<f32>, local_from_sensor: &Pose) -> Pose {
    let turn = pose::exp_so3(Vector3::new(step[3], step[4], step[5]));
    let translation = local_from_sensor.translation.vector + Vector3::new(step[0], step[1], step[2]);
    // Renormalised: products of products would leave the unit sphere exponentially fast.
    let rotation = UnitQuaternion::new_normalize((turn * local_from_sensor.rotation).into_inner());
    Pose::from_parts(translation.into(), rotation)
}

/// The step that [`apply`] needs to go from `from` to `to`.
fn difference(to: &Pose, from: &Pose) -> [f32; 6] {
    let t = to.translation.vector - from.translation.vector;
    let w = pose::log_so3(&(to.rotation * from.rotation.inverse()));
    [t.x, t.y, t.z, w.x, w.y, w.z]
}

/// How well a pose explains the scan: points whose partner is near, counted softly. For choosing between two starts.
pub fn score<const SETS: usize>(
    config: &Config,
    map_config: &voxel_map::Config,
    map: &VoxelMap<SETS>,
    path_m: f32,
    source: &[SourcePoint],
    local_from_sensor: &Pose,
) -> f32 {
    // Every eighth point is enough for a choice.
    let scored = source.iter().step_by(8).filter_map(|point| {
        let p = (local_from_sensor * nalgebra::Point3::from(point.position)).coords;
        let (voxel, mean, _) = map.partner(map_config, &p, point.group, path_m)?;
        let residual = p - mean;
        let mahalanobis2: f32 = voxel.across().map(|a| square(a.dot(&residual))).sum();
        let kernel2 = config.kernel_start * config.kernel_start;
        Some(kernel2 / (kernel2 + mahalanobis2))
    });
    scored.sum()
}

/// The ground points of a registered scan [m, sensor frame] with their heights [m] above the submap's ground.
pub fn ground_heights<'a, const SETS: usize>(
    map_config: &'a voxel_map::Config,
    map: &'a VoxelMap<SETS>,
    path_m: f32,
    source: &'a [SourcePoint],
    local_from_sensor: &'a Pose,
) -> impl Iterator<Item = (Vector3<f32>, f32)> + 'a {
    source.iter().filter(|point| point.group == Group::Ground).filter_map(move |point| {
        let p = (local_from_sensor * nalgebra::Point3::from(point.position)).coords;
        let (voxel, mean) = map.find(map_config, &p, point.group, path_m)?;
        let a = voxel.across().next()?;
        let deviations = a.dot(&(p - mean));
        let along_normal = deviations / a.norm();
        let height = if a.z < 0.0 { -along_normal } else { along_normal };
        (deviations * deviations < 9.0).then_some((point.position, height))
    })
}

fn accumulate<'a, const SETS: usize>(
    config: &Config,
    map_config: &voxel_map::Config,
    map: &VoxelMap<SETS>,
    path_m: f32,
    source: impl Iterator<Item = &'a SourcePoint>,
    local_from_sensor: &Pose,
    kernel: f32,
) -> NormalEquations {
    let mut sum = NormalEquations {
        h: [[0.0; 6]; 6],
        g: [0.0; 6],
        squared_m2: 0.0,
        weight: 0.0,
        partners: [0; 2],
        inliers: [0; 2],
    };
    let rotation = *local_from_sensor.rotation.to_rotation_matrix().matrix();
    let kernel2 = kernel * kernel;
    for point in source {
        let arm = rotation * point.position;
        let p = arm + local_from_sensor.translation.vector;
        let Some((voxel, mean, group)) = map.partner(map_config, &p, point.group, path_m) else { continue };
        let residual = p - mean;
        // An error of the elevation lifts a point the more, the farther it is.
        let lift2 = square(map_config.elevation_noise_rad) * arm.norm_squared();
        let share = |a: &Vector3<f32>| 1.0 / (1.0 + lift2 * a.z * a.z);
        let mahalanobis2: f32 = voxel.across().map(|a| square(a.dot(&residual)) * share(&a)).sum();
        // Geman-McClure: outliers end with no weight.
        let w = square(kernel2 / (kernel2 + mahalanobis2));
        let trunk = group == Group::Vegetation && voxel.is_rod();
        let factor = if trunk { config.vegetation_rod_weight } else { 1.0 };
        for a in voxel.across() {
            sum.add(&a, &arm.cross(&a), a.dot(&residual), w * share(&a) * factor);
        }
        sum.squared_m2 += w * mahalanobis2 * map_config.noise_m * map_config.noise_m;
        sum.weight += w;
        let upright = usize::from(group != Group::Ground);
        sum.partners[upright] += 1;
        sum.inliers[upright] += u32::from(mahalanobis2 < 9.0);
    }
    sum
}

impl NormalEquations {
    /// Holds what the scan does not determine (along a tunnel, say) at the start, `off` away.
    fn hold(&mut self, config: &Config, off: &[f32; 6]) {
        for i in 0..6 {
            let sigma = if i < 3 { config.hold_m } else { config.hold_rad };
            let information = 1.0 / (sigma * sigma);
            self.h[i][i] += information;
            self.g[i] += information * off[i];
        }
    }

    /// Adds a residual with the derivative [along, turn] by translation and rotation.
    #[inline]
    fn add(&mut self, along: &Vector3<f32>, turn: &Vector3<f32>, residual: f32, weight: f32) {
        let j = [along.x, along.y, along.z, turn.x, turn.y, turn.z];
        for row in 0..6 {
            let wj = weight * j[row];
            for column in row..6 {
                self.h[row][column] += wj * j[column];
            }
            self.g[row] += wj * residual;
        }
    }
}

fn square(v: f32) -> f32 {
    v * v
}

/// Residuals of neighbouring points err together; this many count as one independent one.
const CORRELATED_POINTS: f32 = 20.0;

/// Covariance in the sensor frame (x, y, z, roll, pitch, yaw) from the information in the local frame. A frame that was
/// not registered gets 1 m and 0.1 rad.
pub fn covariance(information: &Matrix6<f32>, local_from_sensor: &Pose) -> [[f32; 6]; 6] {
    let Some(cholesky) = information.cholesky() else {
        return core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                if i != j {
                    0.0
                } else if i < 3 {
                    1.0
                } else {
                    0.01
                }
            })
        });
    };
    let mut sensor_from_local = Matrix6::zeros();
    let rotation = local_from_sensor.rotation.inverse().to_rotation_matrix();
    sensor_from_local.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
    sensor_from_local.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation.matrix());
    let covariance =
        sensor_from_local * cholesky.inverse() * sensor_from_local.transpose() * CORRELATED_POINTS;
    core::array::from_fn(|i| core::array::from_fn(|j| covariance[(i, j)]))
}
