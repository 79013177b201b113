//! The motion that was published last: its status at the controller, its place on its path, and the reason to stop it.

use std::sync::Arc;

use shared_types::clock::STATE_LIFETIME_NS;
use shared_types::codes::LoopState;
use shared_types::valid::ControllerState;
use trajectory::Trajectory;

use super::request::SelectedMotion;
use super::robot_motion::{Switch, TimedGoal};
use super::stop_reason::StopReason;
use crate::live_scene::{Certificates, Progress};

/// Time after a motion's begin within which the controller must have started it, nanoseconds; else it is stopped.
const START_TIMEOUT_NS: i64 = 300_000_000;

/// The motion that was published last. Only a fresh state of the controller ends it: without one it may be under way.
#[derive(Debug)]
pub(crate) struct SupervisedMotion {
    pub(crate) id: u32,
    pub(crate) motion: Arc<Trajectory>,
    /// Its goals, in their order.
    pub(crate) goals: Arc<[TimedGoal]>,
    /// Where it leaves the motion before it; none where it begins at rest.
    pub(crate) leaves: Option<Switch>,
    pub(crate) certificates: Certificates,
    /// Instance of the controller that the motion was published for.
    controller_instance: u64,
    begin_mono_ns: i64,
    /// Longest duration of a stop on its path, the delay until braking begins included, s.
    pub(crate) stopping_s: f64,
    /// Whether another motion is planned as soon as it is not certified to its end any more.
    pub(crate) is_replanned: bool,
    /// Whether it is not certified to its end, and a later stop is.
    pub(crate) is_blocked: bool,
    status: MotionStatus,
    /// Stamp of the newest state received, nanoseconds of `CLOCK_MONOTONIC`.
    state_mono_ns: i64,
    /// The first reason to stop the motion, if there is one.
    stop: Option<StopReason>,
}

/// Status of a published motion at the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MotionStatus {
    /// The controller has not begun the motion yet.
    Pending,
    /// The controller executes the motion: its place at the state's stamp.
    Executing(Progress),
    /// The controller brakes.
    Stopping,
    /// The motion has ended, for this reason.
    Over(&'static str),
}

impl SupervisedMotion {
    /// A motion that was just published for the controller of this instance.
    pub(crate) fn new(
        id: u32,
        selected: &SelectedMotion,
        begin_mono_ns: i64,
        controller_instance: u64,
        certificates: Certificates,
        stopping_s: f64,
    ) -> Self {
        Self {
            id,
            motion: Arc::clone(&selected.motion),
            goals: Arc::clone(&selected.goals),
            leaves: selected.leaves,
            certificates,
            controller_instance,
            begin_mono_ns,
            stopping_s,
            is_replanned: selected.is_replanned,
            is_blocked: false,
            status: MotionStatus::Pending,
            state_mono_ns: i64::MIN,
            stop: None,
        }
    }

    /// Updates the status from a fresh state of the controller ([`is_fresh`]) and returns it.
    pub(crate) fn update(&mut self, state: &ControllerState) -> MotionStatus {
        self.state_mono_ns = state.values.stamp_mono_ns;
        self.status = self.status_from(state);
        self.status
    }

    fn status_from(&self, state: &ControllerState) -> MotionStatus {
        let values = &state.values;
        if values.instance != self.controller_instance {
            return MotionStatus::Over("another controller is there, which refuses it");
        }
        let is_its_id = values.trajectory_id == self.id;
        match state.state {
            // Before all else: whatever else is said of it, it moves.
            LoopState::Executing if is_its_id => MotionStatus::Executing(Progress::told_by(values)),
            LoopState::Stopping if is_its_id => MotionStatus::Stopping,
            _ if values.refused_trajectory_id == self.id => {
                MotionStatus::Over(state.refusal.text())
            }
            _ if !is_its_id => MotionStatus::Pending,
            LoopState::Holding if values.stamp_mono_ns < self.begin_mono_ns => {
                MotionStatus::Pending
            }
            // Only `Holding` is left: the first two arms have taken the others.
            LoopState::Executing | LoopState::Stopping | LoopState::Holding => {
                MotionStatus::Over("the controller holds")
            }
            LoopState::Starting => MotionStatus::Over("the controller started again"),
            LoopState::Fault => MotionStatus::Over("the controller is in fault"),
        }
    }

