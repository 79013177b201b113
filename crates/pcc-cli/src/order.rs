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
    rate: f64,
}

/// Orders a stop, and by a signal as well where the controller does not reply soon: that needs no service.
pub(crate) fn stop() -> anyhow::Result<()> {
    let (replied, no_reply) = sync_channel::<()>(0);
    let signal = thread::spawn(move || {
        let waited = no_reply.recv_timeout(SIGNAL_AFTER);
        matches!(waited, Err(RecvTimeoutError::Timeout)).then(signal_stop)
    });
    let result = give(Command::Stop);
    drop(replied);
    let signalled = signal.join().unwrap_or(None);
    let error = match result {
        Ok(accepted) => {
            let first = signalled
                .and_then(Result::ok)
                .map(|signalled| signalled.sent);
            say!("{}", accepted.first_sent(first));
            return Ok(());
        }
        Err(error) => error,
    };
    let was_signalled = signalled.as_ref().is_some_and(Result::is_ok);
    let may_be_stopped = error
        .downcast_ref::<Refused>()
        .is_some_and(|refused| refused.reason == CommandRefusal::NothingToDo && was_signalled);
    if !may_be_stopped && !error.is::<ClientError>() {
        return Err(error);
    }
    let Ok(signalled) = signalled.unwrap_or_else(signal_stop) else {
        return Err(error);
    };
    say!("{signalled}; by the services: {error:#}");
    Ok(())
}

/// A stop that was sent by a signal.
struct Signalled {
    controller: Pid,
    sent: Sent,
}

impl Display for Signalled {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { controller, sent } = self;
        write!(
            f,
            "the controller, process {controller}, was told to stop by a signal, {sent}, to which it does not reply"
        )
    }
}

fn signal_stop() -> anyhow::Result<Signalled> {
    let holder = RoleLock::holder(&IpcOptions::from_env(), Role::Controller);
    let controller = holder.and_then(|pid| Pid::from_raw(pid.try_into().ok()?));
    let controller = controller.context("no controller runs here")?;
    let sent = Sent::now();
    kill_process(controller, Signal::USR1)?;
    Ok(Signalled { controller, sent })
}

pub(crate) fn reset() -> anyhow::Result<()> {
    say!("{}", give(Command::ResetFault)?);
    Ok(())
}

pub(crate) fn speed(arguments: &SpeedArguments) -> anyhow::Result<()> {
    say!("{}", give(Command::SetSpeed(arguments.rate))?);
    Ok(())
}

fn give(command: Command) -> anyhow::Result<Accepted> {
    let mut controller = ControllerView::connect(&IpcOptions::from_env())?;
    controller.prepare_to_command()?;
    let sent = Sent::now();
    let reply = controller.command(command, TIMEOUT)?;
    let took_ms = sent.elapsed_ms();
    if reply.reason == CommandRefusal::StopPending {
        bail!("{}; the controller was {} last", reply.reason, reply.state);
    }
    if !reply.accepted {
        let (state, reason) = (reply.state, reply.reason);
        bail!(Refused { state, reason });
    }
    Ok(Accepted {
        sent,
        took_ms,
        state: reply.state,
    })
}

/// An order that the controller has refused.
#[derive(Debug, thiserror::Error)]
#[error("the controller, which is {state}, refuses: {reason}")]
struct Refused {
    state: LoopState,
    reason: CommandRefusal,
}

/// An order that the controller has accepted.
struct Accepted {
    sent: Sent,
    took_ms: f64,
    state: LoopState,
}

impl Accepted {
    /// The same reply, with its time counted from `before` where the order was sent earlier in another way.
    fn first_sent(self, before: Option<Sent>) -> Self {
        let Some(before) = before.filter(|before| before.0 < self.sent.0) else {
            return self;
        };
        Self {
            took_ms: self.took_ms + (self.sent.0 - before.0) as f64 * 1e-6,
            sent: before,
            state: self.state,
        }
    }
}

impl Display for Accepted {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            sent,
            took_ms,
            state,
        } = self;
        write!(
            f,
            "accepted {took_ms:.1} ms after it was {sent}; the controller is {state}"
        )
    }
}

/// When an order was sent, nanoseconds of `CLOCK_MONOTONIC`, the clock of every stamp of the controller.
struct Sent(i64);

impl Sent {
    fn now() -> Self {
        Self(mono_now_ns())
    }

    fn elapsed_ms(&self) -> f64 {
        (mono_now_ns() - self.0) as f64 * 1e-6
    }
}

impl Display for Sent {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "sent at {}", seconds(self.0))
    }
}

/// A time of `CLOCK_MONOTONIC`, given in nanoseconds, as text in seconds with every digit.
pub(crate) fn seconds(ns: i64) -> String {
    format!("{}.{:09} s", ns / 1_000_000_000, ns % 1_000_000_000)
}
