//! Whether a refined loop is believed: it must fit, cover, and contradict nothing.

use super::Refined;
use crate::config::LoopConfig;

/// What becomes of a proposed loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Part of the graph.
    Accepted,
    /// Too little of the new place lies where the old one has something.
    LittleOverlap,
    /// Too few of the points that lie on the old place fit it.
    PoorFit,
    /// Too much of the old place was seen through from the new one.
    SeenThrough,
    /// The registration ended far from the proposal.
    RanAway,
    /// The scan does not fix all six degrees of freedom.
    Degenerate,
    /// The next proposal does not agree, or none came.
    Unconfirmed,
    /// The graph cannot follow.
    Disbelieved,
}

impl Verdict {
    /// For loops.csv.
    pub fn reason(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::LittleOverlap => "too little overlap with the old place",
            Self::PoorFit => "does not fit the old place",
            Self::SeenThrough => "the old place was seen through",
            Self::RanAway => "the registration ended far from the proposal",
            Self::Degenerate => "the registration is degenerate",
            Self::Unconfirmed => "no second loop agrees",
            Self::Disbelieved => "contradicts the rest of the graph",
        }
    }

    /// The registration's own evidence; `None` when nothing speaks against the loop.
    pub(crate) fn against(config: &LoopConfig, refined: &Refined) -> Option<Self> {
        if !(refined.moved_m <= config.max_correction_m) {
            Some(Self::RanAway)
        } else if !(refined.overlap >= config.min_overlap) {
            Some(Self::LittleOverlap)
        } else if !(refined.fit >= config.min_fit) {
            Some(Self::PoorFit)
        } else if !(refined.seen_through <= config.max_seen_through) {
            Some(Self::SeenThrough)
        } else if !refined.determined {
            Some(Self::Degenerate)
        } else {
            None
        }
    }
}
