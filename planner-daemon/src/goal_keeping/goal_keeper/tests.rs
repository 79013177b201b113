//! Every way of a goal from its giving to its end, without a port or a clock.

use shared_types::codes::{LoopFault, LoopState, Refusal};
use shared_types::message;
use trajectory::Knot;

use super::*;
use crate::execution::FollowedMotion;
use crate::fixtures::{followed, unit_robot};

const MS: i64 = 1_000_000;
/// When the first goal is given.
const GIVEN: i64 = 1_000 * MS;
const PLAN: u64 = 500;

fn configuration(bend: f64) -> Goal {
    Goal::Configuration([bend, 0.1, -0.3, 0.2, 0.1, 0.5])
}

fn given(given_mono_ns: i64, goal: Goal) -> StandingGoal {
    StandingGoal {
        given_mono_ns,
        stamp_mono_ns: given_mono_ns,
        goal,
        tip_velocity_m_s: [0.0; 3],
        limits_scale: 1.0,
        robot_hash: None,
        is_withdrawn: false,
    }
}

fn holding() -> RobotMotion {
    RobotMotion::Holding(Configuration::zeros())
}

fn following(trajectory_id: u32) -> RobotMotion {
    RobotMotion::Following(FollowedMotion {
        trajectory_id,
        ..followed()
    })
}

fn busy(state: LoopState, fault: LoopFault, passes: bool) -> RobotMotion {
    RobotMotion::Busy {
        state,
        fault,
        passes,
        stopped_for: None,
    }
}

fn switch(trajectory_id: u32, path_time_s: f64) -> Switch {
    let knot = Knot {
        time: 0.0,
        position: Configuration::zeros(),
        velocity: Configuration::zeros(),
        acceleration: Configuration::zeros(),
    };
    Switch {
        trajectory_id,
        path_time_s,
        state: knot,
    }
}

fn ended_by(trajectory_id: u32, outcome: MotionOutcome) -> MotionResult {
    let wire = message::MotionResult {
        trajectory_id,
        outcome: outcome.code(),
        joined_by: u32::from(outcome == MotionOutcome::Joined),
        ..message::MotionResult::ZEROED
    };
    MotionResult::try_from(&wire).unwrap()
}

fn stopped(trajectory_id: u32, cause: StopCause, sender: CommandSender) -> MotionResult {
    MotionResult {
        cause,
        sender,
        ..ended_by(trajectory_id, MotionOutcome::Stopped)
    }
}

fn refused(trajectory_id: u32, refusal: Refusal) -> MotionResult {
    MotionResult {
        refusal,
        ..ended_by(trajectory_id, MotionOutcome::Refused)
    }
}

fn failed(outcome: Outcome, reason: &str) -> PlanResult {
    PlanResult {
        plan_id: PLAN,
        outcome,
        reason: ReasonText::new(reason),
        published: None,
    }
}

/// A keeper, and the time.
struct Bench {
    keeper: GoalKeeper,
    now: i64,
}

impl Bench {
    fn new() -> Self {
        Self {
            keeper: GoalKeeper::new(unit_robot()),
            now: GIVEN,
        }
    }

    /// A keeper whose first goal is given, and its motion 7 of 2 s published.
    fn underway() -> Self {
        let mut bench = Self::new();
        bench.give(given(GIVEN, configuration(0.4)));
        bench.heads(&holding(), 7);
        bench
    }

    fn give(&mut self, goal: StandingGoal) {
        assert_eq!(self.keeper.give(goal).unwrap(), None);
    }

    fn after(&mut self, ms: i64, robot: &RobotMotion) -> Option<PlanRequest> {
        self.now += ms * MS;
        self.keeper.next_plan(robot, self.now)
    }

    /// A plan is made now, and its motion published.
    fn heads(&mut self, robot: &RobotMotion, trajectory_id: u32) -> PlanRequest {
        let request = self.after(100, robot).expect("a plan");
        self.publish(trajectory_id);
        request
    }

    fn publish(&mut self, trajectory_id: u32) {
        self.keeper.hear_plan(&PlanResult {
            plan_id: PLAN,
            outcome: Outcome::Ok,
            reason: ReasonText::new(""),
            published: Some(PublishedMotion {
                trajectory_id,
                duration_s: 2.0,
            }),
        });
    }

