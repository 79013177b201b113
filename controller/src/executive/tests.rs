mod endings;
mod robot_states;
mod stops;
mod waiting;

use pcc_model::Configuration;
use rand_pcg::{
    Pcg64,
    rand_core::{Rng, SeedableRng},
};
use robot_driver::Mode;
use shared_types::codes::{CommandRefusal, LoopFault, LoopState, MotorState};
use shared_types::message::Setpoint;
use shared_types::valid::Signature;

use crate::{
    executive::StopOrigin,
    fixtures::{MS, World, curved_motion, target_configuration},
};

fn run_until(world: &mut World, limit: usize, done: impl Fn(&World) -> bool) -> usize {
    for cycle in 0..limit {
        world.cycle(MS);
        if done(world) {
            return cycle;
        }
    }
    panic!("not within {limit} cycles: {:?}", world.last);
}

fn state(world: &World) -> LoopState {
    world.last.as_ref().unwrap().state
}

fn moving(world: &World) -> f64 {
    world.last.as_ref().unwrap().commanded.velocity.norm()
}

#[test]
fn a_trajectory_is_followed_in_time_to_its_end_and_the_robot_follows() {
    let mut world = World::holding();
    assert_eq!(state(&world), LoopState::Holding);
    world.begin_motion(1);
    let duration = curved_motion(9, 0, Configuration::zeros(), target_configuration()).duration_s();
    let worst = std::cell::RefCell::new(0.0_f64);
    let cycles = run_until(&mut world, 20_000, |world| {
        let error_rad = world.last.as_ref().unwrap().tracking_error_rad;
        worst.replace_with(|worst| worst.max(error_rad));
        state(world) == LoopState::Holding && world.commanded() != Configuration::zeros()
    });
    assert!(
        (cycles as f64 * 1e-3 - 2e-3 - duration).abs() <= 1.5e-3,
        "{cycles} for {duration} s"
    );
    assert!((world.commanded() - target_configuration()).amax() < 1e-12);
    let worst = *worst.borrow();
    assert!(worst > 1e-4 && worst < 2e-3, "tracking error {worst} rad");
    let tip = |shape: &Configuration| world.robot.tip(shape);
    let measured = world.last.as_ref().unwrap().measured_rad;
    assert!((tip(&measured) - tip(&target_configuration())).norm() < 0.03);
    assert_eq!(world.reference.refused(), 0);
}

#[test]
fn stops_at_random_instants_keep_every_limit_and_stay_on_the_path() {
    let mut random = Pcg64::seed_from_u64(7);
    let mut longest = 0;
    for round in 0..60 {
        let mut world = World::holding();
        world.begin_motion(1);
        let path = curved_motion(1, 0, Configuration::zeros(), target_configuration());
        let cycles = 4 + random.next_u64() % (path.duration_s() * 1e3) as u64;
        world.run(cycles);
        if round % 3 == 0 {
            world.executive.set_speed(0.4).unwrap();
            world.run(50);
        }
        if world.executive.stop(StopOrigin::Signal).is_err() {
            assert_eq!(
                state(&world),
                LoopState::Holding,
                "the premise: it had ended"
            );
            continue;
        }
        let braking = run_until(&mut world, 2_000, |world| {
            state(world) == LoopState::Holding
        });
        longest = longest.max(braking);
        let mut hint = 0;
        let stopped_s = world.last.as_ref().unwrap().path_time_s;
        let on_path = trajectory::evaluate(&path.knots, &mut hint, stopped_s).position;
        assert!((world.commanded() - on_path).amax() < 1e-12);
    }
    // The limits' own scale: v / a = 0.2 s.
    assert!((100..400).contains(&longest), "longest stop {longest} ms");
}

#[test]
fn a_stop_is_as_fast_as_the_limits_allow() {
    let mut world = World::holding();
    world.begin_motion(1);
    run_until(&mut world, 5_000, |world| {
        world.last.as_ref().unwrap().path_time_s > 2.0
    });
    world.executive.stop(StopOrigin::Signal).unwrap();
    let limit = world.robot.tendon_limits.acceleration;
    let (mut braking, mut at_limit) = (0, 0);
    while state(&world) != LoopState::Holding {
        let output = world.cycle(MS);
        let most = output
            .tendon_acceleration_m_s2
            .iter()
            .fold(0.0, |most: f64, a| most.max(a.abs()));
        braking += 1;
        at_limit += usize::from(most > 0.98 * limit);
    }
    assert!(
        braking > 20 && at_limit * 100 > braking * 90,
        "{at_limit} of {braking} at the limit"
    );
}

