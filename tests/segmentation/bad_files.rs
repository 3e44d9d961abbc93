//! Files that are wrong: one sentence that says what was found and what was expected, and never a panic.

use std::error::Error;
use std::path::Path;

use proptest::prelude::*;
use sdslam::segmentation::{SegmentationError, Segmenter};

use crate::support::{bytes, described, description, onnx};

const NAME: &str = "squeezesegv2";

fn refusal(bytes: &[u8]) -> SegmentationError {
    Segmenter::new(bytes, Path::new("net.onnx"), description()).expect_err("a refusal")
}

/// The error with everything that caused it.
fn text(error: &dyn Error) -> String {
    let cause = error.source().map(|cause| format!(": {}", text(cause)));
    error.to_string() + &cause.unwrap_or_default()
}

/// The file with every `from` replaced by the equally long `to`.
fn replaced(from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = bytes(NAME);
    let places: Vec<_> =
        (0..bytes.len() - from.len()).filter(|&at| bytes[at..].starts_with(from.as_bytes())).collect();
    assert!(!places.is_empty(), "{from} is not in the file");
    places.into_iter().for_each(|at| bytes[at..at + to.len()].copy_from_slice(to.as_bytes()));
    bytes
}

#[test]
fn what_is_no_onnx_is_refused() {
    for bytes in [&b""[..], b"not an onnx file at all\n", &[0xff; 64], &[0x89, b'P', b'N', b'G', 0x0d, 0x0a]]
    {
        let error = refusal(bytes);
        assert!(matches!(error, SegmentationError::NotOnnx { .. }), "{error:?}");
        assert!(text(&error).contains("net.onnx is not a whole ONNX model"), "{}", text(&error));
    }
}

#[test]
fn a_file_that_ends_early_is_refused_wherever_it_ends() {
    let bytes = bytes(NAME);
    for end in (0..bytes.len()).step_by(97).chain(bytes.len() - 40..bytes.len()) {
        let error = refusal(&bytes[..end]);
        let named = text(&error).contains("net.onnx");
        assert!(named, "cut at {end}: {}", text(&error));
    }
}

#[test]
fn another_image_than_described_is_named_with_both_sizes() {
    for (toml, found, expected) in [
        ("[image]\nheight = 16\nwidth = 128\n", "1x5x16x64", "1x5x16x128"),
        ("[image]\nheight = 64\nwidth = 64\n", "1x5x16x64", "1x5x64x64"),
    ] {
        let error = Segmenter::new(&bytes(NAME), &onnx(NAME), described(toml)).expect_err("a refusal");
        let text = text(&error);
        assert!(text.contains(NAME) && text.contains(found) && text.contains(expected), "{text}");
    }
}

#[test]
fn another_number_of_channels_is_named() {
    // In the file, the sizes of the input are 5, 16, 64: one dimension is a message of two bytes, `08 05`.
    let mut bytes = bytes(NAME);
    let shape = [0x0a, 0x02, 0x08, 0x05, 0x0a, 0x02, 0x08, 0x10, 0x0a, 0x02, 0x08, 0x40];
    let at = bytes.windows(shape.len()).position(|window| window == shape).expect("the input's shape");
    bytes[at + 3] = 4;
    let text = text(&refusal(&bytes));
    assert!(text.contains("1x4x16x64") && text.contains("1x5x16x64"), "{text}");
}

#[test]
fn another_number_of_classes_than_described_is_named_with_both() {
    let twenty = "[image]\nheight = 16\nwidth = 64\n";
    let error = Segmenter::new(&bytes(NAME), &onnx(NAME), described(twenty)).expect_err("a refusal");
    let text = text(&error);
    assert!(text.contains("1x6x16x64") && text.contains("1x20x16x64"), "{text}");
}

#[test]
fn operators_that_are_not_known_are_named() {
    let text = text(&refusal(&replaced("MaxPool", "FaxPool")));
    assert!(text.contains("FaxPool") && !text.contains("Conv"), "{text}");
}

#[test]
fn a_folder_without_a_network_says_what_is_expected_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = text(&Segmenter::load(folder.path()).expect_err("it is empty"));
    assert!(text.contains("model.onnx") && text.contains("model.toml"), "{text}");
    let nowhere = folder.path().join("net.onnx");
    let text = self::text(&Segmenter::load(&nowhere).expect_err("there is none"));
    assert!(text.contains("net.onnx"), "{text}");
}

#[test]
fn a_network_is_found_with_its_description_by_file_and_by_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let toml = "[image]\nheight = 16\nwidth = 64\n[output]\nclasses = [40, 50, 70, 10, 0, 80]\n";
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("writable");
    write("model.onnx", &bytes(NAME));
    write("model.toml", toml.as_bytes());
    write("other.onnx", &bytes("darknet21"));
    for path in
        [folder.path().to_path_buf(), folder.path().join("model.onnx"), folder.path().join("other.onnx")]
    {
        let segmenter = Segmenter::load(&path).expect("a model");
        assert_eq!(segmenter.description().image.width, 64);
    }
    // The description of its own name goes before model.toml.
    write("other.toml", b"[image]\nwide = 64\n");
    let text = text(&Segmenter::load(&folder.path().join("other.onnx")).expect_err("an unknown key"));
    assert!(text.contains("other.toml") && text.contains("wide"), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bytes_are_refused_or_run_but_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut bytes = bytes(NAME);
        for (at, value) in flips {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(segmenter) = Segmenter::new(&bytes, Path::new("net.onnx"), description()) {
            let _ = segmenter.segment(&crate::support::scan());
        }
    }
}
