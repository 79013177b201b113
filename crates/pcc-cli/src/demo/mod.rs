//! `pcc demo`: the paper's three hardware experiments, and one with a target that moves, on a running daemon, controller and robot.

mod controller_state;
mod followed;
mod kept_goal;
mod mission;
mod motion;
mod moving;
mod obstacles;
mod recording;
mod session;

pub(crate) use mission::BALL;

use crate::number::any;
use crate::output_files::{make_writable, refuse_existing};
use clap::Args;
use pcc_model::Robot;
use shared_types::ipc::IpcOptions;
use std::path::PathBuf;

/// Arguments of `pcc demo`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Keep recording.npz, scene.json and demo.json in this folder, which has none yet.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Robot file; the same that the daemon and the controller use.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// Seed of the plans (0 to 2^64 - 1).
    #[arg(long, default_value_t = 0, value_parser = any())]
    seed: u64,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let robot = Robot::from_file(&arguments.robot)?;
    if let Some(folder) = &arguments.record {
        refuse_existing(folder, &recording::FILES)?;
        make_writable(folder)?;
    }
    let options = IpcOptions::from_env();
    let mut mission = mission::Mission::begin(&robot, &options, arguments.seed)?;
    let outcome = mission.carry_out();
    mission.end(&outcome);
    let outcome = outcome.and(mission.take_leave());
    if let Some(folder) = &arguments.record {
        mission.save(folder)?;
        say!("recording in {}", folder.display());
    }
    outcome
}
