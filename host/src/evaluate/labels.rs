//! Labels against labels, as semantic-kitti-api counts them.

use std::fmt;
use std::path::{Path, PathBuf};

use sdslam_core::SemanticClass::{self, *};
use serde::Serialize;

use super::EvaluateError;
use crate::dataset::{self, DatasetError, labels};

/// Classes of the single-scan benchmark; class 0 is ignored in the ground truth.
const CLASSES: usize = 20;
/// Classes that only matter together: where one of a group is taken for another, the SLAM does the same.
const GROUPS: [(&str, &[SemanticClass]); 6] = [
    ("ground", &[Road, Parking, Sidewalk, OtherGround, Terrain]),
    ("building, fence", &[Building, Fence]),
    ("vegetation", &[Vegetation]),
    ("trunk, pole, sign", &[Trunk, Pole, TrafficSign]),
    ("vehicle", &[Car, Truck, OtherVehicle]),
    ("person, cyclist", &[Person, Bicyclist, Motorcyclist]),
];
/// Kinds of motion: unknown (ignored in the ground truth), static, moving.
const MOTIONS: usize = 3;
const MOVING: usize = 2;

/// Counts of points by true and predicted class, over any number of scans.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LabelConfusion {
    classes: Confusion<CLASSES>,
    motions: Confusion<MOTIONS>,
}

/// Agreement of labels with the ground truth. Fractions from 0 to 1; a class that occurs on neither side scores 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LabelErrors {
    /// Scans compared.
    pub scans: usize,
    /// Scans of the ground truth that have no labels to compare with.
    pub scans_without_labels: usize,
    /// Points whose true class counts.
    pub points: u64,
    /// Mean IoU over the 19 classes.
    pub mean_iou: f64,
    /// Mean IoU over the classes that occur on either side.
    pub mean_iou_of_present: f64,
    /// Share of right points among those that were given a class.
    pub accuracy: f64,
    /// Per class.
    pub classes: Vec<ClassIou>,
    /// Mean IoU over the groups that occur on either side.
    pub mean_iou_of_groups: f64,
    /// Per group of classes: ground, building and fence, vegetation, trunk, pole and sign, vehicle, person and cyclist.
    pub groups: Vec<ClassIou>,
    /// IoU of moving points; true labels 0 and 1 are ignored.
    pub moving_iou: f64,
    /// Share of the truly moving points that were called moving.
    pub moving_recall: f64,
    /// Share of truly moving points among those called moving.
    pub moving_precision: f64,
    /// Truly moving points.
    pub moving_points: u64,
}

/// Intersection over union of one class or group of classes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassIou {
    /// SemanticKITTI's name, or the group's.
    pub class: &'static str,
    /// From 0 to 1.
    pub iou: f64,
    /// Points of the class or group in the ground truth.
    pub points: u64,
}

impl LabelConfusion {
    /// Counts a scan: raw labels of the same points in the same order.
    pub fn add(&mut self, ground_truth: &[u32], labels: &[u32]) -> Result<(), EvaluateError> {
        if ground_truth.len() != labels.len() {
            let (ground_truth, labels) = (ground_truth.len(), labels.len());
            return Err(EvaluateError::LabelCounts { file: None, ground_truth, labels });
        }
        for (&truth, &label) in ground_truth.iter().zip(labels) {
            self.classes.0[class_index(truth)][class_index(label)] += 1;
            self.motions.0[motion_index(truth)][motion_index(label)] += 1;
        }
        Ok(())
    }

    /// The measures over everything counted so far; the numbers of scans are left at 0.
    pub fn errors(&self) -> LabelErrors {
        let classes: Vec<_> = (1..CLASSES).map(|class| self.classes.of(class)).collect();
        let sum = |count: fn(&ClassCounts) -> u64| classes.iter().map(count).sum::<u64>();
        let moving = self.motions.of(MOVING);
        let named = |(index, class): (usize, &ClassCounts)| ClassIou {
            class: SemanticClass::ALL[index + 1].name(),
            iou: class.iou(),
            points: class.truly(),
        };
        let groups = GROUPS.map(|(name, members)| (name, self.classes.of_group(members)));
        LabelErrors {
            scans: 0,
            scans_without_labels: 0,
            points: sum(ClassCounts::truly),
            mean_iou: classes.iter().map(ClassCounts::iou).sum::<f64>() / classes.len() as f64,
            mean_iou_of_present: mean_iou_of_present(classes.iter()),
            accuracy: fraction(sum(|class| class.right), sum(|class| class.right + class.wrongly)),
            classes: classes.iter().enumerate().map(named).collect(),
            mean_iou_of_groups: mean_iou_of_present(groups.iter().map(|(_, group)| group)),
            groups: groups
                .iter()
                .map(|(class, group)| ClassIou { class, iou: group.iou(), points: group.truly() })
                .collect(),
            moving_iou: moving.iou(),
            moving_recall: fraction(moving.right, moving.truly()),
            moving_precision: fraction(moving.right, moving.right + moving.wrongly),
            moving_points: moving.truly(),
        }
    }
}

