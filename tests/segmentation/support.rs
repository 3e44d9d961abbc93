//! The small networks and their image, and a scan that fits it.

use std::path::{Path, PathBuf};

use sdslam::segmentation::{ModelDescription, Segmenter};

pub const HEIGHT: usize = 16;
pub const WIDTH: usize = 64;
pub const CLASSES: usize = 6;

/// What `tests/networks/make.py` made.
pub fn networks() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("networks")
}

pub fn onnx(name: &str) -> PathBuf {
    networks().join(format!("{name}.onnx"))
}

pub fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(onnx(name)).expect("a network of the repository")
}

/// The description of the small networks.
pub fn description() -> ModelDescription {
    ModelDescription::load(&networks().join("model.toml")).expect("a valid description")
}

pub fn described(text: &str) -> ModelDescription {
    ModelDescription::parse(text, Path::new("model.toml")).expect("a valid description")
}

pub fn segmenter(name: &str) -> Segmenter {
    Segmenter::new(&bytes(name), &onnx(name), description()).expect("a network that runs")
}

/// The image of `make.py`: numbers of -2 to 2 from a multiplicative hash of their index.
pub fn image() -> Vec<f32> {
    let hashed = |index: u64| (index * 2_654_435_761 + 12_345) % (1 << 32) / (1 << 16);
    (0..5 * HEIGHT * WIDTH).map(|index| hashed(index as u64) as f32 / 16384.0 - 2.0).collect()
}

pub fn floats(file: &Path) -> Vec<f32> {
    let bytes = std::fs::read(file).expect("a file of numbers");
    bytes.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

/// A scan of steps in range, with several points in some pixels, no two equally far.
pub fn scan() -> Vec<[f32; 4]> {
    let point = |k: usize| {
        let azimuth = 0.013 * k as f32;
        let elevation = -0.42 + 0.47 * ((k * 7919) % 1000) as f32 / 1000.0;
        let range_m = 6.0
            + 0.0004 * k as f32
            + 3.0 * ((k / 40) % 4) as f32
            + if k.is_multiple_of(5) { 9.0 } else { 0.0 };
        let flat = range_m * elevation.cos();
        [flat * azimuth.cos(), flat * azimuth.sin(), range_m * elevation.sin(), (k % 10) as f32 / 10.0]
    };
    (0..4000).map(point).collect()
}