#[test]
fn speed_is_ramped_within_the_limits_and_reaches_what_was_ordered() {
    let mut world = World::holding();
    world.begin_motion(1);
    for (speed, cycles) in [(0.3, 900), (1.0, 900), (0.0, 900), (0.7, 900)] {
        world.executive.set_speed(speed).unwrap();
        world.run(cycles);
        assert!((world.last.as_ref().unwrap().rate - speed).abs() < 1e-12);
        assert_eq!(state(&world), LoopState::Executing);
    }
    for speed in [-0.1, 1.01, f64::NAN] {
        assert_eq!(
            world.executive.set_speed(speed),
            Err(CommandRefusal::InvalidSpeed)
        );
    }
    run_until(&mut world, 40_000, |world| {
        state(world) == LoopState::Holding
    });
    assert!((world.commanded() - target_configuration()).amax() < 1e-12);
}

#[test]
fn late_cycles_sample_by_absolute_time_without_a_jump() {
    let mut random = Pcg64::seed_from_u64(3);
    let mut world = World::holding();
    world.begin_motion(1);
    let begin_ns = world.now_ns + 3 * MS;
    let mut late = 0;
    while world.now_ns < begin_ns + 3_000 * MS {
        let elapsed_ns = match random.next_u64() % 20 {
            0 => 2 * MS + (random.next_u64() % 17) as i64 * MS,
            _ => MS,
        };
        let output = world.cycle(elapsed_ns);
        late += usize::from(output.late);
        let absolute_s = (world.now_ns - begin_ns).max(0) as f64 * 1e-9;
        assert!(
            (output.path_time_s - absolute_s).abs() < 1e-9 || output.state != LoopState::Executing
        );
    }
    assert!(late > 50, "the premise: {late} late cycles");
    assert_eq!(world.reference.refused(), 0);
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::None);
}

#[test]
fn late_cycles_for_more_than_100_ms_on_end_are_a_controlled_stop() {
    for (late_cycles, fault) in [(33, LoopFault::None), (34, LoopFault::TooLate)] {
        let mut world = World::holding();
        world.begin_motion(1);
        world.run(1_000);
        for _ in 0..late_cycles {
            world.cycle(3 * MS);
        }
        world.cycle(MS);
        assert_eq!(
            world.last.as_ref().unwrap().fault,
            fault,
            "after {late_cycles}"
        );
        if fault != LoopFault::None {
            run_until(&mut world, 1_000, |world| state(world) == LoopState::Fault);
            assert!(world.last.as_ref().unwrap().send, "it holds");
        }
    }
}

#[test]
fn a_lost_daemon_brakes_along_the_path_and_holds() {
    let mut world = World::holding();
    world.begin_motion(1);
    world.run(1_500);
    world.daemon_alive = false;
    world.cycle(MS);
    assert_eq!(state(&world), LoopState::Stopping);
    run_until(&mut world, 1_000, |world| {
        state(world) == LoopState::Holding
    });
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::None);
    world.run(100);
    assert_eq!(
        state(&world),
        LoopState::Holding,
        "a silent daemon does not matter to one that holds"
    );
}

#[test]
fn a_robot_that_says_nothing_stops_the_motion_and_latches_a_fault() {
    let mut world = World::holding();
    world.begin_motion(1);
    world.run(1_500);
    world.robot_silent = true;
    world.run(19);
    assert_eq!(state(&world), LoopState::Executing);
    world.run(3);
    assert_eq!(state(&world), LoopState::Stopping);
    assert_eq!(
        world.executive.reset(Signature::UNSIGNED),
        Err(CommandRefusal::FaultPersists)
    );
    run_until(&mut world, 1_000, |world| state(world) == LoopState::Fault);
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::RobotLost);
    world.cycle(MS);
    assert!(!world.last.as_ref().unwrap().send);
    // It comes back: only a reset lets the controller take hold again.
    world.robot_silent = false;
    world.run(300);
    assert_eq!(state(&world), LoopState::Fault);
    world.executive.reset(Signature::UNSIGNED).unwrap();
    run_until(&mut world, 300, |world| state(world) == LoopState::Holding);
    world.begin_motion(2);
    run_until(&mut world, 20_000, |world| {
        state(world) == LoopState::Holding && moving(world) == 0.0
    });
}

