//! The running processes as the demonstration uses them: orders to the controller, and waiting for its states.

use super::controller_state::{SpeedOrder, TIMEOUT, fresh_state, is_under_way};
use crate::foreign_orders::ForeignOrders;
use crate::order::STANDS_STILL;
use anyhow::{Context, bail};
use client::{Client, ControllerView, ResultView};
use pcc_model::Robot;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandRefusal, LoopState, Refusal};
use shared_types::valid::{Command, ControllerState};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest time to wait for the end of a motion at a low speed, seconds.
const LONGEST_MOTION_S: f64 = 86_400.0;
/// The reason that the demonstration gives for its orders.
const OF_DEMO: &str = "ordered by pcc demo";

/// An order that the demonstration gives during a motion.
#[derive(Clone, Copy)]
pub(super) enum MotionOrder {
    /// Half of the speed that the demonstration found.
    HalveSpeed,
    /// The speed that the demonstration found.
    RestoreSpeed,
    /// A stop.
    Stop,
}

/// The running processes, and what the demonstration has ordered of them.
pub(super) struct Session<'a> {
    pub(super) robot: &'a Robot,
    pub(super) client: Client,
    pub(super) controller: ControllerView,
    /// How the motions end, as the controller tells it.
    pub(super) results: ResultView,
    /// Whether the demonstration is to end now.
    pub(super) interrupted: Arc<AtomicBool>,
    pub(super) seed: u64,
    /// Stops and resets of others, from before the demonstration waits for anything.
    pub(super) foreign_orders: ForeignOrders,
    /// The trajectory that was executed last.
    pub(super) last_id: Option<u32>,
    /// The demonstration's order of a speed, until the speed found is restored.
    pub(super) speed_order: Option<SpeedOrder>,
}

