//! The range image: RangeNet++'s spherical projection of a scan.

use super::description::{CHANNELS, ImageGeometry, Normalisation};

/// A scan as an image. Pixels are counted row by row from the upper left, where the sensor looks backwards.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeImage {
    /// How it was made.
    pub geometry: ImageGeometry,
    /// Range of the nearest point of every pixel \[m\]; infinite where it is empty.
    pub range_m: Vec<f32>,
    /// Index of that point; [`RangeImage::NONE`] where the pixel is empty.
    pub point: Vec<u32>,
    /// Pixel of every point; [`RangeImage::NONE`] for one without a direction (at the origin or not finite).
    pub pixel: Vec<u32>,
    /// Range of every point \[m\].
    pub point_range_m: Vec<f32>,
    /// Points whose elevation lies in the image; others belong to its first or last row.
    pub in_view: usize,
}

impl RangeImage {
    /// No pixel or no point.
    pub const NONE: u32 = u32::MAX;

    /// Projects x, y, z \[m\] in the sensor frame (and remission) as they are in the file: networks are trained on points
    /// without corrections. The nearest point wins a pixel, among equals the first.
    pub fn project(geometry: ImageGeometry, points: &[[f32; 4]]) -> Self {
        let mut image = Self {
            geometry,
            range_m: vec![f32::INFINITY; geometry.pixels()],
            point: vec![Self::NONE; geometry.pixels()],
            pixel: Vec::with_capacity(points.len()),
            point_range_m: Vec::with_capacity(points.len()),
            in_view: 0,
        };
        let view = View::of(&geometry);
        for (index, &[x, y, z, _]) in points.iter().enumerate() {
            let range_m = (x * x + y * y + z * z).sqrt();
            image.point_range_m.push(range_m);
            if !(range_m > 0.0 && range_m.is_finite()) {
                image.pixel.push(Self::NONE);
                continue;
            }
            let (pixel, in_view) = view.pixel([x, y, z], range_m);
            image.pixel.push(pixel as u32);
            image.in_view += usize::from(in_view);
            if range_m < image.range_m[pixel] {
                image.range_m[pixel] = range_m;
                image.point[pixel] = index as u32;
            }
        }
        image
    }

    /// The network's input, channel by channel: range, x, y, z, remission, normalised; an empty pixel is 0 in all.
    pub fn to_tensor(&self, points: &[[f32; 4]], normalise: &Normalisation) -> Vec<f32> {
        let pixels = self.geometry.pixels();
        let mut tensor = vec![0.0; CHANNELS * pixels];
        for (pixel, (&index, &range_m)) in self.point.iter().zip(&self.range_m).enumerate() {
            let Some(&[x, y, z, remission]) = points.get(index as usize) else { continue };
            for (channel, value) in [range_m, x, y, z, remission].into_iter().enumerate() {
                tensor[channel * pixels + pixel] =
                    (value - normalise.means[channel]) / normalise.deviations[channel];
            }
        }
        tensor
    }
}

/// The image's geometry, ready for a hundred thousand points.
struct View {
    height: f32,
    width: f32,
    columns: usize,
    down_rad: f32,
    fov_rad: f32,
}

impl View {
    fn of(geometry: &ImageGeometry) -> Self {
        let (up_rad, down_rad) = (geometry.fov_up_deg.to_radians(), geometry.fov_down_deg.to_radians());
        Self {
            height: geometry.height as f32,
            width: geometry.width as f32,
            columns: geometry.width,
            down_rad,
            fov_rad: up_rad - down_rad,
        }
    }

    /// Pixel of a point, and whether its elevation lies in the image. libm, so that the pixel is the same on every machine.
    fn pixel(&self, [x, y, z]: [f32; 3], range_m: f32) -> (usize, bool) {
        let yaw = -libm::atan2f(y, x);
        let pitch = libm::asinf((z / range_m).clamp(-1.0, 1.0));
        let u = 0.5 * (yaw / std::f32::consts::PI + 1.0);
        let v = 1.0 - (pitch - self.down_rad) / self.fov_rad;
        let column = (u * self.width).floor().clamp(0.0, self.width - 1.0);
        let row = (v * self.height).floor().clamp(0.0, self.height - 1.0);
        (row as usize * self.columns + column as usize, (0.0..=1.0).contains(&v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: ImageGeometry = ImageGeometry { height: 4, width: 8, fov_up_deg: 10.0, fov_down_deg: -30.0 };

    fn pixel_of(azimuth_deg: f32, elevation_deg: f32) -> (u32, u32) {
        let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
        let flat = 7.0 * elevation.cos();
        let point = [flat * azimuth.cos(), flat * azimuth.sin(), 7.0 * elevation.sin(), 0.5];
        let pixel = RangeImage::project(SMALL, &[point]).pixel[0];
        (pixel / 8, pixel % 8)
    }

    #[test]
    fn azimuth_runs_from_the_rear_over_the_left_and_elevation_downwards() {
        assert_eq!(pixel_of(179.0, 9.0), (0, 0));
        assert_eq!(pixel_of(89.0, 1.0), (0, 2));
        assert_eq!(pixel_of(1.0, -1.0), (1, 3));
        assert_eq!(pixel_of(-1.0, -11.0), (2, 4));
        assert_eq!(pixel_of(-179.0, -29.0), (3, 7));
    }

    #[test]
    fn what_is_above_or_below_the_view_goes_to_the_edge_and_is_not_counted() {
        let points = [[1.0, 0.0, 5.0, 0.0], [1.0, 0.0, -5.0, 0.0], [5.0, 0.0, -0.5, 0.0]];
        let image = RangeImage::project(SMALL, &points);
        assert_eq!(image.pixel, [4, 3 * 8 + 4, 8 + 4]);
        assert_eq!(image.in_view, 1);
    }

    #[test]
    fn the_nearest_point_wins_and_every_point_keeps_its_pixel() {
        let points = [[9.0, 0.1, 0.0, 0.9], [3.0, 0.1, 0.0, 0.3], [6.0, 0.1, 0.0, 0.6], [3.0, 0.1, 0.0, 0.7]];
        let image = RangeImage::project(SMALL, &points);
        let pixel = image.pixel[0] as usize;
        assert!(image.pixel.iter().all(|&p| p as usize == pixel));
        assert_eq!(image.point[pixel], 1);
        assert_eq!(image.point.iter().filter(|&&index| index != RangeImage::NONE).count(), 1);
        let normalise = Normalisation { means: [1.0; 5], deviations: [2.0; 5] };
        let tensor = image.to_tensor(&points, &normalise);
        let at = |channel: usize| tensor[channel * 32 + pixel];
        assert_eq!([at(1), at(2), at(3), at(4)], [1.0, -0.45, -0.5, -0.35]);
        assert_eq!(tensor.iter().filter(|&&value| value != 0.0).count(), 5);
    }

    #[test]
    fn points_without_a_direction_have_no_pixel() {
        let points =
            [[0.0; 4], [f32::NAN, 1.0, 1.0, 0.0], [f32::INFINITY, 1.0, 1.0, 0.0], [1e30, 1.0, 1.0, 0.0]];
        let image = RangeImage::project(SMALL, &points);
        assert_eq!(image.pixel, [RangeImage::NONE; 4]);
        assert_eq!(image.in_view, 0);
    }
}
