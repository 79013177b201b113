//! Why weights are refused.

use input_files::{InputFileError, SettingsError, shortened, shown};
use std::path::PathBuf;
use thiserror::Error;

/// Why weights are refused.
#[derive(Debug, Error)]
pub enum WeightsError {
    /// The manifest is not read or not understood.
    #[error("manifest: {0}")]
    Manifest(#[from] SettingsError),
    /// What the manifest says of some weights is refused.
    #[error("manifest {}: `{key}` of `{name}` is {found}; {allowed} is needed", shown(.path))]
    Entry {
        /// The manifest.
        path: PathBuf,
        /// The name of the weights.
        name: String,
        /// The key.
        key: &'static str,
        /// The key's value.
        found: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The manifest has no such name.
    #[error(
        "{path} has no weights `{}`; one of {} is needed (weights/README.md says how to train more)",
        shortened(.name),
        .known.join(", ")
    )]
    NotInManifest {
        /// The manifest.
        path: PathBuf,
        /// The name asked for.
        name: String,
        /// The names that the manifest has.
        known: Vec<String>,
    },
    /// The file that the manifest names is not read.
    #[error("weights `{name}`, by `file` in {manifest:?}: {source}")]
    File {
        /// The manifest.
        manifest: PathBuf,
        /// The name of the weights.
        name: String,
        /// Why the file is not read.
        source: InputFileError,
    },
    /// The file is not what the manifest says of it.
    #[error(
        "weights file {} has {key} {found:?}, but `{key}` is {:?} in MANIFEST.toml; they must be the same: one of the two is damaged, or another's", shown(.path),
        shortened(.expected)
    )]
    Differs {
        /// The file.
        path: PathBuf,
        /// The manifest's key.
        key: &'static str,
        /// The key's value by the file.
        found: String,
        /// The key's value by the manifest.
        expected: String,
    },
    /// Not a safetensors file.
    #[error("weights file {} is not a safetensors file: {reason}", shown(.path))]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what is needed.
        reason: String,
    },
    /// What the file holds does not fit.
    #[error("weights file {}: {reason}", shown(.path))]
    Content {
        /// The file.
        path: PathBuf,
        /// What in the file differs from what the network, the manifest or the robot needs.
        reason: ContentError,
    },
}

/// Why the content of a weights file is refused.
#[derive(Debug, Error)]
pub enum ContentError {
    /// A tensor is missing.
    #[error("tensor `{tensor}` is missing; it is needed")]
    NoTensor {
        /// The tensor.
        tensor: String,
    },
    /// A tensor has another shape or type.
    #[error("tensor `{tensor}` has {found}, f32 {expected:?} is needed")]
    Shape {
        /// The tensor.
        tensor: String,
        /// Shape or type that the tensor has.
        found: String,
        /// The shape needed.
        expected: Vec<usize>,
    },
    /// A tensor holds values that are not finite.
    #[error("tensor `{tensor}` has the value {value} at index {index}; finite values are needed")]
    NotFinite {
        /// The tensor.
        tensor: String,
        /// Index of the first such value.
        index: usize,
        /// The value.
        value: f32,
    },
    /// A tensor's values do not make sense together.
    #[error("tensor `{tensor}` has {found}, {expected} is needed")]
    Value {
        /// The tensor.
        tensor: &'static str,
        /// What the tensor has.
        found: String,
        /// What is needed.
        expected: &'static str,
    },
    /// The metadata does not fit this program.
    #[error("metadata `{key}` is {}, {expected} is needed", .found.as_ref().map_or("missing".into(), |found| shortened(&format!("{found:?}"))))]
    Metadata {
        /// The key.
        key: &'static str,
        /// The key's value, if there is one.
        found: Option<String>,
        /// What is needed.
        expected: String,
    },
    /// The weights were trained for another robot.
    #[error(
        "it is for another robot: metadata `{key}` ({quantity}) is {found:?}; this robot's, {expected:?}, is needed"
    )]
    Robot {
        /// The metadata's key.
        key: &'static str,
        /// The quantity that differs.
        quantity: &'static str,
        /// The weights' value.
        found: f64,
        /// The robot's value.
        expected: f64,
    },
}
