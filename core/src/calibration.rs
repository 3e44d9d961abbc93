//! Calibration of the ranges by class, and of the beams' elevations, learnt while driving. Not in the paper.
//!
//! What is seen of a trunk lies before its axis: from ahead and from behind it has two places, and the vehicle seems to
//! move less than it does. Vegetation is measured the longer, the farther it is (as would be, were weak and slanted echoes noticed
//! late), and the vehicle seems to move more. With poses that are true, both show in the residuals along the rays.
//!
//! A beam that points 0.03 deg too high sees the ground 20 m ahead 1 cm too high. Nearer or farther, other beams see the
//! same ground, so the submap and the scan disagree in the same way in every frame; the attitude gives in to it a
//! little each time, and pitch drifts (0.1 deg per 100 m on a straight road, where nothing else holds it). The mean
//! residual of the ground per elevation shows the error; it is taken out of the cells before anything uses them.

use nalgebra::Vector3;

use crate::error::ParameterError;
use crate::math;
use crate::scan::SemanticClass;
use crate::scan_cells::Cell;

/// Parameters of the calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Share of a frame's error of the elevations that is corrected, 0 to 1; with 0 they stay as they are.
    pub gain: f32,
    /// Weight of "no error" against the residuals of a frame [m2]: one residual weighs its squared distance.
    pub prior_m2: f32,
    /// What is seen of trunks, poles and signs lies this far before their axes [m].
    pub rod_depth_m: f32,
    /// Share of the range by which vegetation is measured long.
    pub vegetation_range_error: f32,
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self =
        Self { gain: 0.1, prior_m2: 3e4, rod_depth_m: 0.02, vegetation_range_error: 0.0004 };
    /// The paper has none.
    pub const PAPER: Self =
        Self { gain: 0.0, rod_depth_m: 0.0, vegetation_range_error: 0.0, ..Self::DEFAULT };

    /// What the range to a point of a class is multiplied by, from its square [m2]. Within 1 m nothing is a rod.
    fn stretch(&self, class: SemanticClass, range2_m2: f32) -> f32 {
        use SemanticClass::*;
        match class {
            Vegetation => 1.0 - self.vegetation_range_error,
            Trunk | Pole | TrafficSign if range2_m2 > 1.0 => 1.0 + self.rod_depth_m / math::sqrt(range2_m2),
            _ => 1.0,
        }
    }

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if !(self.gain >= 0.0 && self.gain <= 1.0) {
            return Err(ParameterError { parameter: "calibration.gain", expected: "0 to 1" });
        }
        if !(self.prior_m2 > 0.0) {
            return Err(ParameterError { parameter: "calibration.prior_m2", expected: "positive" });
        }
        if !(self.rod_depth_m >= 0.0 && self.rod_depth_m <= 0.5) {
            return Err(ParameterError { parameter: "calibration.rod_depth_m", expected: "0 to 0.5 m" });
        }
        if !(self.vegetation_range_error >= 0.0 && self.vegetation_range_error <= 0.01) {
            let parameter = "calibration.vegetation_range_error";
            return Err(ParameterError { parameter, expected: "0 to 0.01" });
        }
        Ok(())
    }
}

/// Bins of the tangent of the elevation.
const BINS: usize = 128;
/// Tangent of the lowest elevation, -26.6 deg.
const LOWEST: f32 = -0.5;
/// Width of a bin: 0.29 deg at the horizon.
const WIDTH: f32 = 0.005;
/// Nearer to the vertical axis of the sensor a point has no elevation to speak of [m].
const MIN_DISTANCE_M: f32 = 0.5;

/// Corrections by elevation, 0.5 KiB.
pub struct Calibration {
    /// What is added to the elevation at the middle of each bin [rad].
    correction_rad: [f32; BINS],
}

impl Calibration {
    /// No correction.
    pub const fn new() -> Self {
        Self { correction_rad: [0.0; BINS] }
    }

    /// The corrections, to save and restore them [rad].
    #[cfg(feature = "snapshot")]
    pub(crate) fn corrections_mut(&mut self) -> &mut [f32; BINS] {
        &mut self.correction_rad
    }

    /// The corrections [rad].
    #[cfg(feature = "snapshot")]
    pub(crate) fn corrections(&self) -> &[f32; BINS] {
        &self.correction_rad
    }

    /// Forgets what was learnt.
    pub fn clear(&mut self) {
        self.correction_rad = [0.0; BINS];
    }

    /// Corrects the elevations and ranges of a scan. The errors change so little within a cell that its mean is enough.
    pub fn apply(&self, config: &Config, cells: &mut [Cell]) {
        for cell in cells {
            let seen = cell.mean();
            let stretch = config.stretch(cell.class, seen.norm_squared());
            cell.shift(&(Vector3::from(self.correct(seen.into())) * stretch - seen));
        }
    }

