//! One drive on disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sdslam_core::MapPose;

use super::{DatasetError, text, trajectory};

/// Time between two scans [s] where a drive has no times.txt.
const ASSUMED_PERIOD_S: f64 = 0.1;

const LAYOUT: &str = "a KITTI odometry data set has DATASET/sequences/NN/velodyne";

/// One drive in KITTI odometry layout. Frame 0 is the scan file with the lowest number.
#[derive(Debug, Clone)]
pub struct Sequence {
    name: String,
    velodyne: PathBuf,
    scans: BTreeMap<usize, PathBuf>,
    first: usize,
    last: usize,
    labels: Option<PathBuf>,
    /// Line k belongs to scan file number k; none where the drive has no times.txt.
    times_s: Option<Vec<f64>>,
    camera_from_sensor: MapPose,
    ground_truth: PathBuf,
}

/// One scan as it is on disk.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawScan {
    /// x, y, z [m] in the sensor frame and remission. Non-finite points and zeros are passed through.
    pub points: Vec<[f32; 4]>,
    /// SemanticKITTI's raw label of every point (see [`super::labels`]); none where the drive was opened without.
    pub labels: Option<Vec<u32>>,
}

impl Sequence {
    /// Opens `dataset/sequences/sequence` with the labels in its folder `labels_folder` (`labels` where not given)
    /// and checks that everything needed is there.
    pub fn open(dataset: &Path, sequence: &str, labels_folder: Option<&str>) -> Result<Self, DatasetError> {
        let mut opened = Self::open_unlabelled(dataset, sequence)?;
        let labels = sequence_folder(dataset, sequence).join(labels_folder.unwrap_or("labels"));
        let hint = "name the folder that holds the NNNNNN.label files";
        opened.labels = Some(folder("labels folder", labels, hint)?);
        Ok(opened)
    }

    /// Opens a drive for its points only.
    pub fn open_unlabelled(dataset: &Path, sequence: &str) -> Result<Self, DatasetError> {
        folder("dataset folder", dataset.into(), LAYOUT)?;
        let all = folder("sequences folder", dataset.join("sequences"), LAYOUT)?;
        let path = sequence_folder(dataset, sequence);
        if sequence.is_empty() || !path.is_dir() {
            let (sequence, available) = (sequence.into(), available(&all)?);
            return Err(DatasetError::SequenceNotFound { sequence, path, available });
        }
        let velodyne = folder("velodyne folder", path.join("velodyne"), LAYOUT)?;
        let scans = scan_files(&velodyne)?;
        let (Some((&first, _)), Some((&last, _))) = (scans.first_key_value(), scans.last_key_value()) else {
            return Err(DatasetError::NoScans { path: velodyne });
        };
        let camera_from_sensor = read_calibration(&path.join("calib.txt"))?;
        let times_s = read_times(&path.join("times.txt"), last)?;
        let ground_truth = dataset.join("poses").join(format!("{sequence}.txt"));
        let name = sequence.into();
        Ok(Self {
            name,
            velodyne,
            scans,
            first,
            last,
            labels: None,
            times_s,
            camera_from_sensor,
            ground_truth,
        })
    }

    /// The sequence's name, as in the path.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Frames from the first to the last scan file; one that is missing in between counts.
    #[allow(clippy::len_without_is_empty, reason = "a sequence without scans cannot be opened")]
    pub fn len(&self) -> usize {
        self.last - self.first + 1
    }

    /// Number in the file names of a frame: `NNNNNN.bin`, `NNNNNN.label`, and the line in times.txt and the poses.
    pub fn file_number(&self, frame: usize) -> usize {
        self.first + frame
    }

    /// Whether the drive has a times.txt; otherwise scans are taken to be 0.1 s apart.
    pub fn has_times(&self) -> bool {
        self.times_s.is_some()
    }

    /// Time of a frame [s] as in the file: unchecked, it may go back. NaN beyond the last frame.
    pub fn stamp_s(&self, frame: usize) -> f64 {
        let number = self.file_number(frame);
        match &self.times_s {
            Some(times_s) => times_s.get(number).copied().unwrap_or(f64::NAN),
            None => number as f64 * ASSUMED_PERIOD_S,
        }
    }

    /// The camera's pose of the sensor: `camera_from_sensor * point_in_sensor` is the point in the camera frame.
    pub fn camera_from_sensor(&self) -> MapPose {
        self.camera_from_sensor
    }

    /// Ground truth, `DATASET/poses/NN.txt`, from frame 0 on: camera frame poses. None where there is no such file.
    /// It can be shorter or longer than the drive.
    pub fn ground_truth(&self) -> Result<Option<Vec<MapPose>>, DatasetError> {
        if !self.ground_truth.is_file() {
            return Ok(None);
        }
        let mut poses = trajectory::read_kitti(&self.ground_truth)?;
        Ok(Some(poses.split_off(self.first.min(poses.len()))))
    }

