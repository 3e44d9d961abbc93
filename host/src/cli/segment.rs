//! `sdslam segment`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::frames::FrameRange;
use super::progress::Progress;
use super::{CliError, print};
use crate::run::{self, SegmentRequest};
use crate::segmentation::Segmenter;

/// Give every point of a drive a class: label files from raw scans.
///
/// Reads DATASET/sequences/NN/velodyne and writes OUT/NN/labels/NNNNNN.label with SemanticKITTI's ids, and segment.log.
/// A scan that cannot be read or has no point in the network's field of view gets no file; segment.log says which.
///
/// Example: sdslam segment --dataset ~/kitti --sequence 07 --out labelled --png
/// Compare: sdslam evaluate --labels-truth ~/kitti/sequences/07/labels --labels-estimate labelled/07/labels
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder with sequences/.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Name of the sequence, e.g. 07.
    #[arg(long, value_name = "NN")]
    sequence: String,
    /// Where the files go: into the folder OUT/NN.
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    network: NetworkArgs,
    /// Frames to segment, from A up to but without B; A.. and ..B leave the other end open. Default: all.
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Paint every scan: range/NNNNNN.png, the range image, and birds_eye/NNNNNN.png, the points from above, coloured by
    /// class.
    #[arg(long)]
    png: bool,
    /// Replace the files of an earlier run in OUT/NN. Nothing else is deleted.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// Which network.
#[derive(Debug, clap::Args)]
pub(super) struct NetworkArgs {
    /// Network of RangeNet++'s kind: an ONNX file, described by the .toml file of its name or model.toml beside it, or a
    /// folder with model.onnx and model.toml. Default: the model that is part of this program.
    #[arg(long, value_name = "FILE|DIR")]
    pub(super) model: Option<PathBuf>,
}

/// How many threads.
#[derive(Debug, clap::Args)]
pub(super) struct ThreadArgs {
    /// Threads: 1 does one thing after the other; with more, later scans are read and segmented meanwhile. The results
    /// are the same. Default: one per core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl NetworkArgs {
    /// The network that was asked for.
    pub(super) fn load(model: Option<&Path>) -> Result<Arc<Segmenter>, CliError> {
        let segmenter = match model {
            Some(path) => Segmenter::load(path),
            None => Segmenter::built_in(),
        };
        Ok(Arc::new(segmenter?))
    }
}

impl ThreadArgs {
    pub(super) fn count(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, Into::into);
        self.threads.map_or_else(cores, usize::from)
    }
}

impl Args {
    pub(super) fn execute(self) -> Result<(), CliError> {
        let segmenter = NetworkArgs::load(self.network.model.as_deref())?;
        let progress = Progress::new("segment");
        let summary = run::segment(&self.request(), &segmenter, |done, all| progress.show(done, all))?;
        print(summary.to_string())
    }

    fn request(self) -> SegmentRequest {
        let frames = self.frames.unwrap_or(FrameRange { first: 0, end: None });
        SegmentRequest {
            dataset: self.dataset,
            sequence: self.sequence,
            first_frame: frames.first,
            end_frame: frames.end,
            threads: self.threads.count(),
            pictures: self.png,
            overwrite: self.overwrite,
            out: self.out,
        }
    }
}
