//! Views of the controller and the robot, the scene, and what a killed publisher leaves.

use std::thread;
use std::time::Duration;

use client::{ClientError, ControllerView, CycleRecorder, ResultView, RobotView, ScenePublisher};
use shared_types::PROTOCOL_VERSION;
use shared_types::clock::{mono_now_ns, wall_now_ns};
use shared_types::codes::{CommandRefusal, LoopState, MotionOutcome, MotorState, SceneRefusal};
use shared_types::ipc::*;
use shared_types::message::{self, MovingBall, ReasonText};
use shared_types::valid::{Command, Scene, SignedCommand, SourceName};

use crate::support::{LONG, World};

fn node(world: &World) -> IpcNode {
    IpcNode::create(&world.options, "test").unwrap()
}

#[test]
fn the_newest_states_are_seen_and_kept() {
    let world = World::new();
    let mut controller = ControllerView::connect(&world.options).unwrap();
    let mut robot = RobotView::connect(&world.options).unwrap();
    assert!(controller.latest_state().unwrap().is_none());
    assert!(robot.latest().unwrap().is_none());

    let node = node(&world);
    let controller_states = publisher(&node, &controller_state_service(&node).unwrap()).unwrap();
    let robot_states = publisher(&node, &robot_state_service(&node).unwrap()).unwrap();
    for cycle in 1..=100 {
        let state = LoopState::Executing.code();
        controller_states
            .send_copy(message::ControllerState {
                cycle,
                state,
                ..message::ControllerState::ZEROED
            })
            .unwrap();
        let state = MotorState::Following.code();
        robot_states
            .send_copy(message::RobotState {
                sequence: cycle,
                state,
                ..message::RobotState::ZEROED
            })
            .unwrap();
    }
    for _ in 0..2 {
        let state = controller.latest_state().unwrap().unwrap();
        assert_eq!(
            (state.values.cycle, state.state),
            (100, LoopState::Executing)
        );
        let state = robot.latest().unwrap().unwrap();
        assert_eq!(
            (state.values.sequence, state.state),
            (100, MotorState::Following)
        );
    }
}

#[test]
fn a_state_that_is_none_is_an_error() {
    let world = World::new();
    let mut robot = RobotView::connect(&world.options).unwrap();
    let node = node(&world);
    let states = publisher(&node, &robot_state_service(&node).unwrap()).unwrap();
    states
        .send_copy(message::RobotState {
            measured_tendon_m: [f64::NAN; 9],
            ..message::RobotState::ZEROED
        })
        .unwrap();
    let error = robot.latest().unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::BadMessage {
                sender: "robot",
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn commands_reach_the_controller_and_its_refusals_come_back() {
    let world = World::new();
    let mut view = ControllerView::connect(&world.options).unwrap();
    let error = view
        .command(Command::Stop, Duration::from_millis(20))
        .unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::NoServer {
                server: "controller",
                ..
            }
        ),
        "{error}"
    );
    let error = view.command(Command::SetSpeed(2.0), LONG).unwrap_err();
    assert!(matches!(error, ClientError::InvalidRequest(_)), "{error}");
    thread::scope(|scope| {
        scope.spawn(|| answer_commands(&world, 2));
        assert!(view.command(Command::SetSpeed(0.5), LONG).unwrap().accepted);
        let reply = view.command(Command::ResetFault, LONG).unwrap();
        assert_eq!(
            (reply.accepted, reply.refusal),
            (false, CommandRefusal::NothingToDo)
        );
    });
}

/// Accepts new speeds and refuses everything else.
fn answer_commands(world: &World, count: usize) {
    let node = node(world);
    let server = command_server(&node, &command_service(&node).unwrap()).unwrap();
    let mut answered = 0;
    while answered < count {
        let Some(active) = server.receive().unwrap() else {
            thread::sleep(Duration::from_millis(1));
            continue;
        };
        let command = SignedCommand::try_from(active.payload()).unwrap().command;
        let accepted = matches!(command, Command::SetSpeed(_));
        let refusal = if accepted {
            CommandRefusal::None
        } else {
            CommandRefusal::NothingToDo
        };
        let reply = message::CommandReply {
            command_id: active.command_id,
            protocol_version: PROTOCOL_VERSION,
            accepted: u32::from(accepted),
            refusal: refusal.code(),
            state: LoopState::Holding.code(),
            ..message::CommandReply::ZEROED
        };
        active.send_copy(reply).unwrap();
        answered += 1;
    }
}

