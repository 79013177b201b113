//! Why a scene file is refused.

use crate::obstacle::solid_error::SolidError;
use crate::scene::static_scene::SceneError;
use input_files::{InputFileError, SettingsError, shown};
use std::path::PathBuf;
use thiserror::Error;

/// Balls that a scene file may hold, so that a request's own have room beside them.
pub(crate) const MAX_FILE_BALLS: usize = 1024;

/// Why a scene file is refused.
#[derive(Debug, Error)]
pub enum SceneFileError {
    /// The file is not read, is not TOML, a key is missing or unknown, or a value has the wrong type.
    #[error("scene file: {0}")]
    Settings(#[from] SettingsError),
    /// The file names neither an obstacle nor that there is none.
    #[error(
        "scene file {} names no obstacle; where there is none, `balls = []` is needed, so that a file that was cut off is no empty scene",
        shown(.path)
    )]
    Silent {
        /// The scene file.
        path: PathBuf,
    },
    /// An entry is refused.
    #[error("scene file {}: {entry}: {source}", shown(.path))]
    Entry {
        /// The scene file.
        path: PathBuf,
        /// The refused entry, as `boxes[0]`.
        entry: String,
        /// What is wrong with the entry.
        source: Box<EntryError>,
    },
    /// Too many balls for a file.
    #[error("scene file {} has {count} balls; at most {MAX_FILE_BALLS} are allowed", shown(.path))]
    Balls {
        /// The file.
        path: PathBuf,
        /// Number of balls in the file.
        count: usize,
    },
    /// The obstacles do not make a scene; lengths in section lengths of the robot.
    #[error("scene file {}: {source}", shown(.path))]
    Scene {
        /// The file.
        path: PathBuf,
        /// What is wrong with the scene.
        source: SceneError,
    },
}

/// Why an entry of a scene file is refused.
#[derive(Debug, Error)]
pub enum EntryError {
    /// A number is out of its range.
    #[error("{key} is {value}; {allowed} is allowed")]
    Value {
        /// The key.
        key: &'static str,
        /// The key's value as the file has it.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// A file that the entry names is not read.
    #[error("`file`: {0}")]
    File(#[from] InputFileError),
    /// A file with a mesh or a grid is not understood.
    #[error("`file` {} is not understood: {reason}", shown(.path))]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// The numbers of a rotation make none.
    #[error("{0}")]
    Rotation(String),
    /// The numbers do not make a solid; lengths in section lengths of the robot.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// What a file holds does not make a solid; an open edge in the unit of the file, other lengths in section lengths of the robot.
    #[error("{}: {source}", shown(.path))]
    SolidOfFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with the solid.
        source: SolidError,
    },
}
