//! Weights files: safetensors with metadata, checked before anything is computed with them.

use crate::weights::error::{ContentError, WeightsError};
use crate::weights::manifest_entry::ManifestEntry;
use crate::weights::safetensors_header::header_fault;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

struct Tensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

impl Tensor {
    fn read(name: &str, view: &TensorView) -> Result<Self, ContentError> {
        if view.dtype() != Dtype::F32 {
            return Err(ContentError::Shape {
                tensor: name.into(),
                found: format!("{:?} {:?}", view.dtype(), view.shape()),
                expected: view.shape().to_vec(),
            });
        }
        let (bytes, _) = view.data().as_chunks::<4>();
        let values: Vec<f32> = bytes.iter().map(|b| f32::from_le_bytes(*b)).collect();
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(ContentError::NotFinite {
                tensor: name.into(),
                index,
                value: values[index],
            });
        }
        let shape = view.shape().to_vec();
        Ok(Self { shape, values })
    }
}

/// The content of a weights file: finite f32 tensors and metadata.
pub struct WeightsFile {
    path: PathBuf,
    tensors: BTreeMap<String, Tensor>,
    metadata: HashMap<String, String>,
    hash: u64,
}

impl WeightsFile {
    /// The first 8 bytes of the file's SHA-256, the first one the highest; 0 where the file was not checked.
    #[must_use]
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Checks the content of a weights file against what the manifest says of it.
    ///
    /// # Errors
    /// [`WeightsError`], naming what does not fit.
    pub(crate) fn checked(
        path: &Path,
        content: &[u8],
        entry: &ManifestEntry,
    ) -> Result<Self, WeightsError> {
        let is_same = |key, found: String, expected: String| match found == expected {
            true => Ok(()),
            false => Err(WeightsError::Differs {
                path: path.into(),
                key,
                found,
                expected,
            }),
        };
        is_same("bytes", content.len().to_string(), entry.bytes.to_string())?;
        let digest = Sha256::digest(content);
        let hash = digest.iter().map(|b| format!("{b:02x}")).collect();
        is_same("sha256", hash, entry.sha256.clone())?;
        let first: [u8; 8] = std::array::from_fn(|index| digest[index]);
        let file = Self {
            hash: u64::from_be_bytes(first),
            ..Self::parse(path, content)?
        };
        let found = file.metadata("architecture").unwrap_or("none");
        is_same("architecture", found.into(), entry.architecture.clone())?;
        Ok(file)
    }

    pub(crate) fn parse(path: &Path, content: &[u8]) -> Result<Self, WeightsError> {
        let fail = |e: safetensors::SafeTensorError| WeightsError::Format {
            path: path.into(),
            reason: header_fault(content).unwrap_or_else(|| {
                format!("{e}; tensors of F32, one right behind the other, are needed")
            }),
        };
        let (_, header) = SafeTensors::read_metadata(content).map_err(fail)?;
        let file = SafeTensors::deserialize(content).map_err(fail)?;
        let tensors = file
            .tensors()
            .iter()
            .map(|(name, view)| Ok((name.clone(), Tensor::read(name, view)?)))
            .collect::<Result<_, ContentError>>();
        let tensors = tensors.map_err(|reason| WeightsError::Content {
            path: path.into(),
            reason,
        })?;
        Ok(Self {
            path: path.into(),
            tensors,
            metadata: header.metadata().clone().unwrap_or_default(),
            hash: 0,
        })
    }

    /// The error that says that this file's content does not fit.
    pub(crate) fn refused(&self, reason: ContentError) -> WeightsError {
        WeightsError::Content {
            path: self.path.clone(),
            reason,
        }
    }

    /// The error that says that a metadata entry does not fit, and what is needed.
    pub(crate) fn refused_entry(
        &self,
        key: &'static str,
        expected: impl Into<String>,
    ) -> WeightsError {
        self.refused(ContentError::Metadata {
            key,
            found: self.metadata.get(key).cloned(),
            expected: expected.into(),
        })
    }

    /// The values of a tensor, row-major, if it has the shape.
    ///
    /// # Errors
    /// [`ContentError::NoTensor`] or [`ContentError::Shape`].
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<&[f32], WeightsError> {
        let tensor = name.into();
        let Some(known) = self.tensors.get(name) else {
            return Err(self.refused(ContentError::NoTensor { tensor }));
        };
        if known.shape != shape {
            return Err(self.refused(ContentError::Shape {
                tensor,
                found: format!("f32 {:?}", known.shape),
                expected: shape.to_vec(),
            }));
        }
        Ok(&known.values)
    }

    /// The tensors' names and shapes.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        let tensors = self.tensors.iter();
        tensors.map(|(name, tensor)| (name.as_str(), tensor.shape.as_slice()))
    }

    /// The values of a tensor of one dimension, if it has this length.
    pub(crate) fn vector(&self, name: &str, length: usize) -> Result<Vec<f32>, WeightsError> {
        Ok(self.tensor(name, &[length])?.to_vec())
    }

    /// Checks that a metadata entry has a value.
    ///
    /// # Errors
    /// [`ContentError::Metadata`].
    pub fn expect(&self, key: &'static str, expected: &str) -> Result<(), WeightsError> {
        match self.metadata.get(key) {
            Some(found) if found == expected => Ok(()),
            _ => Err(self.refused_entry(key, format!("`{expected}`"))),
        }
    }

    /// Whether the name of some tensor begins with `begin`.
    pub(crate) fn has_tensors(&self, begin: &str) -> bool {
        let mut following = self.tensors.range(begin.to_owned()..);
        following
            .next()
            .is_some_and(|(name, _)| name.starts_with(begin))
    }

    /// A metadata entry, if there is one.
    #[must_use]
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.get(key).map(String::as_str)
    }

    /// Checks that the weights are for a robot of three sections with this bending limit (rad).
    ///
    /// # Errors
    /// [`ContentError::Metadata`] or [`ContentError::Robot`].
    pub fn expect_robot(&self, bending_limit: f64) -> Result<(), WeightsError> {
        /// Limits that differ by less are the same.
        const SAME_LIMIT_RAD: f64 = 1e-6;
        self.expect("sections", "3")?;
        let found: f64 = self.number("theta_max")?;
        let is_same = (found - bending_limit).abs() <= SAME_LIMIT_RAD;
        if !is_same {
            return Err(self.refused(ContentError::Robot {
                key: "theta_max",
                quantity: "bending limit, rad",
                found,
                expected: bending_limit,
            }));
        }
        Ok(())
    }

    /// A metadata entry as a count of at least 1.
    ///
    /// # Errors
    /// [`ContentError::Metadata`].
    pub fn count(&self, key: &'static str) -> Result<usize, WeightsError> {
        match self.number(key)? {
            0 => Err(self.refused_entry(key, "a count of at least 1")),
            count => Ok(count),
        }
    }

    /// A metadata entry as a number.
    ///
    /// # Errors
    /// [`ContentError::Metadata`].
    pub fn number<T: std::str::FromStr>(&self, key: &'static str) -> Result<T, WeightsError> {
        let number = self.metadata(key).and_then(|text| text.parse().ok());
        number.ok_or_else(|| self.refused_entry(key, "a number"))
    }
}