#[test]
fn a_recorder_gets_every_cycle_and_counts_what_it_missed() {
    let world = World::new();
    let mut recorder = CycleRecorder::connect(&world.options).unwrap();
    let node = node(&world);
    let cycles = cycle_publisher(&node, &cycle_service(&node).unwrap()).unwrap();
    let publish = |batches: std::ops::Range<u64>| {
        for batch in batches {
            let sample = cycles.loan_slice_uninit(10).unwrap();
            let cycle = |index| message::Cycle {
                sequence: batch * 10 + index as u64,
                ..message::Cycle::ZEROED
            };
            sample.write_from_fn(cycle).send().unwrap();
        }
    };
    let mut recorded = Vec::new();
    publish(0..50);
    assert_eq!(recorder.drain(&mut recorded).unwrap(), 500);
    publish(50..60);
    assert_eq!(recorder.drain(&mut recorded).unwrap(), 100);
    assert!(
        recorded
            .iter()
            .enumerate()
            .all(|(index, cycle)| cycle.values.sequence == index as u64)
    );
    assert_eq!(recorder.missed(), 0);

    publish(60..160);
    let kept = recorder.drain(&mut recorded).unwrap();
    assert_eq!(kept, 640, "64 batches fit the buffer");
    assert_eq!(recorder.missed(), 1000 - kept as u64);
    publish(0..1);
    recorder.drain(&mut recorded).unwrap();
    assert_eq!(
        recorder.missed(),
        1000 - kept as u64,
        "a new controller counts from the start"
    );
}

