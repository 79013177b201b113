//! What the driver of a robot's motors needs: set-points from the controller, checked and extrapolated, and `robot_state` in return.
//!
//! [`RobotConnection::open`] joins the robot's place, [`RobotConnection::drive_from`] says where the motors stand, and then each cycle asks
//! [`RobotDriver::next_targets`] what the motors are to do and tells [`RobotDriver::report`] what they did:
//!
//! ```no_run
//! # use pcc_model::Robot;
//! # use robot_driver::{DriverSettings, RobotConnection, TendonState};
//! # use shared_types::{codes::MotorFault, ipc::{IpcError, IpcOptions}};
//! # fn drive(robot: &Robot, mut motors: impl FnMut(&[f64; 9]) -> [f64; 9]) -> Result<(), IpcError> {
//! let connection = RobotConnection::open(&IpcOptions::from_env(), robot, &DriverSettings::of(robot))?;
//! let mut driver = connection.drive_from(&TendonState::default());
//! driver.shut_down_at_signals()?;
//! while let Some(targets) = driver.next_targets() {
//!     let measured_m = motors(&targets.position_m);
//!     driver.report(&measured_m, MotorFault::None);
//! }
//! # Ok(())
//! # }
//! ```

mod config;
mod driven_robot;
mod driver;
mod reference;
mod setpoint;
mod shared_memory;
mod shutdown;
mod tendon_vector;

pub use config::{ConfigError, check_loop, robot_of};
pub use driven_robot::{DrivenRobot, off_configuration_m};
pub use driver::{DriverSettings, RobotConnection, RobotDriver};
pub use reference::{FAULT_SILENCE_NS, Reference};
pub use setpoint::{Mode, MotorTargets, ReferenceLimits, Refusal, TendonState, longest_cycle_ns};
pub use shared_memory::claim_shared_memory;
pub use shutdown::{Shutdown, no_handler};
pub use tendon_vector::{TENDONS, TendonVector};
