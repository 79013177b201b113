//! What `MANIFEST.toml` says of one weights file.

use crate::weights::error::WeightsError;
use input_files::shortened;
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use std::ffi::OsStr;
use std::path::Path;

/// Longest name of a file, bytes.
const MAX_NAME: usize = 255;

/// What the manifest says of one file.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ManifestEntry {
    /// File name in the manifest's folder.
    pub file: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// The size of the file, bytes.
    pub bytes: u64,
    /// The network that the weights are of.
    pub architecture: String,
    /// How the training data was made.
    pub description: String,
    /// Seeds of the data sets that it was trained with (`pcc dataset --seed`).
    #[serde(default)]
    pub training_seeds: Vec<u64>,
    /// Seconds of training.
    pub training_seconds: u64,
    /// Updates of training.
    pub updates: u64,
    /// Figures measured with the weights, and the command that measured them.
    #[serde(default, deserialize_with = "table")]
    pub measured: toml::Table,
}

/// Reads a table of TOML, and refuses a date, which serde would take for one.
fn table<'de, D: Deserializer<'de>>(deserializer: D) -> Result<toml::Table, D::Error> {
    match toml::Value::deserialize(deserializer)? {
        toml::Value::Table(table) => Ok(table),
        other => {
            let found = other.type_str();
            Err(D::Error::custom(format!(
                "invalid type: {found}, expected a table"
            )))
        }
    }
}

impl ManifestEntry {
    pub(crate) fn check(&self, path: &Path, name: &str) -> Result<(), WeightsError> {
        let is_name = Path::new(&self.file).file_name() == Some(OsStr::new(&self.file));
        let is_file = is_name && self.file.len() <= MAX_NAME && !self.file.contains('\0');
        let is_hash = self.sha256.len() == 64 && self.sha256.bytes().all(|b| b.is_ascii_hexdigit());
        let refused = |key, found: &str, allowed| WeightsError::Entry {
            path: path.into(),
            name: name.into(),
            key,
            found: shortened(&format!("{found:?}")),
            allowed,
        };
        if !is_file {
            let allowed = "the name of a file beside it, of at most 255 bytes,";
            return Err(refused("file", &self.file, allowed));
        }
        if !is_hash {
            let allowed = "a hash of 64 hexadecimal digits";
            return Err(refused("sha256", &self.sha256, allowed));
        }
        Ok(())
    }
}
