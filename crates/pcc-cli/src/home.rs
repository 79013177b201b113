//! `pcc home`: where the servos of a robot are while it is straight.

use clap::Args;
use dynamixel_robot::{DynamixelConfig, home};
use shared_types::ipc::IpcOptions;
use std::path::PathBuf;

/// Arguments of `pcc home`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Configuration file of `dynamixel-robot`.
    #[arg(
        long,
        value_name = "FILE",
        default_value = "config/dynamixel-robot.toml"
    )]
    config: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let config = DynamixelConfig::from_file(&arguments.config)?;
    say!("the tendons are wound to their pre-tension: the robot must be straight and free");
    home(&config, &IpcOptions::from_env())?;
    say!("home; the servos hold the robot straight");
    Ok(())
}