    /// A point with its elevation corrected [m, sensor frame].
    fn correct(&self, p: [f32; 3]) -> [f32; 3] {
        let Some((distance, [low, high])) = bins(p) else { return p };
        let turn = self.correction_rad[low.0] * low.1 + self.correction_rad[high.0] * high.1;
        // A small turn in the vertical plane through the point.
        let shrink = 1.0 - turn * p[2] / distance;
        [p[0] * shrink, p[1] * shrink, p[2] + turn * distance]
    }

    /// Learns from one registered frame: ground points [m, sensor frame] and their heights [m] above the submap's ground.
    pub fn learn(&mut self, config: &Config, heights: impl Iterator<Item = (Vector3<f32>, f32)>) {
        let (mut lift, mut weight) = ([0.0; BINS], [config.prior_m2; BINS]);
        for (p, height) in heights {
            let Some((distance, bins)) = bins(p.into()) else { continue };
            for (bin, share) in bins {
                lift[bin] += share * height * distance;
                weight[bin] += share * distance * distance;
            }
        }
        for ((correction, lift), weight) in self.correction_rad.iter_mut().zip(lift).zip(weight) {
            *correction -= config.gain * (lift + config.prior_m2 * *correction) / weight;
        }
    }
}

/// Horizontal distance [m] and the two bins around the elevation of a point, with their shares.
#[inline]
fn bins(p: [f32; 3]) -> Option<(f32, [(usize, f32); 2])> {
    let distance = math::sqrt(p[0] * p[0] + p[1] * p[1]);
    if distance < MIN_DISTANCE_M {
        return None;
    }
    let at = ((p[2] / distance - LOWEST) / WIDTH - 0.5).clamp(0.0, (BINS - 2) as f32);
    // A second bound for the compiler, which then knows that both bins exist.
    let low = (at as usize).min(BINS - 2);
    let share = at - low as f32;
    Some((distance, [(low, 1.0 - share), (low + 1, share)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ground 1.73 m below the sensor, seen with an elevation error that grows with the distance, against a true map.
    #[test]
    fn takes_out_a_constant_error_of_the_elevation() {
        let mut calibration = Calibration::new();
        let seen = |distance: f32| [distance, 0.0, -1.73 + 0.002 * distance];
        for _ in 0..200 {
            let corrected = [6.0, 9.0, 14.0, 20.0, 30.0].map(|d| calibration.correct(seen(d)));
            let heights = corrected.iter().map(|p| (Vector3::from(*p), p[2] + 1.73));
            let config = Config { prior_m2: 1.0, ..Config::DEFAULT };
            calibration.learn(&config, heights);
        }
        for d in [6.0, 9.0, 14.0, 20.0, 30.0] {
            let height = calibration.correct(seen(d))[2] + 1.73;
            assert!(height.abs() < 0.1 * 0.002 * d, "{height} m at {d} m");
        }
    }

    #[test]
    fn a_point_above_the_sensor_or_not_finite_stays_as_it_is() {
        let mut calibration = Calibration::new();
        calibration.correction_rad = [0.01; BINS];
        assert_eq!(calibration.correct([0.0, 0.0, 5.0]), [0.0, 0.0, 5.0]);
        let moved = calibration.correct([10.0, 0.0, 80.0]);
        assert!((moved[0] - 9.2).abs() < 1e-4 && (moved[2] - 80.1).abs() < 1e-4, "{moved:?}");
    }

    #[test]
    fn ranges_are_corrected_by_class_in_every_direction() {
        use SemanticClass::*;
        let [rod, leaves] = [Config::DEFAULT.rod_depth_m, Config::DEFAULT.vegetation_range_error];
        assert!(rod > 0.0 && leaves > 0.0);
        for (class, seen_m) in [(Trunk, 10.0 - rod), (Vegetation, 10.0 * (1.0 + leaves)), (Building, 10.0)] {
            let mut cells = crate::scan_cells::ScanCells::<8>::new();
            for k in 0..6 {
                let (angle, z) = (k as f32, 0.1 * k as f32);
                let across = math::sqrt(1.0 - z * z);
                let ray = [across * math::cos(angle), across * math::sin(angle), z];
                cells.add(ray.map(|v| v * seen_m), class, 0.15, 1.0 / 0.15);
            }
            Calibration::new().apply(&Config::DEFAULT, cells.cells_mut());
            assert_eq!(cells.cells().len(), 6);
            for cell in cells.cells() {
                assert!((cell.mean().norm() - 10.0).abs() < 1e-4, "{class:?} at {} m", cell.mean().norm());
            }
        }
    }
}
