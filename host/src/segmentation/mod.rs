//! Semantic segmentation of raw scans (section 3.1.1): a network of RangeNet++'s kind on the range image.
//!
//! [`Segmenter::segment`] is projection ([`projection`]), network ([`network`]), classes of the pixels ([`pixels`]), if
//! asked for those of whole objects ([`objects`]), the way back to the points ([`knn`]), and if asked for doubt where plants
//! stand on the ground ([`feet`]). A network is an ONNX file and a [`ModelDescription`] beside it:
//!
//! | key of `model.toml` | default (RangeNet++) | meaning |
//! | --- | --- | --- |
//! | `image.height`, `image.width` | 64, 2048 | rows and columns of the range image |
//! | `image.fov_up_deg`, `image.fov_down_deg` | 3, -25 | elevation of its upper and lower edge |
//! | `normalise.means`, `normalise.deviations` | | of range, x, y, z \[m\], remission; an empty pixel is 0 after it |
//! | `output.kind` | `"logits"` | or `"probabilities"` |
//! | `output.classes` | 20 classes | raw SemanticKITTI id of every output channel; several may share one |
//! | `knn.neighbours`, `knn.window` | 5, 5 | voters, and side of the window they are taken from |
//! | `knn.sigma`, `knn.cutoff_m` | 1, 1 | weights of the window, largest difference of range |
//! | `objects.link_m` | 0 (off) | pixels nearer than this are one object, and agree ([`objects`]) |
//! | `objects.vehicle_m`, `objects.small_m` | 12, 1.2 | longest vehicle; longest object that follows its majority |
//! | `objects.min_pixels` | 10 | fewest pixels of an object |
//! | `feet.height_m` | 0 (off) | the lowest vegetation below a plant has no confidence ([`feet`]) |
//! | `feet.plant_m` | 0.25 | least height of a plant |
//!
//! The same scan gives the same classes on any number of threads. Another CPU may round a network's sums differently.

pub mod description;
mod error;
pub mod feet;
pub mod knn;
pub mod network;
pub mod objects;
pub mod picture;
pub mod pixels;
pub mod projection;

use std::fmt;
use std::path::{Path, PathBuf};

use cpu_time::ThreadTime;
use sdslam_core::{MotionClass, SemanticClass};

use crate::dataset::labels;
use description::ImageGeometry;
pub use description::ModelDescription;
pub use error::{DescriptionFault, SegmentationError};
use network::Network;
use pixels::PixelClasses;
use projection::RangeImage;

const DEFAULT_NETWORK: &[u8] = include_bytes!("../../model/default.onnx");
const DEFAULT_DESCRIPTION: &str = include_str!("../../model/default.toml");

/// A network, ready for scans.
#[derive(Debug)]
pub struct Segmenter {
    name: String,
    description: ModelDescription,
    network: Network,
    /// Whether an output channel may win: those without a use for the SLAM do not.
    votes: Vec<bool>,
}

/// Classes of a scan's points, in their order.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// Class of every point; unlabelled for one that has no direction or no vote.
    pub classes: Vec<SemanticClass>,
    /// Confidence of the class, 255 = certain.
    pub confidences: Vec<u8>,
    /// The range image that the network saw.
    pub image: RangeImage,
    /// CPU time it took.
    pub times: SegmentationTimes,
}

/// CPU time of one scan \[ms\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SegmentationTimes {
    /// Points to image.
    pub projection_ms: f32,
    /// Image to output tensor.
    pub network_ms: f32,
    /// Output tensor to points.
    pub knn_ms: f32,
}

impl Segmenter {
    /// Loads `path`: an ONNX file, or a folder with `model.onnx`. Its description is the file of the same name with the
    /// ending `.toml`, else `model.toml` beside it, else RangeNet++'s values hold.
    pub fn load(path: &Path) -> Result<Self, SegmentationError> {
        let onnx = if path.is_dir() { path.join("model.onnx") } else { path.to_path_buf() };
        if path.is_dir() && !onnx.is_file() {
            return Err(SegmentationError::NoNetwork { path: path.into() });
        }
        let bytes = std::fs::read(&onnx).map_err(SegmentationError::reading(&onnx))?;
        let description = match description_beside(&onnx) {
            Some(file) => ModelDescription::load(&file)?,
            None => ModelDescription::default(),
        };
        Self::new(&bytes, &onnx, description)
    }

