//! How far one scan saw in every direction: the evidence for free space.

use sdslam_core::LabelledPoint;

/// Edge of a pixel \[rad\]: half a degree, wider than the gaps of a 64-beam sensor.
const PIXEL_RAD: f32 = std::f32::consts::PI / 360.0;
const WIDTH: usize = 720;
const HEIGHT: usize = 360;
/// Pixels of the 3 by 3 around a direction that must hold a range.
const MIN_PIXELS: usize = 6;

/// Nearest range per direction of one scan.
pub(crate) struct RangeImage {
    /// \[m\]; infinite where nothing came back.
    nearest_m: Vec<f32>,
}

impl RangeImage {
    /// Of all points of a scan, whatever their class: a car hides what is behind it, too.
    pub(crate) fn of(points: &[LabelledPoint]) -> Self {
        let mut nearest_m = vec![f32::INFINITY; WIDTH * HEIGHT];
        for point in points {
            let Some((column, row, range_m)) = pixel(point.position) else { continue };
            let nearest = &mut nearest_m[row * WIDTH + column];
            *nearest = nearest.min(range_m);
        }
        Self { nearest_m }
    }

    /// Whether the scan saw through a place (sensor frame) \[m\]: everything around its direction lies behind it by
    /// `margin_m`. The nearest of nine pixels counts, so that edges and surfaces seen at a flat angle hide themselves.
    pub(crate) fn sees_through(&self, place: [f32; 3], margin_m: f32) -> bool {
        let Some((column, row, range_m)) = pixel(place) else { return false };
        let rows = row.saturating_sub(1)..=(row + 1).min(HEIGHT - 1);
        let mut seen = 0;
        for row in rows {
            for step in [WIDTH - 1, 0, 1] {
                let nearest = self.nearest_m[row * WIDTH + (column + step) % WIDTH];
                if nearest < range_m + margin_m {
                    return false;
                }
                seen += usize::from(nearest.is_finite());
            }
        }
        seen >= MIN_PIXELS
    }
}

/// Column, row and range \[m\] of a place; none at the sensor itself or for what is not finite.
fn pixel([x, y, z]: [f32; 3]) -> Option<(usize, usize, f32)> {
    let across = x.hypot(y);
    let range_m = across.hypot(z);
    if !(range_m > 0.5 && range_m.is_finite()) {
        return None;
    }
    let column = (libm::atan2f(y, x) / PIXEL_RAD + WIDTH as f32 / 2.0) as usize % WIDTH;
    let row = ((libm::atan2f(z, across) / PIXEL_RAD + HEIGHT as f32 / 2.0) as usize).min(HEIGHT - 1);
    Some((column, row, range_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sdslam_core::SemanticClass;

    /// A wall 20 m ahead, 10 m wide and high.
    fn wall() -> RangeImage {
        let points: Vec<LabelledPoint> = (-100..100)
            .flat_map(|y| (-100..100).map(move |z| [20.0, 0.05 * y as f32, 0.05 * z as f32]))
            .map(|position| LabelledPoint::new(position, SemanticClass::Building))
            .collect();
        RangeImage::of(&points)
    }

    #[test]
    fn what_stands_before_a_wall_is_seen_through_and_nothing_else() {
        let image = wall();
        assert!(image.sees_through([10.0, 0.0, 0.0], 0.5));
        assert!(!image.sees_through([19.8, 0.0, 0.0], 0.5), "the wall itself");
        assert!(!image.sees_through([25.0, 0.0, 0.0], 0.5), "behind the wall");
        assert!(!image.sees_through([10.0, 10.0, 0.0], 0.5), "where nothing came back");
        assert!(!image.sees_through([-10.0, 0.0, 0.0], 0.5), "behind the sensor");
        assert!(!image.sees_through([f32::NAN, 0.0, 0.0], 0.5));
    }
}
