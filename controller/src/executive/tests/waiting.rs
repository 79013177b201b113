//! Trajectories that wait for their begin, and what comes before it.

use shared_types::codes::{CommandRefusal, LoopFault, LoopState, Refusal};

use shared_types::valid::Signature;

use super::state;
use crate::{
    executive::{BeginWindow, GuardState, check_still_valid},
    fixtures::{MS, World, curved_motion, target_configuration},
};

const WINDOW: BeginWindow = BeginWindow {
    past_ns: 100 * MS,
    ahead_ns: 60_000 * MS,
};

/// A world whose controller has a trajectory that begins in 50 ms.
fn waiting() -> World {
    let mut world = World::holding();
    let begin_ns = world.now_ns + 50 * MS;
    let mut motion = curved_motion(4, begin_ns, world.commanded(), target_configuration());
    motion.requested_ns = 1;
    assert!(world.executive.execute(motion).is_ok());
    world.run(10);
    world
}

/// Makes a cycle as the loop does, `elapsed_ns` after the one before. Returns why a trajectory was refused in it, if one was.
fn cycle(world: &mut World, elapsed_ns: i64, heard: &GuardState) -> Option<Refusal> {
    let now_ns = world.now_ns + elapsed_ns;
    let window = WINDOW.of_waiting();
    let refused = world.executive.refuse_due(now_ns, |motion| {
        check_still_valid(motion, now_ns, heard, &window)
    });
    world.last = None;
    world.cycle(elapsed_ns);
    refused.map(|(reason, _)| reason.code())
}

#[test]
fn a_reset_puts_a_trajectory_aside_that_waits_and_leaves_one_that_has_begun() {
    let mut world = waiting();
    assert_eq!(world.executive.reset(Signature::UNSIGNED), Ok(()));
    let aside = world.executive.take_finished().map(|ended| ended.motion.id);
    assert_eq!(aside, Some(4));
    assert_eq!(
        world.executive.reset(Signature::UNSIGNED),
        Err(CommandRefusal::NothingToDo)
    );
    world.run(100);
    assert_eq!(state(&world), LoopState::Holding);
    world.begin_motion(5);
    world.run(100);
    assert_eq!(
        world.executive.reset(Signature::UNSIGNED),
        Err(CommandRefusal::NothingToDo)
    );
    world.run(1);
    assert_eq!(state(&world), LoopState::Executing);
}

#[test]
fn a_trajectory_begins_late_after_a_pause_and_is_refused_after_a_long_one() {
    for (pause_ms, refusal) in [
        (100, None),
        (340, None),
        (341, Some(Refusal::BeginsInThePast)),
        (5_000, Some(Refusal::BeginsInThePast)),
    ] {
        let mut world = waiting();
        let refused = cycle(&mut world, pause_ms * MS, &GuardState::default());
        assert_eq!(refused, refusal, "{pause_ms} ms");
        let last = world.last.unwrap();
        let expected = match refusal {
            None => LoopState::Executing,
            Some(_) => LoopState::Holding,
        };
        assert_eq!((last.state, last.fault), (expected, LoopFault::None));
    }
}

#[test]
fn a_trajectory_that_has_come_to_be_unwanted_is_refused_when_it_is_to_begin() {
    let mut world = waiting();
    let heard = GuardState {
        wanted_from_ns: 1,
        daemon_instance: None,
    };
    assert_eq!(cycle(&mut world, MS, &heard), None, "it waits");
    assert_eq!(
        cycle(&mut world, 50 * MS, &heard),
        Some(Refusal::RequestedBefore)
    );
    assert_eq!(state(&world), LoopState::Holding);
}
