//! `pcc stop`, `pcc reset`, `pcc speed`: orders to the controller.

use std::fmt::{self, Display, Formatter};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use client::{ClientError, ControllerView};
use rustix::process::{Pid, Signal, kill_process};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandRefusal, LoopState};
use shared_types::ipc::{IpcOptions, Role, RoleLock};
use shared_types::valid::Command;

use crate::number::real;

/// Longest wait for a reply of the controller.
const TIMEOUT: Duration = Duration::from_secs(5);
/// How long `pcc stop` waits for a reply before it sends the controller a signal as well.
const SIGNAL_AFTER: Duration = Duration::from_millis(50);

/// Message about an ordered speed of 0.
pub(crate) const STANDS_STILL: &str =
    "the controller's speed is 0: it does not move until `pcc speed` is ordered";

/// Arguments of `pcc speed`.
#[derive(Args)]
pub(crate) struct SpeedArguments {
    /// Share of a motion's own rate, 0 (stand still on the path) to 1.
    #[arg(value_parser = real(0.0, 1.0, ""))]
    pub(crate) rate: f64,
}

/// Orders a stop, and by a signal as well where the controller does not reply soon: that needs no service.
pub(crate) fn stop() -> anyhow::Result<()> {
    let (replied, no_reply) = sync_channel::<()>(0);
    let signal = thread::spawn(move || {
        let waited = no_reply.recv_timeout(SIGNAL_AFTER);
        matches!(waited, Err(RecvTimeoutError::Timeout)).then(signal_stop)
    });
    let result = send(Command::Stop);
    drop(replied);
    let signalled = signal.join().unwrap_or(None);
    let error = match result {
        Ok(mut accepted) => {
            if let Some(Ok(first)) = signalled {
                accepted.sent_ns = accepted.sent_ns.min(first.sent_ns);
            }
            say!("{accepted}");
            return Ok(());
        }
        Err(error) => error,
    };
    let was_signalled = signalled.as_ref().is_some_and(Result::is_ok);
    let may_be_stopped = error
        .downcast_ref::<Refused>()
        .is_some_and(|refused| refused.refusal == CommandRefusal::NothingToDo && was_signalled);
    if !may_be_stopped && !error.is::<ClientError>() {
        return Err(error);
    }
    let Ok(Signalled {
        controller,
        sent_ns,
    }) = signalled.unwrap_or_else(signal_stop)
    else {
        return Err(error);
    };
    say!(
        "the controller, process {controller}, was told to stop by a signal, sent at {}, to which it does not reply; by the services: {error:#}",
        seconds(sent_ns)
    );
    Ok(())
}

/// A stop that was sent by a signal.
struct Signalled {
    controller: Pid,
    /// When it was sent, nanoseconds of `CLOCK_MONOTONIC`.
    sent_ns: i64,
}

fn signal_stop() -> anyhow::Result<Signalled> {
    let holder = RoleLock::holder(&IpcOptions::from_env(), Role::Controller);
    let controller = holder.and_then(|pid| Pid::from_raw(pid.try_into().ok()?));
    let controller = controller.context("no controller runs here")?;
    let sent_ns = mono_now_ns();
    kill_process(controller, Signal::USR1)?;
    Ok(Signalled {
        controller,
        sent_ns,
    })
}

/// Orders a reset or a speed.
pub(crate) fn give(command: Command) -> anyhow::Result<()> {
    say!("{}", send(command)?);
    Ok(())
}

fn send(command: Command) -> anyhow::Result<Accepted> {
    let mut controller = ControllerView::connect(&IpcOptions::from_env())?;
    controller.prepare_to_command()?;
    let sent_ns = mono_now_ns();
    let reply = controller.command(command.because("ordered by pcc"), TIMEOUT)?;
    let replied_ns = mono_now_ns();
    if reply.refusal == CommandRefusal::StopPending {
        bail!("{}; the controller was {} last", reply.refusal, reply.state);
    }
    if !reply.accepted {
        bail!(Refused {
            refusal: reply.refusal,
            reason: reply.reason.to_string(),
        });
    }
    Ok(Accepted {
        sent_ns,
        replied_ns,
        state: reply.state,
        reason: reply.reason.to_string(),
    })
}

/// An order that the controller has refused.
#[derive(Debug, thiserror::Error)]
#[error("{refusal}: {reason}")]
struct Refused {
    refusal: CommandRefusal,
    reason: String,
}

/// An order that the controller has accepted; times are nanoseconds of `CLOCK_MONOTONIC`, the clock of every stamp of the controller.
struct Accepted {
    sent_ns: i64,
    replied_ns: i64,
    state: LoopState,
    reason: String,
}

impl Display for Accepted {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let took_ms = (self.replied_ns - self.sent_ns) as f64 * 1e-6;
        write!(
            f,
            "accepted {took_ms:.1} ms after it was sent at {}; the controller is {}: {}",
            seconds(self.sent_ns),
            self.state,
            self.reason
        )
    }
}

/// A time of `CLOCK_MONOTONIC`, given in nanoseconds, as text in seconds with every digit.
pub(crate) fn seconds(ns: i64) -> String {
    format!("{}.{:09} s", ns / 1_000_000_000, ns % 1_000_000_000)
}
