//! The controller and the simulated robot as real processes: start order, kills, restarts, faults, shutdown.
#![allow(clippy::unwrap_used, missing_docs)]

mod joined;

use joined::{Joined, Seen};
use pcc_model::{Configuration, Robot};
use shared_types::{
    clock::mono_now_ns,
    codes::{
        CommandRefusal, CommandSender, LoopFault, LoopState, MotionOutcome, MotorState, Refusal,
        StopCause,
    },
    message::{Cycle, RobotState},
    valid::{Command, MotionResult},
};

fn goal(sign: f64) -> Configuration {
    Configuration::from([0.5, -0.3, 0.4, 0.3, -0.4, 0.5]) * sign
}

/// Velocity and acceleration limits over everything sent, and no step that the velocities do not explain.
fn assert_within_limits(robot: &Robot, cycles: &[Cycle]) {
    let limits = &robot.tendon_limits;
    for pair in cycles.windows(2) {
        let elapsed_s = (pair[1].stamp_mono_ns - pair[0].stamp_mono_ns) as f64 * 1e-9;
        assert_eq!(
            pair[1].sequence,
            pair[0].sequence + 1,
            "every cycle exactly once"
        );
        for tendon in 0..9 {
            let [before, after] =
                [pair[0], pair[1]].map(|cycle| cycle.setpoint_velocity_m_s[tendon]);
            let step_m = pair[1].setpoint_m[tendon] - pair[0].setpoint_m[tendon];
            assert!(after.abs() <= limits.velocity * (1.0 + 1e-6));
            assert!(
                pair[1].setpoint_acceleration_m_s2[tendon].abs()
                    <= limits.acceleration * (1.0 + 1e-6)
            );
            assert!((after - before).abs() <= limits.acceleration * elapsed_s * 1.01 + 1e-9);
            let unexplained_m = (step_m - 0.5 * (before + after) * elapsed_s).abs();
            assert!(
                unexplained_m <= limits.acceleration * elapsed_s.powi(2) + 1e-9,
                "{unexplained_m} in {elapsed_s} s"
            );
        }
    }
}

/// Stamps and lengths are rounded: a step ÷ time may exceed its limit by so much.
const ALLOWED_USE: f64 = 1.001;

/// The robot's own reference never moves or accelerates beyond its limits, by its own stamps: in ramps, rests, restarts and where
/// set-points take hold of it. While it follows, it is the set-points', which are judged by the times that they are of.
fn assert_smooth_reference(robot: &Robot, states: &[RobotState]) {
    let limits = &robot.tendon_limits;
    let follows = |state: &RobotState| state.state == MotorState::Following.code();
    let unled = states
        .windows(2)
        .filter(|pair| !pair.iter().all(follows))
        .inspect(|pair| assert!(pair[1].stamp_mono_ns > pair[0].stamp_mono_ns));
    let mut judged = 0;
    for pair in unled {
        judged += 1;
        let elapsed_s = (pair[1].stamp_mono_ns - pair[0].stamp_mono_ns) as f64 * 1e-9;
        for tendon in 0..9 {
            let step_m = pair[1].accepted_setpoint_m[tendon] - pair[0].accepted_setpoint_m[tendon];
            let change_m_s =
                pair[1].accepted_velocity_m_s[tendon] - pair[0].accepted_velocity_m_s[tendon];
            assert!(
                step_m.abs() <= limits.velocity * elapsed_s * ALLOWED_USE + 1e-9,
                "step {step_m} in {elapsed_s} s"
            );
            assert!(
                change_m_s.abs() <= limits.acceleration * elapsed_s * ALLOWED_USE + 1e-9,
                "{change_m_s} in {elapsed_s} s"
            );
        }
    }
    assert!(judged > 0, "the premise: the robot did not only follow");
}

fn robot_is(state: MotorState) -> impl Fn(&Seen) -> bool {
    move |seen: &Seen| {
        seen.robot
            .last()
            .is_some_and(|now| now.state == state.code())
    }
}

