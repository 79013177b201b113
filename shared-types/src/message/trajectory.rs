//! A timed motion: what the planner answers and what the controller follows.

use iceoryx2::prelude::ZeroCopySend;

use super::wire::wire_message;
use crate::capacity::{DOF, MAX_KNOTS};

wire_message! {
    /// One knot of a motion; neighbours are joined by quintic Hermite segments.
    pub struct Knot: "pcc.v7.Knot", 152 bytes {
        /// Time since the motion's begin, seconds.
        pub time_s: f64,
        /// Configuration ζ, radians: (x, y) bending components of sections 1, 2, 3.
        pub configuration_rad: [f64; DOF],
        /// First derivative of the configuration by time, rad/s.
        pub velocity_rad_s: [f64; DOF],
        /// Second derivative of the configuration by time, rad/s².
        pub acceleration_rad_s2: [f64; DOF],
    }
}

wire_message! {
    /// What the controller is to execute (service `trajectory`, history 1).
    pub struct TrajectoryMessage: "pcc.v7.TrajectoryMessage", 39000 bytes {
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// Names this trajectory in the controller's state; at least 1, and none that was used in the 497 days before.
        pub trajectory_id: u32,
        /// The plan that the motion was selected from.
        pub plan_id: u64,
        /// [`super::ControllerState::instance`] of the controller that is to execute it; every other one refuses it.
        pub controller_instance: u64,
        /// [`super::Heartbeat::instance`] of the daemon that publishes and supervises it. A controller that receives
        /// another daemon's heartbeats refuses it: nothing would stop it for an obstacle.
        pub daemon_instance: u64,
        /// [`super::RobotDescription::robot_hash`] of the robot that it is planned for; a controller of another one refuses it.
        pub robot_hash: u64,
        /// When the sender of the request was asked for it, nanoseconds of `CLOCK_MONOTONIC`. What was requested before the last stop,
        /// the last reset or the controller's start is refused.
        pub requested_mono_ns: i64,
        /// When the motion begins, nanoseconds of `CLOCK_MONOTONIC`; where it leaves another one, when that is expected.
        pub begin_mono_ns: i64,
        /// [`crate::codes::MotionStart`].
        pub start: u32,
        /// The trajectory that it leaves, where it begins in motion; else 0. It is refused unless that one is executed.
        pub leaves_trajectory_id: u32,
        /// Path time of that trajectory at which it is left, seconds; there this one's path time is 0, and both have the same
        /// position, velocity and acceleration by path time, to 1e-9.
        pub leaves_at_s: f64,
        /// Knots in use, 2..=256.
        pub knot_count: u32,
        /// The draw that the motion is of, as in the candidate's summary in the answer.
        pub draw: u32,
        /// Tracking error that the certificate covers, radians (Euclidean norm of the configuration error).
        pub path_tolerance_rad: f64,
        /// The first `knot_count` are the motion; the others are not read.
        pub knots: [Knot; MAX_KNOTS],
    }
}
