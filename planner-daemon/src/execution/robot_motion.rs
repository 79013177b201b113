//! What the robot does, as far as supervision knows: where a motion that is planned now can begin.

use std::sync::Arc;
use std::time::Duration;

use pcc_model::Configuration;
use planning::Via;
use shared_types::clock::seconds;
use shared_types::codes::{LoopFault, LoopState};
use trajectory::{Knot, Trajectory};

use super::refusal::ExecutionRefusal;
use super::stop_reason::StopReason;
use crate::live_scene::Progress;

/// Least path time between a switch and a knot of the motion that is left, s; the controller wants 0.4 ms.
const SWITCH_GAP_S: f64 = 6e-4;
/// Least path time between the robot and a switch, s: one that rests on its path leaves it once it goes on.
const LEAST_AHEAD_S: f64 = 1e-3;
/// Time that a motion takes from a switch until it has braked, s: 0.3 s at the shipped robots' limits, and some more.
const BRAKING_S: f64 = 0.4;

/// What the robot does by the controller's last fresh state.
#[derive(Clone, Debug, Default)]
pub(crate) enum RobotMotion {
    /// No controller has spoken for 200 ms.
    #[default]
    Unknown,
    /// It rests in this configuration, radians.
    Holding(Configuration),
    /// It follows a motion of this daemon.
    Following(FollowedMotion),
    /// It stops, is in fault, or follows a motion that is about to be left or stopped.
    Busy {
        /// The controller's state.
        state: LoopState,
        /// The fault that is latched.
        fault: LoopFault,
        /// Whether this is over within some milliseconds.
        passes: bool,
        /// Why this daemon has its motion stopped, if it has.
        stopped_for: Option<StopReason>,
    },
}

impl RobotMotion {
    /// Why no motion can begin where the robot is, or be joined there; none where one can.
    pub(crate) fn why_not_ready(&self) -> Option<String> {
        match self {
            Self::Holding(_) | Self::Following(_) => None,
            Self::Busy {
                state: LoopState::Holding,
                passes: true,
                ..
            } => Some("the controller waits for the begin of a motion".to_owned()),
            Self::Busy { state, fault, .. } => {
                Some(format!("the controller is {state} (fault: {fault})"))
            }
            Self::Unknown => Some(ExecutionRefusal::ControllerAbsent.to_string()),
        }
    }
}

/// A goal of a motion, and when the motion passes it or ends in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimedGoal {
    pub(crate) goal: Via,
    /// Path time, s.
    pub(crate) time_s: f64,
}

/// A motion of this daemon that the controller follows.
#[derive(Clone, Debug)]
pub(crate) struct FollowedMotion {
    pub(crate) trajectory_id: u32,
    pub(crate) motion: Arc<Trajectory>,
    /// Its goals, in their order.
    pub(crate) goals: Arc<[TimedGoal]>,
    /// Whether what is left of it is not certified to its end.
    pub(crate) is_blocked: bool,
    /// Its place at the state's stamp.
    pub(crate) progress: Progress,
    /// The highest path time per time that it can have by now.
    pub(crate) fastest_rate: f64,
}

/// Where a motion leaves the one that is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Switch {
    /// Id of the motion that is left.
    pub(crate) trajectory_id: u32,
    /// Its path time there, s.
    pub(crate) path_time_s: f64,
    /// Its state there, with which the other motion begins.
    pub(crate) state: Knot,
}

impl FollowedMotion {
    /// The largest path time that it can have reached by a time, s.
    pub(crate) fn latest_s(&self, mono_ns: i64) -> f64 {
        let since_s = seconds((mono_ns - self.progress.mono_ns).max(0));
        self.progress.time_s + since_s * self.fastest_rate
    }

    /// The first place at which the motion can be left by one that is published `lead` from now; none where it ends before that.
    pub(crate) fn switch_after(&self, lead: Duration, now_mono_ns: i64) -> Option<Switch> {
        self.switch_from(self.earliest_s(lead, now_mono_ns))
    }

    /// The first such place at which none of its goals is so near ahead that a motion which brakes there would miss it, but for the last
    /// one, and the goals from there on.
    pub(crate) fn switch_between_goals(
        &self,
        lead: Duration,
        now_mono_ns: i64,
    ) -> Option<(Switch, Vec<Via>)> {
        let (_, passed) = self.goals.split_last()?;
        let mut earliest_s = self.earliest_s(lead, now_mono_ns);
        for goal in passed {
            let ahead_s = goal.time_s - earliest_s;
            if (0.0..=BRAKING_S).contains(&ahead_s) {
                earliest_s = goal.time_s;
            }
        }
        let switch = self.switch_from(earliest_s)?;
        let ahead = self.goals.iter();
        let ahead = ahead.filter(|goal| goal.time_s > switch.path_time_s);
        Some((switch, ahead.map(|goal| goal.goal).collect()))
    }

