//! Piecewise-constant-curvature model of a three-section continuum robot (Webster & Jones 2010; the paper, section III).
//!
//! A configuration ζ holds, for each section, the pair ξ_i = θ_i (−sin φ_i, cos φ_i) in radians: its norm is the
//! section's bending angle, and the straight shape ζ = 0 is regular. Lengths have the unit of the section lengths.
//! Positions and Jacobians are in the robot's base frame.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod arc;
mod backbone;
mod lanes;
mod limits;
mod numbers;
mod robot;
mod robot_file;
mod section;
mod tendons;
mod tips;

pub use arc::Nearest;
pub use backbone::{Backbone, Pose};
pub use lanes::{LANES, norms_squared, one_by_one, side_by_side};
pub use numbers::Numbers;
pub use robot::{Robot, TendonLimits};
pub use robot_file::RobotFileError;
pub use tendons::{Tendon, TendonMap, TendonMapError};
pub use tips::MovingTips;

/// Number of sections.
pub const SECTIONS: usize = 3;
/// Tendons that a robot may have: as many as the messages between the processes carry.
pub const MAX_TENDONS: usize = 9;
/// Number of configuration components: two a section.
pub const DOF: usize = 2 * SECTIONS;

/// A configuration `[ξ11, ξ12, ξ21, ξ22, ξ31, ξ32]`, radians.
pub type Configuration = nalgebra::SVector<f64, DOF>;
/// A position or a direction in the base frame.
pub type Point = nalgebra::Vector3<f64>;
