//! Every capacity with its price. A profile is a choice of these numbers; a full buffer is reported in
//! [`crate::estimate::BufferUse`] and leaves the state valid.
//!
//! | capacity | full scan | bytes each | what happens when it is full |
//! | --- | --- | --- | --- |
//! | `CELLS` | 32768 | 68 cell and slots, 46 clustering, 16 registration | further points are left out, counted as `over_capacity` |
//! | `INSTANCES` | 2048 | 22 | further instances are left out, counted as `landmarks_refused` |
//! | `LANDMARKS` | 384 | 2 x 960, this scan's and the last one's | movable ones come first, then small, then the largest; `landmarks_refused` |
//! | `TRACKS` | 256 | 808 | a landmark without a track stays undecided; `tracks_refused` |
//! | `VOXEL_SETS` | 8192 | 8 x 80 | the voxel of the set seen longest ago is replaced; `voxels_evicted` |
//! | `MAP_LANDMARKS` | 512 | 968 | the landmark seen longest ago is dropped; `submap_landmarks_evicted` |
//! | `RANGE_COLUMNS` | 720 | 11 x 64 | never: fewer columns make coarser range images of the last second |
//!
//! Loop detection, a struct of its own ([`crate::loop_closure`]); one profile for the vehicle, one for a host:
//!
//! | capacity | vehicle, host | bytes each | what happens when it is full |
//! | --- | --- | --- | --- |
//! | `COLUMNS` | 4096 | 56 | points of further columns make no keypoints; `left_out` of the extractor |
//! | [`KEYPOINTS`] | 64 | 20 in the features, 8 in a place | the farthest are left out; `left_out` of the features |
//! | [`WORDS`] | 384 | 12 | triangles of farther neighbours are left out |
//! | `PLACES` | 256, 4096 | 5156: words, keypoints, stamp, votes | the place that was added first is forgotten; `forgotten` |
//! | `BUCKETS` | 32768, 524288 | 8 | never full: the words of a bucket are a chain |
//! | [`CANDIDATES`] | 24 | 1164, most of it [`HYPOTHESES`] | the places with the fewest words in common are not examined |
//! | [`HYPOTHESES`] | 96 | 12 | further transforms of the same place are not tried |
//!
//! Arrays on the stack during a question: about 16 KiB with triangles as words, 32 KiB with the paper's descriptors.
//!
//! Not chosen by a profile: the hull pairs ([`PAIRS`]). What a profile costs to the byte, and whether a drive fits it, the
//! desk simulator of `firmware-sim` says.
//!
//! The points of a scan (16 bytes each) are the caller's.

use crate::loop_closure::{FeatureExtractor, LoopDetector};
use crate::odometry::Odometry;

/// Landmark pairs whose hulls are registered, nearest first: 48 x 560 B.
pub const PAIRS: usize = 48;

/// Columns of a range image, half a degree each: what an [`Odometry`] has unless its profile says otherwise.
pub const RANGE_COLUMNS: usize = 720;

/// Keypoints of a keyframe.
pub const KEYPOINTS: usize = 64;

/// Words of a place: triangles of keypoints.
pub const WORDS: usize = 384;

/// Places examined per question.
pub const CANDIDATES: usize = 24;

/// Transforms proposed for a place.
pub const HYPOTHESES: usize = 96;

/// Loop detection on a host: 4096 keyframes, 8 km at one every 2 m; 24 MiB.
pub type HostLoopDetector = LoopDetector<4096, 524_288>;

/// Loop detection on the vehicle: the last 256 keyframes, half a kilometre at one every 2 m; 1.6 MiB.
pub type VehicleLoopDetector = LoopDetector<256, 32_768>;

/// Keypoints from full scans: 0.2 MiB.
pub type FullScanFeatureExtractor = FeatureExtractor<4096>;

/// Profile for full scans of a 64-beam LiDAR, 10 times a second.
pub type FullScanOdometry = Odometry<32768, 2048, 384, 256, 8192, 512>;

/// Points of a full scan that the caller provides for: 131072 x 16 B = 2 MiB.
pub const FULL_SCAN_POINTS: usize = 131_072;

/// Memory of the full-scan profile, the caller's points included: fits the 16 MiB external RAM of a Cortex-M7 board.
pub const FULL_SCAN_BYTES: usize = core::mem::size_of::<FullScanOdometry>()
    + FULL_SCAN_POINTS * core::mem::size_of::<crate::scan::LabelledPoint>();

/// Memory of the vehicle's loop detection, besides [`FULL_SCAN_BYTES`].
pub const VEHICLE_LOOP_BYTES: usize =
    core::mem::size_of::<VehicleLoopDetector>() + core::mem::size_of::<FullScanFeatureExtractor>();

const _: () = assert!(FULL_SCAN_BYTES <= 16 << 20, "the full-scan profile must fit 16 MiB");

/// Profile for small scans and a small memory, for [`crate::Config::paper`]: landmarks only, no voxels.
pub type LandmarkOdometry = Odometry<2048, 256, 96, 32, 1, 96, 360>;

/// Points of a small scan: 8192 x 16 B = 128 KiB.
pub const LANDMARK_POINTS: usize = 8192;

/// Memory of the landmark profile, the caller's points included.
pub const LANDMARK_BYTES: usize = core::mem::size_of::<LandmarkOdometry>()
    + LANDMARK_POINTS * core::mem::size_of::<crate::scan::LabelledPoint>();

const _: () = assert!(LANDMARK_BYTES <= 1 << 20, "the landmark profile must fit 1 MiB");
const _: () = assert!(VEHICLE_LOOP_BYTES <= 2 << 20, "the vehicle's loop detection must fit 2 MiB");
const _: () = assert!(FULL_SCAN_BYTES + VEHICLE_LOOP_BYTES <= 16 << 20, "both together must fit 16 MiB");
