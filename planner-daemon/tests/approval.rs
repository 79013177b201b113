//! Plans that are looked at, and executed by another client, to a controller that the test plays.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod common;
mod played_controller;

use std::thread::{scope, sleep};
use std::time::{Duration, Instant};

use client::Client;
use common::{PATIENCE, World, request, until};
use played_controller::{PlayedController, plan};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, MotionStart, Outcome, PlanField, StartKind};
use shared_types::message::Knot;
use shared_types::valid::{PlanReport, PlanRequest, PlannedExecution};

/// Has a plan executed by a client of its own while the controller goes on; the report and the knots of its candidate.
fn execute(
    world: &World,
    controller: &mut PlayedController,
    execution: &PlannedExecution,
) -> (PlanReport, Vec<Knot>) {
    scope(|scope| {
        let client = scope.spawn(|| {
            let mut client = Client::connect(&world.options).unwrap();
            let answer = client.execute_planned(execution, PATIENCE).unwrap();
            let knots = answer.selected().map(|selected| selected.knots.to_vec());
            (answer.report().clone(), knots.unwrap_or_default())
        });
        while !client.is_finished() {
            controller.cycle();
            sleep(Duration::from_millis(2));
        }
        client.join().unwrap()
    })
}

fn cycle_for(controller: &mut PlayedController, duration: Duration) {
    let begun = Instant::now();
    while begun.elapsed() < duration {
        controller.cycle();
        sleep(Duration::from_millis(2));
    }
}

fn assert_refused((report, knots): &(PlanReport, Vec<Knot>), texts: &[&str]) {
    assert_eq!(report.outcome, Outcome::ExecutionRefused, "{report:?}");
    for text in texts {
        assert!(report.reason.contains(text), "{}", report.reason);
    }
    assert_eq!(report.trajectory_id, None);
    assert!(!knots.is_empty(), "it tells what was to move");
}

#[test]
fn a_candidate_is_executed_exactly_as_it_was_answered_while_the_robot_is_at_its_start() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let preview = plan(&mut client, &mut controller, &request());
    let plan_id = preview.report().plan_id;
    assert_eq!(preview.report().trajectory_id, None);
    assert!(controller.trajectory().is_none(), "it was only planned");

    let named = PlannedExecution::now(plan_id, Some(1));
    let (report, knots) = execute(&world, &mut controller, &named);
    assert_eq!(report.outcome, Outcome::Ok, "{}", report.reason);
    assert_eq!((report.plan_id, report.selected), (plan_id, Some(0)));
    assert_eq!(knots, preview.candidate(1).unwrap().knots);
    let trajectory = until(|| controller.trajectory());
    assert_eq!(Some(trajectory.id), report.trajectory_id);
    assert_eq!(trajectory.knots, knots);
    assert_eq!(trajectory.requested_mono_ns, named.requested_mono_ns);
    let draw = preview.candidate(1).unwrap().summary.draw as usize;
    assert_eq!((trajectory.plan_id, trajectory.draw), (plan_id, draw));

    let selected = PlannedExecution::now(plan_id, None);
    controller.begin(&trajectory);
    assert_refused(
        &execute(&world, &mut controller, &selected),
        &["still to be executed"],
    );
    // Before its begin a controller that holds has not executed it.
    cycle_for(&mut controller, Duration::from_millis(200));
    let end = trajectory.knots[trajectory.knots.len() - 1];
    controller.state.state = LoopState::Holding.code();
    controller.state.commanded_configuration_rad = end.configuration_rad;
    cycle_for(&mut controller, Duration::from_millis(20));
    assert_refused(
        &execute(&world, &mut controller, &selected),
        &["away from the commanded configuration", "plan again"],
    );
    controller.state.commanded_configuration_rad = trajectory.knots[0].configuration_rad;
    cycle_for(&mut controller, Duration::from_millis(20));
    let (again, knots) = execute(&world, &mut controller, &selected);
    assert_eq!(again.outcome, Outcome::Ok, "{}", again.reason);
    assert_eq!(knots, preview.selected().unwrap().knots);
}