/// Sends a motion, and returns its id once it is well on its way.
fn run_into_motion(joined: &mut Joined, goal: &Configuration) -> u32 {
    joined.wait_for(LoopState::Holding);
    let id = joined.send_motion(goal);
    joined.wait_until("well on its way", |seen| {
        seen.controller.is_some_and(|now| {
            now.state == LoopState::Executing.code()
                && now.trajectory_id == id
                && now.trajectory_time_s > 0.3
        })
    });
    id
}

#[test]
fn any_start_order_kills_and_restarts_never_make_the_set_point_jump() {
    let mut joined = Joined::new();
    // The controller first, the robot later.
    let controller = joined.start("controller");
    joined.wait_for(LoopState::Starting);
    joined.wait_until("a reason to wait", |seen| {
        let told = seen.controller.map(|now| now.reason.to_string());
        told.as_deref() == Some("no robot state: 100 ms without one are allowed")
    });
    let robot = joined.start("simulated-robot");
    run_into_motion(&mut joined, &goal(1.0));
    joined.wait_for(LoopState::Holding);
    let reached = Configuration::from(joined.controller().commanded_configuration_rad);
    assert!((reached - goal(1.0)).amax() < 1e-9);
    joined.with_seen(|seen| assert_within_limits(&joined.robot, &seen.cycles));

    // The controller is killed in motion: the robot ramps to rest, a new controller takes hold where it rests.
    run_into_motion(&mut joined, &goal(-1.0));
    joined.forget();
    controller.kill();
    joined.wait_until("at rest after loss", robot_is(MotorState::AtRestAfterLoss));
    let rest = joined.with_seen(|seen| *seen.robot.last().unwrap());
    assert_eq!(rest.ramps_to_rest, 1);
    joined.with_seen(|seen| {
        assert!(
            seen.robot
                .iter()
                .any(|state| state.state == MotorState::RampingToRest.code())
        );
        assert_smooth_reference(&joined.robot, &seen.robot);
        assert_within_limits(&joined.robot, &seen.cycles);
    });
    joined.forget();
    let controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    let held = joined.controller();
    for (held_m, rest_m) in held
        .commanded_tendon_m
        .iter()
        .zip(&rest.accepted_setpoint_m)
    {
        assert!((held_m - rest_m).abs() < 1e-12, "{held_m} against {rest_m}");
    }
    // Cycles come in batches, after the state that tells of them.
    let first_held = |seen: &Seen| {
        let starting = LoopState::Starting.code();
        seen.cycles.iter().position(|cycle| cycle.state != starting)
    };
    joined.wait_until("a cycle that holds", |seen| first_held(seen).is_some());
    joined.with_seen(|seen| {
        assert_smooth_reference(&joined.robot, &seen.robot);
        let held = first_held(seen).unwrap();
        assert_within_limits(&joined.robot, &seen.cycles[held..]);
    });

    // The robot is killed in motion: the controller stops, and goes on after a reset.
    run_into_motion(&mut joined, &goal(1.0));
    robot.kill();
    joined.wait_for(LoopState::Fault);
    assert_eq!(joined.controller().fault, LoopFault::RobotLost.code());
    let _robot = joined.start("simulated-robot");
    joined.wait_until("at rest", robot_is(MotorState::AtRestAfterLoss));
    assert!(joined.command(Command::ResetFault).accepted);
    run_into_motion(&mut joined, &goal(0.2));
    joined.wait_for(LoopState::Holding);
    let end = joined.controller();
    assert!((Configuration::from(end.commanded_configuration_rad) - goal(0.2)).amax() < 1e-9);
    assert_eq!(
        joined.with_seen(|seen| seen.robot.last().unwrap().rejected_setpoints),
        0
    );
    drop(controller);
}