#[test]
fn a_stuck_motor_is_a_tracking_error_before_it_is_twice_the_tolerance() {
    let mut world = World::holding();
    world.begin_motion(1);
    world.run(800);
    world.stuck_tendon = Some(4);
    let mut error_rad = 0.0;
    while state(&world) == LoopState::Executing {
        let output = world.cycle(MS);
        error_rad = (output.measured_rad - output.commanded.position).norm();
    }
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::TrackingError);
    assert!(error_rad > 0.015 && error_rad < 0.04, "{error_rad}");
    run_until(&mut world, 1_000, |world| state(world) == LoopState::Fault);
    // Latched while the cause is there, and after a reset at once again.
    world.executive.reset(Signature::UNSIGNED).unwrap();
    run_until(&mut world, 100, |world| state(world) == LoopState::Fault);
    world.stuck_tendon = None;
    world.run(2_000);
    world.executive.reset(Signature::UNSIGNED).unwrap();
    world.run(100);
    assert_eq!(state(&world), LoopState::Holding);
}

#[test]
fn a_restarted_controller_waits_for_rest_and_takes_hold_without_a_jump() {
    let mut random = Pcg64::seed_from_u64(11);
    for _ in 0..20 {
        let mut world = World::holding();
        world.begin_motion(1);
        let cycles = 500 + random.next_u64() % 3_000;
        world.run(cycles);
        // Killed; a new one is there at any time from 1 ms on, also while the robot still moves.
        world.without_controller(MS + (random.next_u64() % 300) as i64 * MS);
        world.restart_controller();
        world.last = None;
        let mut sent_while_moving = false;
        let mut first_sent = None;
        for _ in 0..600 {
            let rested = world.reference.velocity_m_s() == [0.0; 9];
            let reference_m = world.reference_m();
            let output = world.cycle(MS);
            sent_while_moving |= output.send && !rested;
            if output.send && first_sent.is_none() {
                first_sent = Some((output.tendon_m, reference_m));
            }
        }
        let (first_m, reference_m) = first_sent.unwrap();
        assert!(!sent_while_moving);
        assert_eq!(
            first_m, reference_m,
            "it holds the accepted tendons themselves"
        );
        assert_eq!(world.reference.mode(), Mode::Following);
        assert_eq!(
            state(&world),
            LoopState::Holding,
            "it does not resume by itself"
        );
        // The first trajectory from there continues from the very same tendons.
        world.begin_motion(1);
        run_until(&mut world, 20_000, |world| {
            state(world) == LoopState::Executing
        });
        run_until(&mut world, 20_000, |world| {
            state(world) == LoopState::Holding
        });
        assert!((world.commanded() - target_configuration()).amax() < 1e-9);
    }
}

#[test]
fn a_stalled_loop_finds_the_robot_at_rest_and_never_pulls_it_back() {
    for stall_ms in [15, 19, 25, 60, 400] {
        let mut world = World::holding();
        world.begin_motion(1);
        world.run(1_500);
        assert!(moving(&world) > 0.1, "the premise: it moves");
        world.without_controller(stall_ms * MS);
        let before = world.reference_m();
        world.last = None;
        world.cycle(MS);
        let step_m = (world.reference_m()[3] - before[3]).abs();
        assert!(
            step_m <= world.robot.tendon_limits.velocity * 1e-3 * 1.1,
            "{step_m} after {stall_ms} ms"
        );
        let output = world.last.as_ref().unwrap();
        if stall_ms < 20 {
            assert_eq!(
                (output.state, output.fault),
                (LoopState::Executing, LoopFault::None)
            );
            let error_rad = output.tracking_error_rad;
            assert!(error_rad < 2e-3, "{error_rad} rad: the robot has gone on");
            continue;
        }
        assert_eq!(
            (output.state, output.fault),
            (LoopState::Fault, LoopFault::RobotRampedToRest)
        );
        assert!(!output.send);
        world.run(600);
        world.executive.reset(Signature::UNSIGNED).unwrap();
        run_until(&mut world, 300, |world| state(world) == LoopState::Holding);
        assert_eq!(world.reference.refused(), 0);
    }
}

