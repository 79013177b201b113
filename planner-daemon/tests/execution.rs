//! What the daemon publishes for execution, to a controller that the test plays.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod common;
mod played_controller;

use client::{Client, ScenePublisher};
use common::{PATIENCE, World, assert_refused, executed, request, until};
use played_controller::{PlayedController, plan};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandSender, LoopState, Outcome, ProcessKind, StartKind};
use shared_types::ipc::*;
use shared_types::message::*;
use shared_types::valid::{self, PlanRequest};

fn ball(centre_m: [f64; 3]) -> MovingBall {
    MovingBall {
        centre_m,
        radius_m: 0.3,
        velocity_m_s: [0.0; 3],
    }
}

#[test]
fn a_motion_is_published_as_planned_then_stopped_when_a_ball_appears() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);

    let before = mono_now_ns();
    let answer = plan(&mut client, &mut controller, &executed());
    let report = answer.report();
    assert_eq!(report.outcome, Outcome::Ok, "{}", report.reason);
    let trajectory = until(|| controller.trajectory());
    assert_eq!(report.trajectory_id, Some(trajectory.id));
    assert_eq!(trajectory.controller_instance, 5);
    assert_eq!(trajectory.plan_id, report.plan_id);
    let selected = answer.selected().unwrap();
    assert_eq!(trajectory.draw, selected.summary.draw as usize);
    assert_eq!(trajectory.knots, selected.knots);
    assert_eq!(trajectory.path_tolerance_rad, 0.01);
    assert!(trajectory.begin_mono_ns >= before + 50_000_000);

    let second = plan(&mut client, &mut controller, &executed());
    assert_refused(second.report(), "still to be executed");

    controller.state.trajectory_id = trajectory.id;
    controller.state.state = LoopState::Executing.code();
    let mut scenes = ScenePublisher::connect(&world.options, "test").unwrap();
    scenes.publish(&[ball([-2.0, 0.0, 1.0])], PATIENCE).unwrap();
    for _ in 0..50 {
        controller.cycle();
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert_eq!(controller.stops, 0, "a ball aside stops nothing");
    let end = trajectory.knots[trajectory.knots.len() - 1];
    let position_m = match request().goal {
        valid::Goal::Tip { position_m, .. } => position_m,
        valid::Goal::Configuration(_) => unreachable!(),
    };
    scenes.publish(&[ball(position_m)], PATIENCE).unwrap();
    until(|| {
        controller.cycle();
        (controller.stops > 0).then_some(())
    });
    let signature = controller.last_stop.unwrap();
    let reason = signature.reason.to_string();
    assert_eq!(signature.sender, CommandSender::Supervision);
    assert!(
        reason.starts_with("the live scene is in the way at"),
        "{reason}"
    );

    // It has stopped somewhere; a motion from there onto the ball is planned and not published.
    controller.state.state = LoopState::Holding.code();
    let unaware = PlanRequest {
        ignores_live_scene: true,
        ..executed()
    };
    let refused = plan(&mut client, &mut controller, &unaware);
    assert_refused(refused.report(), "the live scene is in the way");
    let refused = plan(&mut client, &mut controller, &executed());
    assert_eq!(refused.report().outcome, Outcome::GoalInCollision);
    scenes.publish(&[], PATIENCE).unwrap();
    controller.state.commanded_configuration_rad = end.configuration_rad;
    let refused = plan(&mut client, &mut controller, &executed());
    assert_refused(refused.report(), "away from the commanded configuration");
    assert!(controller.trajectory().is_none());
    assert!(
        daemon.said().contains("ordered to stop"),
        "{}",
        daemon.said()
    );
}