#[test]
fn a_motion_of_another_daemon_or_from_before_a_stop_is_refused_by_name() {
    let mut joined = Joined::new();
    let _robot = joined.start("simulated-robot");
    let _controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    let id = joined.send_motion_of_another_daemon(&goal(1.0));
    joined.wait_for_refusal(id, Refusal::OtherDaemon);
    let before_ns = mono_now_ns();
    let stop = joined.command(Command::Stop);
    assert_eq!(stop.refusal, CommandRefusal::NothingToDo);
    let id = joined.send_motion_of(before_ns, &goal(1.0));
    joined.wait_for_refusal(id, Refusal::RequestedBefore);
    let id = joined.send_motion_of(mono_now_ns() + 1_000_000_000, &goal(1.0));
    joined.wait_for_refusal(id, Refusal::Malformed);
    let told = joined.controller();
    assert!(told.wanted_from_mono_ns > told.instance.cast_signed());
    assert_eq!(joined.controller().trajectory_id, 0, "nothing has moved");
    run_into_motion(&mut joined, &goal(1.0));
}

#[test]
fn a_lost_daemon_a_stop_and_a_shutdown_brake_along_the_path() {
    let mut joined = Joined::new();
    let mut robot = joined.start("simulated-robot");
    let mut controller = joined.start("controller");
    run_into_motion(&mut joined, &goal(1.0));
    joined.set_daemon_alive(false);
    joined.wait_for(LoopState::Holding);
    assert_eq!(joined.controller().fault, LoopFault::None.code());
    // Without a daemon no trajectory is taken, and the reason is published.
    let id = joined.send_motion(&goal(-1.0));
    joined.wait_for_refusal(id, Refusal::NotReady);
    joined.set_daemon_alive(true);
    std::thread::sleep(std::time::Duration::from_millis(50));
    // Another daemon, so soon that no heartbeat is missed, does not know the motion of the one before.
    run_into_motion(&mut joined, &goal(-1.0));
    joined.replace_daemon();
    joined.wait_for(LoopState::Holding);
    let held = Configuration::from(joined.controller().commanded_configuration_rad);
    assert!((held - goal(-1.0)).norm() > 0.05, "stopped on the way");
    run_into_motion(&mut joined, &goal(1.0));
    assert!(joined.command(Command::SetSpeed(0.5)).accepted);
    assert!(joined.command(Command::Stop).accepted);
    joined.wait_for(LoopState::Holding);
    assert_eq!(
        joined.command(Command::Stop).refusal,
        CommandRefusal::NothingToDo
    );
    assert_eq!(
        joined.command(Command::SetSpeed(1.5)).refusal,
        CommandRefusal::InvalidSpeed
    );
    assert!(joined.command(Command::SetSpeed(1.0)).accepted);
    run_into_motion(&mut joined, &goal(-1.0));
    controller.signal("TERM");
    assert!(controller.wait().success());
    joined.with_seen(|seen| {
        assert_within_limits(&joined.robot, &seen.cycles);
        let last = seen.cycles.last().unwrap();
        assert_eq!(
            (last.state, last.setpoint_velocity_m_s),
            (LoopState::Holding.code(), [0.0; 9])
        );
    });
    robot.signal("TERM");
    assert!(robot.wait().success());
    assert!(
        !joined
            .files_left()
            .iter()
            .any(|path| path.to_string_lossy().ends_with(".pose"))
    );
}

#[test]
fn a_stuck_motor_is_a_latched_fault_and_a_second_process_is_refused_by_name() {
    let mut joined = Joined::new();
    joined.path_tolerance_rad = 0.1;
    let robot = joined.start("simulated-robot");
    let _controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    for (program, name) in [
        ("controller", "a controller already runs"),
        ("simulated-robot", "a robot already runs"),
    ] {
        let mut second = joined.start(program);
        assert!(!second.wait().success());
        let said = second.stderr();
        assert!(said.contains(name), "{said}");
    }
    run_into_motion(&mut joined, &goal(1.0));
    robot.signal("USR1");
    joined.wait_for(LoopState::Fault);
    let told = joined.controller();
    assert_eq!(told.fault, LoopFault::TrackingError.code());
    let reason = told.reason.to_string();
    assert!(
        reason.contains("rad off its path, 0.1000 are allowed"),
        "{reason}"
    );
    let id = joined.send_motion(&goal(0.0));
    joined.wait_for_refusal(id, Refusal::Faulted);
    robot.signal("USR1");
    joined.wait_until("back in place", |seen| {
        seen.controller
            .is_some_and(|now| now.tracking_error_rad < 0.01)
    });
    assert!(joined.command(Command::ResetFault).accepted);
    joined.wait_for(LoopState::Holding);
}

