//! Stage 1, section 3.1.2: invalid and unlabelled points are removed, the rest is sorted into ground, pure static
//! and unknown motion, and gathered in cells.

use crate::error::ParameterError;
use crate::estimate::PointCounts;
use crate::scan::{LabelledPoint, MotionClass, SemanticClass};
use crate::scan_cells::ScanCells;

/// Parameters of the label filter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Points nearer than this are dropped [m].
    pub min_range_m: f32,
    /// Points farther than this are dropped [m].
    pub max_range_m: f32,
    /// Points whose class is less certain than this are dropped, 0..255; from 1 on, those without any confidence.
    pub min_confidence: u8,
    /// The same for points of the ground, 0..255: the foot of a thing, taken for ground, lifts it.
    pub min_ground_confidence: u8,
    /// Side of a cell of ground [m].
    pub ground_cell_m: f32,
    /// Side of a cell of buildings, fences, vegetation and other structures [m].
    pub large_cell_m: f32,
    /// Side of a cell of trunks, poles, signs and other objects [m].
    pub small_cell_m: f32,
    /// Side of a cell of things that may move [m].
    pub movable_cell_m: f32,
}

impl Config {
    /// Defaults: cells as fine as the smallest landmark of the group needs.
    pub const DEFAULT: Self = Self {
        min_range_m: 2.0,
        max_range_m: 100.0,
        min_confidence: 1,
        min_ground_confidence: 135,
        ground_cell_m: 0.6,
        large_cell_m: 0.4,
        small_cell_m: 0.15,
        movable_cell_m: 0.2,
    };

    /// Least confidence of the points of a class.
    const fn least_confidence(&self, class: SemanticClass) -> u8 {
        match class.motion() {
            MotionClass::Ground if self.min_ground_confidence > self.min_confidence => {
                self.min_ground_confidence
            }
            _ => self.min_confidence,
        }
    }

    /// Side [m] of the cells of a class.
    pub const fn cell_side_m(&self, class: SemanticClass) -> f32 {
        use SemanticClass::*;
        match class {
            Building | Fence | Vegetation | OtherStructure => self.large_cell_m,
            Trunk | Pole | TrafficSign | OtherObject => self.small_cell_m,
            _ => match class.motion() {
                MotionClass::UnknownMotion => self.movable_cell_m,
                _ => self.ground_cell_m,
            },
        }
    }

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        const fn side(value: f32, parameter: &'static str) -> Result<(), ParameterError> {
            if value >= 0.05 && value <= 5.0 {
                Ok(())
            } else {
                Err(ParameterError { parameter, expected: "0.05 to 5 m" })
            }
        }
        if !(self.min_range_m >= 0.5) {
            return Err(ParameterError { parameter: "label_filter.min_range_m", expected: "at least 0.5 m" });
        }
        if !(self.max_range_m > self.min_range_m && self.max_range_m <= 200.0) {
            let expected = "above min_range_m and at most 200 m";
            return Err(ParameterError { parameter: "label_filter.max_range_m", expected });
        }
        if let Err(e) = side(self.ground_cell_m, "label_filter.ground_cell_m") {
            return Err(e);
        }
        if let Err(e) = side(self.large_cell_m, "label_filter.large_cell_m") {
            return Err(e);
        }
        if let Err(e) = side(self.small_cell_m, "label_filter.small_cell_m") {
            return Err(e);
        }
        side(self.movable_cell_m, "label_filter.movable_cell_m")
    }
}

/// Sorts the points of a scan into `cells`. Each kept point's `landmark` field holds its cell afterwards, a dropped one
/// [`LabelledPoint::NO_LANDMARK`].
pub fn filter<const CELLS: usize>(
    config: &Config,
    points: &mut [LabelledPoint],
    cells: &mut ScanCells<CELLS>,
) -> PointCounts {
    cells.clear();
    let by_class = SemanticClass::ALL.map(|class| {
        let side = config.cell_side_m(class);
        (class.motion(), side, 1.0 / side, config.least_confidence(class))
    });
    let (min2, max2) = (config.min_range_m * config.min_range_m, config.max_range_m * config.max_range_m);
    let mut counts = PointCounts { received: points.len() as u32, ..PointCounts::default() };
    for point in points {
        point.landmark = LabelledPoint::NO_LANDMARK;
        let [x, y, z] = point.position;
        let range2 = x * x + y * y + z * z;
        let (motion, side, inverse, least_confidence) = by_class[point.class as usize];
        if !range2.is_finite() && !point.position.iter().all(|v| v.is_finite()) {
            counts.not_finite += 1;
        } else if !(min2..=max2).contains(&range2) {
            counts.out_of_range += 1;
        } else if motion == MotionClass::Dropped {
            counts.unlabelled += 1;
        } else if point.confidence < least_confidence {
            counts.unsure += 1;
        } else {
            match cells.add(point.position, point.class, side, inverse) {
                Some(cell) => {
                    point.landmark = cell;
                    *match motion {
                        MotionClass::Ground => &mut counts.ground,
                        MotionClass::PureStatic => &mut counts.pure_static,
                        _ => &mut counts.unknown_motion,
                    } += 1;
                }
                None => counts.over_capacity += 1,
            }
        }
    }
    counts
}

/// Replaces the cell in each point's `landmark` field by the cell's landmark.
pub fn assign_landmarks<const CELLS: usize>(points: &mut [LabelledPoint], cells: &ScanCells<CELLS>) {
    for point in points {
        if let Some(cell) = cells.cells().get(point.landmark as usize) {
            point.landmark = cell.landmark;
        }
    }
}
