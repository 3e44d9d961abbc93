//! Where the class of every point comes from, as it is typed.

use std::path::Path;

use super::CliError;
use super::segment::NetworkArgs;
use crate::run::ClassSource;

/// Source of the classes.
#[derive(Debug, clap::Args)]
pub(super) struct ClassArgs {
    /// Folder of the label files within the sequence.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["model", "segment"])]
    labels: Option<String>,
    #[command(flatten)]
    network: NetworkArgs,
    /// Segment the scans even where there are labels.
    #[arg(long)]
    segment: bool,
}

impl ClassArgs {
    /// Label files with `--labels`, a network with `--model` or `--segment`; else the folder `labels` of the sequence where
    /// there is one.
    pub(super) fn source(&self, dataset: &Path, sequence: &str) -> Result<ClassSource, CliError> {
        let model = self.network.model.as_deref();
        let labels = self.labels.as_deref().unwrap_or("labels");
        let there = dataset.join("sequences").join(sequence).join("labels").is_dir();
        let from_labels = self.labels.is_some() || (model.is_none() && !self.segment && there);
        Ok(if from_labels {
            ClassSource::Labels(labels.into())
        } else {
            ClassSource::Network(NetworkArgs::load(model)?)
        })
    }
}