    /// The model that is part of the program: trained on simulated worlds only, see `host/model/`.
    pub fn built_in() -> Result<Self, SegmentationError> {
        let description = ModelDescription::parse(DEFAULT_DESCRIPTION, Path::new("default.toml"))?;
        Self::new(DEFAULT_NETWORK, Path::new("default.onnx"), description)
    }

    /// From the bytes of an ONNX file; `path` names it in messages.
    pub fn new(bytes: &[u8], path: &Path, description: ModelDescription) -> Result<Self, SegmentationError> {
        let network = Network::load(bytes, path, &description)?;
        let votes = description.output.classes.iter().map(|class| class.motion() != MotionClass::Dropped);
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, votes: votes.collect(), network, description })
    }

    /// Name of the network's file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the network wants and says.
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Classes of the points x, y, z \[m\] in the sensor frame and remission, as they are in the file: neither corrected
    /// nor deskewed. Points without a direction stay unlabelled; an error if no point lies in the image.
    pub fn segment(&self, points: &[[f32; 4]]) -> Result<Segmentation, SegmentationError> {
        let geometry = self.description.image;
        let clock = ThreadTime::now();
        let image = RangeImage::project(geometry, points);
        if image.in_view == 0 {
            let (down_deg, up_deg) = (geometry.fov_down_deg, geometry.fov_up_deg);
            return Err(SegmentationError::NothingInView { points: points.len(), down_deg, up_deg });
        }
        let tensor = image.to_tensor(points, &self.description.normalise);
        let projection_ms = milliseconds(&clock);
        let output = self.network.run(&tensor)?;
        let network_ms = milliseconds(&clock) - projection_ms;
        let (classes, confidences) = self.classes_of_points(&output, points, &image);
        let knn_ms = milliseconds(&clock) - projection_ms - network_ms;
        let times = SegmentationTimes { projection_ms, network_ms, knn_ms };
        Ok(Segmentation { classes, confidences, image, times })
    }

    fn classes_of_points(
        &self,
        output: &[f32],
        points: &[[f32; 4]],
        image: &RangeImage,
    ) -> (Vec<SemanticClass>, Vec<u8>) {
        let mut pixels = PixelClasses::of(output, self.description.output.kind, image.point.len());
        let ModelDescription { objects, feet, output, .. } = &self.description;
        objects::unify(objects, points, image, &output.classes, &mut pixels);
        let votes = knn::vote(&self.description.knn, image, &pixels, &self.votes);
        let class = |vote: &knn::PointVote| {
            let class = self.description.output.classes.get(vote.channel as usize);
            (class.copied().unwrap_or(SemanticClass::Unlabelled), (255.0 * vote.confidence).round() as u8)
        };
        let (classes, mut confidences): (Vec<_>, Vec<_>) = votes.iter().map(class).unzip();
        feet::doubt(feet, points, &classes, &mut confidences);
        (classes, confidences)
    }
}

impl fmt::Display for Segmenter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ImageGeometry { height, width, .. } = self.description.image;
        write!(f, "network {}, range image of {height} x {width}", self.name)
    }
}

impl Segmentation {
    /// SemanticKITTI's id of every point, as label files hold it.
    pub fn raw_labels(&self) -> Vec<u32> {
        self.classes.iter().map(|&class| labels::raw_id(class)).collect()
    }
}

fn milliseconds(clock: &ThreadTime) -> f32 {
    clock.elapsed().as_secs_f32() * 1e3
}

fn description_beside(onnx: &Path) -> Option<PathBuf> {
    let beside = [onnx.with_extension("toml"), onnx.with_file_name("model.toml")];
    beside.into_iter().find(|file| file.is_file())
}
