//! `pcc stop`, `pcc reset`, `pcc speed`: orders to the controller.

use crate::number::rate;
use anyhow::{Context, bail};
use clap::Args;
use client::{ClientError, ControllerView};
use rustix::process::{Pid, Signal, kill_process};
use shared_types::codes::CommandRefusal;
use shared_types::ipc::{IpcOptions, Role, RoleLock};
use shared_types::valid::Command;
use std::time::Duration;

/// How long a controller is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Arguments of `pcc speed`.
#[derive(Args)]
pub(crate) struct SpeedArguments {
    /// Rate at which the path time runs, 0 (stand still on the path) to 1.
    #[arg(value_parser = rate())]
    rate: f64,
}

/// Where the services cannot be joined (a full disk, no place left), the controller is told by a signal.
pub(crate) fn stop() -> anyhow::Result<()> {
    let result = give(Command::Stop);
    let cannot_join =
        |error: &anyhow::Error| matches!(error.downcast_ref(), Some(ClientError::Ipc(_)));
    match result {
        Err(error) if cannot_join(&error) => stop_by_signal().map_err(|_| error),
        result => result,
    }
}

fn stop_by_signal() -> anyhow::Result<()> {
    let holder = RoleLock::holder(&IpcOptions::from_env(), Role::Controller);
    let controller = holder.and_then(|pid| Pid::from_raw(pid.try_into().ok()?));
    let controller = controller.context("no controller runs here")?;
    kill_process(controller, Signal::USR1)?;
    say!(
        "the services cannot be joined: the controller, process {controller}, is told to stop by a signal, and does not reply"
    );
    Ok(())
}

pub(crate) fn reset() -> anyhow::Result<()> {
    give(Command::ResetFault)
}

pub(crate) fn speed(arguments: &SpeedArguments) -> anyhow::Result<()> {
    give(Command::SetSpeed(arguments.rate))
}

fn give(command: Command) -> anyhow::Result<()> {
    let reply = ControllerView::connect(&IpcOptions::from_env())?.command(command, PATIENCE)?;
    if reply.reason == CommandRefusal::StopPending {
        bail!("{}; the controller was {} last", reply.reason, reply.state);
    }
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