    /// Plans in the next `ms` milliseconds, each of which fails.
    fn failing_plans(&mut self, ms: i64, robot: &RobotMotion, result: &PlanResult) -> usize {
        let mut count = 0;
        for _ in 0..ms {
            if self.after(1, robot).is_some() {
                self.keeper.hear_plan(result);
                count += 1;
            }
        }
        count
    }

    fn state(&self) -> GoalState {
        GoalState::try_from(self.keeper.status().state).unwrap()
    }

    fn reason(&self) -> String {
        self.keeper.status().reason.text().into_owned()
    }
}

#[test]
fn a_goal_is_planned_for_headed_for_and_reached() {
    let mut bench = Bench::new();
    assert_eq!(bench.state(), GoalState::None);
    assert!(bench.after(1, &holding()).is_none(), "no goal");
    bench.give(given(GIVEN, configuration(0.4)));
    assert_eq!(bench.state(), GoalState::Planning);
    let request = bench.heads(&holding(), 7);
    assert_eq!(request.requested_mono_ns, Some(GIVEN));
    assert_eq!(request.goal, configuration(0.4));
    assert!(request.execute);
    assert_eq!(bench.state(), GoalState::Underway);
    assert_eq!(bench.keeper.status().trajectory_id, 7);
    bench
        .keeper
        .hear_result(&ended_by(7, MotionOutcome::Reached));
    // Within the motion's own tolerance, not exactly there.
    for _ in 0..1_000 {
        assert!(bench.after(1, &holding()).is_none(), "it stays");
    }
    assert_eq!(bench.state(), GoalState::Reached);
    assert_eq!(bench.keeper.status().plan_count, 1);
}

