//! The configuration: one TOML file with every parameter, one table per stage.
//!
//! A preset gives all values; a file, which may hold any part of them, is laid over the preset; unknown keys,
//! wrong types and values out of range are refused with the file and the key named.

mod error;
mod merge;
mod render;

use std::path::Path;

use sdslam_core::Config as CoreConfig;
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::dataset::ELEVATION_CORRECTION_DEG;
pub use error::ConfigError;

/// The default configuration with a comment, unit and default for every key.
pub const DEFAULT_FILE: &str = include_str!("default.toml");

/// Where the values that a file does not give come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// The paper's stages followed by the dense 6-DoF refinement.
    #[default]
    Accurate,
    /// Nothing but the paper.
    Paper,
}

/// What is done to a scan before the core sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputConfig {
    /// Added to the elevation of every point \[deg\]; 0 switches the correction off.
    pub elevation_correction_deg: f64,
    /// Undo the motion of the vehicle during one turn of the sensor.
    pub deskew: bool,
}

/// The static semantic voxel map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapConfig {
    /// Edge of a voxel \[m\].
    pub voxel_m: f64,
    /// Points farther from the sensor are left out \[m\].
    pub max_range_m: f64,
    /// Voxels with fewer points are left out of the file.
    pub min_points: u32,
}

/// Loop closure (section 3.5): what becomes of the loops that the core proposes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoopConfig {
    /// Look for loops and correct the trajectory and the map by them.
    pub enabled: bool,
    /// Path between keyframes \[m\].
    pub keyframe_m: f64,
    /// Path between two accepted loops \[m\].
    pub spacing_m: f64,
    /// Proposals of the features that are refined per keyframe.
    pub max_candidates: u32,
    /// The registration may end this far from the proposal \[m\].
    pub max_correction_m: f32,
    /// Share of the points above ground that must lie on something of their kind, 0..1.
    pub min_overlap: f32,
    /// Share of those that must fit it, 0..1.
    pub min_fit: f32,
    /// Share of the old place that may have been seen through from the new one, 0..1.
    pub max_seen_through: f32,
}

/// Every parameter of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct HostConfig {
    /// What the other values were laid over.
    pub preset: Preset,
    /// Correction of the scans.
    pub input: InputConfig,
    /// The voxel map.
    pub map: MapConfig,
    /// Loop closure.
    pub loops: LoopConfig,
    /// The stages of the core, one table each.
    pub core: CoreConfig,
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Accurate => "accurate",
            Self::Paper => "paper",
        })
    }
}

impl Default for InputConfig {
    fn default() -> Self {
        Self { elevation_correction_deg: ELEVATION_CORRECTION_DEG, deskew: false }
    }
}

impl Default for MapConfig {
    fn default() -> Self {
        Self { voxel_m: 0.2, max_range_m: 60.0, min_points: 2 }
    }
}

impl Default for LoopConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            keyframe_m: 2.0,
            spacing_m: 8.0,
            max_candidates: 2,
            max_correction_m: 2.0,
            min_overlap: 0.5,
            min_fit: 0.7,
            max_seen_through: 0.05,
        }
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self::of_preset(Preset::default())
    }
}

impl LoopConfig {
    fn check(&self) -> Option<(&'static str, &'static str)> {
        let is_share = |share: f32| (0.0..=1.0).contains(&share);
        if !(0.5..=20.0).contains(&self.keyframe_m) {
            Some(("loops.keyframe_m", "between 0.5 and 20"))
        } else if !(0.0..=1000.0).contains(&self.spacing_m) {
            Some(("loops.spacing_m", "between 0 and 1000"))
        } else if !(0.0..=20.0).contains(&self.max_correction_m) {
            Some(("loops.max_correction_m", "between 0 and 20"))
        } else if !is_share(self.min_overlap) {
            Some(("loops.min_overlap", "between 0 and 1"))
        } else if !is_share(self.min_fit) {
            Some(("loops.min_fit", "between 0 and 1"))
        } else if !is_share(self.max_seen_through) {
            Some(("loops.max_seen_through", "between 0 and 1"))
        } else {
            None
        }
    }
}

