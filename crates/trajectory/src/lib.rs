//! Motions of the robot in time: their one representation, and how a path becomes one.
//!
//! A motion is a list of [`Knot`]s joined by quintic Hermite segments, so position, velocity and acceleration
//! are continuous everywhere. What is planned, certified, sent and executed is this same curve.
//! [`allocate`] turns waypoints into such a motion within the tendons' limits, [`limit_use`] measures a motion
//! against them exactly, and [`rate`] slows or stops one along its own path.
//!
//! Units: radians for positions, seconds for times; tendon quantities in the length unit of the tendon map.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod curve;
mod knot;
mod segment;

pub use curve::{Trajectory, TrajectoryError, evaluate};
pub use knot::{Knot, State};
pub use segment::QuinticSegment;

pub(crate) type Configuration = nalgebra::SVector<f64, 6>;
