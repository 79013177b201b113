//! Motions of the robot in time: their one representation, and how a path becomes one.
//!
//! A motion is a list of [`Knot`]s joined by quintic Hermite segments, so position, velocity and acceleration
//! are continuous everywhere. What is planned, certified, sent and executed is this same curve.
//! [`allocate`] turns waypoints into such a motion within the tendons' limits, [`limit_use`] measures a motion
//! against them exactly, and a [`RateLaw`] slows or stops one along its own path.
//!
//! Units: radians for positions, seconds for times; tendon quantities in the length unit of the tendon map.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod allocation;
mod curve;
mod jerk;
mod knot;
mod limit_use;
mod placement;
mod rate;
mod segment;
mod spline;
mod stopping;
mod tendon;
mod tendon_path;
mod topp;
mod width;

pub use allocation::{
    AllocationError, AllocationOptions, Allocator, End, EndMotion, EndMotions, MAX_KNOTS, allocate,
};
pub use curve::{Trajectory, TrajectoryError, evaluate};
pub use knot::{Knot, State};
pub use limit_use::{LimitUse, limit_use};
pub use rate::{BRAKING_SHARE, Playback, RateLaw, RateStep};
pub use segment::QuinticSegment;
pub use stopping::{StoppingError, stopping_motion};

#[cfg(test)]
mod test_paths;
