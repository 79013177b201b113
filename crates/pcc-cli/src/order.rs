//! `pcc stop`, `pcc reset`, `pcc speed`: orders to the controller.

use anyhow::bail;
use clap::Args;
use client::ControllerView;
use shared_types::ipc::IpcOptions;
use shared_types::valid::Command;
use std::time::Duration;

/// How long a controller is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Arguments of `pcc speed`.
#[derive(Args)]
pub(crate) struct SpeedArguments {
    /// Rate at which the path time runs, 0 (stand still on the path) to 1.
    #[arg(allow_negative_numbers = true)]
    rate: f64,
}

pub(crate) fn stop() -> anyhow::Result<()> {
    give(Command::Stop)
}

pub(crate) fn reset() -> anyhow::Result<()> {
    give(Command::ResetFault)
}

pub(crate) fn speed(arguments: &SpeedArguments) -> anyhow::Result<()> {
    give(Command::SetSpeed(arguments.rate))
}

fn give(command: Command) -> anyhow::Result<()> {
    let reply = ControllerView::connect(&IpcOptions::from_env())?.command(command, PATIENCE)?;
    if !reply.accepted {
        bail!(
            "the controller, which is {}, refuses: {}",
            reply.state,
            reply.reason
        );
    }
    say!("accepted; the controller is {}", reply.state);
    Ok(())
}
