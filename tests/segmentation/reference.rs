//! The SemanticKITTI test network on two real scans against its reference outputs (see ../shared/models/README.md).

use std::path::{Path, PathBuf};

use sdslam::dataset::{labels, read_scan};
use sdslam::segmentation::description::Normalisation;
use sdslam::segmentation::network::Network;
use sdslam::segmentation::pixels::PixelClasses;
use sdslam::segmentation::projection::RangeImage;
use sdslam::segmentation::{ModelDescription, Segmenter};
use sdslam_core::SemanticClass;

use crate::support::{described, floats};

const SCANS: [(&str, &str); 2] = [("90", "000100"), ("91", "000003")];

/// Folder of the unpacked test data, and the network.
fn test_data() -> Option<(PathBuf, PathBuf)> {
    let network =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/models/3dmininet_tiny_semantickitti.onnx");
    let network = std::env::var_os("SDSLAM_TEST_NETWORK").map_or(network, PathBuf::from);
    let data = std::env::var_os("SDSLAM_TEST_DATA").map(PathBuf::from);
    let found = data.filter(|data| data.join("net_reference").is_dir() && network.is_file());
    if found.is_none() {
        println!(
            "skipped: SDSLAM_TEST_DATA with net_reference, or ../shared/models with the test network, is not there"
        );
    }
    found.map(|data| (data, network))
}

fn differing<T: PartialEq>(found: impl IntoIterator<Item = T>, expected: impl IntoIterator<Item = T>) -> f64 {
    let (mut all, mut differ) = (0, 0);
    for (found, expected) in found.into_iter().zip(expected) {
        all += 1;
        differ += usize::from(found != expected);
    }
    differ as f64 / f64::from(all)
}

fn classes(file: &Path) -> Vec<SemanticClass> {
    let bytes = std::fs::read(file).expect("reference classes");
    bytes.iter().map(|&index| SemanticClass::ALL[index as usize]).collect()
}

#[test]
fn pixels_and_image_are_those_of_the_reference() {
    let Some((data, _)) = test_data() else { return };
    for (sequence, number) in SCANS {
        let reference = data.join(format!("net_reference/{sequence}_{number}"));
        let points =
            read_scan(&data.join(format!("sequences/{sequence}/velodyne/{number}.bin"))).expect("a scan");
        let image = RangeImage::project(ModelDescription::default().image, &points);
        let pixels = std::fs::read(reference.join("pixel.u32")).expect("reference pixels");
        let pixels = pixels.as_chunks::<4>().0.iter().map(|&bytes| u32::from_le_bytes(bytes));
        let moved = differing(image.pixel.iter().copied(), pixels);
        let found = image.to_tensor(&points, &Normalisation::default());
        let expected = floats(&reference.join("image.f32"));
        assert_eq!(found.len(), expected.len());
        let other =
            differing(found.iter().map(|v| (v * 1e4).round()), expected.iter().map(|v| (v * 1e4).round()));
        println!(
            "{sequence}/{number}: {moved:.6} of the points in another pixel, {other:.6} of the image differs"
        );
        assert!(moved <= 5e-4 && other <= 1e-3);
    }
}

#[test]
fn from_the_reference_image_come_the_reference_classes() {
    let Some((data, network)) = test_data() else { return };
    let description = ModelDescription::default();
    let bytes = std::fs::read(&network).expect("the network");
    let net = Network::load(&bytes, &network, &description).expect("it runs");
    for (sequence, number) in SCANS {
        let reference = data.join(format!("net_reference/{sequence}_{number}"));
        let output = net.run(&floats(&reference.join("image.f32"))).expect("it runs");
        let expected = floats(&reference.join("logits_every16.f32"));
        let largest =
            output.iter().step_by(16).zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let pixels = description.image.pixels();
        let found = PixelClasses::of(&output, description.output.kind, pixels).channel;
        let expected = std::fs::read(reference.join("classes_image.u8")).expect("reference classes");
        let differ = differing(found, expected);
        println!(
            "{sequence}/{number}: largest difference {largest:.1e}, {differ:.6} of the pixels of another class"
        );
        assert!(largest < 1e-3 && differ < 1e-4);
    }
}

#[test]
fn labels_after_knn_are_those_of_the_reference() {
    let Some((data, network)) = test_data() else { return };
    let bytes = std::fs::read(&network).expect("the network");
    for (sequence, number) in SCANS {
        let points =
            read_scan(&data.join(format!("sequences/{sequence}/velodyne/{number}.bin"))).expect("a scan");
        for (toml, file) in [
            ("[knn]\nneighbours = 0\n", "classes_before.u8"),
            ("[knn]\nneighbours = 7\nwindow = 7\ncutoff_m = 2.0\nsigma = 0\n", "classes_knn7_plain.u8"),
            ("", "classes_knn5_gauss.u8"),
            ("[knn]\nneighbours = 7\nwindow = 7\ncutoff_m = 2.0\n", "classes_knn7_gauss.u8"),
        ] {
            let segmenter = Segmenter::new(&bytes, &network, described(toml)).expect("it runs");
            let found = segmenter.segment(&points).expect("classes");
            let expected = classes(&data.join(format!("net_reference/{sequence}_{number}/{file}")));
            assert_eq!(found.classes.len(), expected.len());
            let differ = differing(found.classes.iter().copied(), expected);
            println!("{sequence}/{number} {file}: {:.4} % of the points agree", 100.0 * (1.0 - differ));
            assert!(differ <= 1e-3, "{file}: {differ}");
            assert_eq!(labels::class_of(found.raw_labels()[0]), found.classes[0]);
        }
    }
}
