//! Where a request begins that begins where the robot is: where it holds, or where it can leave the motion that it follows.

use std::sync::Arc;
use std::time::Duration;

use pcc_model::Configuration;
use planning::{EndToMove, Problem, Request, StartMotion};
use shared_types::capacity::MAX_GOALS;
use shared_types::codes::Outcome;

use super::refusal::Refusal;
use super::request_validator::PlanTask;
use crate::execution::{FollowedMotion, RobotMotion, Switch};

/// Why a request cannot begin where the robot is.
#[derive(Debug, PartialEq)]
pub(super) enum NotReady {
    /// It can in a moment: the motion ends, or is about to be left.
    Passes(Refusal),
    /// It cannot.
    Stays(Refusal),
}

/// Sets the start of a task to where the robot is, `lead` from now; returns where it leaves the motion that is followed, if it does.
pub(super) fn begin_at_robot(
    task: &mut PlanTask,
    robot: &RobotMotion,
    lead: Duration,
    now_mono_ns: i64,
) -> Result<Option<Switch>, NotReady> {
    match robot {
        RobotMotion::Holding(configuration) => {
            task.ahead.clear();
            set_start(task, *configuration, None);
            Ok(None)
        }
        RobotMotion::Following(followed) => {
            let switch = leave(task, followed, lead, now_mono_ns)?;
            let motion = StartMotion {
                velocity: switch.state.velocity,
                acceleration: switch.state.acceleration,
            };
            set_start(task, switch.state.position, Some(motion));
            if task.moves_end_of == Some(followed.trajectory_id) && !followed.is_blocked {
                let remaining = followed.motion.remaining_from(switch.path_time_s);
                task.request.end_to_move = remaining.map(|remaining| EndToMove {
                    remaining: Arc::new(remaining),
                    most_knots: task.knots.end_moved,
                });
            }
            Ok(Some(switch))
        }
        RobotMotion::Busy { passes: true, .. } => Err(NotReady::Passes(not_ready(robot))),
        RobotMotion::Busy { .. } | RobotMotion::Unknown => Err(NotReady::Stays(not_ready(robot))),
    }
}

fn not_ready(robot: &RobotMotion) -> Refusal {
    refusal(&robot.why_not_ready().unwrap_or_default())
}

/// Where a task leaves the motion that is followed; the goals ahead from there on become the task's first ones, if it appends its own.
fn leave(
    task: &mut PlanTask,
    followed: &FollowedMotion,
    lead: Duration,
    now_mono_ns: i64,
) -> Result<Switch, NotReady> {
    let found = if task.appends {
        followed.switch_between_goals(lead, now_mono_ns)
    } else {
        let switch = followed.switch_after(lead, now_mono_ns);
        switch.map(|switch| (switch, Vec::new()))
    };
    let (switch, ahead) = found.ok_or_else(|| {
        let id = followed.trajectory_id;
        NotReady::Passes(refusal(&format!(
            "trajectory {id} ends before it can be left"
        )))
    })?;
    check_room(ahead.len(), task.via.len() + 1)?;
    task.ahead = ahead;
    Ok(switch)
}

/// Checks that there are not too many goals ahead for the appended ones.
fn check_room(ahead: usize, appended: usize) -> Result<(), NotReady> {
    if ahead + appended <= MAX_GOALS {
        return Ok(());
    }
    let reason = format!(
        "the queue is full: {ahead} goals are still ahead, and with {appended} more there would be over {MAX_GOALS}"
    );
    Err(NotReady::Stays(Refusal::new(Outcome::Overloaded, reason)))
}

fn refusal(what: &str) -> Refusal {
    let reason = format!("the motion cannot begin where the robot is: {what}");
    Refusal::new(Outcome::RobotNotReady, reason)
}

