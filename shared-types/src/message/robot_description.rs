//! The robot that processes are set up for.

use iceoryx2::prelude::ZeroCopySend;

use super::reason::write_text;
use super::wire::wire_message;
use crate::capacity::{DOF, ROBOT_NAME_BYTES, SECTIONS, TENDONS};

/// Numbers of the tendons' matrix.
const MATRIX: usize = TENDONS * DOF;

wire_message! {
    /// The robot that the daemon plans for (service `robot_description`, each second; who comes late gets the last one).
    pub struct RobotDescription: "pcc.v7.RobotDescription", 624 bytes {
        /// When it was sent, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// [`super::Heartbeat::instance`] of the sender.
        pub instance: u64,
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// Tendons in use.
        pub tendon_count: u32,
        /// Equal for equal robot files, and never 0: processes with different ones refuse each other.
        pub robot_hash: u64,
        /// The first 8 bytes of the SHA-256 of the few-step model's weights file, the first one the highest; 0: the daemon has none.
        pub weights_hash: u64,
        /// The robot's name, UTF-8, the rest zero; cut off where it is longer.
        pub name: [u8; ROBOT_NAME_BYTES],
        /// Arc length of each section, metres.
        pub section_lengths_m: [f64; SECTIONS],
        /// Radius of each section's body around its backbone, metres.
        pub tube_radii_m: [f64; SECTIONS],
        /// Largest bending angle of a section, radians.
        pub bending_limit_rad: f64,
        /// Radius of the motors' spools, metres.
        pub spool_radius_m: f64,
        /// Row by row, a row a tendon: tendon length changes are this matrix times the configuration, m/rad.
        pub tendon_matrix_m_rad: [f64; MATRIX],
        /// Largest tendon velocity, m/s.
        pub velocity_limit_m_s: f64,
        /// Largest tendon acceleration, m/s².
        pub acceleration_limit_m_s2: f64,
        /// Largest tendon jerk, m/s³.
        pub jerk_limit_m_s3: f64,
    }
}

impl RobotDescription {
    /// Sets the name, cut at the last whole character that fits.
    pub fn set_name(&mut self, name: &str) {
        self.name = [0; ROBOT_NAME_BYTES];
        write_text(name, &mut self.name);
    }
}
