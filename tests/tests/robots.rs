//! Processes with different robot files refuse each other by name.
#![allow(clippy::unwrap_used)]

use std::fs;

use client::GoalSender;
use shared_types::codes::{GoalState, LoopState, Outcome, Waiting};
use shared_types::valid::{Goal, GoalStatus, PlanRequest, PlannedExecution};
use tests::process::wait_for;
use tests::stack::{NO_DEADLINE, PATIENCE, Part, Stack};
use tests::world::{Settings, World};

/// Gives a process a robot file that differs by its name alone.
fn give_another_robot(world: &World, configuration: &str) {
    let (file, other) = ("robots/unit.toml", "robots/other.toml");
    let robot = fs::read_to_string(world.config(file)).unwrap();
    let renamed = robot.replace("name = \"", "name = \"another ");
    assert_ne!(renamed, robot);
    fs::write(world.config(other), renamed).unwrap();
    let settings = fs::read_to_string(world.config(configuration)).unwrap();
    let changed = settings.replace(file, other);
    assert_ne!(changed, settings);
    fs::write(world.config(configuration), changed).unwrap();
}

fn stack(configurations: &[&str]) -> Stack {
    let world = World::new(&Settings::default());
    for configuration in configurations {
        give_another_robot(&world, configuration);
    }
    let mut stack = Stack::within(world);
    for part in Part::ALL {
        stack.start(part);
    }
    stack.client.wait_for_daemon(PATIENCE).unwrap();
    stack
}

#[test]
fn a_controller_does_not_take_hold_of_another_robot() {
    let mut stack = stack(&["simulated-robot.toml"]);
    wait_for("the controller says what it waits for", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        assert_eq!(state.state, LoopState::Starting);
        let reason = state.values.reason.text();
        let own = format!("this controller's is {:016x}", state.values.robot_hash);
        let is_named = reason.starts_with("another robot: ") && reason.contains(&own);
        (state.waiting == Waiting::OtherRobot && is_named).then_some(())
    })
    .unwrap();
}

#[test]
fn a_daemon_refuses_a_client_that_is_set_up_for_another_robot() {
    let mut stack = stack(&[]);
    let own = stack.world.robot.hash();
    let request = PlanRequest {
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new([0.0; 6], Goal::tip([1.0, 0.0, 2.4]))
    };
    for (stated, outcome) in [(own, Outcome::Ok), (own ^ 1, Outcome::WrongRobot)] {
        stack.client.state_robot(stated);
        let answer = stack.client.plan(&request, PATIENCE).unwrap();
        let report = answer.report();
        assert_eq!(
            (report.outcome, report.robot_hash),
            (outcome, own),
            "{report}"
        );
        let is_named = [own, own ^ 1].map(|hash| report.reason.contains(&format!("{hash:016x}")));
        assert_eq!(is_named, [outcome == Outcome::WrongRobot; 2], "{report}");
    }
    let execution = PlannedExecution::now(1, None);
    let refused = stack.client.execute_planned(&execution, PATIENCE).unwrap();
    assert_eq!(refused.report().outcome, Outcome::WrongRobot);
}

#[test]
fn a_daemon_refuses_a_goal_of_a_program_that_is_set_up_for_another_robot() {
    let stack = stack(&[]);
    let own = stack.world.robot.hash();
    let mut sender = GoalSender::connect(&stack.world.options).unwrap();
    sender.state_robot(own ^ 1);
    sender.give(Goal::tip([1.0, 0.0, 2.4]), 1.0).unwrap();
    let status = sender.confirm(PATIENCE).unwrap();
    assert_eq!(status.state, GoalState::Refused, "{status}");
    let said = status.to_string();
    for named in [own, own ^ 1].map(|hash| format!("{hash:016x}")) {
        assert!(said.contains(&named), "{said}");
    }
    sender.state_robot(own);
    sender.give(Goal::tip([1.0, 0.0, 2.4]), 1.0).unwrap();
    let reached = |status: &GoalStatus| status.state == GoalState::Reached;
    assert!(sender.wait_for(PATIENCE, reached).unwrap().is_some());
}

#[test]
fn a_daemon_publishes_nothing_for_a_controller_of_another_robot() {
    let mut stack = stack(&["controller.toml", "simulated-robot.toml"]);
    wait_for("the controller holds its robot", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.state == LoopState::Holding).then_some(())
    })
    .unwrap();
    let request = PlanRequest {
        execute: true,
        ..PlanRequest::from_robot(Goal::tip([1.0, 0.0, 2.4]))
    };
    let answer = stack.client.plan(&request, PATIENCE).unwrap();
    let report = answer.report();
    assert_eq!(report.robot_hash, stack.world.robot.hash());
    assert_ne!(report.weights_hash, 0);
    assert_eq!(report.outcome, Outcome::ExecutionRefused);
    let own = format!("this daemon's {:016x}", stack.world.robot.hash());
    let reason = &report.reason;
    assert!(reason.contains("their robot files differ"), "{reason}");
    assert!(reason.contains(&own), "{reason}");
}
