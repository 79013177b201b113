//! Tendon lengths: linear in the configuration (docs/robot.md "Tendons").

use crate::{Configuration, DOF, SECTIONS};
use nalgebra::DMatrix;
use thiserror::Error;

/// One tendon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tendon {
    /// Section that the tendon ends in, 1 to 3.
    pub section: usize,
    /// Distance from the backbone, in the length unit of the map.
    pub radius: f64,
    /// Angle ψ about the base axis, rad.
    pub angle: f64,
}

/// Why tendons do not make a map.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TendonMapError {
    /// A tendon's section does not exist.
    #[error("`section` of tendon {tendon} is {section}; 1 to {SECTIONS} are allowed")]
    Section {
        /// Index of the tendon, from 1.
        tendon: usize,
        /// The section that the tendon names.
        section: usize,
    },
    /// A tendon's radius or angle is not usable.
    #[error(
        "tendon {tendon} has radius {radius} and angle {angle}; a finite radius above 0 and a finite angle are allowed"
    )]
    Placement {
        /// Index of the tendon, from 1.
        tendon: usize,
        /// The tendon's radius.
        radius: f64,
        /// The tendon's angle, rad.
        angle: f64,
    },
    /// The tendons do not determine the configuration.
    #[error(
        "the `tendons` determine only {rank} of the {DOF} bending components; at least two tendons a section, not opposite each other, are needed"
    )]
    Rank {
        /// Rank of the map.
        rank: usize,
    },
}

/// The map Δl = A ζ of tendon length changes; positive Δl is a longer tendon.
#[derive(Clone, Debug, PartialEq)]
pub struct TendonMap {
    tendons: Vec<Tendon>,
    matrix: DMatrix<f64>,
    pseudo_inverse: DMatrix<f64>,
}

impl TendonMap {
    /// Builds the map and its pseudo-inverse.
    ///
    /// # Errors
    /// [`TendonMapError`], naming the tendon and what is allowed.
    pub fn new(tendons: Vec<Tendon>) -> Result<Self, TendonMapError> {
        for (index, t) in tendons.iter().enumerate() {
            let tendon = index + 1;
            if !(1..=SECTIONS).contains(&t.section) {
                return Err(TendonMapError::Section {
                    tendon,
                    section: t.section,
                });
            }
            if !(t.radius.is_finite() && t.radius > 0.0 && t.angle.is_finite()) {
                return Err(TendonMapError::Placement {
                    tendon,
                    radius: t.radius,
                    angle: t.angle,
                });
            }
        }
        let matrix = DMatrix::from_fn(tendons.len(), DOF, |j, k| coefficient(&tendons[j], k));
        let rank = if tendons.is_empty() {
            0
        } else {
            matrix.rank(1e-9 * matrix.amax())
        };
        if rank < DOF {
            return Err(TendonMapError::Rank { rank });
        }
        let pseudo_inverse = matrix
            .clone()
            .pseudo_inverse(1e-12 * matrix.amax())
            .map_err(|_| TendonMapError::Rank { rank })?;
        Ok(Self {
            tendons,
            matrix,
            pseudo_inverse,
        })
    }

    /// The tendons, in the order of the lengths.
    #[must_use]
    pub fn tendons(&self) -> &[Tendon] {
        &self.tendons
    }

    /// Number of tendons.
    #[must_use]
    pub fn count(&self) -> usize {
        self.tendons.len()
    }

    /// The map A: tendons × 6, length unit per radian.
    #[must_use]
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// The pseudo-inverse A⁺: 6 × tendons, rad per length unit.
    #[must_use]
    pub fn pseudo_inverse(&self) -> &DMatrix<f64> {
        &self.pseudo_inverse
    }

    /// Writes Δl = A ζ (or its time derivatives for those of ζ) into `out`, one number a tendon; allocates nothing.
    ///
    /// Only as many tendons are written as `out` has room for; what it has beyond [`Self::count`] stays.
    pub fn lengths(&self, configuration: &Configuration, out: &mut [f64]) {
        for (j, length) in out.iter_mut().enumerate().take(self.count()) {
            *length = self.length(j, configuration);
        }
    }

    /// The length change of one tendon.
    fn length(&self, tendon: usize, configuration: &Configuration) -> f64 {
        (0..DOF)
            .map(|k| self.matrix[(tendon, k)] * configuration[k])
            .sum()
    }

    /// ζ = A⁺ Δl, rad: the configuration that fits the lengths best; allocates nothing.
    ///
    /// # Panics
    /// If there are more lengths than tendons.
    #[must_use]
    pub fn configuration(&self, lengths: &[f64]) -> Configuration {
        Configuration::from_fn(|k, _| {
            lengths
                .iter()
                .enumerate()
                .map(|(j, l)| self.pseudo_inverse[(k, j)] * l)
                .sum()
        })
    }

    /// ‖(I − A A⁺) Δl‖, a length: how far tendon lengths are from those of every configuration, as with a slack or broken tendon.
    ///
    /// # Panics
    /// If there are more lengths than tendons.
    #[must_use]
    pub fn slack_residual(&self, lengths: &[f64]) -> f64 {
        let configuration = self.configuration(lengths);
        lengths
            .iter()
            .enumerate()
            .map(|(j, l)| (l - self.length(j, &configuration)).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

fn coefficient(tendon: &Tendon, component: usize) -> f64 {
    if component / 2 >= tendon.section {
        return 0.0;
    }
    let direction = if component.is_multiple_of(2) {
        tendon.angle.sin()
    } else {
        -tendon.angle.cos()
    };
    tendon.radius * direction
}
