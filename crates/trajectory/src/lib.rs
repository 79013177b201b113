//! Motions of the robot in time: their one representation, and how a path becomes one.
//!
//! A motion is a list of [`Knot`]s joined by quintic Hermite segments, so position, velocity and acceleration
//! are continuous everywhere. What is planned, certified, sent and executed is this same curve.
//! [`TimeParameterizer`] turns waypoints into such a motion within the tendons' limits, [`limit_use`] measures a motion
//! against them exactly, and a [`RateLaw`] slows or stops one along its own path.
//!
//! Units: radians for positions, seconds for times; tendon quantities in the length unit of the tendon map.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod curve;
mod limits;
mod parameterize;
mod scaling;

pub use curve::knot::{Knot, State};
pub use curve::segment::QuinticSegment;
pub use curve::trajectory::{Trajectory, TrajectoryError, evaluate};
pub use limits::limit_use::{LimitUse, limit_use};
pub use parameterize::in_motion::MovingStart;
pub use parameterize::options::{MAX_KNOTS, ParameterizationError, ParameterizationOptions};
pub use parameterize::time_parameterizer::TimeParameterizer;
pub use scaling::rate_law::{BRAKING_SHARE, Playback, RateLaw, RateStep};
pub use scaling::stopping::{STOPPING_KNOTS, StoppingError, stopping_motion};

#[cfg(test)]
mod test_paths;
