//! Why a graph cannot be built, read or solved.

use std::path::PathBuf;

/// A fault of a pose graph.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GraphError {
    /// An edge that joins nothing.
    #[error("edge from keyframe {from} to {to}: both must differ and be among the {keyframes} keyframes")]
    Ends {
        /// First end.
        from: usize,
        /// Second end.
        to: usize,
        /// Keyframes in the graph.
        keyframes: usize,
    },
    /// Numbers that cannot be a measurement.
    #[error("edge from keyframe {from} to {to}: {fault}")]
    Measurement {
        /// First end.
        from: usize,
        /// Second end.
        to: usize,
        /// What is wrong.
        fault: &'static str,
    },
    /// Some keyframe is not held by any chain of edges.
    #[error("the graph is not determined: some keyframe is not joined to the first one")]
    NotDetermined,
    /// A g2o file cannot be opened.
    #[error("cannot read {}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A line of a g2o file is wrong.
    #[error("{}, line {line}: {fault}", .file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What was found and what is expected.
        fault: String,
    },
}