#[test]
fn a_robot_that_is_found_elsewhere_goes_to_its_goal_again() {
    let mut bench = Bench::underway();
    bench
        .keeper
        .hear_result(&ended_by(7, MotionOutcome::Reached));
    let there = RobotMotion::Holding(Configuration::repeat(0.1));
    assert!(bench.after(100, &there).is_none(), "it stays");
    assert_eq!(bench.state(), GoalState::Reached);
    // Its driver ends, and begins anew with the robot where it was moved meanwhile.
    let starting = busy(LoopState::Starting, LoopFault::None, true);
    assert!(bench.after(100, &starting).is_none());
    assert_eq!(bench.state(), GoalState::Reached, "it may be there at once");
    assert!(bench.after(101, &starting).is_none());
    assert_eq!(bench.state(), GoalState::RobotNotReady);
    assert!(bench.after(100, &there).is_none(), "nobody moved it");
    let request = bench.after(100, &holding()).expect("it was moved");
    assert_eq!(request.goal, configuration(0.4));
    bench.publish(8);
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_robot_at_rest_at_its_goal_stays() {
    let robot = unit_robot();
    let at = Configuration::from([0.4, 0.1, -0.3, 0.2, 0.1, 0.5]);
    let tip = robot.tip(&at).map(|part| robot.in_metres(part));
    let tolerance_m = 0.05;
    for (off, stays) in [(0.09, true), (0.11, false)] {
        let mut bench = Bench::new();
        bench.give(given(
            GIVEN,
            Goal::Tip {
                position_m: [tip[0] + off * tolerance_m, tip[1], tip[2]],
                tolerance_m: Some(tolerance_m),
            },
        ));
        let planned = bench.after(1, &RobotMotion::Holding(at));
        assert_eq!(planned.is_none(), stays, "{off} of its tolerance away");
        assert_eq!(bench.state() == GoalState::Reached, stays);
    }
    let mut bench = Bench::new();
    bench.give(given(GIVEN, Goal::Configuration(at.into())));
    assert!(bench.after(1, &RobotMotion::Holding(at)).is_none());
    assert_eq!(bench.state(), GoalState::Reached);
}

#[test]
fn what_cannot_be_reached_is_told_and_tried_again_ten_times_a_second() {
    let mut bench = Bench::new();
    bench.give(given(GIVEN, configuration(0.4)));
    let far = failed(Outcome::GoalOutOfReach, "4 m away");
    assert_eq!(bench.failing_plans(1_000, &holding(), &far), 10);
    assert_eq!(bench.state(), GoalState::Unreachable);
    assert!(bench.reason().contains("4 m away"), "{}", bench.reason());
    bench.heads(&holding(), 7);
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_plan_that_waited_too_long_says_nothing_of_the_goal() {
    let mut bench = Bench::new();
    bench.give(given(GIVEN, configuration(0.4)));
    let waited = PlanResult {
        plan_id: 0,
        ..failed(Outcome::Truncated, "the deadline passed")
    };
    bench.failing_plans(200, &holding(), &waited);
    assert_eq!(bench.state(), GoalState::Planning);
    bench.failing_plans(200, &holding(), &failed(Outcome::Truncated, ""));
    assert_eq!(bench.state(), GoalState::Unreachable);
}

#[test]
fn a_robot_that_is_not_ready_is_told_and_asked_again() {
    let mut bench = Bench::new();
    bench.give(given(GIVEN, configuration(0.4)));
    let fault = busy(LoopState::Fault, LoopFault::RobotLost, false);
    for (robot, text) in [
        (RobotMotion::Unknown, "no controller"),
        (fault, "robot lost"),
    ] {
        assert!(bench.after(1, &robot).is_none());
        assert_eq!(bench.state(), GoalState::RobotNotReady);
        assert!(bench.reason().contains(text), "{}", bench.reason());
    }
    let passes = busy(LoopState::Executing, LoopFault::None, true);
    assert!(bench.after(1, &passes).is_none());
    bench.heads(&holding(), 7);
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_robot_that_waits_for_its_switch_during_a_pause_stays_underway() {
    let mut bench = Bench::underway();
    let joins = busy(LoopState::Executing, LoopFault::None, true);
    for _ in 0..5 {
        assert!(bench.after(100, &joins).is_none());
        assert_eq!(bench.state(), GoalState::Underway);
    }
    let starts = busy(LoopState::Starting, LoopFault::None, true);
    bench.after(1, &starts);
    bench.after(500, &starts);
    assert_eq!(bench.state(), GoalState::RobotNotReady);
}

#[test]
fn a_robot_that_is_ready_again_on_its_way_is_told_to_be_underway() {
    let mut bench = Bench::underway();
    bench.after(100, &RobotMotion::Unknown);
    assert_eq!(bench.state(), GoalState::RobotNotReady);
    assert_eq!(
        bench.failing_plans(
            150,
            &following(7),
            &failed(Outcome::ExecutionRefused, "no better")
        ),
        2
    );
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_plan_for_a_goal_that_was_replaced_or_given_up_is_not_executed() {
    for is_withdrawn in [false, true] {
        let mut bench = Bench::new();
        bench.give(given(GIVEN, configuration(0.4)));
        bench.after(1, &holding()).unwrap();
        if is_withdrawn {
            bench.keeper.end("a test");
        }
        bench.give(given(GIVEN + 10, configuration(0.6)));
        assert!(
            bench.after(200, &holding()).is_none(),
            "one plan at a time, whoever it is for"
        );
        assert_eq!(bench.keeper.wants(None, 1.0), Wanted::GivenUp);
        bench
            .keeper
            .hear_plan(&failed(Outcome::ExecutionRefused, ""));
        assert_eq!(bench.state(), GoalState::Planning);
        assert_eq!(
            bench.heads(&holding(), 8).goal,
            configuration(0.6),
            "the new one"
        );
    }
}

#[test]
fn a_motion_is_left_for_another_goal_or_for_a_tenth_of_its_time() {
    let mut bench = Bench::underway();
    bench.after(100, &following(7)).unwrap();
    let at = switch(7, 1.0);
    assert_eq!(bench.keeper.wants(Some(&at), 0.89), Wanted::Yes);
    assert_eq!(
        bench.keeper.wants(Some(&at), 0.91),
        Wanted::NoBetter { remaining_s: 1.0 }
    );
    bench
        .keeper
        .hear_plan(&failed(Outcome::ExecutionRefused, "no better"));
    assert_eq!(bench.state(), GoalState::Underway);
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 1,
        ..given(GIVEN, configuration(0.6))
    });
    bench.after(20, &following(7)).unwrap();
    assert_eq!(bench.keeper.wants(Some(&at), 5.0), Wanted::Yes);
}

#[test]
fn a_slower_share_of_the_limits_is_taken_up_under_way() {
    let mut bench = Bench::underway();
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 1,
        limits_scale: 0.2,
        ..given(GIVEN, configuration(0.4))
    });
    let request = bench.after(20, &following(7)).unwrap();
    assert!((request.limits_scale - 0.2).abs() < f64::EPSILON);
    assert_eq!(bench.keeper.wants(Some(&switch(7, 1.0)), 5.0), Wanted::Yes);
}

