//! How motions end, and what ended them.

use shared_types::codes::{LoopFault, LoopState};
use shared_types::valid::{Command, Signature};

use super::state;
use crate::{
    executive::{Ending, Motion, StopOrigin},
    fixtures::{MS, World, curved_motion, joined_motion, target_configuration},
};

/// A world that executes motion 4, and that motion.
fn executing() -> (World, Motion) {
    let mut world = World::holding();
    let begin_ns = world.now_ns + 3 * MS;
    let motion = curved_motion(4, begin_ns, world.commanded(), target_configuration());
    assert!(world.executive.execute(motion.clone()).is_ok());
    world.run(400);
    assert_eq!(state(&world), LoopState::Executing, "the premise");
    (world, motion)
}

/// Has motion 5 leave motion 4 in 50 ms.
fn join(world: &mut World, left: &Motion) {
    let now_s = world.last.unwrap().path_time_s;
    let mut motion = joined_motion(5, left, now_s + 0.05, world.commanded());
    motion.lead_in_from(left, now_s).unwrap();
    assert!(world.executive.execute(motion).is_ok());
}

#[test]
fn a_motion_that_is_left_is_joined_and_the_other_one_is_reached() {
    let (mut world, left) = executing();
    join(&mut world, &left);
    world.run(5_000);
    assert_eq!(world.ended, [(4, Ending::Joined(5)), (5, Ending::Reached)]);
}

#[test]
fn a_stopped_motion_names_what_stopped_it_first() {
    let ordered = Command::Stop.because("the ball comes nearer").signature;
    let (mut world, _) = executing();
    world.executive.stop(StopOrigin::Command(ordered)).unwrap();
    world.run(2);
    world.executive.stop(StopOrigin::Suspension).unwrap();
    world.daemon_alive = false;
    world.run(3_000);
    let stopped = Ending::Stopped(StopOrigin::Command(ordered));
    assert_eq!(world.ended, [(4, stopped)]);
    let origin = stopped.origin().unwrap();
    assert_eq!(origin.to_string(), "the ball comes nearer");
    let unsigned = StopOrigin::Command(Signature::UNSIGNED).to_string();
    assert_eq!(unsigned, "a command to stop of a person or a program");
}

#[test]
fn the_loss_of_the_daemon_and_each_fault_are_named() {
    let (mut world, _) = executing();
    world.daemon_alive = false;
    world.run(3_000);
    assert_eq!(world.ended, [(4, Ending::Stopped(StopOrigin::DaemonLost))]);
    let (mut world, _) = executing();
    world.guard_held_up = true;
    world.run(3_000);
    let fault = StopOrigin::Fault(LoopFault::GuardHeldUp);
    assert_eq!(world.ended, [(4, Ending::Stopped(fault))]);
}

#[test]
fn a_motion_that_a_stalled_loop_finds_ended_is_stamped_with_the_cycle_that_found_it() {
    let (mut world, _) = executing();
    world.without_controller(60 * MS);
    world.cycle(MS);
    let ramped = StopOrigin::Fault(LoopFault::RobotRampedToRest);
    assert_eq!(world.ended, [(4, Ending::Stopped(ramped))]);
    assert_eq!(world.last_ended_ns, world.now_ns);
}

#[test]
fn what_the_robot_ended_is_not_ended_by_a_stop_that_a_stalled_loop_finds_with_it() {
    let (mut world, left) = executing();
    join(&mut world, &left);
    world.without_controller(60 * MS);
    world.stop = Some(StopOrigin::Signal);
    world.cycle(MS);
    let ramped = StopOrigin::Fault(LoopFault::RobotRampedToRest);
    let ended = [(5, Ending::SetAside(ramped)), (4, Ending::Stopped(ramped))];
    assert_eq!(world.ended, ended);
}

#[test]
fn what_waits_for_its_begin_or_its_switch_is_set_aside_before_the_other_one_ends() {
    let (mut world, left) = executing();
    join(&mut world, &left);
    world.executive.stop(StopOrigin::Signal).unwrap();
    world.run(3_000);
    let signal = StopOrigin::Signal;
    assert_eq!(
        world.ended,
        [(5, Ending::SetAside(signal)), (4, Ending::Stopped(signal))]
    );
    world.ended.clear();
    let begin_ns = world.now_ns + 500 * MS;
    let waits = curved_motion(6, begin_ns, world.commanded(), target_configuration());
    assert!(world.executive.execute(waits).is_ok());
    world.run(5);
    world.executive.reset(Signature::UNSIGNED).unwrap();
    world.run(5);
    let reset = StopOrigin::Reset(Signature::UNSIGNED);
    assert_eq!(world.ended, [(6, Ending::SetAside(reset))]);
}

#[test]
fn a_stop_that_the_end_of_the_path_comes_before_is_no_stop_of_the_next_motion() {
    let (mut world, motion) = executing();
    while world.last.unwrap().path_time_s < motion.duration_s() - 0.002 {
        world.run(1);
    }
    world.executive.stop(StopOrigin::Signal).unwrap();
    world.run(1_000);
    assert_eq!(state(&world), LoopState::Holding);
    world.ended.clear();
    let back = motion.knots[0].position;
    let next = curved_motion(7, world.now_ns, world.commanded(), back);
    assert!(world.executive.execute(next).is_ok());
    world.run(10_000);
    assert_eq!(world.ended, [(7, Ending::Reached)]);
}
