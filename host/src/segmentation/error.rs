//! Why a network cannot be used, or a scan cannot be segmented.

use std::path::{Path, PathBuf};

/// Why there are no classes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentationError {
    /// A file of the model cannot be read.
    #[error("cannot read {} of the segmentation model", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A folder holds no network.
    #[error("the folder {} holds no model.onnx; expected model.onnx and, if it is not RangeNet++'s, model.toml", .path.display())]
    NoNetwork {
        /// The folder.
        path: PathBuf,
    },
    /// The bytes are not an ONNX model, or only the beginning of one.
    #[error("{} is not a whole ONNX model: {reason}", .path.display())]
    NotOnnx {
        /// The file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// Not one image in, one answer out.
    #[error("{} has {inputs} inputs and {outputs} outputs, expected one of each", .path.display())]
    Bindings {
        /// The file.
        path: PathBuf,
        /// Inputs found.
        inputs: usize,
        /// Outputs found.
        outputs: usize,
    },
    /// Operators that the inference library does not have.
    #[error("{} uses operators that cannot be run here: {}; expected operators known to tract-onnx", .path.display(), .operators.join(", "))]
    Operators {
        /// The file.
        path: PathBuf,
        /// Their ONNX names.
        operators: Vec<String>,
    },
    /// The file and its description do not agree.
    #[error("{} {what} {found}, but its model.toml (or RangeNet++'s defaults) says {expected}", .path.display())]
    Shape {
        /// The ONNX file.
        path: PathBuf,
        /// Which tensor.
        what: &'static str,
        /// Shape in the file.
        found: String,
        /// Shape that the description asks for.
        expected: String,
    },
    /// The inference library refuses the network.
    #[error("{} cannot be prepared for an image of {expected}", .path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// Shape that the description asks for.
        expected: String,
        /// What the library says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// `model.toml` is no TOML, has an unknown key or a value of the wrong type.
    #[error("the model description {} is not valid", .path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// Line, column and reason.
        source: Box<toml::de::Error>,
    },
    /// A value of `model.toml` is out of range.
    #[error("{}: `{}` must be {}", .path.display(), .fault.key, .fault.expected)]
    DescriptionValue {
        /// The file.
        path: PathBuf,
        /// Which value.
        fault: DescriptionFault,
    },
    /// No point lies where the network looks.
    #[error(
        "none of the {points} points lies in the network's field of view of {down_deg} to {up_deg} deg of elevation"
    )]
    NothingInView {
        /// Points of the scan.
        points: usize,
        /// Lower edge of the image \[deg\].
        down_deg: f32,
        /// Upper edge of the image \[deg\].
        up_deg: f32,
    },
    /// The network fails on a scan.
    #[error("the network cannot be run")]
    Inference(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// A value that `model.toml` cannot have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DescriptionFault {
    /// Table and key.
    pub key: &'static str,
    /// What is allowed.
    pub expected: &'static str,
}

impl SegmentationError {
    pub(super) fn reading(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Unreadable { path: path.into(), source }
    }
}
