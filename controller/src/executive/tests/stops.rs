//! Stops on motions of the time parameterization, whose jerk steps as real ones do.

use pcc_model::Configuration;
use rand_pcg::{
    Pcg64,
    rand_core::{Rng, SeedableRng},
};
use shared_types::codes::{LoopFault, LoopState};

use crate::executive::StopOrigin;
use crate::fixtures::{MS, World, target_configuration, timed_motion};

/// A straight line and a path with corners, from where the world holds.
fn paths() -> [Vec<Configuration>; 2] {
    let (zero, target) = (Configuration::zeros(), target_configuration());
    let corner = Configuration::from([0.5, 0.2, -0.3, 0.4, 0.1, -0.2]);
    [vec![zero, target], vec![zero, corner, target]]
}

#[test]
fn a_stop_in_any_cycle_of_a_motion_with_steps_of_jerk_holds_the_robot() {
    let mut random = Pcg64::seed_from_u64(31);
    for path in paths() {
        for (period_ns, every) in [(MS / 4, 97), (MS, 13), (5 * MS / 2, 7), (10 * MS, 2)] {
            let mut along = World::with_period(period_ns);
            along.run(10);
            let begin_ns = along.now_ns + 3 * MS;
            let motion = timed_motion(1, begin_ns, &path);
            assert!(along.executive.execute(motion).is_ok());
            let mut cycle = 0;
            loop {
                let output = along
                    .cycle(period_ns / 2 + (random.next_u64() as i64 & 0xfff_ffff) % period_ns);
                cycle += 1;
                if cycle > 20 && output.state == LoopState::Holding {
                    break;
                }
                if cycle % every == 0 {
                    stop(along.clone(), period_ns);
                }
            }
        }
    }
}

/// The world itself checks the limits of everything that is sent.
fn stop(mut world: World, period_ns: i64) {
    if world.executive.stop(StopOrigin::Signal).is_err() {
        return;
    }
    for _ in 0..4_000 {
        let output = world.cycle(period_ns);
        assert!(output.send && output.fault == LoopFault::None, "{output:?}");
        if output.state == LoopState::Holding {
            return;
        }
    }
    panic!("it does not come to rest: {:?}", world.last);
}

#[test]
fn a_late_cycle_in_a_stop_sends_the_acceleration_of_its_end() {
    let path = &paths()[1];
    for late_ns in [2 * MS, 3 * MS, 7 * MS + 1, 20 * MS, 45 * MS] {
        let mut world = World::holding();
        let motion = timed_motion(1, world.now_ns, path);
        assert!(world.executive.execute(motion).is_ok());
        world.run(900);
        world.executive.stop(StopOrigin::Signal).unwrap();
        world.run(20);
        let before = *world.last.as_ref().unwrap();
        assert!(before.rate > 0.0, "the premise: it brakes");
        world.last = None;
        let late = world.cycle(late_ns);
        let after = world.cycle(MS / 10);
        for tendon in 0..9 {
            let slope =
                (after.tendon_velocity_m_s[tendon] - late.tendon_velocity_m_s[tendon]) / 1e-4;
            let sent = late.tendon_acceleration_m_s2[tendon];
            let limit = world.robot.tendon_limits.acceleration;
            assert!(
                after.rate == 0.0 || (slope - sent).abs() < 0.1 * limit,
                "{slope} after {sent} was sent, {late_ns} ns late"
            );
        }
    }
}
