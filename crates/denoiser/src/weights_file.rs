//! Weights files: safetensors with metadata, checked before anything is computed with them.

use crate::manifest::ManifestEntry;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why weights are refused.
#[derive(Debug, Error)]
pub enum WeightsError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The manifest is not understood.
    #[error("manifest {path} is not understood: {reason}")]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The manifest has no such name.
    #[error("{path} has no weights `{name}`, only {}; weights/README.md says how to train them", .known.join(", "))]
    NotInManifest {
        /// The manifest.
        path: PathBuf,
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// The file is shorter or longer than the manifest says.
    #[error(
        "weights file {path} has {found} bytes, the manifest says {expected}: it is truncated or another file"
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Its size.
        found: u64,
        /// The manifest's size.
        expected: u64,
    },
    /// The content is not what the manifest says.
    #[error(
        "weights file {path} has sha256 {found}, the manifest says {expected}: it is damaged or another file"
    )]
    Hash {
        /// The file.
        path: PathBuf,
        /// Its hash.
        found: String,
        /// The manifest's hash.
        expected: String,
    },
    /// Not a safetensors file.
    #[error("weights file {path} is not a safetensors file: {reason}")]
    Format {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// A tensor is missing.
    #[error("weights have no tensor `{tensor}`")]
    NoTensor {
        /// The tensor.
        tensor: String,
    },
    /// A tensor has another shape or type.
    #[error("tensor `{tensor}` has {found}, f32 {expected:?} is needed")]
    Shape {
        /// The tensor.
        tensor: String,
        /// What it has.
        found: String,
        /// The shape needed.
        expected: Vec<usize>,
    },
    /// A tensor holds values that are not finite.
    #[error("tensor `{tensor}` has a value that is not finite at index {index}")]
    NotFinite {
        /// The tensor.
        tensor: String,
        /// Index of the first such value.
        index: usize,
    },
    /// A tensor's values do not make sense together.
    #[error("tensor `{tensor}` has {found}, {expected} is needed")]
    Value {
        /// The tensor.
        tensor: &'static str,
        /// What it has.
        found: String,
        /// What is needed.
        expected: &'static str,
    },
    /// The metadata does not fit this program.
    #[error("weights metadata `{key}` is {found:?}, {expected} is needed")]
    Metadata {
        /// The key.
        key: &'static str,
        /// Its value, if there is one.
        found: Option<String>,
        /// What is needed.
        expected: String,
    },
    /// The weights were trained for another robot.
    #[error("weights are for another robot: {quantity} is {found}, this robot has {expected}")]
    Robot {
        /// What differs.
        quantity: &'static str,
        /// The weights' value.
        found: f64,
        /// The robot's value.
        expected: f64,
    },
}

struct Tensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

impl Tensor {
    fn read(name: &str, view: &TensorView) -> Result<Self, WeightsError> {
        if view.dtype() != Dtype::F32 {
            return Err(WeightsError::Shape {
                tensor: name.into(),
                found: format!("{:?} {:?}", view.dtype(), view.shape()),
                expected: view.shape().to_vec(),
            });
        }
        let (bytes, _) = view.data().as_chunks::<4>();
        let values: Vec<f32> = bytes.iter().map(|b| f32::from_le_bytes(*b)).collect();
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(WeightsError::NotFinite {
                tensor: name.into(),
                index,
            });
        }
        let shape = view.shape().to_vec();
        Ok(Self { shape, values })
    }
}

/// The content of a weights file: finite f32 tensors and metadata.
pub struct WeightsFile {
    tensors: BTreeMap<String, Tensor>,
    metadata: HashMap<String, String>,
}

impl WeightsFile {
    /// Opens a weights file and checks its size, hash and values.
    ///
    /// # Errors
    /// [`WeightsError`], naming what does not fit.
    pub fn open(path: &Path, entry: &ManifestEntry) -> Result<Self, WeightsError> {
        let missing = |source| WeightsError::Missing {
            path: path.into(),
            source,
        };
        check_size(path, std::fs::metadata(path).map_err(missing)?.len(), entry)?;
        let content = std::fs::read(path).map_err(missing)?;
        check_size(path, content.len() as u64, entry)?;
        check_hash(path, &content, entry)?;
        let file = Self::parse(path, &content)?;
        file.expect("architecture", &entry.architecture)?;
        Ok(file)
    }