fn set_start(task: &mut PlanTask, start: Configuration, motion: Option<StartMotion>) {
    task.problem = Arc::new(Problem {
        start,
        ..Problem::clone(&task.problem)
    });
    task.request = Request {
        knots: task.knots.of(motion.is_some()),
        start_motion: motion,
        end_to_move: None,
        ..task.request.clone()
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::execution::TimedGoal;
    use crate::fixtures::{followed, motion, task};
    use planning::{Goal, Via};
    use shared_types::codes::{LoopFault, LoopState};

    const LEAD: Duration = Duration::from_millis(5);

    #[test]
    fn a_request_begins_where_the_robot_holds() {
        let mut task = task();
        let held = Configuration::repeat(0.3);
        let switch = begin_at_robot(&mut task, &RobotMotion::Holding(held), LEAD, 0);
        assert_eq!(switch, Ok(None));
        assert_eq!(task.problem.start, held);
        assert!(task.request.start_motion.is_none());
    }

    #[test]
    fn appended_goals_come_after_those_ahead_until_the_queue_is_full() {
        let motion = motion();
        let goal = |time_s: f64| TimedGoal {
            goal: Via {
                goal: Goal::Configuration(Configuration::repeat(time_s)),
                tip_tolerance: 0.01,
            },
            time_s,
        };
        let end_s = motion.duration();
        let times_s = [0.05, 0.7 * end_s, 0.8 * end_s, end_s];
        let robot = RobotMotion::Following(FollowedMotion {
            motion: Arc::new(motion),
            goals: times_s.map(goal).into(),
            ..followed()
        });
        let mut appended = task();
        appended.appends = true;
        appended.via = vec![goal(9.0).goal; 4];
        assert!(
            begin_at_robot(&mut appended, &robot, LEAD, 0)
                .unwrap()
                .is_some()
        );
        assert_eq!(
            appended.ahead,
            times_s[1..]
                .iter()
                .map(|&s| goal(s).goal)
                .collect::<Vec<_>>()
        );
        assert_eq!(appended.goals().len(), MAX_GOALS);
        assert_eq!(appended.goals()[7].goal, appended.problem.goal);
        let mut replacing = task();
        begin_at_robot(&mut replacing, &robot, LEAD, 0).unwrap();
        assert!(replacing.ahead.is_empty());
        appended.via.push(goal(9.0).goal);
        let Err(NotReady::Stays(refusal)) = begin_at_robot(&mut appended, &robot, LEAD, 0) else {
            panic!("more goals than the queue holds");
        };
        assert_eq!(refusal.outcome, Outcome::Overloaded);
        assert!(
            refusal.reason.contains("3 goals are still ahead"),
            "{}",
            refusal.reason
        );
        let holding = RobotMotion::Holding(Configuration::zeros());
        begin_at_robot(&mut appended, &holding, LEAD, 0).unwrap();
        assert!(appended.ahead.is_empty());
    }

    #[test]
    fn what_is_left_of_a_motion_belongs_to_the_start_that_was_set_last() {
        let mut task = task();
        task.moves_end_of = Some(7);
        let mut followed = followed();
        let robot = RobotMotion::Following(followed.clone());
        begin_at_robot(&mut task, &robot, LEAD, 0).unwrap();
        let to_move = task.request.end_to_move.clone().unwrap();
        assert_eq!(to_move.most_knots, task.knots.end_moved);
        assert_eq!(to_move.remaining.knots()[0].position, task.problem.start);
        followed.is_blocked = true;
        let robot = RobotMotion::Following(followed);
        begin_at_robot(&mut task, &robot, 2 * LEAD, 0).unwrap();
        assert!(task.request.end_to_move.is_none());
    }

    #[test]
    fn who_does_not_hold_and_does_not_follow_is_told_why() {
        let busy = |state, passes| RobotMotion::Busy {
            state,
            fault: LoopFault::None,
            passes,
            stopped_for: None,
        };
        for (robot, text) in [
            (busy(LoopState::Stopping, false), "stopping"),
            (busy(LoopState::Executing, true), "executing"),
            (RobotMotion::Unknown, "no controller"),
        ] {
            let not_ready = begin_at_robot(&mut task(), &robot, LEAD, 0).unwrap_err();
            let (NotReady::Passes(refusal) | NotReady::Stays(refusal)) = not_ready;
            assert_eq!(refusal.outcome, Outcome::RobotNotReady);
            assert!(refusal.reason.contains(text), "{}", refusal.reason);
        }
    }
}