    /// Reads a frame. [`DatasetError::MissingFrame`] means that only this one is lost.
    pub fn read(&self, frame: usize) -> Result<RawScan, DatasetError> {
        let number = self.file_number(frame);
        let Some(path) = self.scans.get(&number) else {
            return Err(DatasetError::MissingFrame { path: self.velodyne.join(format!("{number:06}.bin")) });
        };
        let points = read_scan(path)?;
        let labels = match &self.labels {
            None => None,
            Some(folder) => Some(read_labels_of(path, folder, points.len())?),
        };
        Ok(RawScan { points, labels })
    }
}

/// Reads a `.bin` scan: x, y, z [m] and remission of every point.
pub fn read_scan(path: &Path) -> Result<Vec<[f32; 4]>, DatasetError> {
    let bytes = std::fs::read(path).map_err(DatasetError::read(path))?;
    let (points, []) = bytes.as_chunks::<16>() else {
        return Err(DatasetError::ScanSize { path: path.into(), bytes: bytes.len() });
    };
    Ok(points.iter().map(|point| bytemuck::pod_read_unaligned(point)).collect())
}

/// Reads a `.label` file: one raw label a point.
pub fn read_labels(path: &Path) -> Result<Vec<u32>, DatasetError> {
    let bytes = std::fs::read(path).map_err(DatasetError::read(path))?;
    let (labels, []) = bytes.as_chunks::<4>() else {
        return Err(DatasetError::LabelSize { path: path.into(), bytes: bytes.len() });
    };
    Ok(labels.iter().map(|label| bytemuck::pod_read_unaligned(label)).collect())
}

fn read_labels_of(scan: &Path, folder: &Path, points: usize) -> Result<Vec<u32>, DatasetError> {
    let path = folder.join(scan.file_stem().unwrap_or_default()).with_extension("label");
    if !path.is_file() {
        let hint = "every scan needs its label file";
        return Err(DatasetError::Missing { what: "label file", path, hint });
    }
    let labels = read_labels(&path)?;
    if labels.len() != points {
        return Err(DatasetError::LabelCount { path, labels: labels.len(), points });
    }
    Ok(labels)
}

fn sequence_folder(dataset: &Path, sequence: &str) -> PathBuf {
    dataset.join("sequences").join(sequence)
}

fn folder(what: &'static str, path: PathBuf, hint: &'static str) -> Result<PathBuf, DatasetError> {
    if path.is_dir() { Ok(path) } else { Err(DatasetError::Missing { what, path, hint }) }
}

/// Which sequences there are, for the message that one is not.
fn available(sequences: &Path) -> Result<String, DatasetError> {
    let mut names: Vec<_> = files_in(sequences)?
        .into_iter()
        .filter(|path| path.is_dir())
        .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
        .collect();
    names.sort();
    Ok(if names.is_empty() { "there are none".into() } else { format!("there are {}", names.join(", ")) })
}

/// Everything in a folder, in any order.
pub(crate) fn files_in(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let read = |entry: std::io::Result<std::fs::DirEntry>| entry.map(|entry| entry.path());
    let entries = std::fs::read_dir(folder).map_err(DatasetError::read(folder))?;
    entries.map(read).collect::<Result<_, _>>().map_err(DatasetError::read(folder))
}

fn scan_files(velodyne: &Path) -> Result<BTreeMap<usize, PathBuf>, DatasetError> {
    let numbered = |path: PathBuf| {
        let number = path.file_stem()?.to_str()?.parse::<u32>().ok()?;
        (path.extension()? == "bin").then_some((number as usize, path))
    };
    Ok(files_in(velodyne)?.into_iter().filter_map(numbered).collect())
}

fn read_calibration(path: &Path) -> Result<MapPose, DatasetError> {
    if !path.is_file() {
        let hint = "its line `Tr:` tells where the sensor is in the camera frame";
        return Err(DatasetError::Missing { what: "calibration", path: path.into(), hint });
    }
    let text = text::read(path)?;
    let malformed = |line, problem| DatasetError::Malformed { path: path.into(), line, problem };
    let tr = text::lines(&text).find_map(|(line, text)| Some((line, text.strip_prefix("Tr:")?)));
    let Some((line, tr)) = tr else {
        return Err(malformed(
            text.lines().count(),
            "the file ends without a line `Tr: ` and 12 numbers".into(),
        ));
    };
    text::rigid_transform(tr).map_err(|problem| malformed(line, format!("after `Tr:` {problem}")))
}

/// One stamp a line; none where there is no file. `last` is the number of the last scan.
fn read_times(path: &Path, last: usize) -> Result<Option<Vec<f64>>, DatasetError> {
    if !path.exists() {
        return Ok(None);
    }
    let text = text::read(path)?;
    let stamp = |(line, text)| match text::numbers::<1>(text) {
        Ok([stamp_s]) => Ok(stamp_s),
        Err(problem) => Err(DatasetError::Malformed { path: path.into(), line, problem }),
    };
    let times_s = text::lines(&text).map(stamp).collect::<Result<Vec<_>, _>>()?;
    if times_s.len() <= last {
        return Err(DatasetError::TimesTooShort { path: path.into(), stamps: times_s.len(), last });
    }
    Ok(Some(times_s))
}
