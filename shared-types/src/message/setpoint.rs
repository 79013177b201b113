//! The set-point of the motors.

use iceoryx2::prelude::ZeroCopySend;

use super::wire::wire_message;
use crate::capacity::TENDONS;

wire_message! {
    /// Tendon set-point (service `setpoint`, one publisher: the controller's loop, every cycle).
    pub struct Setpoint: "pcc.v7.Setpoint", 240 bytes {
        /// Counts the publisher's set-points, from 1.
        pub sequence: u64,
        /// Time at which the trajectory was evaluated, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// The executing trajectory; 0: none.
        pub trajectory_id: u32,
        /// [`crate::codes::LoopState`] of the controller.
        pub state: u32,
        /// Tendon length changes against the straight robot, metres.
        pub position_m: [f64; TENDONS],
        /// Velocities of the tendons, m/s.
        pub velocity_m_s: [f64; TENDONS],
        /// Accelerations of the tendons, m/s².
        pub acceleration_m_s2: [f64; TENDONS],
    }
}
