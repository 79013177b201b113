//! Piecewise-constant-curvature model of a three-section continuum robot (Webster & Jones 2010; the paper, section III).
//!
//! A configuration ζ holds, for each section, the pair ξ_i = θ_i (−sin φ_i, cos φ_i) in radians: its norm is the
//! section's bending angle, and the straight configuration ζ = 0 is regular. Lengths have the unit of the section lengths.
//! Positions and Jacobians are in the robot's base frame.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod arc;
mod backbone;
mod bit_hash;
mod dimensions;
mod lanes;
mod limits;
mod numbers;
mod robot;
mod robot_file;
mod section;
mod tendons;
mod tips;
mod unit_robot;

pub use arc::Nearest;
pub use backbone::{Backbone, Pose};
pub use bit_hash::BitHash;
pub use dimensions::{Configuration, DOF, MAX_TENDONS, Point, SECTIONS};
pub use lanes::{LANES, norms_squared, one_by_one, side_by_side};
pub use numbers::Numbers;
pub use robot::{Robot, TendonLimits};
pub use robot_file::RobotFileError;
pub use tendons::{Tendon, TendonMap, TendonMapError};
pub use tips::MovingTips;
pub use unit_robot::UnitRobot;
