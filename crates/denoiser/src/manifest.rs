//! `MANIFEST.toml`: which weights there are, how large, and their hashes.

use crate::weights_file::{WeightsError, WeightsFile};
use input_files::{SettingsFile, read_bytes, shortened};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

const FILE: &str = "MANIFEST.toml";
/// Longest weights file that is read.
const MAX_BYTES: u64 = 1 << 30;
/// Longest name of a file, bytes.
const MAX_NAME: usize = 255;

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
    #[serde(default, deserialize_with = "table")]
    pub measured: toml::Table,
}

/// A table, which a date is not, though it reads like one.
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
    fn check(&self, path: &Path, name: &str) -> Result<(), WeightsError> {
        let is_name = Path::new(&self.file).file_name() == Some(OsStr::new(&self.file));
        let is_file = is_name && self.file.len() <= MAX_NAME && !self.file.contains('\0');
        let is_hash = self.sha256.len() == 64 && self.sha256.bytes().all(|b| b.is_ascii_hexdigit());
        for (holds, key, found, allowed) in [
            (
                is_file,
                "file",
                &self.file,
                "the name of a file beside it, of at most 255 bytes,",
            ),
            (
                is_hash,
                "sha256",
                &self.sha256,
                "a hash of 64 hexadecimal digits",
            ),
        ] {
            if !holds {
                return Err(WeightsError::Entry {
                    path: path.into(),
                    name: name.into(),
                    key,
                    found: shortened(&format!("{found:?}")),
                    allowed,
                });
            }
        }
        Ok(())
    }
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
