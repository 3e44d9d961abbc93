//! A labelled drive in KITTI odometry layout, read scan by scan.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use sdslam_core::LabelledPoint;

use crate::labels::class_of;
use crate::source::RecordedScan;

/// Bytes of a point in a `.bin` file: x, y, z \[m\] and remission as float32.
const POINT_BYTES: usize = 16;
/// Time between two scans \[s\] where a drive has no times.txt.
const ASSUMED_PERIOD_S: f64 = 0.1;

/// A drive.
#[derive(Clone)]
pub struct Drive {
    scans: Vec<Scan>,
}

#[derive(Clone)]
struct Scan {
    points: PathBuf,
    labels: PathBuf,
    stamp_s: f64,
}

impl Drive {
    /// Opens `folder`, which has `velodyne/NNNNNN.bin`, `labels/NNNNNN.label` and `times.txt`.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let velodyne = folder.join("velodyne");
        let times_s = read_times(&folder.join("times.txt"))?;
        let scans = scan_numbers(&velodyne)?.into_iter().map(|number| {
            let stamp_s = match &times_s {
                Some(times_s) => *times_s
                    .get(number)
                    .with_context(|| format!("times.txt has no line for scan {number}"))?,
                None => number as f64 * ASSUMED_PERIOD_S,
            };
            let points = velodyne.join(format!("{number:06}.bin"));
            let labels = folder.join("labels").join(format!("{number:06}.label"));
            Ok(Scan { points, labels, stamp_s })
        });
        let scans = scans.collect::<anyhow::Result<Vec<_>>>()?;
        ensure!(!scans.is_empty(), "no NNNNNN.bin in {}", velodyne.display());
        Ok(Self { scans })
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.scans.len()
    }

    /// Reads scan `index`.
    pub fn read(&self, index: usize) -> anyhow::Result<RecordedScan> {
        let scan = self.scans.get(index).with_context(|| format!("the drive has no scan {index}"))?;
        let (bytes, labels) = (read(&scan.points)?, read(&scan.labels)?);
        let size = bytes.len();
        ensure!(size % POINT_BYTES == 0, "{} has {size} bytes, no multiple of 16", scan.points.display());
        let count = size / POINT_BYTES;
        let labelled = labels.len() / 4;
        ensure!(
            labels.len() % 4 == 0 && labelled == count,
            "{} has {labelled} labels for {count} points",
            scan.labels.display()
        );
        let (bytes, _) = bytes.as_chunks::<POINT_BYTES>();
        let (labels, _) = labels.as_chunks::<4>();
        let point = |(bytes, label): (_, &[u8; 4])| {
            LabelledPoint::new(position(bytes), class_of(u32::from_le_bytes(*label)))
        };
        let points = bytes.iter().zip(labels).map(point).collect();
        Ok(RecordedScan { sequence: index as u32, stamp_s: scan.stamp_s, points })
    }
}

fn position(bytes: &[u8; POINT_BYTES]) -> [f32; 3] {
    let (floats, _) = bytes.as_chunks::<4>();
    [0, 1, 2].map(|k| f32::from_le_bytes(floats[k]))
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("failed to read {}", path.display()))
}

/// Numbers of the `.bin` files, ascending.
fn scan_numbers(velodyne: &Path) -> anyhow::Result<Vec<usize>> {
    let failed = || format!("failed to read the folder {}", velodyne.display());
    let mut numbers = Vec::new();
    for entry in fs::read_dir(velodyne).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if path.extension().is_some_and(|extension| extension == "bin") {
            let number = stem.parse();
            numbers.push(number.with_context(|| format!("{} is not named NNNNNN.bin", path.display()))?);
        }
    }
    numbers.sort_unstable();
    Ok(numbers)
}

/// Line k is the stamp of scan k \[s\]; none without the file.
fn read_times(path: &Path) -> anyhow::Result<Option<Vec<f64>>> {
    if !path.exists() {
        return Ok(None);
    }
    let text = fs::read_to_string(path).with_context(|| format!("failed to read {}", path.display()))?;
    let mut times_s = Vec::new();
    for (index, line) in text.lines().enumerate() {
        match line.trim().parse() {
            Ok(stamp_s) => times_s.push(stamp_s),
            Err(_) => bail!("{} line {}: {line:?} is not a time in seconds", path.display(), index + 1),
        }
    }
    Ok(Some(times_s))
}
