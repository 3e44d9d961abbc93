//! Where proposed loops come from.

use sdslam_core::MapPose;

/// Who proposed a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// The features of the place.
    Features,
    /// The corrected trajectory comes near an old place.
    Position,
}

impl Source {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Features => "features",
            Self::Position => "position",
        }
    }
}

/// A place that may be an old one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Proposal {
    /// The old keyframe.
    pub old: usize,
    /// Pose of the new keyframe in the frame of the old one.
    pub old_from_new: MapPose,
    pub source: Source,
    /// Pairs of keypoints that agree.
    pub keypoint_inliers: u32,
}