impl HostConfig {
    /// The values of a preset.
    pub fn of_preset(preset: Preset) -> Self {
        let core = match preset {
            Preset::Accurate => CoreConfig::accurate(),
            Preset::Paper => CoreConfig::paper(),
        };
        let (input, map, loops) = Default::default();
        Self { preset, input, map, loops, core }
    }

    /// Reads `file` over a preset: `preset` if given, else the one the file names, else `accurate`.
    pub fn load(file: &Path, preset: Option<Preset>) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(file)
            .map_err(|source| ConfigError::Unreadable { file: file.into(), source })?;
        Self::parse(&text, file, preset)
    }

    /// Like [`Self::load`] with the file's text at hand; `file` is for messages.
    pub fn parse(text: &str, file: &Path, preset: Option<Preset>) -> Result<Self, ConfigError> {
        let invalid = |source| ConfigError::Invalid { file: file.into(), source: Box::new(source) };
        let mut user: Table = toml::from_str(text).map_err(invalid)?;
        let named: NamedPreset = toml::from_str(text).map_err(invalid)?;
        let preset = preset.or(named.preset).unwrap_or_default();
        user.remove("preset");
        let mut table = Self::of_preset(preset).to_table();
        merge::lay_over(&mut table, &user).map_err(|fault| fault.in_file(file))?;
        let config = Self::from_table(table).map_err(invalid)?;
        config.check(file)?;
        Ok(config)
    }

    /// The commented configuration file that holds these values.
    pub fn render(&self) -> String {
        render::fill(DEFAULT_FILE, &self.to_table())
    }

    /// Checks every parameter; `file` is for the message.
    pub fn check(&self, file: &Path) -> Result<(), ConfigError> {
        let fault = self.check_host().or_else(|| self.core.check().err().map(|e| (e.parameter, e.expected)));
        fault.map_or(Ok(()), |(parameter, expected)| {
            let table = self.to_table();
            let found = merge::lookup(&table, parameter);
            let found = found.map_or_else(String::new, |value| format!(", found {}", render::literal(value)));
            Err(ConfigError::OutOfRange { file: file.into(), parameter, expected, found })
        })
    }

    fn check_host(&self) -> Option<(&'static str, &'static str)> {
        if !(-5.0..=5.0).contains(&self.input.elevation_correction_deg) {
            Some(("input.elevation_correction_deg", "between -5 and 5"))
        } else if !(0.01..=10.0).contains(&self.map.voxel_m) {
            Some(("map.voxel_m", "between 0.01 and 10"))
        } else if !(1.0..=200.0).contains(&self.map.max_range_m) {
            Some(("map.max_range_m", "between 1 and 200"))
        } else {
            self.loops.check()
        }
    }

    /// All values as nested tables: `preset`, `input`, `map` and one table per stage of the core.
    fn to_table(&self) -> Table {
        let mut table = as_table(&self.core);
        table.extend(as_table(&HostTables {
            preset: self.preset,
            input: self.input,
            map: self.map,
            loops: self.loops,
        }));
        table
    }

    fn from_table(mut table: Table) -> Result<Self, toml::de::Error> {
        let host: Table = HostTables::KEYS.into_iter().filter_map(|key| table.remove_entry(key)).collect();
        let HostTables { preset, input, map, loops } = host.try_into()?;
        Ok(Self { preset, input, map, loops, core: table.try_into()? })
    }
}

/// The part of the file that is not the core's.
#[derive(Serialize, Deserialize)]
struct HostTables {
    preset: Preset,
    input: InputConfig,
    map: MapConfig,
    loops: LoopConfig,
}

/// The preset that a file names.
#[derive(Deserialize)]
struct NamedPreset {
    preset: Option<Preset>,
}

impl HostTables {
    const KEYS: [&str; 4] = ["preset", "input", "map", "loops"];
}

fn as_table(tables: &impl Serialize) -> Table {
    Table::try_from(tables).expect("plain structs of numbers, flags and names always have a TOML form")
}

#[cfg(test)]
mod tests;
