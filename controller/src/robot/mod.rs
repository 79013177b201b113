//! The simulated robot: motors with limits, backlash and noise behind checked set-points, in a process of its own.

mod config;
mod motor;
mod pose_memory;
mod reference;
mod service;
mod setpoint;
mod simulated_robot;

pub use config::RobotConfig;
pub use motor::{Motor, MotorLimits, MotorTarget};
pub use pose_memory::{PoseMemory, RememberedPose};
pub use reference::{FAULT_SILENCE_NS, Reference};
pub use service::{Switches, run};
pub use setpoint::{Mode, ReferenceLimits, Refusal};
pub use simulated_robot::{Measurement, SimulatedRobot};
