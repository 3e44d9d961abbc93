//! A recording: every scan as the core gets it, in the firmware's wire format, one behind the other.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use sdslam_core::LabelledPoint;
use sdslam_firmware_sim::wire::write_scan;

use super::OutputError;

/// A recording that grows.
pub(super) struct Recording {
    path: PathBuf,
    file: BufWriter<File>,
    scans: u32,
}

impl Recording {
    /// Begins a recording in place of an earlier one.
    pub(super) fn create(path: &Path) -> Result<Self, OutputError> {
        let failed = |source| OutputError::Write { path: path.into(), source };
        let file = File::create(path).map_err(failed)?;
        Ok(Self { path: path.into(), file: BufWriter::new(file), scans: 0 })
    }

    /// Adds a scan.
    pub(super) fn add(&mut self, stamp_s: f64, points: &[LabelledPoint]) -> Result<(), OutputError> {
        let written = write_scan(self.scans, stamp_s, points, |piece| self.file.write_all(piece));
        self.scans = self.scans.wrapping_add(1);
        written.map_err(|source| self.failed(source))
    }

    /// Writes out what is left.
    pub(super) fn finish(mut self) -> Result<(), OutputError> {
        self.file.flush().map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}
