//! How far body points can move when the configuration changes (ROBOT "A certificate for whole motions").

use pcc_model::{Configuration, Robot, SECTIONS};
use std::ops::Add;

/// Upper bounds Λ_k of the displacement of any point of each section.
///
/// For a point at fraction σ of section k, a turn |Δξ_i| of a section i before it moves it by at most
/// |Δξ_i| times the length of backbone beyond the middle of section i; its own section contributes |Δξ_k| L_k σ²/2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Bound of each section, σ = 1.
    pub sections: [f64; SECTIONS],
}

impl Displacement {
    /// No motion.
    pub(crate) const NONE: Self = Self {
        sections: [0.0; SECTIONS],
    };

    /// The bounds for path lengths (rad) of the three bending pairs.
    #[must_use]
    pub fn of_turns(robot: &Robot, turns: [f64; SECTIONS]) -> Self {
        let lengths = &robot.section_lengths;
        let bound = |k: usize| -> f64 {
            (0..=k)
                .map(|i| turns[i] * (0.5 * lengths[i] + lengths[i + 1..=k].iter().sum::<f64>()))
                .sum()
        };
        Self {
            sections: std::array::from_fn(bound),
        }
    }

    /// The bounds for a straight move between two configurations.
    #[must_use]
    pub fn of_edge(robot: &Robot, a: &Configuration, b: &Configuration) -> Self {
        Self::of_turns(robot, turns(&(b - a)))
    }

    /// The largest of the bounds.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.sections.into_iter().fold(0.0, f64::max)
    }
}

impl Add for Displacement {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            sections: std::array::from_fn(|k| self.sections[k] + other.sections[k]),
        }
    }
}

/// Norm of each bending pair.
pub(crate) fn turns(change: &Configuration) -> [f64; SECTIONS] {
    std::array::from_fn(|i| change[2 * i].hypot(change[2 * i + 1]))
}

/// How much the tube must grow so that a body within `path_tolerance_rad` (each bending pair) of the path stays inside.
#[must_use]
pub fn tracking_growth(robot: &Robot, path_tolerance_rad: f64) -> f64 {
    Displacement::of_turns(robot, [path_tolerance_rad; SECTIONS]).largest()
}
