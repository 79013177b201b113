//! What stands at the controller while the demonstration runs: stops and resets that others order, and the speed.

use crate::order::seconds;
use client::ControllerView;
use shared_types::clock::mono_now_ns;
use shared_types::message;
use shared_types::valid::{Command, ControllerState};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How long the controller's state is waited for before the speed is given back.
const STATE_WITHIN: Duration = Duration::from_secs(1);
/// Longest wait for a process.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);
/// Share of the speed found at which the demonstration slows a motion down.
const SLOWER: f64 = 0.5;

/// Stops and resets that the demonstration knows of: those of before it, and its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownOrders {
    instance: u64,
    /// Nanoseconds of `CLOCK_MONOTONIC`.
    until_ns: i64,
}

/// Why the demonstration does not go on.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Overruled {
    #[error(
        "a stop or a reset that this demonstration did not order was given at {} (by somebody else, or by the daemon: see its log); \
         the demonstration ends here, and resets nothing",
        seconds(*.at_ns)
    )]
    Ordered { at_ns: i64 },
    #[error(
        "the controller was started anew at {}; the demonstration ends here",
        seconds(*.at_ns)
    )]
    Restarted { at_ns: i64 },
}

impl KnownOrders {
    /// All that this state tells of.
    pub(super) fn of(values: &message::ControllerState) -> Self {
        Self {
            instance: values.instance,
            until_ns: values.wanted_from_mono_ns,
        }
    }

    /// The demonstration's own stop or reset was answered just now: the controller dates it before.
    pub(super) fn add_own(&mut self, answered_ns: i64) {
        self.until_ns = self.until_ns.max(answered_ns);
    }

    /// # Errors
    /// [`Overruled`] where a state tells of a stop, a reset or a start of the controller that is not known.
    pub(super) fn check(&self, values: &message::ControllerState) -> Result<(), Overruled> {
        let at_ns = values.wanted_from_mono_ns;
        if values.instance != self.instance {
            return Err(Overruled::Restarted { at_ns });
        }
        if at_ns > self.until_ns {
            return Err(Overruled::Ordered { at_ns });
        }
        Ok(())
    }
}

/// A speed that the demonstration has ordered, and the one that it found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slowed {
    instance: u64,
    pub(super) found: f64,
    pub(super) ordered: f64,
}

impl Slowed {
    pub(super) fn from(values: &message::ControllerState) -> Self {
        Self {
            instance: values.instance,
            found: values.speed,
            ordered: SLOWER * values.speed,
        }
    }

    /// Whether the speed is still the demonstration's: neither ordered anew by somebody else nor gone with its controller.
    pub(super) fn stands(&self, values: &message::ControllerState) -> bool {
        values.instance == self.instance && values.speed.to_bits() == self.ordered.to_bits()
    }

    /// Orders the speed found again, and says what came of it; what somebody else has ordered meanwhile stays.
    pub(super) fn give_back(self, controller: &mut ControllerView) {
        let Self { found, ordered, .. } = self;
        let Some(state) = fresh_state(controller) else {
            say!(
                "the controller's speed may stay {ordered} (it was {found}): the controller is silent; order `pcc speed {found}`"
            );
            return;
        };
        if !self.stands(&state.values) {
            let speed = state.values.speed;
            if speed.to_bits() != found.to_bits() {
                say!("the controller's speed is {speed}, as ordered by somebody else; it stays");
            }
            return;
        }
        match controller.command(Command::SetSpeed(found), PATIENCE) {
            Ok(reply) if reply.accepted => say!("the controller's speed is {found} again"),
            Ok(reply) => say!(
                "the controller's speed stays {ordered} (it was {found}): {}; order `pcc speed {found}`",
                reply.reason
            ),
            Err(error) => say!(
                "the controller's speed may stay {ordered} (it was {found}): {error}; order `pcc speed {found}`"
            ),
        }
    }
}

/// A state of after the call, also for a demonstration that was interrupted; none where the controller is silent.
pub(super) fn fresh_state(controller: &mut ControllerView) -> Option<ControllerState> {
    let (asked_ns, end) = (mono_now_ns(), Instant::now() + STATE_WITHIN);
    while Instant::now() < end {
        let state = controller.latest_state().ok()?;
        if let Some(state) = state.filter(|state| state.values.stamp_mono_ns >= asked_ns) {
            return Some(state);
        }
        sleep(Duration::from_millis(5));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(instance: u64, wanted_from_mono_ns: i64, speed: f64) -> message::ControllerState {
        message::ControllerState {
            instance,
            wanted_from_mono_ns,
            speed,
            ..message::ControllerState::ZEROED
        }
    }

    #[test]
    fn orders_of_others_end_the_demonstration_and_its_own_do_not() {
        let mut known = KnownOrders::of(&values(7, 100, 1.0));
        assert_eq!(known.check(&values(7, 100, 1.0)), Ok(()));
        let ordered = |at_ns| Err(Overruled::Ordered { at_ns });
        assert_eq!(known.check(&values(7, 150, 1.0)), ordered(150));
        known.add_own(200);
        assert_eq!(known.check(&values(7, 150, 1.0)), Ok(()));
        assert_eq!(known.check(&values(7, 201, 1.0)), ordered(201));
        known.add_own(190);
        assert_eq!(known.check(&values(7, 201, 1.0)), ordered(201));
        assert_eq!(known.check(&values(7, 200, 1.0)), Ok(()));
    }

    #[test]
    fn another_controller_is_told_from_an_order() {
        let known = KnownOrders::of(&values(7, 100, 1.0));
        let error = known.check(&values(8, 1_500_000_000, 1.0)).unwrap_err();
        assert!(error.to_string().contains("anew at 1.500000000 s"));
        let error = known.check(&values(7, 1_500_000_000, 1.0)).unwrap_err();
        assert!(error.to_string().contains("given at 1.500000000 s"));
    }

    #[test]
    fn half_of_the_speed_found_is_ordered_and_another_ones_speed_is_known() {
        let slowed = Slowed::from(&values(7, 0, 0.5));
        assert_eq!((slowed.found, slowed.ordered), (0.5, 0.25));
        assert!(slowed.stands(&values(7, 9, 0.25)));
        assert!(!slowed.stands(&values(7, 0, 0.5)));
        assert!(!slowed.stands(&values(7, 0, 0.3)));
        assert!(!slowed.stands(&values(8, 0, 0.25)));
    }
}
