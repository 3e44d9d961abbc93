//! The story of one frame, in the paper's order.

use crate::error::{OdometryError, ParameterError};
use crate::estimate::{FrameEstimate, StageObserver, TrackReport};
use crate::landmarks::Landmark;
use crate::scan::LabelledScan;

/// All parameters, one table per stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Config {}

impl Config {
    /// Nothing but the paper.
    pub const fn paper() -> Self {
        Self {}
    }
    /// The default: the paper's stages with the dense refinement.
    pub const fn accurate() -> Self {
        Self {}
    }
    /// Checks every parameter.
    pub const fn check(&self) -> Result<(), ParameterError> {
        Ok(())
    }
}

/// The odometry with its memory.
pub struct Odometry<const CELLS: usize> {
    _cells: [u8; CELLS],
}

/// Profile for full HDL-64 scans.
pub type FullScanOdometry = Odometry<1>;

impl<const CELLS: usize> Odometry<CELLS> {
    /// An odometry at the origin.
    pub const fn new(config: Config) -> Result<Self, ParameterError> {
        match config.check() {
            Ok(()) => Ok(Self { _cells: [0; CELLS] }),
            Err(error) => Err(error),
        }
    }
    /// Back to the origin, everything forgotten.
    pub fn reset(&mut self) {}
    /// Registers one scan.
    pub fn process_scan(&mut self, scan: &mut LabelledScan<'_>) -> Result<FrameEstimate, OdometryError> {
        self.process_scan_observed(scan, &mut ())
    }
    /// [`Self::process_scan`], telling `observer` when each stage is done.
    pub fn process_scan_observed(
        &mut self,
        _scan: &mut LabelledScan<'_>,
        _observer: &mut impl StageObserver,
    ) -> Result<FrameEstimate, OdometryError> {
        unimplemented!()
    }
    /// Landmarks of the last scan.
    pub fn landmarks(&self) -> &[Landmark] {
        &[]
    }
    /// Living tracks after the last scan.
    pub fn tracks(&self) -> impl Iterator<Item = TrackReport> {
        core::iter::empty()
    }
}
