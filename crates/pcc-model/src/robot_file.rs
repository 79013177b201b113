//! Robot files: TOML in SI units, unknown keys refused.

use crate::SECTIONS;
use crate::robot::{Robot, TendonLimits};
use crate::tendons::{Tendon, TendonMap, TendonMapError};
use serde::Deserialize;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Lengths that a section may have, m: beyond them distances and scaled quantities lose their digits.
const SECTION_LENGTHS_M: [f64; 2] = [1e-4, 1e3];
/// Distances of a tendon from the backbone, m.
const TENDON_RADII_M: [f64; 2] = [1e-6, 1e3];

/// Why a robot file is refused.
#[derive(Debug, Error)]
pub enum RobotFileError {
    /// The file cannot be read.
    #[error("cannot read robot file {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// Not TOML, a key missing or unknown, or a value of the wrong type.
    #[error("robot file is not understood: {0}")]
    Syntax(#[from] toml::de::Error),
    /// A quantity is out of its range.
    #[error("{key} = {value} is not allowed: {allowed}")]
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The tendons do not fit.
    #[error(transparent)]
    Tendons(#[from] TendonMapError),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    name: String,
    section_lengths_m: [f64; SECTIONS],
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
    /// [`RobotFileError`], naming the key and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, RobotFileError> {
        let text = std::fs::read_to_string(path).map_err(|source| RobotFileError::Read {
            path: path.into(),
            source,
        })?;
        Self::from_toml_str(&text)
    }

    /// Reads a robot from the text of a robot file; lengths are metres.
    ///
    /// # Errors
    /// [`RobotFileError`], naming the key and what is allowed.
    pub fn from_toml_str(text: &str) -> Result<Self, RobotFileError> {
        let file: RobotFile = toml::from_str(text)?;
        file.check()?;
        let tendon = |t: &TendonTable| Tendon {
            section: t.section,
            radius: t.radius_m,
            angle: t.angle_deg.to_radians(),
        };
        Ok(Self {
            name: file.name,
            section_lengths: file.section_lengths_m,
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
        for length in self.section_lengths_m {
            check(
                "section_lengths_m",
                length,
                |v| is_within(v, SECTION_LENGTHS_M),
                "0.0001 to 1000 m",
            )?;
        }
        // The map refuses a radius that is not above 0, by the tendon's number.
        for radius in self.tendons.iter().map(|t| t.radius_m).filter(|r| *r > 0.0) {
            check(
                "tendons.radius_m",
                radius,
                |v| is_within(v, TENDON_RADII_M),
                "0.000001 to 1000 m",
            )?;
        }
        positive("spool_radius_m", self.spool_radius_m)?;
        positive(
            "tendon_limits.velocity_m_s",
            self.tendon_limits.velocity_m_s,
        )?;
        positive(
            "tendon_limits.acceleration_m_s2",
            self.tendon_limits.acceleration_m_s2,
        )?;
        positive("tendon_limits.jerk_m_s3", self.tendon_limits.jerk_m_s3)?;
        check(
            "tube_radius_m",
            self.tube_radius_m,
            |v| v >= 0.0,
            "a finite radius of at least 0 m",
        )?;
        check(
            "bending_limit_rad",
            self.bending_limit_rad,
            |v| v > 0.0 && v <= PI,
            "above 0 and at most π rad",
        )
    }
}

fn is_within(value: f64, [least, most]: [f64; 2]) -> bool {
    (least..=most).contains(&value)
}

fn positive(key: &'static str, value: f64) -> Result<(), RobotFileError> {
    check(key, value, |v| v > 0.0, "a finite value above 0")
}

fn check(
    key: &'static str,
    value: f64,
    is_allowed: impl Fn(f64) -> bool,
    allowed: &'static str,
) -> Result<(), RobotFileError> {
    if value.is_finite() && is_allowed(value) {
        Ok(())
    } else {
        Err(RobotFileError::Range {
            key,
            value,
            allowed,
        })
    }
}