    /// Whether the controller has not started it 300 ms after its begin. It has not ended: the controller may still start it.
    pub(crate) fn is_overdue(&self) -> bool {
        self.status == MotionStatus::Pending
            && self.state_mono_ns >= self.begin_mono_ns.saturating_add(START_TIMEOUT_NS)
    }

    /// The motion's status by the last fresh state.
    pub(crate) fn status(&self) -> MotionStatus {
        self.status
    }

    /// Where the motion is by the last fresh state; what has not begun when it should have lags.
    pub(crate) fn progress(&self, now_mono_ns: i64) -> Progress {
        match self.status {
            MotionStatus::Executing(progress) => progress,
            _ => Progress::from_begin(self.begin_mono_ns.max(now_mono_ns)),
        }
    }

    /// Where the motion is that leaves this one at a switch.
    pub(crate) fn progress_of_joining_motion(&self, switch: &Switch, now_mono_ns: i64) -> Progress {
        match self.status {
            MotionStatus::Executing(progress) => progress.of_joining_motion(switch.path_time_s),
            _ => Progress::from_begin(now_mono_ns),
        }
    }

    /// Requests a stop; the first reason stays.
    pub(crate) fn request_stop(&mut self, reason: StopReason) {
        self.stop.get_or_insert(reason);
    }

    /// Why the motion is to be stopped, if it is.
    pub(crate) fn stop_reason(&self) -> Option<StopReason> {
        self.stop
    }
}

