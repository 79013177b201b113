//! Waiting until daemon and controller are ready, and why they are not.

use std::time::Duration;

use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState};
use shared_types::valid::Command;

use super::{PATIENCE, Part, Stack};
use crate::process::{TimedOut, wait_for};
use crate::retries;

/// Longest wait for one state of the controller.
const STATE_WITHIN: Duration = Duration::from_millis(100);

impl Stack {
    /// Waits until the daemon serves and the controller holds. A fault is reset, and counts as a retry.
    ///
    /// # Errors
    /// [`TimedOut`] with the log of the one that is not ready.
    pub fn wait_until_ready(&mut self) -> Result<(), TimedOut> {
        self.ready_again(|fault| retries::note(&format!("a fault was reset: {fault}")))
    }

    /// The same after something that ends in a fault by right, or in one that was counted already: resets it without a word.
    ///
    /// # Errors
    /// [`TimedOut`] with the log of the one that is not ready.
    pub fn clear_fault(&mut self) -> Result<(), TimedOut> {
        self.ready_again(|_| ())
    }

    fn ready_again(&mut self, note: impl Fn(LoopFault)) -> Result<(), TimedOut> {
        if let Err(error) = self.client.wait_for_daemon(PATIENCE) {
            return Err(self.not_ready(Part::Daemon, &error.to_string()));
        }
        let (begin_ns, mut noted) = (mono_now_ns(), None);
        let view = &mut self.controller;
        let held = wait_for("the controller holds", PATIENCE, || {
            let state = view.latest_state().ok().flatten()?;
            let is_new = state.values.stamp_mono_ns > begin_ns;
            if is_new && state.state == LoopState::Fault {
                if noted != Some(state.fault) {
                    note(state.fault);
                    noted = Some(state.fault);
                }
                let _ = view.command(Command::ResetFault, Duration::from_secs(2));
            }
            (is_new && state.state == LoopState::Holding).then_some(())
        });
        held.map_err(|_| self.not_ready(Part::Controller, "the controller does not hold"))
    }

    /// Waits until the controller holds, by a state from now on: not one of a controller that has ended.
    ///
    /// # Errors
    /// [`TimedOut`] with the logs.
    pub fn wait_until_held(&mut self) -> Result<(), TimedOut> {
        self.wait_for_state(&[LoopState::Holding])
    }

    /// Waits until the controller is in one of these states, by a state from now on.
    ///
    /// # Errors
    /// [`TimedOut`] with the logs.
    pub fn wait_for_state(&mut self, states: &[LoopState]) -> Result<(), TimedOut> {
        let view = &mut self.controller;
        let reached = wait_for("the controller's state", PATIENCE, || {
            let state = view.next_state(STATE_WITHIN).ok().flatten()?;
            states.contains(&state.state).then_some(())
        });
        reached.map_err(|_| {
            self.not_ready(
                Part::Controller,
                &format!("it was in none of the states {states:?}"),
            )
        })
    }

    pub(super) fn not_ready(&mut self, part: Part, what: &str) -> TimedOut {
        let state = self.controller.latest_state();
        let state = state.map(|state| state.map(|now| (now.state, now.fault, now.refusal)));
        let logs: String = self
            .processes
            .iter()
            .flatten()
            .map(|process| tail(&process.log()))
            .collect();
        TimedOut {
            what: format!("{}: {what}; controller {state:?}", part.program()),
            waited: PATIENCE,
            log: logs,
        }
    }
}

/// The last lines of a log.
fn tail(log: &str) -> String {
    let lines: Vec<&str> = log.lines().collect();
    lines[lines.len().saturating_sub(8)..].join("\n") + "\n"
}
