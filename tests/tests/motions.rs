//! Plans that become motions, and processes that die under them.
#![allow(clippy::unwrap_used)]

use shared_types::clock::mono_now_ns;
use shared_types::codes::{MotorState, Outcome, Refusal};
use shared_types::valid::{Command, Goal, PlanRequest, PlannedExecution};
use tests::disturbance::Kind;
use tests::judge::Judge;
use tests::kills::disturb;
use tests::listener::Listener;
use tests::process::wait_for;
use tests::stack::{MoveError, NO_DEADLINE, PATIENCE, Part, Stack};
use tests::world::Settings;

#[test]
fn a_plan_becomes_a_motion_within_limits_that_reaches_the_tip() {
    let mut stack = Stack::running(&Settings::fast_robot()).unwrap();
    let listener = Listener::start(&stack.world.options);
    for tip in [[0.0, -1.55, 2.25], [1.5, 0.0, 2.4]] {
        let motion = stack.move_tip(tip).unwrap();
        assert!(motion.commanded_tip_error <= 0.01, "{motion:?}");
        assert!(motion.measured_tip_error <= 0.03, "{motion:?}");
        assert!(motion.duration_s > 0.1, "{motion:?}");
    }
    let mut judge = Judge::new(stack.world.robot.tendon_limits);
    judge.look(&listener.take());
    let verdict = judge.verdict();
    assert!(verdict.setpoints > 500, "{verdict:?}");
    assert!(verdict.velocity > 0.5, "the premise, it moved: {verdict:?}");
    assert_eq!(verdict.offences, Vec::<String>::new());
    assert!(verdict.reference_error_m < 1e-9, "{verdict:?}");
}

#[test]
fn a_killed_controller_lets_the_robot_ramp_to_rest_and_a_new_one_takes_over() {
    let mut stack = Stack::running(&Settings::fast_robot()).unwrap();
    let listener = Listener::start(&stack.world.options);
    let goal = Goal::Configuration([0.9, 0.6, 0.5, -0.4, -0.6, 0.3]);
    let id = stack.begin_motion(goal).unwrap();
    stack.wait_for_progress(id, 0.2).unwrap();
    stack.kill9(Part::Controller);
    wait_for("the robot rests", PATIENCE, || {
        let state = stack.robot.latest().unwrap()?;
        (state.state == MotorState::AtRestAfterLoss).then_some(())
    })
    .unwrap();
    let heard = listener.take();
    let is_ramping = |state: u32| state == MotorState::RampingToRest.code();
    assert!(heard.robot.iter().any(|state| is_ramping(state.state)));
    let mut judge = Judge::new(stack.world.robot.tendon_limits);
    judge.look(&heard);
    let verdict = judge.verdict();
    assert!(
        verdict.unled.velocity > 0.5,
        "the premise, it ramped: {verdict:?}"
    );
    assert_eq!(verdict.offences, Vec::<String>::new());
    assert!(verdict.reference_error_m < 1e-9, "{verdict:?}");
    stack.start(Part::Controller);
    stack.wait_until_ready().unwrap();
    let motion = stack.move_tip([0.0, -1.55, 2.25]).unwrap();
    assert!(motion.commanded_tip_error <= 0.01, "{motion:?}");
}

#[test]
fn killed_stopped_and_held_at_random_instants_everything_works_again_within_the_shipped_limits() {
    let mut stack = Stack::running(&Settings::default()).unwrap();
    let survival = disturb(&mut stack, &Kind::ALL, 9, 1).unwrap();
    assert_eq!(survival.disturbances.len(), 9, "{survival:?}");
    assert_eq!(survival.failures, Vec::<String>::new());
    assert_eq!(survival.recovered, survival.rounds);
    assert_eq!(survival.watched.late, Vec::<String>::new());
    let verdict = survival.verdict;
    assert!(verdict.setpoints > 1000, "{verdict:?}");
    assert!(verdict.velocity > 0.1, "the premise, it moved: {verdict:?}");
    assert_eq!(verdict.offences, Vec::<String>::new());
    assert!(verdict.reference_error_m < 1e-9, "{verdict:?}");
    assert_eq!(verdict.faults, 0);
}

#[test]
fn a_second_daemon_and_a_second_controller_refuse_by_name() {
    let mut stack = Stack::running(&Settings::fast_robot().patient()).unwrap();
    for part in [Part::Daemon, Part::Controller] {
        let mut second = part.start(&stack.world);
        let status = second.wait(PATIENCE).unwrap();
        assert!(!status.success());
        let (log, pid) = (second.log(), stack.process(part).pid().to_string());
        assert!(
            log.contains(part.program()) && log.contains("already runs"),
            "{log}"
        );
        assert!(log.contains(&pid), "{log}");
    }
    stack.move_tip([1.5, 0.0, 2.4]).unwrap();
}

