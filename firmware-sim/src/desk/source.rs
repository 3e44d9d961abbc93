//! Scans to replay: a recording, or a drive.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use sdslam_core::{LabelledPoint, SemanticClass};
use sdslam_firmware_sim::wire::{Received, ScanReader};

use crate::drive::Drive;

/// The recording that comes with the program; `firmware-sim/assets/remake.sh` makes it.
const SMALL_RECORDING: &[u8] = include_bytes!("../../assets/small.sdr");

/// One scan.
#[derive(Clone, Debug)]
pub struct RecordedScan {
    /// Its number.
    pub sequence: u32,
    /// Time \[s\].
    pub stamp_s: f64,
    /// Points.
    pub points: Vec<LabelledPoint>,
}

/// What to replay. Scans are read one at a time.
#[derive(Clone)]
pub struct Source {
    kind: Kind,
    scans: usize,
}

#[derive(Clone)]
enum Kind {
    Small,
    Recording(PathBuf),
    Drive(Drive),
}

impl Source {
    /// A recording, a drive where `sequence` is named, or the small recording where nothing is; at most `scans` of them.
    pub fn open(path: Option<&Path>, sequence: Option<&str>, scans: usize) -> anyhow::Result<Self> {
        let kind = match (path, sequence) {
            (None, _) => Kind::Small,
            (Some(path), None) if path.is_dir() => {
                bail!("{} is a folder: name the drive with --sequence", path.display())
            }
            (Some(path), None) => Kind::Recording(path.into()),
            (Some(path), Some(sequence)) => Kind::Drive(Drive::open(&path.join("sequences").join(sequence))?),
        };
        Ok(Self { kind, scans })
    }

    /// The scans, in order.
    pub fn scans(&self) -> anyhow::Result<Box<dyn Iterator<Item = anyhow::Result<RecordedScan>>>> {
        let all: Box<dyn Iterator<Item = _>> = match &self.kind {
            Kind::Small => Box::new(Recording::new(SMALL_RECORDING.into())),
            Kind::Recording(file) => {
                let bytes =
                    std::fs::read(file).with_context(|| format!("failed to read {}", file.display()))?;
                let name = file.display().to_string();
                Box::new(Recording::new(bytes).map(move |scan| scan.with_context(|| name.clone())))
            }
            Kind::Drive(drive) => {
                let drive = drive.clone();
                Box::new((0..drive.len()).map(move |index| drive.read(index)))
            }
        };
        Ok(Box::new(all.take(self.scans)))
    }
}

/// A recording: scans as they go over the wire, one behind the other.
struct Recording {
    bytes: Vec<u8>,
    at: usize,
    reader: ScanReader,
    points: Vec<LabelledPoint>,
}

/// No sensor makes larger scans.
const MOST_POINTS: usize = 1 << 20;

impl Recording {
    fn new(bytes: Vec<u8>) -> Self {
        let blank = LabelledPoint::new([0.0; 3], SemanticClass::Unlabelled);
        // No scan has more points than there are bytes.
        let points = vec![blank; bytes.len().min(MOST_POINTS)];
        Self { bytes, at: 0, reader: ScanReader::new(), points }
    }
}

impl Iterator for Recording {
    type Item = anyhow::Result<RecordedScan>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.bytes.len() {
            return None;
        }
        let (used, found) = self.reader.read(&self.bytes[self.at..], &mut self.points);
        self.at += used;
        match found {
            Some(Received::Scan(header)) if self.reader.skipped() == 0 => Some(Ok(RecordedScan {
                sequence: header.sequence,
                stamp_s: header.stamp_s,
                points: self.points[..header.points].to_vec(),
            })),
            _ => {
                // A recording is not a noisy line: what is damaged is not replayed as if it were whole.
                let at = std::mem::replace(&mut self.at, self.bytes.len());
                let why = match found {
                    Some(Received::Damaged(error)) => error.to_string(),
                    _ => "it ends within a scan, or is no recording".into(),
                };
                Some(Err(anyhow::anyhow!("damaged recording, before byte {at}: {why}")))
            }
        }
    }
}
