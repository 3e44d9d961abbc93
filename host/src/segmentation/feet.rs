//! Where a plant stands on the ground, its class says little: the lowest points below it get no confidence. Not in
//! RangeNet++, and off unless `model.toml` asks for it.
//!
//! Between plants the ground shows as strands of a few points, and a small network takes them for vegetation, however
//! sure it says it is. In one voxel with the plant above they make a surface that is not there: left out below plants,
//! the SLAM gains; left out where no plant is above, it does not. True feet are no loss: their plant goes on above them.

use sdslam_core::SemanticClass;
use serde::Deserialize;

use super::error::DescriptionFault;

/// Parameters of the feet.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FeetConfig {
    /// Vegetation lower than this above the lowest point of its column of 1 m x 1 m is a foot \[m\]; 0 switches feet off.
    pub height_m: f32,
    /// A column holds a plant if its vegetation reaches this far above its lowest point \[m\].
    pub plant_m: f32,
}

impl Default for FeetConfig {
    fn default() -> Self {
        Self { height_m: 0.0, plant_m: 0.25 }
    }
}

impl FeetConfig {
    pub(super) fn fault(&self) -> Option<DescriptionFault> {
        let heights = [("feet.height_m", self.height_m), ("feet.plant_m", self.plant_m)];
        let (key, _) = heights.into_iter().find(|&(_, value)| !(value >= 0.0 && value.is_finite()))?;
        Some(DescriptionFault { key, expected: "a number of metres, 0 or more" })
    }
}

/// Columns in each direction of the sensor; points farther away have none.
const REACH: i32 = 128;

/// Takes the confidence of every foot. Points are x, y, z \[m\] in the sensor frame, whose z axis points up.
pub fn doubt(config: &FeetConfig, points: &[[f32; 4]], classes: &[SemanticClass], confidences: &mut [u8]) {
    if config.height_m == 0.0 {
        return;
    }
    let columns = (2 * REACH * 2 * REACH) as usize;
    let (mut lowest, mut highest_plant) = (vec![f32::INFINITY; columns], vec![f32::NEG_INFINITY; columns]);
    for (point, &class) in points.iter().zip(classes) {
        let Some(column) = column(point) else { continue };
        lowest[column] = lowest[column].min(point[2]);
        if class == SemanticClass::Vegetation {
            highest_plant[column] = highest_plant[column].max(point[2]);
        }
    }
    for ((point, &class), confidence) in points.iter().zip(classes).zip(confidences) {
        let Some(column) = column(point).filter(|_| class == SemanticClass::Vegetation) else { continue };
        let (height_m, plant_m) = (point[2] - lowest[column], highest_plant[column] - lowest[column]);
        if height_m < config.height_m && plant_m >= config.plant_m {
            *confidence = 0;
        }
    }
}

/// Number of the column of a point.
fn column(&[x, y, z, _]: &[f32; 4]) -> Option<usize> {
    let (row, column) = (x.floor() as i32, y.floor() as i32);
    let inside = x.is_finite() && y.is_finite() && z.is_finite();
    let inside = inside && (-REACH..REACH).contains(&row) && (-REACH..REACH).contains(&column);
    inside.then(|| ((row + REACH) * 2 * REACH + column + REACH) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use SemanticClass::{Building, Terrain, Vegetation};

    const ON: FeetConfig = FeetConfig { height_m: 0.15, plant_m: 0.25 };

    /// Confidences of points at (x, z), all 200 before.
    fn doubted(config: &FeetConfig, points: &[(f32, f32, SemanticClass)]) -> Vec<u8> {
        let places: Vec<_> = points.iter().map(|&(x, z, _)| [x, 3.5, z, 0.1]).collect();
        let classes: Vec<_> = points.iter().map(|&(_, _, class)| class).collect();
        let mut confidences = vec![200; points.len()];
        doubt(config, &places, &classes, &mut confidences);
        confidences
    }

    #[test]
    fn the_foot_of_a_plant_is_doubted_and_its_crown_is_not() {
        let bush = [(-9.5, -1.7, Vegetation), (-9.4, -1.6, Vegetation), (-9.6, -1.0, Vegetation)];
        assert_eq!(doubted(&ON, &bush), [0, 0, 200]);
        assert_eq!(doubted(&FeetConfig::default(), &bush), [200; 3]);
    }

    #[test]
    fn the_lowest_point_of_any_class_counts_but_only_vegetation_is_doubted() {
        let above = [(9.5, -1.7, Terrain), (9.4, -1.6, Vegetation), (9.6, -1.4, Vegetation)];
        assert_eq!(doubted(&ON, &above), [200, 0, 200]);
        let wall = above.map(|(x, z, _)| (x, z, Building));
        assert_eq!(doubted(&ON, &wall), [200; 3]);
    }

    #[test]
    fn flat_vegetation_and_other_columns_are_left_alone() {
        let lawn = [(9.5, -1.7, Vegetation), (9.4, -1.6, Vegetation), (10.1, -1.0, Vegetation)];
        assert_eq!(doubted(&ON, &lawn), [200; 3]);
    }

    #[test]
    fn points_far_away_or_nowhere_have_no_column() {
        for x in [200.0, -200.0, f32::NAN, f32::INFINITY] {
            assert_eq!(doubted(&ON, &[(x, -1.7, Vegetation), (x, 0.0, Vegetation)]), [200; 2], "{x}");
        }
        let nowhere =
            [(9.5, f32::NEG_INFINITY, Vegetation), (9.5, -1.7, Vegetation), (9.5, -1.6, Vegetation)];
        assert_eq!(doubted(&ON, &nowhere), [200; 3]);
    }
}
