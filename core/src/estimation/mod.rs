//! Filters.

pub mod kalman;
