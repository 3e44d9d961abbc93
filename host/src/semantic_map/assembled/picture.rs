//! The map from above, in the colours of its classes.

use super::StaticMap;
use crate::dataset::labels;

/// Pixels of the longer side at most.
const MAX_SIDE_PX: f64 = 4000.0;
const BACKGROUND: [u8; 3] = [255; 3];

impl StaticMap {
    /// PNG, y of the map frame upwards: the highest cell of every pixel in the colour of its class.
    pub fn to_png(&self) -> Vec<u8> {
        let (mut low, mut high) = ([0.0f64; 3], [1.0f64; 3]);
        if let Some(first) = self.cells.first() {
            (low, high) = (first.position.map(f64::from), first.position.map(f64::from));
        }
        for cell in &self.cells {
            for axis in 0..3 {
                low[axis] = low[axis].min(cell.position[axis].into());
                high[axis] = high[axis].max(cell.position[axis].into());
            }
        }
        let pixel_m = self.voxel_m.max((high[0] - low[0]).max(high[1] - low[1]) / (MAX_SIDE_PX - 1.0));
        let side = |axis: usize| ((high[axis] - low[axis]) / pixel_m) as usize + 1;
        let (width, height) = (side(0), side(1));
        let mut top = vec![f32::NEG_INFINITY; width * height];
        let mut image = BACKGROUND.repeat(width * height);
        for cell in &self.cells {
            let [column, row] = [0, 1].map(|i| ((f64::from(cell.position[i]) - low[i]) / pixel_m) as usize);
            let pixel = (height - 1 - row) * width + column;
            if cell.position[2] > top[pixel] {
                top[pixel] = cell.position[2];
                image[3 * pixel..3 * pixel + 3].copy_from_slice(&labels::colour(cell.class));
            }
        }
        encode(width as u32, height as u32, &image)
    }
}

fn encode(width: u32, height: u32, rgb: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(rgb));
    written.expect("an image of the size it says is written to memory");
    bytes
}