    /// Whether it is left at a switch later than a time from now, as fast as it can go.
    pub(crate) fn is_ahead(&self, switch: &Switch, time: Duration, now_mono_ns: i64) -> bool {
        switch.path_time_s >= self.earliest_s(time, now_mono_ns)
    }

    fn earliest_s(&self, lead: Duration, now_mono_ns: i64) -> f64 {
        self.latest_s(now_mono_ns) + (lead.as_secs_f64() * self.fastest_rate).max(LEAST_AHEAD_S)
    }

    /// Its state at a time, if it has gone as fast as it can.
    pub(crate) fn state_at(&self, mono_ns: i64) -> Knot {
        self.state_after(self.latest_s(mono_ns))
    }

    fn switch_from(&self, earliest_s: f64) -> Option<Switch> {
        let path_time_s = clear_of_knots(self.motion.knots(), earliest_s)?;
        Some(Switch {
            trajectory_id: self.trajectory_id,
            path_time_s,
            state: self.state_after(path_time_s),
        })
    }

    /// Its state at a path time, as the first knot of a motion that leaves it.
    fn state_after(&self, path_time_s: f64) -> Knot {
        Knot::of(0.0, &self.motion.at(path_time_s))
    }
}

/// The first time from `earliest_s` on that is not near a knot, s; none beyond the last one.
fn clear_of_knots(knots: &[Knot], earliest_s: f64) -> Option<f64> {
    let next = knots.partition_point(|knot| knot.time + SWITCH_GAP_S <= earliest_s);
    let mut ahead = knots.get(next..)?.iter().map(|knot| knot.time);
    let mut time_s = earliest_s;
    loop {
        let knot_s = ahead.next()?;
        if time_s + SWITCH_GAP_S <= knot_s {
            return Some(time_s);
        }
        time_s = time_s.max(knot_s + SWITCH_GAP_S);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use planning::Goal;

    const NOW: i64 = 5_000_000_000;

    fn followed() -> FollowedMotion {
        let mut followed = fixtures::followed();
        followed.progress.mono_ns = NOW - 10_000_000;
        followed
    }

    #[test]
    fn a_switch_is_ahead_of_where_the_robot_can_be_and_off_the_knots() {
        let followed = followed();
        let switch = followed
            .switch_after(Duration::from_millis(5), NOW)
            .unwrap();
        assert!((0.115..0.13).contains(&switch.path_time_s), "{switch:?}");
        let at = followed.motion.at(switch.path_time_s);
        assert_eq!(switch.state.velocity, at.velocity);
        let end = followed.motion.duration();
        let mut at_end = followed;
        at_end.progress.time_s = end - 0.01;
        assert_eq!(at_end.switch_after(Duration::from_millis(5), NOW), None);
    }

    #[test]
    fn no_goal_is_passed_while_a_motion_brakes_that_goes_on_to_it() {
        let goal = |time_s: f64| TimedGoal {
            goal: Via {
                goal: Goal::Configuration(Configuration::repeat(time_s)),
                tip_tolerance: 0.01,
            },
            time_s,
        };
        let with = |times_s: &[f64]| FollowedMotion {
            goals: times_s.iter().map(|&time_s| goal(time_s)).collect(),
            ..followed()
        };
        let lead = Duration::from_millis(5);
        let end_s = followed().motion.duration();
        let switch = |times_s: &[f64]| with(times_s).switch_between_goals(lead, NOW).unwrap();
        // The robot can be at 0.115 s when the motion is joined.
        let (early, ahead) = switch(&[0.1, 0.9, end_s]);
        assert!((0.115..0.13).contains(&early.path_time_s), "{early:?}");
        assert_eq!(ahead, [goal(0.9).goal, goal(end_s).goal]);
        let (between, ahead) = switch(&[0.3, 0.6, end_s]);
        assert!((0.6..0.62).contains(&between.path_time_s), "{between:?}");
        assert_eq!(ahead, [goal(end_s).goal]);
        let (before_the_end, ahead) = switch(&[0.4]);
        assert!((0.115..0.13).contains(&before_the_end.path_time_s));
        assert_eq!(ahead.len(), 1);
    }

    #[test]
    fn places_near_knots_are_passed_over() {
        let at = |time: f64| Knot::resting(time, Configuration::zeros());
        let knots = [0.0, 0.1, 0.1008, 0.1016, 0.2].map(at);
        let clear = |earliest_s| clear_of_knots(&knots, earliest_s);
        assert_eq!(clear(0.05), Some(0.05));
        assert_eq!(clear(0.0998), Some(0.1016 + SWITCH_GAP_S));
        assert_eq!(clear(0.1012), Some(0.1016 + SWITCH_GAP_S));
        assert_eq!(clear(0.15), Some(0.15));
        assert_eq!(clear(0.1995), None);
        assert_eq!(clear(0.5), None);
    }
}
