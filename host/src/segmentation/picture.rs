//! Pictures of a segmented scan, in SemanticKITTI's colours.

use sdslam_core::SemanticClass;

use super::Segmentation;
use super::projection::RangeImage;
use crate::dataset::labels;

/// Height of a beam in the picture of the range image \[px\]: a turn is much wider than it is high.
const ROW_PX: usize = 4;
/// The view from above reaches this far from the sensor \[m\].
const REACH_M: f32 = 50.0;
/// Size of a pixel seen from above \[m\].
const PIXEL_M: f32 = 0.1;
/// What no point is on, and points without a class.
const EMPTY: [u8; 3] = [0, 0, 0];
const UNLABELLED: [u8; 3] = [90, 90, 90];

/// The range image as a PNG file: class of the nearest point of every pixel.
pub fn range_image(segmentation: &Segmentation) -> Vec<u8> {
    let RangeImage { geometry, point, .. } = &segmentation.image;
    let colour_at =
        |&point: &u32| segmentation.classes.get(point as usize).map_or(EMPTY, |&class| colour(class));
    let rows = point.chunks_exact(geometry.width).flat_map(|row| std::iter::repeat_n(row, ROW_PX));
    png_file(geometry.width, geometry.height * ROW_PX, rows.flatten().flat_map(colour_at).collect())
}

/// The points from above as a PNG file, the vehicle heading up, the sensor in the middle; higher points hide lower ones.
pub fn birds_eye(points: &[[f32; 4]], classes: &[SemanticClass]) -> Vec<u8> {
    let side = (2.0 * REACH_M / PIXEL_M) as usize;
    let mut pixels = vec![EMPTY; side * side];
    let mut top_m = vec![f32::NEG_INFINITY; side * side];
    for (&[x, y, z, _], &class) in points.iter().zip(classes) {
        let (right, down) = ((REACH_M - y) / PIXEL_M, (REACH_M - x) / PIXEL_M);
        let inside = |pixel: f32| pixel >= 0.0 && pixel < side as f32;
        if inside(right) && inside(down) {
            let pixel = down as usize * side + right as usize;
            if z > top_m[pixel] {
                (top_m[pixel], pixels[pixel]) = (z, colour(class));
            }
        }
    }
    png_file(side, side, pixels.into_flattened())
}

fn colour(class: SemanticClass) -> [u8; 3] {
    if class == SemanticClass::Unlabelled { UNLABELLED } else { labels::colour(class) }
}

fn png_file(width: usize, height: usize, rgb: Vec<u8>) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&rgb));
    written.expect("memory takes every picture, and its size is right");
    file
}
