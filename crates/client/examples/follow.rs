//! Follows the planner's motions in the controller's place, with motors that are at once where they are to be: `follow CONTROLLER_FILE`.

use std::error::Error;
use std::path::PathBuf;

use controller::service::{ControllerConfig, Follower};
use robot_driver::TendonState;
use shared_types::codes::MotorFault;
use shared_types::ipc::IpcOptions;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(file) = std::env::args().nth(1) else {
        eprintln!("usage: follow CONTROLLER_FILE");
        std::process::exit(2);
    };
    let config = ControllerConfig::from_file(&PathBuf::from(file))?;
    let motors = TendonState::default();
    let mut follower = Follower::open(config, &IpcOptions::from_env(), &motors)?;
    follower.shut_down_at_signals()?;
    while let Some(cycle) = follower.next_cycle() {
        follower.report(&cycle.targets.position_m, MotorFault::None);
    }
    Ok(())
}