#[test]
fn a_publisher_of_scenes_that_says_nothing_is_not_taken_for_no_obstacles() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let node = IpcNode::create(&world.options, "silent").unwrap();
    let scene = scene_service(&node).unwrap();
    let silent = publisher(&node, &scene).unwrap();
    let refused = plan(&mut client, &mut controller, &executed());
    assert_refused(refused.report(), "has not been heard");
    drop(silent);
    let answer = plan(&mut client, &mut controller, &executed());
    assert_eq!(answer.report().outcome, Outcome::Ok);
    controller.state.trajectory_id = until(|| controller.trajectory()).id;
    controller.state.state = LoopState::Executing.code();
    // One that has not joined the services for a scene yet is nobody.
    let mut speaking = ScenePublisher::connect(&world.options, "test").unwrap();
    for _ in 0..150 {
        controller.cycle();
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    speaking.publish(&[], PATIENCE).unwrap();
    for _ in 0..150 {
        controller.cycle();
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert_eq!(controller.stops, 0, "it speaks: {}", daemon.said());
    let _silent = publisher(&node, &scene).unwrap();
    until(|| {
        controller.cycle();
        (controller.stops > 0).then_some(())
    });
    assert!(
        daemon.said().contains("has not been heard"),
        "{}",
        daemon.said()
    );
}

#[test]
fn a_second_publisher_of_a_sources_name_is_told_so_and_a_restarted_one_gets_it() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let mut first = ScenePublisher::connect(&world.options, "test").unwrap();
    first.publish(&[], PATIENCE).unwrap();
    first.confirm(PATIENCE).unwrap();
    let mut second = ScenePublisher::connect(&world.options, "test").unwrap();
    second.publish(&[], PATIENCE).unwrap();
    let error = second.confirm(PATIENCE).unwrap_err().to_string();
    assert!(error.contains("another publisher has"), "{error}");
    let refused = plan(&mut client, &mut controller, &executed());
    assert_refused(refused.report(), "another publisher has");
    drop(second);
    drop(first);
    let mut again = ScenePublisher::connect(&world.options, "test").unwrap();
    again.publish(&[], PATIENCE).unwrap();
    again.confirm(PATIENCE).unwrap();
    let answer = plan(&mut client, &mut controller, &executed());
    assert_eq!(answer.report().outcome, Outcome::Ok);
}

#[test]
fn a_motion_that_waits_for_its_begin_is_taken_back_when_a_ball_appears() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let later = PlanRequest {
        begin_mono_ns: Some(mono_now_ns() + 600_000_000_000),
        ..executed()
    };
    let first = plan(&mut client, &mut controller, &later);
    assert_eq!(first.report().outcome, Outcome::Ok);
    let begin_mono_ns = until(|| controller.trajectory()).begin_mono_ns;
    assert_eq!(Some(begin_mono_ns), later.begin_mono_ns);
    let mut scenes = ScenePublisher::connect(&world.options, "test").unwrap();
    scenes.publish(&[ball([0.0, 0.0, 3.0])], PATIENCE).unwrap();
    until(|| {
        controller.cycle();
        daemon.said().contains("taken back").then_some(())
    });
    assert!(controller.stops > 0);
    scenes.publish(&[], PATIENCE).unwrap();
    let second = plan(&mut client, &mut controller, &executed());
    assert_eq!(
        second.report().outcome,
        Outcome::Ok,
        "{}",
        second.report().reason
    );
}

#[test]
fn trajectory_ids_grow_over_a_killed_daemon_and_the_heart_beats() {
    let world = World::new();
    let configuration = world.configuration("");
    let mut controller = PlayedController::start(&world.options);
    let mut client = Client::connect(&world.options).unwrap();
    let mut ids = vec![0];
    for _ in 0..2 {
        let daemon = world.start(&configuration);
        client.wait_for_daemon(PATIENCE).unwrap();
        let id = plan(&mut client, &mut controller, &executed())
            .report()
            .trajectory_id
            .unwrap();
        assert!(id > ids[ids.len() - 1], "{id} after {ids:?}");
        ids.push(id);
        let beats: Vec<Heartbeat> = std::iter::from_fn(|| controller.heartbeats.receive().unwrap())
            .map(|sample| *sample)
            .collect();
        assert!(beats.len() > 1);
        assert!(
            beats
                .iter()
                .all(|beat| beat.kind == ProcessKind::Daemon.code())
        );
        daemon.kill();
    }
}

#[test]
fn a_controller_that_comes_late_gets_the_last_trajectory() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let id = plan(&mut client, &mut controller, &executed())
        .report()
        .trajectory_id;
    drop(controller);
    let late = PlayedController::start(&world.options);
    assert_eq!(Some(until(|| late.trajectory()).id), id);
}