#[test]
fn a_plan_that_was_overtaken_by_the_end_of_the_motion_is_not_executed_at_the_goal() {
    let mut bench = Bench::underway();
    bench.after(100, &following(7)).unwrap();
    let there = Wanted::NoBetter { remaining_s: 0.0 };
    assert_eq!(bench.keeper.wants(None, 0.01), there);
    bench
        .keeper
        .hear_result(&ended_by(7, MotionOutcome::Reached));
    assert_eq!(bench.keeper.wants(None, 0.01), there);
    bench
        .keeper
        .hear_plan(&failed(Outcome::ExecutionRefused, "no better"));
    bench.after(20, &holding());
    assert_eq!(bench.state(), GoalState::Reached);
    assert_eq!(bench.keeper.status().motion_count, 1);
}

#[test]
fn a_result_that_is_lost_does_not_keep_the_robot_from_its_goal() {
    let mut bench = Bench::underway();
    assert!(bench.after(100, &holding()).is_none(), "it may still come");
    assert!(bench.after(99, &holding()).is_none());
    assert!(bench.after(1, &holding()).is_some(), "it does not");
    bench.publish(8);
    // The late result of the first one says nothing of the second.
    bench
        .keeper
        .hear_result(&stopped(7, StopCause::Fault, CommandSender::Program));
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_motion_that_is_joined_ends_nothing_and_the_one_before_still_counts_where_the_next_is_set_aside()
 {
    let mut bench = Bench::underway();
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 1,
        ..given(GIVEN, configuration(0.6))
    });
    bench.heads(&following(7), 8);
    bench
        .keeper
        .hear_result(&ended_by(7, MotionOutcome::Joined));
    assert_eq!(bench.state(), GoalState::Underway);
    bench
        .keeper
        .hear_result(&ended_by(8, MotionOutcome::Reached));
    bench.after(20, &holding());
    assert_eq!(bench.state(), GoalState::Reached);
    // A program stops the motion under way while another one is to join it.
    let mut bench = Bench::underway();
    bench.after(100, &following(7)).unwrap();
    bench.publish(8);
    bench
        .keeper
        .hear_result(&stopped(7, StopCause::Command, CommandSender::Program));
    assert_eq!(bench.state(), GoalState::Ended);
}

#[test]
fn the_way_to_a_former_place_goes_on_while_the_new_one_cannot_be_reached() {
    let mut bench = Bench::underway();
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 1,
        ..given(GIVEN, configuration(0.6))
    });
    bench.after(20, &following(7)).unwrap();
    bench
        .keeper
        .hear_plan(&failed(Outcome::ExecutionRefused, "switch missed"));
    assert_eq!(bench.state(), GoalState::Underway, "tried again");
    bench.after(100, &following(7)).unwrap();
    bench.keeper.hear_plan(&failed(Outcome::GoalOutOfReach, ""));
    assert_eq!(bench.state(), GoalState::Unreachable);
    // Back where it was.
    bench.give(StandingGoal {
        stamp_mono_ns: GIVEN + 2,
        ..given(GIVEN, configuration(0.4))
    });
    bench.after(100, &following(7)).unwrap();
    bench
        .keeper
        .hear_plan(&failed(Outcome::ExecutionRefused, "no better"));
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_goal_that_an_obstacle_has_come_to_is_told_while_the_motion_to_it_still_goes_on() {
    let mut bench = Bench::underway();
    let RobotMotion::Following(mut barred) = following(7) else {
        unreachable!("it follows")
    };
    barred.is_blocked = true;
    let barred = RobotMotion::Following(barred);
    bench.after(20, &barred).unwrap();
    let failure = failed(Outcome::GoalInCollision, "the obstacle is there");
    bench.keeper.hear_plan(&failure);
    assert_eq!(bench.state(), GoalState::Unreachable);
    // The motion is certified to its end again.
    bench.after(100, &following(7)).unwrap();
    bench
        .keeper
        .hear_plan(&failed(Outcome::ExecutionRefused, "no better"));
    assert_eq!(bench.state(), GoalState::Underway);
}

#[test]
fn a_motion_that_a_client_has_executed_ends_the_goal_by_its_number() {
    let mut bench = Bench::underway();
    bench.keeper.end_for_foreign(9);
    assert_eq!(bench.state(), GoalState::Ended);
    assert!(
        bench.reason().contains("trajectory 9"),
        "{}",
        bench.reason()
    );
    assert!(bench.after(100, &following(9)).is_none());
}

mod endings;
mod pace;
