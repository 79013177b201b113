//! The paper's own generator of paths (docs/evaluation.md "The reference setting"; the paper, section IV "Training Data").
//!
//! The straight way of the tip is followed from a start to each of ten terminal solutions; a path that collides is
//! repaired; what reaches, moves in small enough steps and is clear by the sampled criterion is kept. Checked against
//! the paths of the authors' program: from the same ends it makes the same paths.
//!
//! The loops over side-by-side numbers are compiled for each kind of vectors (`fearless_simd::dispatch`). Their functions
//! are `#[inline(always)]` to take on a kind's instructions; no kind fuses or reorders operations, so the result does not
//! depend on the processor.

pub(crate) mod generator;
mod kinematics;
pub(crate) mod path_maker;
mod repair;
mod sampled;
pub(crate) mod settings;
mod solver;
mod spline;
pub(crate) mod target;
