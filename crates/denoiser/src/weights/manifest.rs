//! `MANIFEST.toml`: which weights there are, how large, and their hashes.

use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;
use crate::weights::manifest_entry::ManifestEntry;
use input_files::{SettingsFile, read_bytes};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const FILE: &str = "MANIFEST.toml";
/// Longest weights file that is read.
const MAX_BYTES: u64 = 1 << 30;

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
    /// [`WeightsError::Manifest`], or [`WeightsError::Entry`].
    pub fn open(folder: &Path) -> Result<Self, WeightsError> {
        let path = folder.join(FILE);
        let entries: BTreeMap<String, ManifestEntry> = SettingsFile { path: &path }.read()?;
        for (name, entry) in &entries {
            entry.check(&path, name)?;
        }
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
        let path = self.folder.join(&entry.file);
        let content = read_bytes(&path, MAX_BYTES).map_err(|source| WeightsError::File {
            manifest: self.folder.join(FILE),
            name: name.into(),
            source,
        })?;
        WeightsFile::checked(&path, &content, entry)
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