    pub(crate) fn parse(path: &Path, content: &[u8]) -> Result<Self, WeightsError> {
        let fail = |e: safetensors::SafeTensorError| WeightsError::Format {
            path: path.into(),
            reason: e.to_string(),
        };
        let (_, header) = SafeTensors::read_metadata(content).map_err(fail)?;
        let file = SafeTensors::deserialize(content).map_err(fail)?;
        let tensors = file
            .tensors()
            .iter()
            .map(|(name, view)| Ok((name.clone(), Tensor::read(name, view)?)))
            .collect::<Result<_, WeightsError>>()?;
        Ok(Self {
            tensors,
            metadata: header.metadata().clone().unwrap_or_default(),
        })
    }

    /// The values of a tensor, row-major, if it has the shape.
    ///
    /// # Errors
    /// [`WeightsError::NoTensor`] or [`WeightsError::Shape`].
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<&[f32], WeightsError> {
        let tensor = self
            .tensors
            .get(name)
            .ok_or_else(|| WeightsError::NoTensor {
                tensor: name.into(),
            })?;
        if tensor.shape != shape {
            return Err(WeightsError::Shape {
                tensor: name.into(),
                found: format!("f32 {:?}", tensor.shape),
                expected: shape.to_vec(),
            });
        }
        Ok(&tensor.values)
    }

    /// Checks that a metadata entry has a value.
    ///
    /// # Errors
    /// [`WeightsError::Metadata`].
    pub fn expect(&self, key: &'static str, expected: &str) -> Result<(), WeightsError> {
        match self.metadata.get(key) {
            Some(found) if found == expected => Ok(()),
            found => Err(WeightsError::Metadata {
                key,
                found: found.cloned(),
                expected: format!("`{expected}`"),
            }),
        }
    }

    /// A metadata entry, if there is one.
    #[must_use]
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.get(key).map(String::as_str)
    }

    /// Checks that the weights are for a robot of three sections with this bending limit (rad).
    ///
    /// # Errors
    /// [`WeightsError::Metadata`] or [`WeightsError::Robot`].
    pub fn expect_robot(&self, bending_limit: f64) -> Result<(), WeightsError> {
        /// Limits that differ by less are the same.
        const SAME_LIMIT_RAD: f64 = 1e-6;
        self.expect("sections", "3")?;
        let found: f64 = self.number("theta_max")?;
        let is_same = (found - bending_limit).abs() <= SAME_LIMIT_RAD;
        if !is_same {
            return Err(WeightsError::Robot {
                quantity: "bending limit (rad)",
                found,
                expected: bending_limit,
            });
        }
        Ok(())
    }

    /// A metadata entry as a count of at least 1.
    ///
    /// # Errors
    /// [`WeightsError::Metadata`].
    pub fn count(&self, key: &'static str) -> Result<usize, WeightsError> {
        match self.number(key)? {
            0 => Err(WeightsError::Metadata {
                key,
                found: Some("0".into()),
                expected: "a count of at least 1".into(),
            }),
            count => Ok(count),
        }
    }

    /// A metadata entry as a number.
    ///
    /// # Errors
    /// [`WeightsError::Metadata`].
    pub fn number<T: std::str::FromStr>(&self, key: &'static str) -> Result<T, WeightsError> {
        let found = self.metadata.get(key);
        let missing = || WeightsError::Metadata {
            key,
            found: found.cloned(),
            expected: "a number".into(),
        };
        found.and_then(|text| text.parse().ok()).ok_or_else(missing)
    }
}

fn check_size(path: &Path, found: u64, entry: &ManifestEntry) -> Result<(), WeightsError> {
    if found == entry.bytes {
        return Ok(());
    }
    Err(WeightsError::Size {
        path: path.into(),
        found,
        expected: entry.bytes,
    })
}

fn check_hash(path: &Path, content: &[u8], entry: &ManifestEntry) -> Result<(), WeightsError> {
    let digest = Sha256::digest(content);
    let hash: String = digest.iter().map(|b| format!("{b:02x}")).collect();
    if hash == entry.sha256 {
        return Ok(());
    }
    Err(WeightsError::Hash {
        path: path.into(),
        found: hash,
        expected: entry.sha256.clone(),
    })
}
