//! The simulated robot: motors with limits, backlash and noise behind a driver's checked set-points, in a process of its own.

mod config;
mod motor;
mod pose_memory;
mod service;
mod simulated_motors;

pub use config::RobotConfig;
pub use motor::{Motor, MotorLimits, MotorTarget};
pub use pose_memory::PoseMemory;
pub use service::{Switches, run};
pub use simulated_motors::SimulatedMotors;