/// Whether a controller's state is at most [`STATE_LIFETIME_NS`] old; one stamped in the future is not fresh.
pub(crate) fn is_fresh(state: &ControllerState, now_mono_ns: i64) -> bool {
    let age_ns = now_mono_ns.saturating_sub(state.values.stamp_mono_ns);
    (0..=STATE_LIFETIME_NS).contains(&age_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::execution::ExecutionTiming;
    use crate::fixtures::{controller_state, motion};
    use shared_types::message;

    const BEGIN: i64 = 10_000_000_000;
    const CONTROLLER: u64 = 77;

    fn supervised() -> SupervisedMotion {
        let selected = SelectedMotion {
            motion: Arc::new(motion()),
            goals: Arc::default(),
            leaves: None,
            draw: 0,
            plan_id: 1,
            is_replanned: false,
            timing: ExecutionTiming {
                requested_mono_ns: 1,
                begin_mono_ns: None,
            },
        };
        SupervisedMotion::new(
            7,
            &selected,
            BEGIN,
            CONTROLLER,
            Certificates::default(),
            0.25,
        )
    }

    fn state(change: impl Fn(&mut message::ControllerState)) -> ControllerState {
        controller_state(|values| {
            values.stamp_mono_ns = BEGIN;
            values.instance = CONTROLLER;
            values.trajectory_id = 7;
            values.state = LoopState::Executing.code();
            change(values);
        })
    }

    fn update(change: impl Fn(&mut message::ControllerState)) -> MotionStatus {
        supervised().update(&state(change))
    }

    #[test]
    fn its_place_and_rate_are_those_heard_last_and_the_motion_that_leaves_it_is_before_its_switch()
    {
        let mut supervised = supervised();
        let heard = state(|values| (values.trajectory_time_s, values.rate) = (1.5, 0.5));
        supervised.update(&heard);
        let now = BEGIN + 900_000_000;
        let progress = supervised.progress(now);
        let (time_s, mono_ns, rate) = (1.5, BEGIN, 0.5);
        assert_eq!(
            progress,
            Progress {
                time_s,
                mono_ns,
                rate
            }
        );
        let switch = Switch {
            trajectory_id: 7,
            path_time_s: 1.75,
            state: motion().knots()[0],
        };
        let joining = supervised.progress_of_joining_motion(&switch, now);
        assert_eq!(joining, progress.of_joining_motion(1.75));
    }

    #[test]
    fn a_motion_is_over_only_when_a_state_says_so() {
        let over = |change: fn(&mut message::ControllerState)| {
            let status = update(change);
            assert!(matches!(status, MotionStatus::Over(_)), "{status:?}");
            status
        };
        let refused = over(|values| {
            (values.refused_trajectory_id, values.refusal) = (7, 5);
            (values.trajectory_id, values.state) = (6, LoopState::Holding.code());
        });
        assert_eq!(refused, MotionStatus::Over("begins in the past"));
        over(|values| values.instance = 78);
        over(|values| values.state = LoopState::Holding.code());
        over(|values| values.state = LoopState::Fault.code());
        over(|values| values.state = LoopState::Starting.code());
    }

    #[test]
    fn a_motion_that_is_executed_is_not_over_whatever_was_refused() {
        let refused = |values: &mut message::ControllerState| values.refused_trajectory_id = 7;
        let MotionStatus::Executing(progress) = update(refused) else {
            panic!("it is executed");
        };
        assert_eq!((progress.time_s, progress.rate), (0.0, 0.0));
        let stopping = update(|values| {
            refused(values);
            values.state = LoopState::Stopping.code();
        });
        assert_eq!(stopping, MotionStatus::Stopping);
    }

    #[test]
    fn a_motion_that_is_not_taken_up_is_overdue_and_not_over() {
        let mut supervised = supervised();
        let not_taken = |after_ns: i64| {
            state(|values| {
                (values.trajectory_id, values.state) = (6, LoopState::Holding.code());
                values.stamp_mono_ns = BEGIN + after_ns;
            })
        };
        assert!(!supervised.is_overdue());
        assert_eq!(
            supervised.update(&not_taken(START_TIMEOUT_NS - 1)),
            MotionStatus::Pending
        );
        assert!(!supervised.is_overdue());
        assert_eq!(
            supervised.update(&not_taken(START_TIMEOUT_NS)),
            MotionStatus::Pending
        );
        assert!(supervised.is_overdue());
        supervised.update(&state(|values| {
            values.stamp_mono_ns = BEGIN + START_TIMEOUT_NS;
        }));
        assert!(!supervised.is_overdue());
    }

    #[test]
    fn a_motion_that_nobody_speaks_of_stays_and_lags_once_it_should_have_begun() {
        let supervised = supervised();
        assert_eq!(supervised.status(), MotionStatus::Pending);
        let late = BEGIN + 60_000_000_000;
        assert_eq!(supervised.progress(late), Progress::from_begin(late));
    }

    #[test]
    fn a_motion_is_awaited_until_it_has_begun() {
        let holding = LoopState::Holding.code();
        let before = update(|values| {
            (values.state, values.stamp_mono_ns) = (holding, BEGIN - 1);
        });
        assert_eq!(before, MotionStatus::Pending);
        let elsewhere = update(|values| {
            (values.trajectory_id, values.state) = (6, holding);
            values.stamp_mono_ns = BEGIN + START_TIMEOUT_NS - 1;
        });
        assert_eq!(elsewhere, MotionStatus::Pending);
        assert_eq!(
            update(|values| values.state = LoopState::Stopping.code()),
            MotionStatus::Stopping
        );
    }

    #[test]
    fn the_first_reason_to_stop_stays() {
        let mut supervised = supervised();
        supervised.request_stop(StopReason::ControllerSilent);
        supervised.request_stop(StopReason::DaemonEnds);
        assert_eq!(supervised.stop_reason(), Some(StopReason::ControllerSilent));
    }

    #[test]
    fn states_of_long_ago_and_of_the_future_say_nothing_of_now() {
        let state = state(|_| ());
        assert!(is_fresh(&state, BEGIN));
        assert!(is_fresh(&state, BEGIN + STATE_LIFETIME_NS));
        assert!(!is_fresh(&state, BEGIN + STATE_LIFETIME_NS + 1));
        assert!(!is_fresh(&state, BEGIN - 1));
    }
}
