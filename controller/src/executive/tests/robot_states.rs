use robot_driver::Mode;
use shared_types::codes::{LoopFault, LoopState, Waiting};
use shared_types::valid::Signature;

use super::{run_until, state};
use crate::{
    executive::{RobotSample, RobotUpdate},
    fixtures::{MS, World},
};

fn waiting(world: &World) -> Waiting {
    world.last.as_ref().unwrap().waiting
}

/// A world in mid-motion.
fn moving() -> World {
    let mut world = World::holding();
    world.begin_motion(1);
    world.run(1_500);
    assert_eq!(state(&world), LoopState::Executing, "the premise");
    world
}

#[test]
fn a_robot_that_repeats_its_last_state_is_lost() {
    let mut world = moving();
    world.repeats_state = true;
    world.run(20);
    assert_eq!(state(&world), LoopState::Executing);
    world.run(3);
    assert_eq!(state(&world), LoopState::Stopping);
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::RobotLost);
    run_until(&mut world, 1_000, |world| state(world) == LoopState::Fault);
    world.cycle(MS);
    assert_eq!(waiting(&world), Waiting::RepeatedRobotState);
    assert!(!world.last.as_ref().unwrap().send);
}

#[test]
fn a_stamp_that_is_not_of_now_is_no_sign_of_life() {
    let cases = [
        (-30 * MS, Waiting::OldRobotState),
        (3 * MS, Waiting::FutureRobotState),
        (1_700_000_000_000 * MS, Waiting::FutureRobotState),
        (-1_000 * MS, Waiting::RepeatedRobotState),
    ];
    for (offset_ns, reason) in cases {
        let mut world = moving();
        if reason == Waiting::OldRobotState {
            // Stamps that lag from the first: each is newer than the one before.
            world.restart_controller();
            world.last = None;
        }
        world.stamp_offset_ns = offset_ns;
        world.run(600);
        let output = world.last.as_ref().unwrap();
        assert!(!output.send, "{offset_ns}: {output:?}");
        assert_eq!(output.waiting, reason, "{offset_ns}");
        assert!(output.refused_robot_states > 500, "{offset_ns}");
    }
}

#[test]
fn pauses_of_the_machine_make_no_state_old() {
    let mut world = moving();
    for pause_ms in [300, 25, 40, 1_000] {
        world.last = None;
        world.cycle(pause_ms * MS);
    }
    world.run(50);
    let output = world.last.as_ref().unwrap();
    assert_eq!(
        (output.state, output.fault, output.refused_robot_states),
        (LoopState::Executing, LoopFault::None, 0)
    );
}

#[test]
fn a_robot_that_is_the_first_to_wake_after_a_pause_has_not_strayed() {
    for pause_ms in [30, 60, 100, 300] {
        let mut world = moving();
        world.now_ns += pause_ms * MS;
        world.robot_alone();
        world.last = None;
        world.cycle(MS / 5);
        let mut worst_rad = 0.0_f64;
        for _ in 0..200 {
            worst_rad = worst_rad.max(world.cycle(MS).tracking_error_rad);
        }
        assert!(worst_rad < 2e-3, "{worst_rad} rad after {pause_ms} ms");
    }
}

