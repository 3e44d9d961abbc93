//! Clustering.

pub mod dbscan;
pub mod radix;
