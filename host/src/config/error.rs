//! What can be wrong with a configuration.

use std::path::{Path, PathBuf};

/// Why a configuration was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is no TOML, or a value does not fit its parameter.
    #[error("the configuration {} is not valid", .file.display())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// Line, column and reason.
        source: Box<toml::de::Error>,
    },
    /// No parameter has this name.
    #[error("{}: unknown key `{key}`; {} (`sdslam config` prints them all)", .file.display(), known(.siblings))]
    UnknownKey {
        /// The file.
        file: PathBuf,
        /// Table and key.
        key: String,
        /// The keys that exist in its place.
        siblings: Vec<String>,
    },
    /// The value has another type than the parameter.
    #[error("{}: `{key}` must be of type {expected}, not {found}", .file.display())]
    WrongType {
        /// The file.
        file: PathBuf,
        /// Table and key.
        key: String,
        /// Type of the parameter.
        expected: &'static str,
        /// Type found.
        found: &'static str,
    },
    /// The value is outside its range.
    #[error("{}: `{parameter}` must be {expected}{found}", .file.display())]
    OutOfRange {
        /// The file.
        file: PathBuf,
        /// Table and key.
        parameter: &'static str,
        /// What is allowed.
        expected: &'static str,
        /// The value, where the parameter is one key: `, found ...`.
        found: String,
    },
}

fn known(siblings: &[String]) -> String {
    if siblings.is_empty() {
        "nothing belongs there".into()
    } else {
        format!("known: {}", siblings.join(", "))
    }
}

/// A fault in one key, before the file is known.
pub(super) enum KeyFault {
    Unknown { key: String, siblings: Vec<String> },
    WrongType { key: String, expected: &'static str, found: &'static str },
}

impl KeyFault {
    pub(super) fn in_file(self, file: &Path) -> ConfigError {
        let file = file.into();
        match self {
            Self::Unknown { key, siblings } => ConfigError::UnknownKey { file, key, siblings },
            Self::WrongType { key, expected, found } => ConfigError::WrongType { file, key, expected, found },
        }
    }
}
