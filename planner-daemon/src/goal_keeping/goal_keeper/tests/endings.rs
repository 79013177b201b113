//! What ends a goal, and what does not.

use super::*;
use crate::live_scene::InTheWay;

#[test]
fn whoever_stops_the_robot_ends_the_goal_but_for_the_daemons_supervision() {
    use CommandSender::{Program, Supervision};
    for (cause, sender, ends) in [
        (StopCause::Command, Program, true),
        (StopCause::Command, Supervision, false),
        (StopCause::Reset, Program, true),
        (StopCause::Fault, Program, true),
        (StopCause::Signal, Program, true),
        (StopCause::Suspension, Program, true),
    ] {
        let mut bench = Bench::underway();
        bench.keeper.hear_result(&stopped(7, cause, sender));
        assert_eq!(bench.keeper.has_goal(), !ends, "{cause:?} {sender:?}");
        assert_eq!(bench.after(20, &holding()).is_some(), !ends);
        if ends {
            assert_eq!(bench.state(), GoalState::Ended);
            let again = bench.keeper.give(given(GIVEN, configuration(0.6)));
            assert!(again.unwrap_err().contains("given up before"));
            bench.give(given(bench.now, configuration(0.6)));
            bench.heads(&holding(), 8);
        }
    }
}

#[test]
fn a_refusal_ends_the_goal_only_where_another_than_the_daemon_has_ordered_a_stop() {
    let mut bench = Bench::underway();
    bench
        .keeper
        .hear_result(&refused(7, Refusal::StartsElsewhere));
    assert!(bench.after(20, &holding()).is_some(), "at once");
    bench.publish(8);
    bench
        .keeper
        .hear_result(&refused(8, Refusal::RequestedBefore));
    let mut stopped = HeardOrders {
        wanted_from_mono_ns: bench.now,
        goals_from_mono_ns: GIVEN - 1,
        daemon_instance: 1,
    };
    bench.keeper.hear_orders(stopped);
    let request = bench.heads(&holding(), 9);
    let requested = stopped.wanted_from_mono_ns + 1;
    assert_eq!(request.requested_mono_ns, Some(requested));
    bench
        .keeper
        .hear_result(&refused(9, Refusal::RequestedBefore));
    stopped.goals_from_mono_ns = bench.now;
    bench.keeper.hear_orders(stopped);
    assert_eq!(bench.state(), GoalState::Ended);
}

#[test]
fn a_controller_that_refuses_everything_is_asked_ten_times_a_second() {
    let mut bench = Bench::new();
    bench.give(given(GIVEN, configuration(0.4)));
    let mut count = 0;
    for _ in 0..1_000 {
        if bench.after(1, &holding()).is_some() {
            count += 1;
            bench.publish(count);
            bench
                .keeper
                .hear_result(&refused(count, Refusal::OutOfLimits));
        }
    }
    assert!((10..=11).contains(&count), "{count}");
}

#[test]
fn stops_that_the_controller_tells_of_end_a_goal_at_rest_but_not_the_daemons_own() {
    let mut bench = Bench::new();
    bench.give(given(GIVEN, configuration(0.4)));
    // The daemon's supervision has stopped something after the goal was given.
    let own = HeardOrders {
        wanted_from_mono_ns: GIVEN + 5 * MS,
        goals_from_mono_ns: GIVEN - 1,
        daemon_instance: 1,
    };
    bench.keeper.hear_orders(own);
    let request = bench.heads(&holding(), 7);
    assert_eq!(request.requested_mono_ns, Some(GIVEN + 5 * MS + 1));
    bench
        .keeper
        .hear_result(&ended_by(7, MotionOutcome::Reached));
    bench.after(20, &holding());
    assert_eq!(bench.state(), GoalState::Reached);
    let ordered = HeardOrders {
        wanted_from_mono_ns: GIVEN + 400 * MS,
        goals_from_mono_ns: GIVEN + 400 * MS,
        ..own
    };
    bench.keeper.hear_orders(ordered);
    assert_eq!(bench.state(), GoalState::Ended);
    assert!(bench.reason().contains("a stop"), "{}", bench.reason());
    bench.give(given(GIVEN + 401 * MS, configuration(0.5)));
    bench.keeper.hear_orders(ordered);
    bench.heads(&holding(), 8);
}