impl Session<'_> {
    /// Waits until the controller holds.
    pub(super) fn begin(&mut self) -> anyhow::Result<()> {
        let held = self.hold()?.values;
        if held.speed < 1.0 {
            let speed = held.speed;
            say!("the controller follows motions at speed {speed} of their own rate");
        }
        Ok(())
    }

    /// Gives an order, and returns its name; none where somebody else has ordered a speed meanwhile, which stays.
    pub(super) fn order(
        &mut self,
        order: MotionOrder,
        state: &ControllerState,
    ) -> anyhow::Result<Option<&'static str>> {
        match order {
            MotionOrder::HalveSpeed => {
                // Noted before it is ordered: an order without a reply may be obeyed.
                let order = *self.speed_order.insert(SpeedOrder::from(&state.values));
                self.command(Command::SetSpeed(order.ordered))?;
                Ok(Some("speed"))
            }
            MotionOrder::RestoreSpeed => {
                let own = self
                    .speed_order
                    .filter(|own| own.is_in_force(&state.values));
                let Some(own) = own else {
                    let speed = state.values.speed;
                    say!("  somebody else has ordered speed {speed} meanwhile; it stays");
                    self.speed_order = None;
                    return Ok(None);
                };
                self.command(Command::SetSpeed(own.found))?;
                self.speed_order = None;
                Ok(Some("speed"))
            }
            MotionOrder::Stop => {
                self.command(Command::Stop)?;
                self.note_own_order();
                Ok(Some("stop"))
            }
        }
    }

    /// Gives an order; an error where the controller does not obey.
    fn command(&mut self, command: Command) -> anyhow::Result<()> {
        let reply = self.controller.command(command.because(OF_DEMO), TIMEOUT)?;
        if !reply.accepted {
            bail!("the controller does not obey: {}", reply.reason);
        }
        Ok(())
    }

    /// Notes that the controller has just answered a stop or a reset of the demonstration's own.
    fn note_own_order(&mut self) {
        self.foreign_orders.ignore_own(mono_now_ns());
    }

    /// Waits until the controller holds the robot; an error where its speed is 0, at which it would follow no motion.
    pub(super) fn hold(&mut self) -> anyhow::Result<ControllerState> {
        let held = self.wait(TIMEOUT, "the controller holds", |s| {
            s.state == LoopState::Holding
        })?;
        if held.values.speed <= 0.0 {
            bail!("{STANDS_STILL}");
        }
        Ok(held)
    }

    /// Waits until the controller takes a trajectory, and then at most `timeout` until the robot rests again.
    pub(super) fn follow(&mut self, id: u32, timeout: Duration) -> anyhow::Result<ControllerState> {
        let taken = self.wait(TIMEOUT, "the trajectory is taken", |s| {
            s.values.trajectory_id == id || s.values.refused_trajectory_id == id
        })?;
        if taken.values.refused_trajectory_id == id && taken.refusal != Refusal::None {
            bail!("the controller refused the trajectory: {}", taken.refusal);
        }
        let ended = self.wait(timeout, "the motion ends", |s| {
            matches!(s.state, LoopState::Holding | LoopState::Fault)
        })?;
        match self.results.wait_for(id, TIMEOUT)? {
            Some(result) => say!("  trajectory {id} {result}"),
            None => say!("  the controller does not tell how trajectory {id} ended"),
        }
        Ok(ended)
    }

    /// Stops what moves, if something does.
    pub(super) fn stop(&mut self) {
        match self
            .controller
            .command(Command::Stop.because(OF_DEMO), TIMEOUT)
        {
            Ok(reply) if reply.accepted || reply.refusal == CommandRefusal::NothingToDo => {}
            Ok(reply) => say!(
                "the robot may move on: the stop was answered with `{}`",
                reply.reason
            ),
            Err(error) => say!("the robot may move on: {error}"),
        }
    }

    /// Stops the demonstration's own last motion if it is under way or may still begin; a motion of somebody else goes on.
    pub(super) fn stop_own(&mut self) {
        let Some(id) = self.last_id else {
            return;
        };
        let orders = &self.foreign_orders;
        let is_own = fresh_state(&mut self.controller).is_none_or(|state| {
            orders.is_same_controller(&state.values) && is_under_way(&state, id)
        });
        if is_own {
            self.stop();
        }
    }

    /// Restores the speed that the demonstration found, where it has not yet.
    pub(super) fn restore_speed(&mut self) {
        if let Some(order) = self.speed_order.take() {
            order.restore(&mut self.controller);
        }
    }

    /// Clears the controller's fault, unless somebody else has ordered something meanwhile.
    pub(super) fn reset(&mut self) -> anyhow::Result<()> {
        self.look()?;
        let reply = self.controller.command(Command::ResetFault, TIMEOUT)?;
        if !reply.accepted {
            bail!("the controller does not reset: {}", reply.reason);
        }
        self.note_own_order();
        Ok(())
    }

    /// Waits for a fresh state; an error where it reports an order of somebody else.
    pub(super) fn look(&mut self) -> anyhow::Result<ControllerState> {
        self.wait(TIMEOUT, "the controller says what it does", |_| true)
    }

    /// Waits at most `timeout` for a fresh state that satisfies `until`; a stop or a reset of somebody else is an error.
    pub(super) fn wait(
        &mut self,
        timeout: Duration,
        what: &str,
        until: impl Fn(&ControllerState) -> bool,
    ) -> anyhow::Result<ControllerState> {
        let (asked, end) = (mono_now_ns(), Instant::now() + timeout);
        while Instant::now() < end {
            if self.interrupted.load(Ordering::Relaxed) {
                bail!("interrupted");
            }
            if let Some(state) = self.controller.latest_state()?
                && state.values.stamp_mono_ns >= asked
            {
                let checked = self.foreign_orders.check(&state.values);
                checked.context("the demonstration ends here, and resets nothing")?;
                if until(&state) {
                    return Ok(state);
                }
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        bail!("waited {timeout:?} in vain until {what}")
    }
}

/// Longest time to wait for the end of a motion that lasts `duration_s` at its own rate and is followed at `speed`.
pub(super) fn motion_timeout(duration_s: f64, speed: f64) -> Duration {
    TIMEOUT + Duration::from_secs_f64((duration_s / speed).min(LONGEST_MOTION_S))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_motion_is_waited_for_longer() {
        assert_eq!(motion_timeout(4.0, 1.0), TIMEOUT + Duration::from_secs(4));
        assert_eq!(motion_timeout(4.0, 0.5), TIMEOUT + Duration::from_secs(8));
        for speed in [1e-300, f64::MIN_POSITIVE] {
            assert!(motion_timeout(4.0, speed) <= TIMEOUT + Duration::from_secs(86_400));
        }
    }
}
