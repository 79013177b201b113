//! `dynamixel-robot`: drives a robot whose tendons are wound by Dynamixel servos.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Parser;
use dynamixel_robot::{DynamixelConfig, run};
use robot_driver::Shutdown;
use shared_types::ipc::IpcOptions;

/// Drives a robot whose tendons are wound by Dynamixel servos (X series, protocol 2.0), in the simulated robot's place.
///
/// It refuses set-points that the robot file does not allow, and ramps to rest by itself after 20 ms without one. It starts only where the
/// robot was homed (`pcc home`) since its servos have had power. One robot runs per prefix.
///
/// Environment: PCC_PREFIX (default pcc) and PCC_ROOT (default ~/.pcc-services where that exists, else
/// /dev/shm/pcc-UID) name the robot's shared memory; RUST_LOG sets the log level on stderr (default info). SIGTERM and
/// SIGINT end it with exit 0: the tendons ramp to rest, and the servos hold where they are.
#[derive(Parser)]
#[command(version, verbatim_doc_comment)]
struct Arguments {
    /// Configuration file (TOML; every setting is explained in the shipped one).
    #[arg(
        long,
        value_name = "FILE",
        default_value = "config/dynamixel-robot.toml"
    )]
    config: PathBuf,
}

fn main() -> ExitCode {
    logging::exit_code("dynamixel-robot", start())
}

fn start() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    logging::start().context("cannot start to log")?;
    let config = DynamixelConfig::from_file(&arguments.config)?;
    let mut shutdown = Shutdown::default();
    shutdown.ask_at_signals("robot")?;
    run(&config, &IpcOptions::from_env(), shutdown)?;
    Ok(())
}
