//! How often plans begin.

use super::*;
use crate::live_scene::Progress;

#[test]
fn a_goal_that_moves_is_planned_for_fifty_times_a_second_at_most() {
    let mut bench = Bench::underway();
    let (mut count, mut ids) = (0, 8..);
    for stamp in 1..=1_000 {
        bench.give(StandingGoal {
            stamp_mono_ns: GIVEN + stamp,
            ..given(GIVEN, configuration(0.4 + 1e-4 * stamp as f64))
        });
        if bench.after(1, &following(7)).is_some() {
            count += 1;
            bench.publish(ids.next().unwrap());
        }
    }
    assert_eq!(count, 50);
}

#[test]
fn a_motion_from_rest_gathers_speed_before_it_is_left_for_a_tip_that_moved_a_little() {
    let tip = |x: f64| Goal::tip([x, 0.5, 2.3]);
    let at = |x: f64, stamp: i64| StandingGoal {
        stamp_mono_ns: GIVEN + stamp,
        ..given(GIVEN, tip(x))
    };
    let mut bench = Bench::new();
    bench.give(at(1.0, 0));
    bench.heads(&holding(), 7);
    let begun = |ms: i64, now: i64, is_blocked: bool| {
        let RobotMotion::Following(followed) = following(7) else {
            unreachable!("it follows")
        };
        RobotMotion::Following(FollowedMotion {
            is_blocked,
            progress: Progress {
                time_s: 1e-3 * ms as f64,
                ..Progress::from_begin(now)
            },
            ..followed
        })
    };
    bench.give(at(1.02, 1));
    let now = bench.now + 20 * MS;
    assert!(bench.after(20, &begun(20, now, false)).is_none());
    let now = bench.now + 140 * MS;
    assert!(bench.after(140, &begun(160, now, false)).is_some());
    // At once where an obstacle has come, or the tip has gone far.
    for (x, is_blocked) in [(1.03, true), (1.4, false)] {
        let mut bench = Bench::new();
        bench.give(at(1.0, 0));
        bench.heads(&holding(), 7);
        bench.give(at(x, 1));
        let now = bench.now + 20 * MS;
        assert!(bench.after(20, &begun(20, now, is_blocked)).is_some());
    }
}

fn tip_at(x: f64, stamp: i64) -> StandingGoal {
    StandingGoal {
        stamp_mono_ns: GIVEN + stamp,
        ..given(GIVEN, Goal::tip([x, 0.5, 2.3]))
    }
}

#[test]
fn a_goal_that_jumps_is_planned_for_at_once_but_not_again_and_again() {
    let mut bench = Bench::new();
    bench.give(tip_at(1.0, 0));
    bench.heads(&holding(), 7);
    bench.give(tip_at(1.02, 1));
    assert!(bench.after(100, &following(7)).is_some());
    bench.publish(8);
    bench.give(tip_at(-1.0, 2));
    let request = bench.after(1, &following(8)).expect("it has jumped");
    assert_eq!(request.goal, Goal::tip([-1.0, 0.5, 2.3]));
    bench.publish(9);
    bench.give(tip_at(1.0, 3));
    assert!(bench.after(19, &following(9)).is_none());
    assert!(bench.after(1, &following(9)).is_some());
}

#[test]
fn a_goal_that_has_jumped_is_planned_for_afresh_until_a_motion_to_it_is_published() {
    let configuration_at = |bend: f64, stamp: i64| StandingGoal {
        stamp_mono_ns: GIVEN + stamp,
        ..given(GIVEN, configuration(bend))
    };
    for at in [tip_at as fn(f64, i64) -> StandingGoal, configuration_at] {
        let mut bench = Bench::new();
        bench.give(at(1.0, 0));
        bench.heads(&holding(), 7);
        let mut goes_on = |stamp: i64, x: f64, becomes: Option<u32>| {
            bench.give(at(x, stamp));
            let request = bench.after(100, &following(7)).unwrap();
            match becomes {
                Some(id) => bench.publish(id),
                None => bench.keeper.hear_plan(&failed(Outcome::NoPath, "")),
            }
            request.previous.is_some()
        };
        assert!(goes_on(1, 1.02, Some(8)));
        assert!(!goes_on(2, -1.0, None));
        assert!(!goes_on(3, -1.01, Some(9)), "the plan to the place before");
        assert!(goes_on(4, -1.02, Some(10)));
        bench
            .keeper
            .hear_result(&refused(10, Refusal::SwitchMissed));
        let request = bench.after(100, &following(9)).unwrap();
        assert_eq!(request.previous, None, "nobody follows it");
    }
}

#[test]
fn a_motion_that_came_after_its_switch_is_planned_again_at_once_but_once() {
    let mut bench = Bench::underway();
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 1,
        ..given(GIVEN, configuration(0.6))
    });
    let missed = |id| refused(id, Refusal::SwitchMissed);
    bench.heads(&following(7), 8);
    bench.keeper.hear_result(&missed(8));
    assert!(bench.after(1, &following(7)).is_some());
    bench.publish(9);
    bench.keeper.hear_result(&missed(9));
    assert!(bench.after(18, &following(7)).is_none());
}

#[test]
fn a_plan_in_work_that_is_made_again_for_a_missed_switch_is_not_followed_by_another() {
    let mut bench = Bench::underway();
    assert!(bench.after(100, &following(7)).is_some());
    let motion = PublishedMotion {
        trajectory_id: 8,
        duration_s: 1.0,
    };
    bench.keeper.hear_motion(motion);
    bench.keeper.hear_result(&refused(8, Refusal::SwitchMissed));
    bench.publish(9);
    assert!(bench.after(21, &following(7)).is_none());
}

