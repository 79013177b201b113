//! Reading the configuration files of both programs.

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use serde::de::DeserializeOwned;

/// Functions that give the defaults of a file's keys, for serde.
macro_rules! defaults {
    ($($name:ident: $kind:ty = $value:expr;)*) => {
        $(pub(super) const fn $name() -> $kind { $value })*
    };
}
pub(crate) use defaults;

/// Why a configuration file was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read configuration {path}: {error}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        error: std::io::Error,
    },
    /// It is not TOML, has an unknown key, or a value of the wrong type.
    #[error("configuration {path}: {error}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where and what.
        error: Box<toml::de::Error>,
    },
    /// A setting is outside its range.
    #[error("configuration {path}: {setting} = {value} is not allowed: {allowed}")]
    Range {
        /// The file.
        path: PathBuf,
        /// The setting's name.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// The robot file that it names was refused.
    #[error("configuration {path}: {error}")]
    Robot {
        /// The configuration file.
        path: PathBuf,
        /// What is wrong with the robot file.
        error: Box<pcc_model::RobotFileError>,
    },
}

/// A file's settings, and the checks of single numbers against it.
pub(crate) struct Checked<'a> {
    pub(crate) path: &'a Path,
}

impl Checked<'_> {
    /// Parses the file as `T`.
    pub(crate) fn read<T: DeserializeOwned>(&self) -> Result<T, ConfigError> {
        let path = self.path.to_owned();
        let text = std::fs::read_to_string(self.path).map_err(|error| ConfigError::Unreadable {
            path: path.clone(),
            error,
        })?;
        toml::from_str(&text).map_err(|error| ConfigError::Syntax {
            path,
            error: Box::new(error),
        })
    }

    /// Loads the robot file `robot`, relative to the configuration's folder.
    pub(crate) fn robot(&self, robot: &Path) -> Result<pcc_model::Robot, ConfigError> {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        pcc_model::Robot::from_file(&folder.join(robot)).map_err(|error| ConfigError::Robot {
            path: self.path.to_owned(),
            error: Box::new(error),
        })
    }

    /// Refuses `value` unless `holds`.
    pub(crate) fn require(
        &self,
        holds: bool,
        setting: &'static str,
        value: f64,
        allowed: impl Into<String>,
    ) -> Result<(), ConfigError> {
        if holds {
            return Ok(());
        }
        Err(ConfigError::Range {
            path: self.path.to_owned(),
            setting,
            value,
            allowed: allowed.into(),
        })
    }

    /// Refuses `value` unless it is in `range`.
    pub(crate) fn within(
        &self,
        setting: &'static str,
        value: impl Into<f64>,
        range: RangeInclusive<f64>,
    ) -> Result<(), ConfigError> {
        let (value, allowed) = (
            value.into(),
            format!("{} to {}", range.start(), range.end()),
        );
        self.require(range.contains(&value), setting, value, allowed)
    }

    /// Checks what both programs' loops have: their rate and their real-time priority.
    pub(crate) fn real_time_loop(&self, rate_hz: u32, priority: u8) -> Result<(), ConfigError> {
        self.within("rate_hz", rate_hz, 100.0..=4000.0)?;
        let allowed = "0 (none) to 99";
        let value = f64::from(priority);
        self.require(priority <= 99, "realtime_priority", value, allowed)
    }
}
