//! A robot whose motors are at once where they are to be: `drive ROBOT_FILE`.

use std::error::Error;
use std::path::PathBuf;

use pcc_model::Robot;
use robot_driver::{DriverSettings, RobotConnection, TendonState};
use shared_types::codes::MotorFault;
use shared_types::ipc::IpcOptions;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(file) = std::env::args().nth(1) else {
        eprintln!("usage: drive ROBOT_FILE");
        std::process::exit(2);
    };
    let robot = Robot::from_file(&PathBuf::from(file))?;
    let settings = DriverSettings::of(&robot);
    let connection = RobotConnection::open(&IpcOptions::from_env(), &robot, &settings)?;
    let mut driver = connection.drive_from(&TendonState::default());
    driver.shut_down_at_signals()?;
    while let Some(targets) = driver.next_targets() {
        driver.report(&targets.position_m, MotorFault::None);
    }
    Ok(())
}
