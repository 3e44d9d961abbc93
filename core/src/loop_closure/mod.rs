//! Loop detection, section 3.5: has the vehicle been here before, and where does it stand with respect to then?
//!
//! The caller makes a keyframe every metre or two, extracts its features from the pure static points
//! ([`FeatureExtractor`]), asks ([`LoopDetector::query`]) and adds the keyframe as a place ([`LoopDetector::add`]). An
//! answer names an old place and the transform from the new keyframe to it, to be refined and checked against the map by
//! the caller. [`Features`] are plain data: kept in a map, they find the place again in another run.
//!
//! | step | file | LinK3D and BoW3D | here |
//! | --- | --- | --- | --- |
//! | keypoints | `features.rs` | clusters of edge points on rings | things of the classes trunk, pole, sign, object |
//! | words | `words.rs`, `link3d.rs` | (value, dimension) of a descriptor | triangles of keypoints with their classes |
//! | places | `place_table.rs` | hash table of words, ratio and frequency test | the same, of fixed size |
//! | transform | `verification.rs` | RANSAC and closed form | consensus of the triangles and closed form |
//!
//! Why not LinK3D's words: they hold while the nearest neighbour of a keypoint is seen again. With the labels of a
//! network on real scans (KITTI raw drive 0005, the same street from 5 m farther or more, F1max 0.64 against 1.00) and
//! with one label in five wrong on simulated drives (08, driven the other way: 0.85 against 0.99) that is not often
//! enough. They are there as [`Rule::Bow3d`], with this verification.
//!
//! Ground, what moves and what may move never make a keypoint; keypoints are paired with those of their own class only.

mod config;
mod detector;
mod features;
pub mod link3d;
mod place_table;
mod verification;
mod words;

pub use config::{Bow3dConfig, Config, Rule};
pub use detector::{LoopCandidate, LoopDetector};
pub use features::{FeatureExtractor, Features, KEYPOINT_CLASSES, Keypoint};
