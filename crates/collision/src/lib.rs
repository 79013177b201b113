//! Scenes of balls, the exact clearance of a robot's body, and certificates for whole motions.
//!
//! Lengths have the unit of the robot's section lengths; positions are in the robot's base frame. The body is a tube
//! of constant radius around the backbone, so clearances are exact (docs/robot.md "Exact geometry of a section").
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod bound;
mod certificate;
mod chain;
mod clearance;
mod minimum;
mod moving;
mod scene;

pub use bound::{Displacement, tracking_growth};
pub use certificate::{certify_edge, certify_polyline, certify_trajectory};
pub use chain::Verdict;
pub use clearance::Contact;
pub use minimum::minimum_clearance;
pub use moving::{MovingBall, certify_moving};
pub use scene::{Ball, MAX_BALLS, MAX_EXTENT, Scene, SceneError};
