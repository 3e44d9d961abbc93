//! loops.csv: every proposed loop and what became of it.

use sdslam_core::MapPose;

use super::proposal::Source;
use super::{Refined, Verdict};

pub(crate) const HEADER: &str = "frame,old_frame,source,keypoint_inliers,x,y,z,qx,qy,qz,qw,inliers,fit,overlap,seen_through,accepted,reason\n";

/// One proposed loop.
pub(crate) struct LoopRow {
    /// Frame of the new keyframe.
    pub frame: usize,
    /// Frame of the old one.
    pub old_frame: usize,
    pub source: Source,
    pub keypoint_inliers: u32,
    pub refined: Refined,
    /// Pose of the new keyframe in the frame of the old one.
    pub old_from_new: MapPose,
    pub verdict: Verdict,
}

impl LoopRow {
    /// A line: frames of the run, pose of the new sensor in the old one's frame \[m\], evidence, verdict.
    pub(crate) fn line(&self) -> String {
        let (t, q) = (self.old_from_new.translation.vector, self.old_from_new.rotation.coords);
        let Refined { inliers, fit, overlap, seen_through, .. } = self.refined;
        format!(
            "{},{},{},{},{:.4},{:.4},{:.4},{:.7},{:.7},{:.7},{:.7},{inliers},{fit:.4},{overlap:.4},{seen_through:.4},{},{}\n",
            self.frame,
            self.old_frame,
            self.source.name(),
            self.keypoint_inliers,
            t.x,
            t.y,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w,
            self.verdict == Verdict::Accepted,
            self.verdict.reason()
        )
    }
}
