//! What stops, other goals and refused plans make of a goal.

use super::*;
use crate::fixtures::unit_robot;
use shared_types::message;

fn goal(given_mono_ns: i64) -> StandingGoal {
    StandingGoal {
        given_mono_ns,
        stamp_mono_ns: given_mono_ns,
        goal: Goal::Tip {
            position_m: [1.0, 0.5, 2.2],
            tolerance_m: None,
        },
        tip_velocity_m_s: [0.0; 3],
        limits_scale: 1.0,
        is_withdrawn: false,
    }
}

fn result(outcome: Outcome, reason: &str, trajectory_id: u32) -> PlanResult {
    let motion = PublishedMotion {
        trajectory_id,
        duration_s: 1.0,
    };
    PlanResult {
        plan_id: 1,
        outcome,
        reason: ReasonText::new(reason),
        published: Some(motion).filter(|_| trajectory_id != 0),
    }
}

/// A keeper whose goal was given at 100 and for which a plan was made from rest at `now`; the time of the request.
fn planned(keeper: &mut GoalKeeper, now_mono_ns: i64) -> Option<i64> {
    let rests = RobotMotion::Holding(Configuration::zeros());
    keeper.next_plan(&rests, now_mono_ns)?.requested_mono_ns
}

fn refused_as_before_a_stop(trajectory_id: u32) -> MotionResult {
    MotionResult::try_from(&message::MotionResult {
        trajectory_id,
        outcome: MotionOutcome::Refused.code(),
        refusal: Refusal::RequestedBefore.code(),
        ..message::MotionResult::ZEROED
    })
    .unwrap()
}

#[test]
fn a_stop_of_the_daemons_own_does_not_end_the_goal_and_any_other_does() {
    for (own_stop_mono_ns, expected) in [(200, GoalState::Underway), (0, GoalState::Ended)] {
        let mut keeper = GoalKeeper::new(unit_robot());
        keeper.give(goal(100)).unwrap();
        assert_eq!(planned(&mut keeper, 150), Some(100));
        keeper.hear_plan(&result(Outcome::Ok, "", 7));
        keeper.hear_own_stop(own_stop_mono_ns);
        keeper.hear_result(&refused_as_before_a_stop(7));
        assert_eq!(keeper.status().state, expected.code());
        let again = planned(&mut keeper, 150 + PERIOD_NS);
        let goes_on = expected == GoalState::Underway;
        assert_eq!(again, goes_on.then_some(own_stop_mono_ns));
    }
    // Somebody else's stop came after the daemon's own.
    let mut keeper = GoalKeeper::new(unit_robot());
    keeper.give(goal(100)).unwrap();
    keeper.hear_own_stop(200);
    assert_eq!(planned(&mut keeper, 250), Some(200));
    keeper.hear_plan(&result(Outcome::Ok, "", 7));
    keeper.hear_result(&refused_as_before_a_stop(7));
    assert_eq!(keeper.status().state, GoalState::Ended.code());
}

#[test]
fn the_end_of_a_goal_that_is_replaced_is_told_once() {
    let mut keeper = GoalKeeper::new(unit_robot());
    keeper.give(goal(100)).unwrap();
    assert_eq!(keeper.take_replaced(), None);
    keeper.give(goal(200)).unwrap();
    let replaced = keeper.take_replaced().unwrap();
    assert_eq!(replaced.given_mono_ns, 100);
    assert_eq!(replaced.state, GoalState::Ended.code());
    assert_eq!(keeper.take_replaced(), None);
    assert_eq!(keeper.status().given_mono_ns, 200);
}

#[test]
fn a_reason_that_begins_with_the_outcome_does_not_say_it_twice() {
    let reason = "goal out of reach: it is missed by 1.2";
    for (told, expected) in [
        (reason, reason),
        ("it is far", "goal out of reach: it is far"),
        ("", "goal out of reach"),
    ] {
        let mut keeper = GoalKeeper::new(unit_robot());
        keeper.give(goal(100)).unwrap();
        planned(&mut keeper, 150);
        keeper.hear_plan(&result(Outcome::GoalOutOfReach, told, 0));
        assert_eq!(keeper.status().state, GoalState::Unreachable.code());
        assert_eq!(keeper.status().reason.text(), expected);
    }
}

#[test]
fn a_motion_that_came_too_late_leaves_the_one_under_way() {
    let mut keeper = GoalKeeper::new(unit_robot());
    keeper.give(goal(100)).unwrap();
    planned(&mut keeper, 150);
    keeper.hear_plan(&result(Outcome::Ok, "", 7));
    let moved = StandingGoal {
        stamp_mono_ns: 300,
        goal: Goal::Configuration([0.1; 6]),
        ..goal(100)
    };
    keeper.give(moved).unwrap();
    planned(&mut keeper, 150 + PERIOD_NS);
    keeper.hear_plan(&result(Outcome::ExecutionRefused, "too late", 0));
    assert_eq!(keeper.status().state, GoalState::Underway.code());
    planned(&mut keeper, 150 + 2 * LOOK_AGAIN_NS);
    keeper.hear_plan(&result(Outcome::NoPath, "", 0));
    assert_eq!(keeper.status().state, GoalState::Unreachable.code());
}