#[test]
fn what_is_executed_and_was_not_published_is_ordered_to_stop() {
    let world = World::new();
    let mut controller = PlayedController::start(&world.options);
    controller.state.trajectory_id = u32::MAX;
    controller.state.state = LoopState::Executing.code();
    // A daemon that starts into it, then one that has been there.
    let _daemon = world.start(&world.configuration(""));
    for _ in 0..2 {
        controller.stops = 0;
        until(|| {
            controller.cycle();
            (controller.stops > 0).then_some(())
        });
        assert_eq!(controller.state.state, LoopState::Stopping.code());
        controller.state.state = LoopState::Holding.code();
        for _ in 0..50 {
            controller.cycle();
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        controller.stops = 0;
        controller.cycle();
        assert_eq!(controller.stops, 0, "nothing moves");
        controller.state.state = LoopState::Executing.code();
    }
}

#[test]
fn a_motion_says_who_watches_over_it_and_is_taken_back_where_it_is_not_taken_up() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let before = mono_now_ns();
    let first = plan(&mut client, &mut controller, &executed());
    assert_eq!(first.report().outcome, Outcome::Ok);
    let trajectory = until(|| controller.trajectory());
    assert!((before..=mono_now_ns()).contains(&trajectory.requested_mono_ns));
    let beat: Heartbeat = until(|| controller.heartbeats.receive().unwrap().map(|beat| *beat));
    assert_eq!(trajectory.daemon_instance, beat.instance);
    // It holds on, as if the trajectory had not arrived.
    until(|| {
        controller.cycle();
        daemon.said().contains("taken back").then_some(())
    });
    assert!(controller.stops > 0);
    assert!(mono_now_ns() > trajectory.begin_mono_ns + 300_000_000);
    let second = plan(&mut client, &mut controller, &executed());
    assert_eq!(second.report().outcome, Outcome::Ok);
}

/// The first time from `from_s` on at which a motion is as near to a configuration as it comes within 2e-3 rad, s.
fn passes(trajectory: &valid::Trajectory, shape: [f64; 6], from_s: f64) -> Option<f64> {
    let knots = trajectory.knots.iter().map(|knot| trajectory::Knot {
        time: knot.time_s,
        position: knot.configuration_rad.into(),
        velocity: knot.velocity_rad_s.into(),
        acceleration: knot.acceleration_rad_s2.into(),
    });
    let motion = trajectory::Trajectory::new(knots.collect()).unwrap();
    let times_s = (0..=20_000).map(|i| motion.duration() * f64::from(i) / 2e4);
    times_s.filter(|&time_s| time_s >= from_s).find(|&time_s| {
        (motion.at(time_s).position - pcc_model::Configuration::from(shape)).norm() < 2e-3
    })
}

#[test]
fn appended_goals_are_reached_after_those_ahead_until_the_queue_is_full() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let shape = |bend: f64| [bend, 0.2, -bend, 0.1, 0.3, 0.5 * bend];
    let goal = |bend: f64| valid::Goal::Configuration(shape(bend));
    let first = PlanRequest {
        via: vec![goal(0.3), goal(0.6)],
        goal: goal(0.9),
        balls: Vec::new(),
        candidate_count: 1,
        ..executed()
    };
    let answer = plan(&mut client, &mut controller, &first);
    assert_eq!(answer.report().outcome, Outcome::Ok, "{}", daemon.said());
    let left = until(|| controller.trajectory());
    controller.begin(&left);
    let appended = PlanRequest {
        start: StartKind::AfterGoals,
        via: Vec::new(),
        goal: goal(-0.5),
        ..first.clone()
    };
    let answer = plan(&mut client, &mut controller, &appended);
    assert_eq!(answer.report().outcome, Outcome::Ok, "{}", daemon.said());
    let joining = until(|| controller.trajectory());
    let leaves = joining.leaves.unwrap();
    assert_eq!(leaves.trajectory_id, left.id);
    let mut passed_s = 0.0;
    for bend in [0.3, 0.6, 0.9, -0.5] {
        if passes(&left, shape(bend), leaves.path_time_s).is_some() || bend < 0.0 {
            let passes_s = passes(&joining, shape(bend), passed_s);
            passed_s = passes_s.unwrap_or_else(|| panic!("{bend} is lost after {passed_s} s"));
        }
    }
    assert!(passed_s > 1.0, "the premise, goals were ahead: {passed_s}");
    controller.begin(&joining);
    let many = PlanRequest {
        via: vec![goal(0.4); 6],
        ..appended
    };
    let refused = plan(&mut client, &mut controller, &many);
    assert_eq!(refused.report().outcome, Outcome::Overloaded);
    let reason = &refused.report().reason;
    assert!(reason.contains("the queue is full"), "{reason}");
}