#[test]
fn a_pause_of_the_whole_machine_is_one_late_cycle_and_no_fault() {
    for pause_ms in [30, 300] {
        let mut world = World::holding();
        world.begin_motion(1);
        world.run(1_500);
        let before = *world.last.as_ref().unwrap();
        // The step is capped, so the path time lags and the positions fall short of what the velocities say.
        world.last = None;
        let after = world.cycle(pause_ms * MS);
        let step_s = after.path_time_s - before.path_time_s;
        assert!((step_s - 0.020).abs() < 1e-9, "{step_s}");
        assert!(after.tracking_error_rad < 2e-3, "{after:?}");
        world.run(100);
        assert_eq!(state(&world), LoopState::Executing);
        assert_eq!(world.reference.refused(), 0);
        run_until(&mut world, 20_000, |world| {
            state(world) == LoopState::Holding
        });
        assert!((world.commanded() - target_configuration()).amax() < 1e-12);
    }
}

#[test]
fn trajectories_are_refused_where_they_cannot_start_and_the_old_one_goes_on() {
    let mut world = World::new();
    let motion = |world: &World| {
        curved_motion(
            2,
            world.now_ns,
            Configuration::zeros(),
            target_configuration(),
        )
    };
    let (reason, _) = world.executive.execute(motion(&world)).unwrap_err();
    assert!(reason.to_string().contains("starting"), "{reason}");
    world.run(10);
    let elsewhere = curved_motion(1, 0, Configuration::repeat(2e-6), target_configuration());
    let (reason, _) = world.executive.execute(elsewhere).unwrap_err();
    assert!(reason.to_string().contains("4.90e-6"), "{reason}");
    world.begin_motion(1);
    assert!(
        world.executive.execute(motion(&world)).is_err(),
        "one already waits"
    );
    world.run(500);
    assert!(
        world.executive.execute(motion(&world)).is_err(),
        "one is executing"
    );
    run_until(&mut world, 20_000, |world| {
        state(world) == LoopState::Holding
    });
    assert!((world.commanded() - target_configuration()).amax() < 1e-12);
}

#[test]
fn a_start_within_tolerance_is_kept_as_an_offset_not_made_as_a_step() {
    let mut world = World::holding();
    let near = Configuration::repeat(4e-7);
    let motion = curved_motion(1, world.now_ns, near, target_configuration());
    world
        .executive
        .execute(motion)
        .map_err(|(reason, _)| reason)
        .unwrap();
    let before = world.last.unwrap().tendon_m;
    let after = world.cycle(MS).tendon_m;
    assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-9));
    run_until(&mut world, 20_000, |world| {
        state(world) == LoopState::Holding
    });
    assert!((world.commanded() + near - target_configuration()).amax() < 1e-12);
}

#[test]
fn a_set_point_beyond_the_limits_is_never_sent() {
    for spoil in [f64::NAN, 50.0] {
        let mut world = World::holding();
        let mut motion = curved_motion(
            1,
            world.now_ns,
            Configuration::zeros(),
            target_configuration(),
        );
        motion.knots[20].velocity[2] = spoil;
        world
            .executive
            .execute(motion)
            .map_err(|(reason, _)| reason)
            .unwrap();
        run_until(&mut world, 20_000, |world| state(world) == LoopState::Fault);
        let output = world.last.as_ref().unwrap();
        assert_eq!(
            (output.fault, output.send),
            (LoopFault::InvalidSetpoint, false)
        );
        world.run(400);
        assert_eq!(world.reference.mode(), Mode::AtRestAfterLoss);
        assert_eq!(world.reference.refused(), 0);
    }
}

#[test]
fn a_robot_in_fault_is_detached_until_reset() {
    let mut world = World::holding();
    world.begin_motion(1);
    world.run(1_500);
    // A foreign set-point makes the robot latch a fault.
    let reference_m = world.reference_m();
    let foreign = Setpoint {
        sequence: 1,
        stamp_mono_ns: world.now_ns,
        position_m: reference_m,
        velocity_m_s: [9.0; 9],
        ..Setpoint::ZEROED
    };
    world.now_ns += MS;
    world.reference.step(world.now_ns, Some(&foreign));
    assert_eq!(MotorState::from(world.reference.mode()), MotorState::Fault);
    world.last = None;
    world.run(5);
    assert_eq!(world.last.as_ref().unwrap().fault, LoopFault::RobotFault);
    world.run(800);
    world.executive.reset(Signature::UNSIGNED).unwrap();
    run_until(&mut world, 300, |world| state(world) == LoopState::Holding);
    world.begin_motion(2);
    run_until(&mut world, 20, |world| state(world) == LoopState::Executing);
}