#[test]
fn ten_thousand_cycles_with_trajectories_arriving_touch_no_system_memory() {
    let mut joined = Joined::new();
    let _robot = joined.start("simulated-robot");
    let _controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    let first = joined.controller();
    let mut sign = 1.0;
    while joined.controller().cycle < first.cycle + 10_000 {
        run_into_motion(&mut joined, &goal(sign));
        joined.wait_for(LoopState::Holding);
        sign = -sign;
    }
    let last = joined.controller();
    assert_eq!(last.loop_system_allocations, 0);
    let sent = last.setpoints_sent - first.setpoints_sent;
    let allocations = last.loop_arena_allocations - first.loop_arena_allocations;
    assert!(sent >= 9_000, "the premise: it sent {sent} set-points");
    let lateness = |share| {
        shared_types::lateness::quantile_ns(&last.lateness_histogram, share).unwrap() / 1_000
    };
    println!(
        "{sent} set-points, {allocations} arena allocations; late by {} / {} / {} µs (p50, p99, p99.9), {} late cycles",
        lateness(0.5),
        lateness(0.99),
        lateness(0.999),
        last.late_cycles
    );
    // iceoryx2 0.10 makes one small block a send.
    assert_eq!(allocations, sent);
}

/// Sends a motion that begins so long after now, ns, and returns its id once it waits in the loop.
fn let_motion_wait(joined: &mut Joined, ahead_ns: i64) -> u32 {
    joined.wait_for(LoopState::Holding);
    let waiting = joined.send_motion_in(ahead_ns, &goal(1.0));
    let another = joined.send_motion_in(ahead_ns, &goal(1.0));
    joined.wait_for_refusal(another, Refusal::Busy);
    waiting
}

#[test]
fn a_reset_sets_a_motion_aside_that_waits_and_a_controllers_start_is_no_later_than_its_instance() {
    let mut joined = Joined::new();
    let _robot = joined.start("simulated-robot");
    let _controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    let told = joined.controller();
    assert!(told.wanted_from_mono_ns <= told.instance.cast_signed());
    let id = let_motion_wait(&mut joined, 10_000_000_000);
    let reset = joined.command(Command::ResetFault);
    assert_eq!((reset.accepted, reset.state), (true, LoopState::Holding));
    joined.wait_for_refusal(id, Refusal::SetAside);
    assert_eq!(
        joined.command(Command::ResetFault).refusal,
        CommandRefusal::NothingToDo
    );
    assert_eq!(joined.controller().trajectory_id, 0, "nothing has moved");
    run_into_motion(&mut joined, &goal(1.0));
}

#[test]
fn a_motion_that_waits_does_not_begin_after_a_long_pause_and_that_is_no_fault() {
    let mut joined = Joined::new();
    let robot = joined.start("simulated-robot");
    let controller = joined.start("controller");
    let id = let_motion_wait(&mut joined, 300_000_000);
    for process in [&controller, &robot] {
        process.signal("STOP");
    }
    std::thread::sleep(std::time::Duration::from_millis(1_000));
    for process in [&robot, &controller] {
        process.signal("CONT");
    }
    joined.wait_for_refusal(id, Refusal::BeginsInThePast);
    let now = joined.controller();
    assert_eq!((now.trajectory_id, now.fault), (0, LoopFault::None.code()));
    run_into_motion(&mut joined, &goal(1.0));
}

