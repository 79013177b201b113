//! Motions among balls that move, for a controller that the test plays.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod common;
mod played_controller;

use std::thread::sleep;
use std::time::Duration;

use client::{Client, ScenePublisher};
use common::{PATIENCE, World, assert_refused, executed, until};
use played_controller::{PlayedController, plan};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, Outcome};
use shared_types::message::MovingBall;
use shared_types::valid::{Goal, PlanRequest};

/// For how long a scene is believed.
const LIFETIME: Duration = Duration::from_millis(300);

/// To be executed, planned as if the live scene were empty.
fn unaware() -> PlanRequest {
    PlanRequest {
        ignores_live_scene: true,
        ..executed()
    }
}

/// Publishes a scene that the daemon has heard then.
fn tell(scenes: &mut ScenePublisher, balls: &[MovingBall]) {
    scenes.publish(balls, LIFETIME).unwrap();
    scenes.confirm(PATIENCE).unwrap();
}

/// A ball that crosses the straight way of [`request`], in its middle at a time, where it is now.
fn crossing(in_the_middle_mono_ns: i64) -> MovingBall {
    let velocity_m_s = [0.0, -0.8, 0.0];
    let early_s = (in_the_middle_mono_ns - mono_now_ns()) as f64 * 1e-9;
    MovingBall {
        centre_m: [0.75, 0.15 - velocity_m_s[1] * early_s, 2.7],
        radius_m: 0.15,
        velocity_m_s,
    }
}

#[test]
fn a_ball_that_crosses_the_way_is_waited_for_or_passed_by_without_a_stop() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let mut scenes = ScenePublisher::connect(&world.options, "test").unwrap();
    let middle_mono_ns = mono_now_ns() + 2_000_000_000;
    tell(&mut scenes, &[crossing(middle_mono_ns)]);
    let refused = plan(&mut client, &mut controller, &unaware());
    assert_refused(refused.report(), "the live scene is in the way");

    tell(&mut scenes, &[crossing(middle_mono_ns)]);
    let answer = plan(&mut client, &mut controller, &executed());
    let report = answer.report();
    assert_eq!(report.outcome, Outcome::Ok, "{}", report.reason);
    let trajectory = until(|| controller.trajectory());
    let duration_s = trajectory.knots[trajectory.knots.len() - 1].time_s;
    // A sensor of 50 Hz goes on to tell of the ball, while the controller does what it was told to.
    for round in 0.. {
        if round % 10 == 0 {
            scenes
                .publish(&[crossing(middle_mono_ns)], LIFETIME)
                .unwrap();
        }
        let passed_s = (mono_now_ns() - trajectory.begin_mono_ns) as f64 * 1e-9;
        if passed_s >= 0.0 {
            controller.state.state = LoopState::Executing.code();
            controller.state.trajectory_id = trajectory.id;
            controller.state.trajectory_time_s = passed_s;
        }
        if passed_s > duration_s {
            break;
        }
        controller.cycle();
        assert_eq!(controller.stops, 0, "at {passed_s} s: {}", daemon.said());
        sleep(Duration::from_millis(2));
    }
    assert!(
        mono_now_ns() > middle_mono_ns,
        "the ball has passed while the motion was under way"
    );
}

/// A ball that comes to the goal of [`executed`] at a time, where it is now.
fn comes_to_the_goal(at_mono_ns: i64) -> MovingBall {
    let in_s = (at_mono_ns - mono_now_ns()) as f64 * 1e-9;
    let Goal::Tip { position_m, .. } = executed().goal else {
        unreachable!("its goal is a tip")
    };
    let velocity_m_s = [0.0, -1.0, 0.0];
    let [x, y, z] = position_m;
    MovingBall {
        centre_m: [x, y - velocity_m_s[1] * in_s, z],
        radius_m: 0.15,
        velocity_m_s,
    }
}

#[test]
fn a_motion_to_where_a_ball_will_come_is_not_begun_and_stopped_in_time_where_it_is_under_way() {
    let world = World::new();
    let daemon = world.start(&world.configuration(""));
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let mut controller = PlayedController::start(&world.options);
    let mut scenes = ScenePublisher::connect(&world.options, "test").unwrap();
    let comes_mono_ns = mono_now_ns() + 15_000_000_000;
    tell(&mut scenes, &[comes_to_the_goal(comes_mono_ns)]);
    let refused = plan(&mut client, &mut controller, &unaware());
    assert_refused(refused.report(), "a ball comes to where it ends");
    tell(&mut scenes, &[comes_to_the_goal(comes_mono_ns)]);
    let aware = plan(&mut client, &mut controller, &executed());
    assert_eq!(aware.report().outcome, Outcome::NoPath);

    tell(&mut scenes, &[]);
    let answer = plan(&mut client, &mut controller, &executed());
    assert_eq!(answer.report().outcome, Outcome::Ok, "{}", daemon.said());
    let trajectory = until(|| controller.trajectory());
    let duration_s = trajectory.knots[trajectory.knots.len() - 1].time_s;
    controller.begin(&trajectory);
    until(|| {
        tell(&mut scenes, &[comes_to_the_goal(comes_mono_ns)]);
        controller.cycle();
        sleep(Duration::from_millis(1));
        (controller.stops > 0).then_some(())
    });
    let reason = controller.last_stop.unwrap().reason.to_string();
    assert!(reason.contains("a ball comes to where it ends"), "{reason}");
    // Others may be told of meanwhile: it goes on for as long as it can still be stopped clear of the ball.
    let passed_s = controller.state.trajectory_time_s;
    assert!(
        passed_s > 0.2 * duration_s && passed_s < duration_s - 0.2,
        "stopped at {passed_s} of {duration_s} s"
    );
}