/// Compares every `.label` file of `labels` with the one of the same name in `ground_truth`.
pub fn label_folders(ground_truth: &Path, labels: &Path) -> Result<LabelErrors, EvaluateError> {
    let (true_files, files) = (label_files(ground_truth)?, label_files(labels)?);
    let mut confusion = LabelConfusion::default();
    for file in &files {
        let true_file = ground_truth.join(file.file_name().unwrap_or_default());
        if !true_file.is_file() {
            let (what, hint) = ("ground truth", "every label file needs its counterpart");
            return Err(DatasetError::Missing { what, path: true_file, hint }.into());
        }
        let (truth, found) = (dataset::read_labels(&true_file)?, dataset::read_labels(file)?);
        if truth.len() != found.len() {
            let (ground_truth, labels) = (truth.len(), found.len());
            return Err(EvaluateError::LabelCounts { file: Some(file.clone()), ground_truth, labels });
        }
        confusion.add(&truth, &found)?;
    }
    let scans_without_labels = true_files.len() - files.len();
    Ok(LabelErrors { scans: files.len(), scans_without_labels, ..confusion.errors() })
}

fn label_files(folder: &Path) -> Result<Vec<PathBuf>, EvaluateError> {
    let mut files = dataset::files_in(folder)?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "label"));
    files.sort();
    if files.is_empty() { Err(EvaluateError::NoLabels { path: folder.into() }) } else { Ok(files) }
}

fn class_index(raw: u32) -> usize {
    labels::benchmark_class(raw) as usize
}

fn motion_index(raw: u32) -> usize {
    match raw & 0xffff {
        0 | 1 => 0,
        _ if labels::is_moving(raw) => MOVING,
        _ => 1,
    }
}

/// Counts by [true class][predicted class].
#[derive(Debug, Clone, PartialEq)]
struct Confusion<const N: usize>([[u64; N]; N]);

impl<const N: usize> Default for Confusion<N> {
    fn default() -> Self {
        Self([[0; N]; N])
    }
}

/// Points of one class, those left out whose true class is 0.
struct ClassCounts {
    right: u64,
    /// Of another true class.
    wrongly: u64,
    /// Given another class.
    missed: u64,
}

impl<const N: usize> Confusion<N> {
    fn of(&self, class: usize) -> ClassCounts {
        let right = self.0[class][class];
        let claimed: u64 = self.0[1..].iter().map(|row| row[class]).sum();
        let truly: u64 = self.0[class].iter().sum();
        ClassCounts { right, wrongly: claimed - right, missed: truly - right }
    }

    /// Some classes as if they were one.
    fn of_group(&self, members: &[SemanticClass]) -> ClassCounts {
        let (mut right, mut claimed, mut truly) = (0, 0, 0);
        for &member in members {
            let class = self.of(member as usize);
            claimed += class.right + class.wrongly;
            truly += class.truly();
            right += members.iter().map(|&other| self.0[member as usize][other as usize]).sum::<u64>();
        }
        ClassCounts { right, wrongly: claimed - right, missed: truly - right }
    }
}

impl ClassCounts {
    fn truly(&self) -> u64 {
        self.right + self.missed
    }

    fn union(&self) -> u64 {
        self.right + self.wrongly + self.missed
    }

    fn iou(&self) -> f64 {
        fraction(self.right, self.union())
    }
}

/// Over those that occur on either side; 0 if none does.
fn mean_iou_of_present<'a>(classes: impl Iterator<Item = &'a ClassCounts>) -> f64 {
    let present: Vec<_> = classes.filter(|class| class.union() > 0).map(ClassCounts::iou).collect();
    if present.is_empty() { 0.0 } else { present.iter().sum::<f64>() / present.len() as f64 }
}

fn fraction(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

impl fmt::Display for LabelErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.scans + self.scans_without_labels;
        writeln!(f, "compared        {} of {all} scans, {} points", self.scans, self.points)?;
        writeln!(f, "moving IoU      {:.4}  ({} points)", self.moving_iou, self.moving_points)?;
        writeln!(f, "moving recall   {:.4}", self.moving_recall)?;
        writeln!(f, "moving precision {:.4}", self.moving_precision)?;
        writeln!(
            f,
            "mean IoU        {:.4}  (of the classes present {:.4})",
            self.mean_iou, self.mean_iou_of_present
        )?;
        writeln!(f, "accuracy        {:.4}", self.accuracy)?;
        for class in &self.classes {
            writeln!(f, "  {:14} {:.4}  ({} points)", class.class, class.iou, class.points)?;
        }
        writeln!(f, "mean IoU of groups {:.4}", self.mean_iou_of_groups)?;
        for group in &self.groups {
            writeln!(f, "  {:17} {:.4}  ({} points)", group.class, group.iou, group.points)?;
        }
        Ok(())
    }
}