#[test]
fn a_plan_in_work_is_not_executed_after_a_stop() {
    let mut bench = Bench::underway();
    bench.after(100, &following(7)).unwrap();
    bench.keeper.hear_orders(HeardOrders {
        wanted_from_mono_ns: bench.now,
        goals_from_mono_ns: bench.now,
        daemon_instance: 1,
    });
    let wanted = bench.keeper.wants(Some(&switch(7, 0.2)), 0.1);
    assert_eq!(wanted, Wanted::GivenUp);
    bench
        .keeper
        .hear_plan(&failed(Outcome::ExecutionRefused, ""));
    assert!(bench.after(100, &following(7)).is_none(), "no more plans");
    // The result tells by whom.
    bench
        .keeper
        .hear_result(&stopped(7, StopCause::Command, CommandSender::Program));
    assert_eq!(bench.state(), GoalState::Ended);
}

#[test]
fn a_withdrawn_goal_stops_its_newest_motion_and_counts_no_more() {
    let withdrawn = |stamp_mono_ns| StandingGoal {
        is_withdrawn: true,
        stamp_mono_ns,
        ..given(GIVEN, configuration(0.4))
    };
    let mut bench = Bench::underway();
    assert_eq!(bench.keeper.give(withdrawn(GIVEN + 1)).unwrap(), Some(7));
    assert_eq!(bench.state(), GoalState::Ended);
    assert!(bench.after(100, &holding()).is_none());
    bench.keeper.give(withdrawn(GIVEN + 2)).unwrap_err();
    // The motion that was to join was refused: the one under way is the one to stop.
    let mut bench = Bench::underway();
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 1,
        ..given(GIVEN, configuration(0.6))
    });
    bench.heads(&following(7), 8);
    bench
        .keeper
        .hear_result(&refused(8, Refusal::StartsElsewhere));
    assert_eq!(bench.keeper.give(withdrawn(GIVEN + 2)).unwrap(), Some(7));
    let mut before = Bench::new();
    before.give(given(GIVEN, configuration(0.4)));
    assert_eq!(before.keeper.give(withdrawn(GIVEN + 1)).unwrap(), None);
}

#[test]
fn of_two_senders_the_one_counts_that_gave_later() {
    let mut bench = Bench::underway();
    bench.give(given(GIVEN + 10, configuration(0.6)));
    assert_eq!(bench.state(), GoalState::Planning);
    for earlier in [GIVEN, GIVEN + 5, GIVEN + 9] {
        let update = StandingGoal {
            stamp_mono_ns: GIVEN + 50,
            ..given(earlier, configuration(0.4))
        };
        bench.keeper.give(update).unwrap_err();
        let withdrawn = StandingGoal {
            is_withdrawn: true,
            ..update
        };
        bench.keeper.give(withdrawn).unwrap_err();
    }
    let request = bench.heads(&following(7), 8);
    assert_eq!(request.goal, configuration(0.6));
    assert_eq!(bench.keeper.status().given_mono_ns, GIVEN + 10);
}

#[test]
fn of_two_updates_the_one_with_the_later_stamp_counts() {
    let mut bench = Bench::underway();
    let update = |stamp, bend| StandingGoal {
        stamp_mono_ns: stamp,
        ..given(GIVEN, configuration(bend))
    };
    bench.give(update(GIVEN + 9, 0.6));
    bench.give(update(GIVEN + 8, 0.8));
    bench.give(update(GIVEN + 9, 0.9));
    assert_eq!(
        bench.heads(&following(7), 8).goal,
        configuration(0.6),
        "the newest"
    );
    assert_eq!(bench.keeper.status().goal_stamp_mono_ns, GIVEN + 9);
}

#[test]
fn a_goal_to_which_the_motion_is_stopped_is_told_while_the_robot_still_brakes() {
    let mut bench = Bench::underway();
    let stopping = RobotMotion::Busy {
        state: LoopState::Stopping,
        fault: LoopFault::None,
        passes: true,
        stopped_for: Some(InTheWay::OnTheWay { at_s: 0.5 }.into()),
    };
    assert!(bench.after(1, &stopping).is_none());
    assert_eq!(bench.state(), GoalState::Unreachable);
    assert!(bench.reason().contains("0.5"), "{}", bench.reason());
}
