//! `model.toml`: what a network wants to see and what its answer means. RangeNet++'s values where nothing is said.

use std::path::Path;

use sdslam_core::SemanticClass;
use serde::Deserialize;

use super::SegmentationError;
use super::error::DescriptionFault;
use super::feet::FeetConfig;
use super::knn::KnnConfig;
use super::objects::ObjectsConfig;
use crate::dataset::labels;

/// Channels of the image: range, x, y, z \[m\], remission (0..1).
pub const CHANNELS: usize = 5;

/// Everything about a network that its ONNX file does not say.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelDescription {
    /// How points become pixels.
    pub image: ImageGeometry,
    /// How pixels become the input tensor.
    pub normalise: Normalisation,
    /// What the output tensor says.
    pub output: OutputMeaning,
    /// How the pixels of an object agree.
    pub objects: ObjectsConfig,
    /// How classes of pixels become classes of points.
    pub knn: KnnConfig,
    /// Where plants stand on the ground.
    pub feet: FeetConfig,
}

/// The image of a scan: azimuth to the right, elevation upwards.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImageGeometry {
    /// Rows.
    pub height: usize,
    /// Columns of a full turn.
    pub width: usize,
    /// Elevation of the upper edge \[deg\].
    pub fov_up_deg: f32,
    /// Elevation of the lower edge \[deg\], negative below the horizon.
    pub fov_down_deg: f32,
}

/// `(value - mean) / deviation` of every channel: range, x, y, z, remission. An empty pixel is 0 in all of them.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Normalisation {
    /// Subtracted.
    pub means: [f32; CHANNELS],
    /// Divided by, above 0.
    pub deviations: [f32; CHANNELS],
}

/// The output tensor.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputMeaning {
    /// What its numbers are.
    pub kind: OutputKind,
    /// Class of every output channel: SemanticKITTI's raw ids in the file. Unlabelled and outlier never win.
    #[serde(deserialize_with = "classes_by_id")]
    pub classes: Vec<SemanticClass>,
}

/// What the numbers of the output are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputKind {
    /// Any numbers; their softmax is the probability.
    Logits,
    /// 0 to 1, a sum of 1 over the channels.
    Probabilities,
}

impl Default for ImageGeometry {
    fn default() -> Self {
        Self { height: 64, width: 2048, fov_up_deg: 3.0, fov_down_deg: -25.0 }
    }
}

impl Default for Normalisation {
    fn default() -> Self {
        Self { means: [12.12, 10.88, 0.23, -1.04, 0.21], deviations: [12.32, 11.47, 6.91, 0.86, 0.16] }
    }
}

impl Default for OutputMeaning {
    /// The 20 classes of SemanticKITTI's single-scan benchmark, in its order.
    fn default() -> Self {
        Self { kind: OutputKind::Logits, classes: SemanticClass::ALL[..20].to_vec() }
    }
}

impl ImageGeometry {
    /// Pixels of the image.
    pub fn pixels(&self) -> usize {
        self.height * self.width
    }
}

impl ModelDescription {
    /// Reads and checks a `model.toml`.
    pub fn load(path: &Path) -> Result<Self, SegmentationError> {
        let text = std::fs::read_to_string(path).map_err(SegmentationError::reading(path))?;
        Self::parse(&text, path)
    }

