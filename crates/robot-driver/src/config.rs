//! What the configuration files of controllers and drivers have in common.

use std::path::{Path, PathBuf};

use input_files::{SettingsError, SettingsFile};

/// Why a configuration file was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file is not read or not understood, or a setting is outside its range.
    #[error("configuration: {0}")]
    Settings(#[from] SettingsError),
    /// The robot file that it names was refused.
    #[error("configuration {path:?}: `robot`: {error}")]
    Robot {
        /// The configuration file.
        path: PathBuf,
        /// What is wrong with the robot file.
        error: Box<pcc_model::RobotFileError>,
    },
}

/// Loads the robot file `robot`, relative to the folder of the configuration.
///
/// # Errors
/// [`ConfigError::Robot`].
pub fn robot_of(
    configuration: &SettingsFile<'_>,
    robot: &Path,
) -> Result<pcc_model::Robot, ConfigError> {
    let path = configuration.path;
    let folder = path.parent().unwrap_or(Path::new("."));
    pcc_model::Robot::from_file(&folder.join(robot)).map_err(|error| ConfigError::Robot {
        path: path.to_owned(),
        error: Box::new(error),
    })
}

/// Checks the settings that loops at 1 kHz have: rate and real-time priority.
///
/// # Errors
/// [`SettingsError::Range`].
pub fn check_loop(
    configuration: &SettingsFile<'_>,
    rate_hz: u32,
    priority: u8,
) -> Result<(), SettingsError> {
    configuration.within("rate_hz", rate_hz, 100..=4000)?;
    let allowed = "0 (none) to 99";
    configuration.require(priority <= 99, "realtime_priority", priority, allowed)
}
