//! Shared by the tests: an odometry on the heap, a small deterministic street, drives through it, and simulated drives.

pub mod drive;
pub mod loops;
pub mod odometry;
pub mod simulated;
pub mod stages;
pub mod street;
pub mod world;
