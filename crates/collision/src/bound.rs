//! How far body points can move when the configuration changes (docs/robot.md "A certificate for whole motions").

use pcc_model::{Configuration, Robot, SECTIONS};
use trajectory::QuinticSegment;

/// Upper bounds Λ_k of the displacement of any point of each section.
///
/// With p = L ∫₀^σ exp(u ξ̂) e₃ du and a right Jacobian of SO(3) of norm at most 1, a change δξ_i moves the end of
/// section i by at most |δξ_i| L_i/2 and turns what follows by at most |δξ_i|. A point at fraction σ of section k
/// therefore moves by at most Σ_{i<k} |δξ_i| (L_i/2 + Σ_{i<j<k} L_j + σ L_k) + |δξ_k| L_k σ²/2, which grows with σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Bound of each section, σ = 1.
    pub sections: [f64; SECTIONS],
}

impl Displacement {
    /// The bounds for ways of these lengths (rad) of the three bending pairs.
    #[must_use]
    pub fn of_turns(robot: &Robot, turns: [f64; SECTIONS]) -> Self {
        let (mut swept, mut turned) = (0.0, 0.0);
        let sections = std::array::from_fn(|k| {
            let length = robot.section_lengths[k];
            swept += turned * length + turns[k] * (0.5 * length);
            turned += turns[k];
            swept
        });
        Self { sections }
    }

    /// The bounds for a straight move between two configurations.
    #[must_use]
    pub fn of_edge(robot: &Robot, a: &Configuration, b: &Configuration) -> Self {
        Self::of_turns(robot, turns(&(b - a)))
    }
}

/// Norm of each bending pair.
fn turns(change: &Configuration) -> [f64; SECTIONS] {
    std::array::from_fn(|i| {
        let (x, y) = (change[2 * i], change[2 * i + 1]);
        (x * x + y * y).sqrt()
    })
}

/// Upper bounds of the lengths (rad) of the ways of the three bending pairs along a curve.
///
/// A Bézier curve is never longer than its control polygon: the mean norm of the derivative's control values times
/// the duration.
pub(crate) fn curve_turns(curve: &QuinticSegment) -> [f64; SECTIONS] {
    curve.control.windows(2).fold([0.0; SECTIONS], |sum, pair| {
        add(sum, turns(&(pair[1] - pair[0])))
    })
}

pub(crate) fn add(a: [f64; SECTIONS], b: [f64; SECTIONS]) -> [f64; SECTIONS] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// How much the tube must grow so that a body within `path_tolerance_rad` (each bending pair) of the path stays inside.
#[must_use]
pub fn tracking_growth(robot: &Robot, path_tolerance_rad: f64) -> f64 {
    let displacement = Displacement::of_turns(robot, [path_tolerance_rad; SECTIONS]);
    displacement.sections.into_iter().fold(0.0, f64::max)
}
