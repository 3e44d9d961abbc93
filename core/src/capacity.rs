//! Every capacity with its price. A profile is a choice of these numbers; a full buffer is reported in
//! [`crate::estimate::BufferUse`] and leaves the state valid.
//!
//! | capacity | full scan | bytes each | what happens when it is full |
//! | --- | --- | --- | --- |
//! | `CELLS` | 32768 | 64 + 4 + 40 + 16 | further points are counted as `over_capacity` and left out |
//! | `INSTANCES` | 2048 | 28 | further instances are left out, counted as `landmarks_refused` |
//! | `LANDMARKS` | 384 | 2 x 976 | movable first, then small, then the largest are kept; `landmarks_refused` |
//! | `TRACKS` | 256 | 952 | a landmark without a track stays undecided; `tracks_refused` |
//! | `VOXEL_SETS` | 8192 | 8 x 88 | the voxel of the set seen longest ago is replaced; `voxels_evicted` |
//! | `MAP_LANDMARKS` | 512 | 980 | the landmark seen longest ago is dropped; `submap_landmarks_evicted` |
//!
//! The points of a scan (16 bytes each) are the caller's.

use crate::odometry::Odometry;

/// Landmark pairs whose hulls are registered, nearest first: 64 x 1.1 kB.
pub const PAIRS: usize = 64;

/// Profile for full scans of a 64-beam LiDAR, 10 times a second.
pub type FullScanOdometry = Odometry<32768, 2048, 384, 256, 8192, 512>;

/// Points of a full scan that the caller provides for: 131072 x 16 B = 2 MiB.
pub const FULL_SCAN_POINTS: usize = 131_072;

/// Memory of the full-scan profile, the caller's points included: fits the 16 MiB external RAM of a Cortex-M7 board.
pub const FULL_SCAN_BYTES: usize = core::mem::size_of::<FullScanOdometry>()
    + FULL_SCAN_POINTS * core::mem::size_of::<crate::scan::LabelledPoint>();

const _: () = assert!(FULL_SCAN_BYTES <= 16 << 20, "the full-scan profile must fit 16 MiB");
