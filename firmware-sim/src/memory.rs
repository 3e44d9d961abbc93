//! What a profile costs: the exact bytes of each part.

/// A part of a profile's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// What lies there.
    pub name: &'static str,
    /// How many of them fit.
    pub capacity: usize,
    /// Bytes in all.
    pub bytes: usize,
}

/// Parts of an odometry.
pub const ODOMETRY_PARTS: usize = 11;

/// Parts of a loop table.
pub const LOOP_PARTS: usize = 2;
