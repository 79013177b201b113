//! The paper's own generator of paths (docs/evaluation.md "The reference setting"; the paper, section IV "Training Data").
//!
//! The straight way of the tip is followed from a start to each of ten terminal solutions; a path that collides is
//! repaired; what reaches, moves in small enough steps and is clear by the sampled criterion is kept. Checked against
//! the paths of the authors' program: from the same ends it makes the same paths.

mod dispatch;
pub(crate) mod generator;
mod kinematics;
mod repair;
pub(crate) mod report;
mod sampled;
pub(crate) mod settings;
mod solver;
mod spline;
pub(crate) mod target;