#[test]
fn a_plan_that_is_not_kept_and_a_candidate_beyond_its_last_are_named() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let preview = plan(&mut client, &mut controller, &request());
    let (plan_id, count) = (preview.report().plan_id, preview.candidates().len());
    let moving = PlanRequest {
        start_velocity_rad_s: [0.01; 6],
        ..request()
    };
    let from_motion = plan(&mut client, &mut controller, &moving);
    let named = |id, candidate| PlannedExecution::now(id, candidate);
    let mut execute = |execution| execute(&world, &mut controller, &execution);
    for (execution, field, text) in [
        (
            named(plan_id - 1, None),
            PlanField::PreviousPlan,
            "none of the last 16".to_owned(),
        ),
        (
            named(plan_id, Some(count)),
            PlanField::PreviousCandidate,
            format!("0..={}", count - 1),
        ),
        (
            PlannedExecution {
                requested_mono_ns: mono_now_ns() + 60_000_000_000,
                ..named(plan_id, None)
            },
            PlanField::Requested,
            "another clock".to_owned(),
        ),
    ] {
        let (report, _) = execute(execution);
        assert_eq!(report.outcome, Outcome::InvalidRequest, "{report:?}");
        assert_eq!(report.invalid_field, field);
        assert!(report.reason.contains(&text), "{}", report.reason);
    }
    assert_refused(
        &execute(named(from_motion.report().plan_id, None)),
        &["begins in motion in a given state"],
    );
}

#[test]
fn a_plan_from_the_robots_motion_is_executed_while_its_switch_is_ahead() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let executed = PlanRequest {
        execute: true,
        limits_scale: 0.2,
        ..request()
    };
    plan(&mut client, &mut controller, &executed);
    let first = until(|| controller.trajectory());
    controller.begin(&first);
    let at_once = PlanRequest {
        start: StartKind::Robot,
        balls: Vec::new(),
        ..request()
    };
    let missed = plan(&mut client, &mut controller, &at_once);
    assert_eq!(missed.report().start, MotionStart::InMotion, "{missed:?}");
    let missed = missed.report().plan_id;
    cycle_for(&mut controller, Duration::from_millis(100));
    let missed = PlannedExecution::now(missed, None);
    assert_refused(
        &execute(&world, &mut controller, &missed),
        &["switch missed", "plan again from where the robot is"],
    );

    let ahead_s = 1.5;
    let later = PlanRequest {
        begin_mono_ns: Some(mono_now_ns() + (ahead_s * 1e9) as i64),
        ..at_once
    };
    let preview = plan(&mut client, &mut controller, &later);
    assert_eq!(preview.report().start, MotionStart::InMotion);
    let named = PlannedExecution::now(preview.report().plan_id, None);
    let (report, knots) = execute(&world, &mut controller, &named);
    assert_eq!(report.outcome, Outcome::Ok, "{}", report.reason);
    assert_eq!(report.start, MotionStart::InMotion);
    let joined = until(|| controller.trajectory());
    assert_eq!(joined.knots, knots);
    let leaves = joined.leaves.unwrap();
    assert_eq!(leaves.trajectory_id, first.id);
    let at_s = leaves.path_time_s;
    let begun_s = (later.begin_mono_ns.unwrap() - controller.begun_mono_ns.unwrap()) as f64 * 1e-9;
    assert!(
        (begun_s - 0.01..begun_s + 0.1).contains(&at_s),
        "{at_s} after {begun_s}"
    );

    controller.begin(&joined);
    cycle_for(&mut controller, Duration::from_millis(50));
    assert_refused(
        &execute(&world, &mut controller, &named),
        &[
            "is not followed any more",
            "plan again from where the robot is",
        ],
    );
}