#[test]
fn a_motion_that_begins_and_ends_in_one_late_cycle_is_named_and_has_its_result() {
    let mut joined = Joined::new();
    let robot = joined.start("simulated-robot");
    let controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    let id = joined.send_still_motion_in(150_000_000);
    std::thread::sleep(std::time::Duration::from_millis(50));
    for process in [&controller, &robot] {
        process.signal("STOP");
    }
    std::thread::sleep(std::time::Duration::from_millis(150));
    for process in [&robot, &controller] {
        process.signal("CONT");
    }
    assert_eq!(joined.wait_for_result(id).outcome, MotionOutcome::Reached);
    joined.wait_until("a state that names it", |seen| {
        seen.controller.is_some_and(|now| now.trajectory_id == id)
    });
    run_into_motion(&mut joined, &goal(1.0));
    joined.with_seen(|seen| {
        let is_of_it = |cycle: &Cycle| cycle.trajectory_id == id;
        assert!(!seen.cycles.iter().any(is_of_it), "the premise");
    });
}

fn assert_stopped(result: &MotionResult, cause: StopCause, reason: &str) {
    let values = &result.values;
    assert_eq!(
        (result.outcome, result.cause),
        (MotionOutcome::Stopped, cause),
        "{result}"
    );
    assert!(
        0.3 < values.path_time_s && values.path_time_s < values.duration_s,
        "{values:?}"
    );
    assert_eq!(result.to_string(), format!("stopped: {reason}"));
}

#[test]
fn every_motion_has_one_result_that_says_how_it_ended_and_who_ended_it() {
    let mut joined = Joined::new();
    let _robot = joined.start("simulated-robot");
    let mut controller = joined.start("controller");
    joined.wait_for(LoopState::Holding);
    let id = joined.send_motion(&goal(1.0));
    let reached = joined.wait_for_result(id);
    let values = &reached.values;
    assert_eq!(reached.outcome, MotionOutcome::Reached, "{reached}");
    assert_eq!(values.path_time_s, values.duration_s);
    assert_eq!(values.plan_id, u64::from(id));
    assert_eq!(values.instance, joined.controller().instance);

    let id = run_into_motion(&mut joined, &goal(-1.0));
    let reply = joined.command(Command::Stop.because("the ball comes nearer"));
    assert_eq!(reply.reason.text(), "the robot brakes along its path");
    let stopped = joined.wait_for_result(id);
    assert_stopped(&stopped, StopCause::Command, "the ball comes nearer");
    let (sender, pid) = (stopped.sender, stopped.values.sender_pid);
    assert_eq!((sender, pid), (CommandSender::Program, std::process::id()));

    let id = let_motion_wait(&mut joined, 10_000_000_000);
    joined.command(Command::ResetFault);
    let aside = joined.wait_for_result(id);
    assert_eq!(
        (aside.outcome, aside.cause, aside.values.path_time_s),
        (MotionOutcome::SetAside, StopCause::Reset, 0.0)
    );
    let id = joined.send_motion_of_another_daemon(&goal(1.0));
    let refused = joined.wait_for_result(id);
    assert_eq!(refused.refusal, Refusal::OtherDaemon, "{refused}");
    assert!(
        refused
            .to_string()
            .starts_with("refused: it was published by another daemon")
    );

    let id = run_into_motion(&mut joined, &goal(1.0));
    joined.set_daemon_alive(false);
    let stopped = joined.wait_for_result(id);
    assert_stopped(&stopped, StopCause::DaemonLost, "the daemon was lost");
    joined.set_daemon_alive(true);
    std::thread::sleep(std::time::Duration::from_millis(50));
    let id = run_into_motion(&mut joined, &goal(-1.0));
    controller.signal("TERM");
    assert!(controller.wait().success());
    let stopped = joined.wait_for_result(id);
    assert_stopped(&stopped, StopCause::Shutdown, "the controller ends");

    joined.with_seen(|seen| {
        let sequences: Vec<u64> = seen.results.iter().map(|result| result.sequence).collect();
        let all: Vec<u64> = (1..=sequences.len() as u64).collect();
        assert_eq!(sequences, all, "each result once, in order");
        let mut ids: Vec<u32> = seen
            .results
            .iter()
            .map(|result| result.trajectory_id)
            .collect();
        ids.sort_unstable();
        let sent: Vec<u32> = (1..=id).collect();
        assert_eq!(ids, sent, "a result for each motion");
    });
}
