//! Robot files: TOML in SI units, unknown keys refused.

use crate::robot::{Robot, TendonLimits};
use crate::tendons::{Tendon, TendonMap, TendonMapError};
use crate::{MAX_TENDONS, Numbers, SECTIONS};
use input_files::{MAX_SETTINGS_BYTES, SettingsError, SettingsFile, read_text, shown};
use serde::Deserialize;
use std::borrow::Cow;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Lengths that a section may have, m: beyond them distances and scaled quantities lose their digits.
const SECTION_LENGTHS_M: [f64; 2] = [1e-4, 1e3];
/// Distances of a tendon from the backbone, and radii of a spool, m.
const SMALL_RADII_M: [f64; 2] = [1e-6, 1e3];
/// Angles of a tendon around the backbone, degrees.
const ANGLES_DEG: [f64; 2] = [-360.0, 360.0];
/// Bending angles that a section may reach, rad: below, a motion is lost among the tolerances it is certified for.
const BENDING_LIMITS_RAD: [f64; 2] = [0.01, PI];
/// Tendon velocities, m/s.
const VELOCITIES_M_S: [f64; 2] = [1e-7, 1e4];
/// Tendon accelerations, m/s².
const ACCELERATIONS_M_S2: [f64; 2] = [1e-7, 1e5];
/// Tendon jerks, m/s³.
const JERKS_M_S3: [f64; 2] = [1e-7, 1e6];

/// Why a robot file is refused.
#[derive(Debug, Error)]
pub enum RobotFileError {
    /// The file is not read or not understood, or a quantity is out of its range.
    #[error("robot file: {0}")]
    Settings(#[from] SettingsError),
    /// More tendons than the messages between the processes carry.
    #[error("robot file: {}: `tendons` are {count}, at most {MAX_TENDONS} are allowed", shown(.path))]
    TendonCount {
        /// The file.
        path: PathBuf,
        /// Tendons in the file.
        count: usize,
    },
    /// The tendons do not fit.
    #[error("robot file: {}: {source}", shown(.path))]
    Tendons {
        /// The file.
        path: PathBuf,
        /// What is wrong with the tendons.
        source: TendonMapError,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    name: String,
    section_lengths_m: Numbers<SECTIONS>,
    bending_limit_rad: f64,
    tube_radius_m: f64,
    spool_radius_m: f64,
    tendon_limits: LimitsTable,
    tendons: Vec<TendonTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsTable {
    velocity_m_s: f64,
    acceleration_m_s2: f64,
    jerk_m_s3: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TendonTable {
    section: usize,
    radius_m: f64,
    angle_deg: f64,
}

impl Robot {
    /// Reads a robot file; lengths are metres.
    ///
    /// # Errors
    /// [`RobotFileError`], naming the file, the key and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, RobotFileError> {
        let text = read_text(path, MAX_SETTINGS_BYTES).map_err(SettingsError::from)?;
        Self::from_toml_str(&text, path)
    }

    /// Reads a robot from the text of a robot file that lies at `path`; lengths are metres.
    ///
    /// # Errors
    /// [`RobotFileError`], naming the file, the key and what is allowed.
    pub fn from_toml_str(text: &str, path: &Path) -> Result<Self, RobotFileError> {
        let settings = SettingsFile { path };
        let file: RobotFile = settings.parse(text)?;
        file.check(&settings)?;
        let tendon = |t: &TendonTable| Tendon {
            section: t.section,
            radius: t.radius_m,
            angle: t.angle_deg.to_radians(),
        };
        let tendons = TendonMap::new(file.tendons.iter().map(tendon).collect());
        let tendons = tendons.map_err(|source| RobotFileError::Tendons {
            path: path.into(),
            source,
        })?;
        Ok(Self {
            name: file.name,
            section_lengths: file.section_lengths_m.0,
            bending_limit: file.bending_limit_rad,
            tube_radii: [file.tube_radius_m; SECTIONS],
            spool_radius: file.spool_radius_m,
            tendons,
            tendon_limits: TendonLimits {
                velocity: file.tendon_limits.velocity_m_s,
                acceleration: file.tendon_limits.acceleration_m_s2,
                jerk: file.tendon_limits.jerk_m_s3,
            },
        })
    }
}

impl RobotFile {
    fn check(&self, file: &SettingsFile<'_>) -> Result<(), RobotFileError> {
        let lengths = self.section_lengths_m.0;
        for (i, length) in lengths.into_iter().enumerate() {
            let key = format!("section_lengths_m[{i}]");
            within(file, key, length, SECTION_LENGTHS_M, "m")?;
        }
        let limit = self.bending_limit_rad;
        within(file, "bending_limit_rad", limit, BENDING_LIMITS_RAD, "rad")?;
        let shortest = lengths.into_iter().fold(f64::INFINITY, f64::min);
        let (radii, unit) = ([0.0, shortest], "m, the length of the shortest section");
        within(file, "tube_radius_m", self.tube_radius_m, radii, unit)?;
        let radius = self.spool_radius_m;
        within(file, "spool_radius_m", radius, SMALL_RADII_M, "m")?;
        self.tendon_limits.check(file)?;
        let count = self.tendons.len();
        if count > MAX_TENDONS {
            let path = file.path.into();
            return Err(RobotFileError::TendonCount { path, count });
        }
        for (i, tendon) in self.tendons.iter().enumerate() {
            let key = |name: &str| format!("tendons[{i}].{name}");
            let TendonTable {
                radius_m,
                angle_deg,
                ..
            } = *tendon;
            within(file, key("radius_m"), radius_m, SMALL_RADII_M, "m")?;
            within(file, key("angle_deg"), angle_deg, ANGLES_DEG, "degrees")?;
        }
        Ok(())
    }
}

impl LimitsTable {
    fn check(&self, file: &SettingsFile<'_>) -> Result<(), SettingsError> {
        let (v, a, j) = (self.velocity_m_s, self.acceleration_m_s2, self.jerk_m_s3);
        for (key, value, allowed, unit) in [
            ("velocity_m_s", v, VELOCITIES_M_S, "m/s"),
            ("acceleration_m_s2", a, ACCELERATIONS_M_S2, "m/s²"),
            ("jerk_m_s3", j, JERKS_M_S3, "m/s³"),
        ] {
            within(file, format!("tendon_limits.{key}"), value, allowed, unit)?;
        }
        Ok(())
    }
}

fn within(
    file: &SettingsFile<'_>,
    key: impl Into<Cow<'static, str>>,
    value: f64,
    [least, most]: [f64; 2],
    unit: &str,
) -> Result<(), SettingsError> {
    let allowed = format!("{least} to {most} {unit}");
    file.require((least..=most).contains(&value), key, value, allowed)
}
