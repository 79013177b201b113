//! The state and the measurements of the robot.

use iceoryx2::prelude::ZeroCopySend;

use super::wire::wire_message;
use crate::capacity::{DOF, TENDONS};

wire_message! {
    /// State of the motor end (service `robot_state`, one publisher: the robot, 1 kHz).
    pub struct RobotState: "pcc.v7.RobotState", 312 bytes {
        /// Counts the publisher's states, from 1.
        pub sequence: u64,
        /// Time of the measurement, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// [`super::RobotDescription::robot_hash`] of the robot that this is; the controller of another one does not take hold of it.
        pub robot_hash: u64,
        /// Sequence of the last accepted set-point; 0: none yet.
        pub accepted_sequence: u64,
        /// [`crate::codes::MotorState`].
        pub state: u32,
        /// [`crate::codes::MotorFault`]: with another one than none and injected the robot is in fault, whatever its state.
        pub fault: u32,
        /// The robot's own reference, metres: the last accepted set-point, or where its ramp to rest has led since.
        pub accepted_setpoint_m: [f64; TENDONS],
        /// Velocity of the robot's own reference, m/s.
        pub accepted_velocity_m_s: [f64; TENDONS],
        /// Measured tendon length changes, metres.
        pub measured_tendon_m: [f64; TENDONS],
        /// Configuration that the measured tendons mean, radians.
        pub measured_configuration_rad: [f64; DOF],
        /// Times that the robot ramped to rest by itself: set-points stayed away or broke a rule, its driver was shut down, or its motors moved when it began.
        pub ramps_to_rest: u32,
        /// Set-points that the robot refused.
        pub rejected_setpoints: u32,
    }
}