#[test]
fn latecomers_get_the_scene_and_a_bad_one_changes_nothing() {
    let world = World::new();
    let mut scenes = ScenePublisher::connect(&world.options, "camera").unwrap();
    let ball = MovingBall {
        radius_m: 0.4,
        ..MovingBall::ZEROED
    };
    let lifetime = Duration::from_secs(1000);
    scenes.publish(&[ball; 2], lifetime).unwrap();
    let bad = MovingBall {
        radius_m: -1.0,
        ..ball
    };
    let error = scenes.publish(&[bad], lifetime).unwrap_err();
    assert!(error.to_string().contains("balls[0]"), "{error}");
    let error = scenes.publish(&[ball], Duration::ZERO).unwrap_err();
    assert!(error.to_string().contains("lifetime_ns"), "{error}");
    let unjudged = scenes.confirm(Duration::from_millis(20)).unwrap_err();
    assert!(
        matches!(unjudged, ClientError::NoServer { .. }),
        "{unjudged}"
    );

    let node = node(&world);
    let subscriber = subscriber(&node, &scene_service(&node).unwrap()).unwrap();
    let scene = loop {
        match subscriber.receive().unwrap() {
            Some(sample) => break Scene::try_from(&*sample).unwrap(),
            None => thread::sleep(Duration::from_millis(1)),
        }
    };
    assert_eq!(scene.balls, [ball; 2]);
    assert_eq!(
        (scene.source.to_string(), scene.sequence),
        ("camera".to_owned(), 1)
    );
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_publisher_that_is_dropped_at_once_has_published_where_somebody_hears() {
    let world = World::new();
    let node = node(&world);
    let scenes = subscriber(&node, &scene_service(&node).unwrap()).unwrap();
    let statuses = publisher(&node, &scene_status_service(&node).unwrap()).unwrap();
    let options = world.options.clone();
    let dropped = thread::spawn(move || {
        let mut camera = ScenePublisher::connect(&options, "camera").unwrap();
        camera.publish(&[], Duration::from_secs(1)).unwrap();
        camera.take_leave().unwrap();
    });
    // The daemon looks only now and then.
    thread::sleep(Duration::from_millis(100));
    let mut last = None;
    while let Some(sample) = scenes.receive().unwrap() {
        last = Some((sample.source, sample.sequence, sample.stamp_mono_ns));
    }
    let (source, sequence, scene_stamp_mono_ns) = last.unwrap();
    assert_eq!(sequence, 2);
    assert!(!dropped.is_finished(), "it waits for the verdict");
    let status = message::SceneStatus {
        protocol_version: PROTOCOL_VERSION,
        source,
        sequence,
        scene_stamp_mono_ns,
        ..message::SceneStatus::ZEROED
    };
    statuses.send_copy(status).unwrap();
    dropped.join().unwrap();
}

#[test]
fn what_a_daemon_says_of_a_scene_is_told_to_its_publisher() {
    let world = World::new();
    let node = node(&world);
    let statuses = publisher(&node, &scene_status_service(&node).unwrap()).unwrap();
    let mut scenes = ScenePublisher::connect(&world.options, "camera").unwrap();
    let (lifetime, patience) = (Duration::from_secs(1), Duration::from_secs(20));
    let wall = wall_now_ns();
    let error = scenes.publish_stamped(wall, &[], lifetime).unwrap_err();
    assert!(error.to_string().contains("wall clock"), "{error}");
    for (sequence, refusal) in [(1, SceneRefusal::None), (2, SceneRefusal::TooManySources)] {
        let stamp = mono_now_ns();
        scenes.publish_stamped(stamp, &[], lifetime).unwrap();
        let of_others = [("other", stamp), ("camera", stamp - 1)];
        let ours = ("camera", stamp);
        for (source, scene_stamp_mono_ns) in of_others.into_iter().chain([ours]) {
            let is_ours = (source, scene_stamp_mono_ns) == ours;
            let said = if is_ours {
                refusal
            } else {
                SceneRefusal::Malformed
            };
            let status = message::SceneStatus {
                protocol_version: PROTOCOL_VERSION,
                source: SourceName::new(source).unwrap().to_wire(),
                sequence,
                scene_stamp_mono_ns,
                refusal: said.code(),
                reason: ReasonText::new(if is_ours { "four others are there" } else { "" }),
                ..message::SceneStatus::ZEROED
            };
            statuses.send_copy(status).unwrap();
        }
        let confirmed = scenes.confirm(patience);
        match refusal {
            SceneRefusal::None => confirmed.unwrap(),
            refusal => {
                let error = confirmed.unwrap_err().to_string();
                let told = format!("{refusal} (four others are there)");
                assert!(error.contains(&told), "{error}");
            }
        }
    }
}

#[test]
fn a_killed_publisher_leaves_its_place_and_its_subscribers_hear_the_next_one() {
    let world = World::new();
    let node = node(&world);
    let setpoints = setpoint_service(&node).unwrap();
    let subscriber = subscriber(&node, &setpoints).unwrap();
    for _ in 0..3 {
        let mut controller = world.process("controller_process", "");
        while subscriber.receive().unwrap().is_none() {
            assert!(controller.is_running());
            thread::sleep(Duration::from_millis(1));
        }
        assert!(
            matches!(publisher(&node, &setpoints), Err(IpcError::Full { .. })),
            "there is one place"
        );
        controller.kill();
        let successor = publisher(&node, &setpoints).unwrap();
        while subscriber.receive().unwrap().is_some() {}
        successor
            .send_copy(message::Setpoint {
                sequence: 77,
                ..message::Setpoint::ZEROED
            })
            .unwrap();
        assert_eq!(subscriber.receive().unwrap().unwrap().sequence, 77);
    }
}

/// Publishes that a trajectory was reached.
fn tell_reached(results: &Publisher<message::MotionResult>, trajectory_id: u32) {
    let result = message::MotionResult {
        trajectory_id,
        outcome: MotionOutcome::Reached.code(),
        ..message::MotionResult::ZEROED
    };
    results.send_copy(result).unwrap();
}

#[test]
fn the_result_of_a_motion_is_found_that_came_before_who_waits_for_it() {
    let world = World::new();
    let node = node(&world);
    let results = publisher(&node, &motion_result_service(&node).unwrap()).unwrap();
    for id in 1..=9 {
        tell_reached(&results, id);
    }
    let mut view = ResultView::connect(&world.options).unwrap();
    tell_reached(&results, 10);
    let mut find = |id| view.wait_for(id, Duration::from_millis(20)).unwrap();
    assert_eq!(find(1), None, "the last eight are kept");
    assert_eq!(find(5).unwrap().outcome, MotionOutcome::Reached);
    assert_eq!(find(10).unwrap().values.trajectory_id, 10);
    assert_eq!(find(11), None);
    tell_reached(&results, 11);
    let ended = view.wait_for(11, LONG).unwrap().unwrap();
    assert_eq!(view.latest().unwrap(), Some(ended));
}