#[test]
fn what_a_starting_controller_waits_for_has_a_name() {
    let mut world = World::new();
    world.robot_silent = true;
    world.run(3);
    assert_eq!(waiting(&world), Waiting::NoRobotState);
    world.robot_silent = false;
    world.run(10);
    assert_eq!(waiting(&world), Waiting::None);

    let sample = world.sample();
    type Spoil = fn(&mut RobotSample);
    let cases: [(Waiting, Spoil); 6] = [
        (Waiting::RobotFollowsAnother, |_| {}),
        (Waiting::RobotFault, |s| {
            s.state = Mode::Fault(robot_driver::Refusal::Stamp).into();
        }),
        (Waiting::RobotMoves, |s| s.state = Mode::Ramping.into()),
        (Waiting::RobotMoves, |s| {
            s.state = Mode::Idle.into();
            s.accepted_velocity_m_s[4] = 1e-6;
        }),
        (Waiting::OtherRobot, |s| {
            s.state = Mode::Idle.into();
            s.robot_hash += 1;
        }),
        (Waiting::OffTendonMap, |s| {
            s.state = Mode::Idle.into();
            // 1.1 µm of residual: (1, 1, 1) on the tendons of one section is no configuration's.
            (0..3).for_each(|i| s.accepted_m[i] += 1.1e-6 / 3.0_f64.sqrt());
        }),
    ];
    for (reason, spoil) in cases {
        world.restart_controller();
        for _ in 0..400 {
            world.now_ns += MS;
            let mut robot = RobotSample {
                stamp_ns: world.now_ns,
                ..sample
            };
            spoil(&mut robot);
            let output = world.controller_cycle(RobotUpdate::State(&robot));
            assert_eq!((output.state, output.send), (LoopState::Starting, false));
            assert_eq!(output.waiting, reason);
            assert_eq!(output.robot_hash, robot.robot_hash);
            let off_map = reason == Waiting::OffTendonMap;
            assert_eq!((output.accepted_residual_m - 1.1e-6).abs() < 1e-9, off_map);
        }
    }
}

#[test]
fn a_robot_that_never_takes_up_the_set_points_is_named() {
    let mut world = World::new();
    world.run(1);
    let sample = RobotSample {
        state: Mode::Idle.into(),
        ..world.sample()
    };
    world.restart_controller();
    for cycle in 0..1_000 {
        world.now_ns += MS;
        let robot = RobotSample {
            stamp_ns: world.now_ns,
            ..sample
        };
        let output = world.controller_cycle(RobotUpdate::State(&robot));
        assert_eq!(output.waiting, Waiting::NotTakenUp, "cycle {cycle}");
    }
}

#[test]
fn a_reset_brings_back_the_tolerance_of_the_settings() {
    let mut world = World::holding();
    let mut motion = crate::fixtures::curved_motion(
        1,
        world.now_ns + 3 * MS,
        world.commanded(),
        crate::fixtures::target_configuration(),
    );
    motion.path_tolerance_rad = 1e-12;
    assert!(world.executive.execute(motion).is_ok());
    run_until(&mut world, 1_000, |world| state(world) == LoopState::Fault);
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::TrackingError);
    world.executive.reset(Signature::UNSIGNED).unwrap();
    world.run(500);
    assert_eq!(state(&world), LoopState::Holding);
}

#[test]
fn a_motion_that_waits_for_its_begin_allows_and_forbids_nothing_yet() {
    let mut world = World::holding();
    let mut motion = crate::fixtures::curved_motion(
        1,
        world.now_ns + 300 * MS,
        world.commanded(),
        crate::fixtures::target_configuration(),
    );
    motion.path_tolerance_rad = 1e-12;
    assert!(world.executive.execute(motion).is_ok());
    world.run(250);
    assert_eq!(state(&world), LoopState::Holding);
    run_until(&mut world, 1_000, |world| state(world) == LoopState::Fault);
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::TrackingError);
}

#[test]
fn a_killed_robot_that_comes_back_is_found_where_it_stands() {
    for kill_at in [3, 700, 1_500] {
        let mut world = World::holding();
        world.begin_motion(1);
        world.run(kill_at);
        world.robot_silent = true;
        world.run(100);
        world.restart_robot();
        world.robot_silent = false;
        let mut refused = None;
        for _ in 0..1_000 {
            world.cycle(MS);
            if state(&world) == LoopState::Fault && refused.is_none() {
                refused = Some(world.executive.reset(Signature::UNSIGNED));
            }
        }
        assert_eq!(
            state(&world),
            LoopState::Holding,
            "killed after {kill_at} ms"
        );
        assert_eq!(world.reference.mode(), Mode::Following);
    }
}
