//! `MANIFEST.toml`: which weights there are, how large, and their hashes.

use crate::weights_file::{WeightsError, WeightsFile};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const FILE: &str = "MANIFEST.toml";

/// What the manifest says of one file.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ManifestEntry {
    /// File name in the manifest's folder.
    pub file: String,
    /// SHA-256 of its content, in hexadecimal.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
    /// Which network it holds.
    pub architecture: String,
    /// How its data was made.
    pub description: String,
    /// Seconds of training.
    pub training_seconds: u64,
    /// Updates of training.
    pub updates: u64,
    /// Figures measured with it, and the command that measured them.
    #[serde(default)]
    pub measured: BTreeMap<String, toml::Value>,
}

/// The weights of a folder.
#[derive(Clone, Debug)]
pub struct Manifest {
    folder: PathBuf,
    entries: BTreeMap<String, ManifestEntry>,
}

impl Manifest {
    /// Reads `MANIFEST.toml` of a folder.
    ///
    /// # Errors
    /// [`WeightsError::Missing`] or [`WeightsError::Manifest`].
    pub fn open(folder: &Path) -> Result<Self, WeightsError> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| WeightsError::Missing {
            path: path.clone(),
            source,
        })?;
        let entries = toml::from_str(&text).map_err(|e| WeightsError::Manifest {
            path,
            reason: e.to_string(),
        })?;
        Ok(Self {
            folder: folder.into(),
            entries,
        })
    }

    /// Loads and checks the weights of a name.
    ///
    /// # Errors
    /// [`WeightsError`]: the name is not in the manifest, or the file does not fit it.
    pub fn weights(&self, name: &str) -> Result<WeightsFile, WeightsError> {
        let entry = self.entry(name)?;
        WeightsFile::open(&self.folder.join(&entry.file), entry)
    }

    /// The names of the weights, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    /// What it says of the weights of a name.
    ///
    /// # Errors
    /// [`WeightsError::NotInManifest`].
    pub fn entry(&self, name: &str) -> Result<&ManifestEntry, WeightsError> {
        let unknown = || WeightsError::NotInManifest {
            path: self.folder.join(FILE),
            name: name.into(),
            known: self.entries.keys().cloned().collect(),
        };
        self.entries.get(name).ok_or_else(unknown)
    }
}
