//! Section 3.4.2: pitch and height from the ground in front of and behind the vehicle.
//!
//! The paper gives no formula for the accumulation. Read literally (pitch = angle between both planes, summed per frame)
//! a crest is counted once per frame while it lies between the patches. Here the angle between the planes is the road's
//! curvature over the distance of the patches, and the pitch grows by curvature times distance driven. The height
//! follows from moving along the ground's mean plane in the sensor frame, which also levels a sensor that is mounted
//! with a tilt.

use nalgebra::Vector3;

use crate::error::ParameterError;
use crate::estimate::GroundEvidence;
use crate::geometry::plane::{self, LevelPlane};
use crate::math;
use crate::scan::MotionClass;
use crate::scan_cells::Cell;

/// Parameters of the vertical pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Ground nearer than this is left out [m].
    pub near_m: f32,
    /// Ground farther than this is left out [m].
    pub far_m: f32,
    /// Half width of the patches [m].
    pub half_width_m: f32,
    /// Scale of the robust fit [m].
    pub scale_m: f32,
    /// Fewest cells in a patch.
    pub min_cells: u32,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self =
        Self { near_m: 4.0, far_m: 20.0, half_width_m: 5.0, scale_m: 0.05, min_cells: 30 };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if self.near_m >= 0.0 && self.far_m > self.near_m && self.half_width_m > 0.0 && self.scale_m > 0.0 {
            return Ok(());
        }
        let expected = "0 <= near_m < far_m, and positive half_width_m and scale_m";
        Err(ParameterError { parameter: "precise_pose.vertical", expected })
    }
}

/// The ground around the vehicle, sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Slope ahead minus slope behind [rad]: how much the road bends upwards.
    pub bend_rad: f32,
    /// Distance of the centres of both patches [m].
    pub apart_m: f32,
    /// Mean plane: its slope is that of the ground under the sensor.
    pub mean: LevelPlane,
}

/// Fits the planes in front of and behind the vehicle. `None` where one of them is not seen.
pub fn fit(config: &Config, cells: &[Cell]) -> (Option<Ground>, GroundEvidence) {
    let patch = |ahead: bool| {
        move |p: &Vector3<f32>| {
            let x = if ahead { p.x } else { -p.x };
            x > config.near_m && x < config.far_m && math::abs(p.y) < config.half_width_m
        }
    };
    let (front, front_count) = fit_patch(config, cells, patch(true));
    let (rear, rear_count) = fit_patch(config, cells, patch(false));
    let mut evidence = GroundEvidence { front: front_count, rear: rear_count, pitch_rad: 0.0 };
    let (Some(front), Some(rear)) = (front, rear) else { return (None, evidence) };
    let (ahead, behind) = (math::atan2(front.slope_x, 1.0), math::atan2(rear.slope_x, 1.0));
    let mean = LevelPlane {
        slope_x: 0.5 * (front.slope_x + rear.slope_x),
        slope_y: 0.5 * (front.slope_y + rear.slope_y),
        offset: 0.5 * (front.offset + rear.offset),
    };
    evidence.pitch_rad = 0.5 * (ahead + behind);
    (Some(Ground { bend_rad: ahead - behind, apart_m: config.near_m + config.far_m, mean }), evidence)
}

fn fit_patch(
    config: &Config,
    cells: &[Cell],
    inside: impl Fn(&Vector3<f32>) -> bool + Copy,
) -> (Option<LevelPlane>, u32) {
    let ground = || {
        cells
            .iter()
            .filter(|c| c.class.motion() == MotionClass::Ground)
            .map(Cell::mean)
            .filter(move |p| inside(p))
    };
    let count = ground().count() as u32;
    if count < config.min_cells {
        return (None, count);
    }
    let mean_height = ground().map(|p| p.z).sum::<f32>() / count as f32;
    let start = LevelPlane { offset: mean_height, ..LevelPlane::default() };
    (
        plane::fit_level(ground, 4.0 * config.scale_m, 3, start)
            .and_then(|p| plane::fit_level(ground, config.scale_m, 3, p)),
        count,
    )
}