    /// Like [`Self::load`] with the file's text at hand; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SegmentationError> {
        let description: Self = toml::from_str(text)
            .map_err(|source| SegmentationError::Description { path: path.into(), source: source.into() })?;
        match description.fault() {
            Some(fault) => Err(SegmentationError::DescriptionValue { path: path.into(), fault }),
            None => Ok(description),
        }
    }

    /// Shape of the input tensor: one image, channels, rows, columns.
    pub fn input_shape(&self) -> [usize; 4] {
        [1, CHANNELS, self.image.height, self.image.width]
    }

    /// Shape of the output tensor.
    pub fn output_shape(&self) -> [usize; 4] {
        [1, self.output.classes.len(), self.image.height, self.image.width]
    }

    fn fault(&self) -> Option<DescriptionFault> {
        let fault = |key, expected| Some(DescriptionFault { key, expected });
        let ImageGeometry { height, width, fov_up_deg: up, fov_down_deg: down } = self.image;
        if !(1..=1024).contains(&height) {
            return fault("image.height", "between 1 and 1024");
        }
        if !(1..=8192).contains(&width) {
            return fault("image.width", "between 1 and 8192");
        }
        if !(up > down && up <= 90.0 && down >= -90.0) {
            return fault("image.fov_up_deg", "above image.fov_down_deg, and both between -90 and 90");
        }
        if !self.normalise.means.iter().all(|mean| mean.is_finite()) {
            return fault("normalise.means", "five finite numbers");
        }
        if !self.normalise.deviations.iter().all(|deviation| deviation.is_finite() && *deviation > 0.0) {
            return fault("normalise.deviations", "five numbers above 0");
        }
        if !(1..=64).contains(&self.output.classes.len()) {
            return fault("output.classes", "1 to 64 names, one for every output channel");
        }
        self.objects.fault().or_else(|| self.knn.fault()).or_else(|| self.feet.fault())
    }
}

fn classes_by_id<'de, D: serde::Deserializer<'de>>(ids: D) -> Result<Vec<SemanticClass>, D::Error> {
    let ids = Vec::<u32>::deserialize(ids)?;
    ids.iter().map(|&id| class_by_id(id).map_err(serde::de::Error::custom)).collect()
}

fn class_by_id(id: u32) -> Result<SemanticClass, String> {
    match labels::class_of(id) {
        SemanticClass::Unlabelled if id != 0 => Err(format!(
            "{id} is no class of SemanticKITTI, expected a raw id such as 10 for car or 40 for road"
        )),
        class => Ok(class),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<ModelDescription, String> {
        ModelDescription::parse(text, Path::new("model.toml")).map_err(|error| {
            let source = std::error::Error::source(&error).map(ToString::to_string);
            format!("{error}: {}", source.unwrap_or_default())
        })
    }

    #[test]
    fn an_empty_description_is_rangenet() {
        let description = parse("").expect("defaults");
        assert_eq!(description.input_shape(), [1, 5, 64, 2048]);
        assert_eq!(description.output_shape(), [1, 20, 64, 2048]);
        assert_eq!(description.output.classes[19], SemanticClass::TrafficSign);
        assert_eq!(description, ModelDescription::default());
    }

    #[test]
    fn a_part_is_laid_over_the_defaults() {
        let description = parse("[image]\nwidth = 1024\n[output]\nclasses = [0, 10]\n");
        let description = description.expect("valid");
        assert_eq!((description.image.height, description.image.width), (64, 1024));
        assert_eq!(description.output.classes, [SemanticClass::Unlabelled, SemanticClass::Car]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, said) in [
            ("[image]\nhight = 64\n", "hight"),
            ("[picture]\n", "picture"),
            ("[image]\nheight = 0\n", "image.height"),
            ("[image]\nfov_up_deg = -30.0\n", "image.fov_up_deg"),
            ("[normalise]\nmeans = [1.0, 2.0]\n", "5"),
            ("[normalise]\ndeviations = [1.0, 1.0, 0.0, 1.0, 1.0]\n", "normalise.deviations"),
            ("[output]\nkind = \"votes\"\n", "votes"),
            ("[output]\nclasses = [0, 12]\n", "12 is no class"),
            ("[output]\nclasses = []\n", "output.classes"),
            ("[knn]\nwindow = 4\n", "knn.window"),
            ("[knn]\nneighbours = 26\n", "knn.neighbours"),
            ("[knn]\ncutoff_m = -1.0\n", "knn.cutoff_m"),
            ("[objects]\nlink_m = -0.3\n", "objects.link_m"),
            ("[objects]\nsmall_m = nan\n", "objects.small_m"),
            ("[feet]\nheight_m = -0.1\n", "feet.height_m"),
            ("[knn]\nsigma = -1.0\n", "knn.sigma"),
        ] {
            let refusal = parse(text).expect_err(text);
            assert!(refusal.contains("model.toml") && refusal.contains(said), "{text}: {refusal}");
        }
    }
}
