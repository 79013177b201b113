//! Robot files: TOML in SI units, unknown keys refused.

use crate::robot::{Robot, TendonLimits};
use crate::tendons::{Tendon, TendonMap, TendonMapError};
use crate::{MAX_TENDONS, Numbers, SECTIONS};
use input_files::{InputFileError, MAX_SETTINGS_BYTES, read_text};
use serde::Deserialize;
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
    /// The file cannot be read.
    #[error("robot file: {0}")]
    Read(#[from] InputFileError),
    /// What it says is refused.
    #[error("robot file {path}: {source}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The reason: any of the others.
        source: Box<RobotFileError>,
    },
    /// Not TOML, a key missing or unknown, or a value of the wrong type.
    #[error("it is not understood: {}", input_files::readable(.0))]
    Syntax(toml::de::Error),
    /// A quantity is out of its range.
    #[error("{key} = {value} is not allowed: {allowed}")]
    Range {
        /// The key.
        key: String,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// More tendons than the messages between the processes carry.
    #[error("the robot has {count} tendons, at most {MAX_TENDONS} are allowed")]
    TendonCount {
        /// Tendons in the file.
        count: usize,
    },
    /// The tendons do not fit.
    #[error(transparent)]
    Tendons(#[from] TendonMapError),
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
        let text = read_text(path, MAX_SETTINGS_BYTES)?;
        Self::from_toml_str(&text).map_err(|source| RobotFileError::Content {
            path: path.into(),
            source: Box::new(source),
        })
    }

    /// Reads a robot from the text of a robot file; lengths are metres.
    ///
    /// # Errors
    /// [`RobotFileError`], naming the key and what is allowed.
    pub fn from_toml_str(text: &str) -> Result<Self, RobotFileError> {
        let file: RobotFile = toml::from_str(text).map_err(RobotFileError::Syntax)?;
        file.check()?;
        let tendon = |t: &TendonTable| Tendon {
            section: t.section,
            radius: t.radius_m,
            angle: t.angle_deg.to_radians(),
        };
        Ok(Self {
            name: file.name,
            section_lengths: file.section_lengths_m.0,
            bending_limit: file.bending_limit_rad,
            tube_radii: [file.tube_radius_m; SECTIONS],
            spool_radius: file.spool_radius_m,
            tendons: TendonMap::new(file.tendons.iter().map(tendon).collect())?,
            tendon_limits: TendonLimits {
                velocity: file.tendon_limits.velocity_m_s,
                acceleration: file.tendon_limits.acceleration_m_s2,
                jerk: file.tendon_limits.jerk_m_s3,
            },
        })
    }
}

impl RobotFile {
    fn check(&self) -> Result<(), RobotFileError> {
        let lengths = self.section_lengths_m.0;
        for (i, length) in lengths.into_iter().enumerate() {
            let key = format!("section_lengths_m[{i}]");
            within(&key, length, SECTION_LENGTHS_M, "m")?;
        }
        within(
            "bending_limit_rad",
            self.bending_limit_rad,
            BENDING_LIMITS_RAD,
            "rad",
        )?;
        let shortest = lengths.into_iter().fold(f64::INFINITY, f64::min);
        let allowed = "m, the length of the shortest section";
        within(
            "tube_radius_m",
            self.tube_radius_m,
            [0.0, shortest],
            allowed,
        )?;
        within("spool_radius_m", self.spool_radius_m, SMALL_RADII_M, "m")?;
        self.tendon_limits.check()?;
        let count = self.tendons.len();
        if count > MAX_TENDONS {
            return Err(RobotFileError::TendonCount { count });
        }
        for (i, tendon) in self.tendons.iter().enumerate() {
            let key = |name: &str| format!("tendons[{i}].{name}");
            within(&key("radius_m"), tendon.radius_m, SMALL_RADII_M, "m")?;
            within(&key("angle_deg"), tendon.angle_deg, ANGLES_DEG, "degrees")?;
        }
        Ok(())
    }
}

impl LimitsTable {
    fn check(&self) -> Result<(), RobotFileError> {
        for (key, value, allowed, unit) in [
            ("velocity_m_s", self.velocity_m_s, VELOCITIES_M_S, "m/s"),
            (
                "acceleration_m_s2",
                self.acceleration_m_s2,
                ACCELERATIONS_M_S2,
                "m/s²",
            ),
            ("jerk_m_s3", self.jerk_m_s3, JERKS_M_S3, "m/s³"),
        ] {
            within(&format!("tendon_limits.{key}"), value, allowed, unit)?;
        }
        Ok(())
    }
}

fn within(
    key: &str,
    value: f64,
    [least, most]: [f64; 2],
    unit: &str,
) -> Result<(), RobotFileError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(RobotFileError::Range {
        key: key.into(),
        value,
        allowed: format!("{least} to {most} {unit}"),
    })
}