#[test]
fn a_plan_in_work_is_given_up_for_a_goal_that_has_jumped() {
    let mut bench = Bench::new();
    bench.give(tip_at(1.0, 0));
    assert!(bench.after(0, &holding()).is_some());
    assert!(!bench.keeper.overtakes(false, bench.now + 30 * MS));
    bench.give(tip_at(-1.0, 1));
    assert!(
        !bench.keeper.overtakes(false, bench.now + 19 * MS),
        "too soon"
    );
    assert!(bench.keeper.wants_plan_in_work());
    assert!(bench.keeper.overtakes(false, bench.now + 20 * MS));
    assert!(!bench.keeper.wants_plan_in_work(), "it is not made again");
    assert!(
        !bench.keeper.overtakes(false, bench.now + 21 * MS),
        "it is already"
    );
    assert_eq!(bench.keeper.wants(None, 1.0), Wanted::GivenUp);
    bench.keeper.hear_plan(&failed(Outcome::Truncated, ""));
    assert_eq!(bench.state(), GoalState::Planning);
    let request = bench.after(20, &holding()).expect("a plan to the new goal");
    assert_eq!(request.goal, Goal::tip([-1.0, 0.5, 2.3]));
    assert_eq!(bench.keeper.wants(None, 1.0), Wanted::Yes);
}

#[test]
fn a_motion_of_a_plan_that_is_not_complete_is_under_way() {
    let mut bench = Bench::new();
    bench.give(tip_at(1.0, 0));
    assert!(bench.after(0, &holding()).is_some());
    let motion = PublishedMotion {
        trajectory_id: 7,
        duration_s: 2.0,
    };
    bench.keeper.hear_motion(motion);
    assert_eq!(bench.state(), GoalState::Underway);
    assert!(bench.after(50, &following(7)).is_none(), "the plan goes on");
    bench.publish(7);
    assert_eq!(bench.keeper.status().motion_count, 1);
    let withdrawn = StandingGoal {
        is_withdrawn: true,
        ..tip_at(1.0, 1)
    };
    assert_eq!(bench.keeper.give(withdrawn), Ok(Some(7)));
}

#[test]
fn a_goal_that_stays_where_it_is_keeps_its_plan_however_long_that_takes() {
    for goal in [configuration(0.4), Goal::tip([1.0, 0.5, 2.3])] {
        let mut bench = Bench::new();
        bench.give(given(GIVEN, goal));
        assert!(bench.after(0, &holding()).is_some());
        assert!(!bench.keeper.overtakes(false, bench.now + 60 * MS));
    }
}

#[test]
fn of_a_goal_that_jumps_about_every_other_plan_is_finished() {
    let mut bench = Bench::new();
    bench.give(tip_at(1.0, 0));
    let mut is_given_up = Vec::new();
    for stamp in 1..=6 {
        assert!(bench.after(25, &holding()).is_some());
        bench.give(tip_at(if stamp % 2 == 0 { 1.0 } else { -1.0 }, stamp));
        is_given_up.push(bench.keeper.overtakes(false, bench.now + 20 * MS));
        bench.keeper.hear_plan(&failed(Outcome::Truncated, ""));
    }
    assert_eq!(is_given_up, [true, false, true, false, true, false]);
}

#[test]
fn a_plan_whose_motion_is_on_its_way_may_be_given_up_and_the_next_one_too() {
    let mut bench = Bench::new();
    bench.give(tip_at(1.0, 0));
    assert!(bench.after(0, &holding()).is_some());
    bench.give(tip_at(-1.0, 1));
    assert!(bench.keeper.overtakes(true, bench.now + 20 * MS));
    bench.publish(7);
    assert!(bench.after(25, &following(7)).is_some());
    bench.give(tip_at(1.0, 2));
    assert!(bench.keeper.overtakes(false, bench.now + 20 * MS));
}

#[test]
fn a_goal_that_jumps_and_comes_back_is_planned_for_again() {
    let mut bench = Bench::new();
    bench.give(tip_at(1.0, 0));
    assert!(bench.after(0, &holding()).is_some());
    bench.give(tip_at(-1.0, 1));
    assert!(bench.keeper.overtakes(false, bench.now + 20 * MS));
    bench.give(tip_at(1.0, 2));
    bench.keeper.hear_plan(&failed(Outcome::Truncated, ""));
    assert!(bench.after(21, &holding()).is_some());
}

#[test]
fn a_goal_with_a_velocity_is_followed_by_motions_with_its_limits() {
    let moving = |ms| StandingGoal {
        tip_velocity_m_s: [0.1, 0.0, 0.0],
        ..tip_at(1.0, ms)
    };
    let mut bench = Bench::new();
    bench.give(moving(0));
    assert_eq!(bench.keeper.motion_to_target(), None, "the robot rests");
    bench.heads(&holding(), 7);
    assert_eq!(bench.keeper.motion_to_target(), Some(7));
    bench.give(StandingGoal {
        limits_scale: 0.5,
        ..moving(1)
    });
    assert_eq!(bench.keeper.motion_to_target(), None, "other limits");
    bench.give(tip_at(1.0, 2));
    assert_eq!(bench.keeper.motion_to_target(), None, "it rests");
}
