//! Clustering.

pub mod dbscan;
