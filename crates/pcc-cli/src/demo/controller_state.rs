//! The controller's state as the demonstration reads it: whose order its speed is, and whether a motion is under way.

use client::ControllerView;
use shared_types::codes::LoopState;
use shared_types::message;
use shared_types::valid::{Command, ControllerState};
use std::time::Duration;

/// Longest wait for a state of the controller before the speed is restored.
const STATE_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest wait for a reply of a process.
pub(super) const TIMEOUT: Duration = Duration::from_secs(10);
/// Share of the speed found at which the demonstration slows a motion down.
const SLOWER: f64 = 0.5;

/// Whether a motion is executed, or may still begin: a controller that holds may have taken a motion of which it has reported neither
/// begin nor refusal.
pub(super) fn is_under_way(state: &ControllerState, trajectory_id: u32) -> bool {
    let values = &state.values;
    let is_known = values.trajectory_id == trajectory_id;
    match state.state {
        LoopState::Executing => is_known,
        LoopState::Holding => !is_known && values.refused_trajectory_id != trajectory_id,
        LoopState::Starting | LoopState::Stopping | LoopState::Fault => false,
    }
}

/// The demonstration's order of a speed, and the speed that it found.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedOrder {
    instance: u64,
    pub(super) found: f64,
    pub(super) ordered: f64,
}

impl SpeedOrder {
    pub(super) fn from(values: &message::ControllerState) -> Self {
        Self {
            instance: values.instance,
            found: values.speed,
            ordered: SLOWER * values.speed,
        }
    }

    /// Whether the order is still in force: no one else has ordered a speed, and the controller was not started anew.
    pub(super) fn is_in_force(&self, values: &message::ControllerState) -> bool {
        values.instance == self.instance && values.speed.to_bits() == self.ordered.to_bits()
    }

    /// A sentence about a speed that the demonstration has not ordered; none where it is the one that the demonstration found.
    fn note_on_other_speed(&self, values: &message::ControllerState) -> Option<String> {
        let (speed, found) = (values.speed, self.found);
        if speed.to_bits() == found.to_bits() {
            return None;
        }
        Some(if values.instance == self.instance {
            format!("the controller's speed is {speed}, as ordered by somebody else; it stays")
        } else {
            format!(
                "the controller was started anew, and its speed is {speed}; `pcc speed {found}` gives back what was found"
            )
        })
    }

    /// Orders the speed found again, and prints the result. A speed that somebody else has ordered meanwhile stays, and so does that of
    /// a controller that was started anew.
    pub(super) fn restore(self, controller: &mut ControllerView) {
        let Self { found, ordered, .. } = self;
        let Some(state) = fresh_state(controller) else {
            say!(
                "the controller's speed may stay {ordered} (it was {found}): the controller is silent; order `pcc speed {found}`"
            );
            return;
        };
        if !self.is_in_force(&state.values) {
            if let Some(text) = self.note_on_other_speed(&state.values) {
                say!("{text}");
            }
            return;
        }
        match controller.command(Command::SetSpeed(found), TIMEOUT) {
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

/// A state that is newer than the call, also for a demonstration that was interrupted; none where the controller is silent.
pub(super) fn fresh_state(controller: &mut ControllerView) -> Option<ControllerState> {
    controller.next_state(STATE_TIMEOUT).ok().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(instance: u64, speed: f64) -> message::ControllerState {
        message::ControllerState {
            instance,
            speed,
            ..message::ControllerState::ZEROED
        }
    }

    #[test]
    fn half_of_the_speed_found_is_ordered_and_another_ones_speed_is_known() {
        let order = SpeedOrder::from(&values(7, 0.5));
        assert_eq!((order.found, order.ordered), (0.5, 0.25));
        assert!(order.is_in_force(&values(7, 0.25)));
        assert!(!order.is_in_force(&values(7, 0.5)));
        assert!(!order.is_in_force(&values(7, 0.3)));
        assert!(!order.is_in_force(&values(8, 0.25)));
    }

    #[test]
    fn the_speed_of_a_controller_started_anew_is_nobodys_order() {
        let order = SpeedOrder::from(&values(7, 0.5));
        let ordered = order.note_on_other_speed(&values(7, 0.3)).unwrap();
        assert!(ordered.contains("speed is 0.3, as ordered by somebody else"));
        let anew = order.note_on_other_speed(&values(8, 1.0)).unwrap();
        assert!(anew.contains("started anew") && anew.contains("speed is 1"));
        assert!(anew.contains("`pcc speed 0.5`"), "{anew}");
        for instance in [7, 8] {
            assert_eq!(order.note_on_other_speed(&values(instance, 0.5)), None);
        }
    }

    #[test]
    fn a_motion_that_waits_for_its_begin_is_under_way_and_one_that_is_over_is_not() {
        let state = |state: LoopState, trajectory_id: u32, refused_trajectory_id: u32| {
            let values = message::ControllerState {
                state: state.code(),
                trajectory_id,
                refused_trajectory_id,
                ..message::ControllerState::ZEROED
            };
            ControllerState::try_from(&values).unwrap()
        };
        for (loop_state, executed, refused, expected) in [
            (LoopState::Holding, 4, 3, true),
            (LoopState::Holding, 5, 3, false),
            (LoopState::Holding, 4, 5, false),
            (LoopState::Executing, 5, 3, true),
            (LoopState::Executing, 4, 3, false),
            (LoopState::Stopping, 5, 3, false),
            (LoopState::Fault, 4, 3, false),
            (LoopState::Starting, 4, 3, false),
        ] {
            let state = state(loop_state, executed, refused);
            assert_eq!(is_under_way(&state, 5), expected, "{state:?}");
        }
    }
}