#[test]
fn a_motion_that_does_not_start_where_the_robot_is_is_not_executed() {
    let mut stack = Stack::running(&Settings::fast_robot().patient()).unwrap();
    let request = shared_types::valid::PlanRequest {
        sampler: stack.world.sampler(),
        execute: true,
        ..shared_types::valid::PlanRequest::new([0.3; 6], Goal::Configuration([0.2; 6]))
    };
    let refused = stack.try_motion(&request);
    assert!(
        matches!(&refused, Err(MoveError::Refused { outcome: Outcome::ExecutionRefused, reason }) if !reason.is_empty()),
        "{refused:?}"
    );
}

/// Has a candidate of an earlier plan executed; an error is why it was not published.
fn execute_planned(stack: &mut Stack, asked: PlannedExecution) -> Result<u32, String> {
    let answer = stack.client.execute_planned(&asked, PATIENCE).unwrap();
    let report = answer.report();
    report.trajectory_id.ok_or_else(|| {
        assert_eq!(report.outcome, Outcome::ExecutionRefused, "{report}");
        report.reason.clone()
    })
}

#[test]
fn a_plan_is_executed_after_it_was_looked_at_unless_a_stop_comes_between() {
    let mut stack = Stack::running(&Settings::fast_robot().patient()).unwrap();
    let preview = |stack: &mut Stack, tip| {
        let request = PlanRequest {
            candidate_count: 3,
            deadline: Some(NO_DEADLINE),
            ..PlanRequest::from_robot(Goal::tip(tip))
        };
        let answer = stack.client.plan(&request, PATIENCE).unwrap();
        assert_eq!(answer.report().trajectory_id, None);
        let last = answer.candidate(1).unwrap().knots.last().unwrap();
        (answer.report().plan_id, last.configuration_rad)
    };
    let (plan_id, end) = preview(&mut stack, [1.5, 0.0, 2.4]);
    let asked = PlannedExecution::now(plan_id, Some(1));
    let stop = Command::Stop.because("between request and execution");
    let _ = stack.controller.command(stop, PATIENCE).unwrap();
    // The daemon refuses it where it has heard of the stop, else the controller.
    match execute_planned(&mut stack, asked) {
        Err(reason) => assert!(reason.contains("came after the request"), "{reason}"),
        Ok(id) => {
            let state = wait_for("it is refused", PATIENCE, || {
                let state = stack.controller.latest_state().unwrap()?;
                (state.values.refused_trajectory_id == id).then_some(state)
            });
            assert_eq!(state.unwrap().refusal, Refusal::RequestedBefore);
        }
    }
    let mut refused = String::new();
    let id = wait_for(
        "it is published once the refusal is known",
        PATIENCE,
        || {
            stack.wait_until_ready().unwrap();
            let asked = PlannedExecution::now(plan_id, Some(1));
            let published = execute_planned(&mut stack, asked);
            published.map_err(|reason| refused = reason).ok()
        },
    );
    let id = id.unwrap_or_else(|error| panic!("{error}: {refused}"));
    stack.wait_for_end(id).unwrap();
    let reached = stack.commanded();
    assert!((reached - pcc_model::Configuration::from(end)).norm() < 1e-9);
    let asked = PlannedExecution::now(plan_id, Some(1));
    let reason = execute_planned(&mut stack, asked).unwrap_err();
    assert!(reason.contains("plan again"), "{reason}");
}

#[test]
fn a_plan_that_begins_elsewhere_is_made_while_another_waits_for_the_robot() {
    let mut stack = Stack::running(&Settings::fast_robot().patient()).unwrap();
    let from_robot = PlanRequest {
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::from_robot(Goal::tip([1.5, 0.0, 2.4]))
    };
    let begins_late = PlanRequest {
        execute: true,
        begin_mono_ns: Some(mono_now_ns() + 3_000_000_000),
        ..from_robot.clone()
    };
    let answer = stack.client.plan(&begins_late, PATIENCE).unwrap();
    let report = answer.report();
    assert!(report.trajectory_id.is_some(), "{}", report.reason);
    let elsewhere = PlanRequest {
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new([0.3; 6], Goal::Configuration([0.2; 6]))
    };
    let mut waits = stack.client.submit(&from_robot).unwrap();
    let elsewhere = stack.client.submit(&elsewhere).unwrap();
    let made = stack.client.wait(elsewhere, PATIENCE).unwrap();
    assert_eq!(made.report().outcome, Outcome::Ok);
    let answer = stack.client.poll(&mut waits).unwrap();
    assert!(answer.is_none(), "the robot is about to begin");
    let refused = stack.client.wait(waits, PATIENCE).unwrap();
    assert_eq!(refused.report().outcome, Outcome::RobotNotReady);
}
