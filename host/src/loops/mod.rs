//! The back end (sections 3.5 and 3.6): keyframes, loops between them, the pose graph, and the map that bends with it.
//!
//! It takes the scans in the order of the drive with the poses of the odometry, and never looks at a clock or another
//! thread: it may run beside the front end and gives the same bits.
//!
//! A loop is proposed by the features of the place ([`sdslam_core::loop_closure`]) or, where the corrected trajectory
//! comes near an old place, by position. A proposal is refined by the dense registration against the map of the old
//! place, tested ([`Verdict`]), and must agree with another one, the next or the last in the graph; then the graph
//! decides whether it can follow ([`crate::pose_graph`]).

mod agreement;
mod back_end;
mod beside;
mod correction;
mod keyframe;
mod nearness;
mod proposal;
mod refine;
mod table;
mod verdict;

pub use back_end::LoopCounts;
pub(crate) use back_end::{BackEnd, BackEndResult, BackEndScan};
pub(crate) use beside::Beside;
pub(crate) use refine::{PLACE_RANGE_M, Place, Refined, Refiner};
pub use verdict::Verdict;
