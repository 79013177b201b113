//! What the reference does with set-points that come, stay away, break a rule, or are late.

use super::*;

const LIMITS: ReferenceLimits = ReferenceLimits {
    velocity_m_s: 0.08,
    acceleration_m_s2: 0.4,
    allowance: 1.05,
    lost_after_ns: 20_000_000,
    longest_cycle_ns: 5_000_000,
};
const MS: i64 = 1_000_000;

fn at_rest() -> Reference {
    Reference::new(LIMITS, 0, &TendonState::default())
}

/// Accelerates all tendons (the first fastest) at half the limit until `end_ms`; returns the last target.
fn speed_up(reference: &mut Reference, end_ms: i64) -> Setpoint {
    let mut last = None;
    for ms in 1..=end_ms {
        let t = seconds((ms - 1) * MS);
        let target = Setpoint {
            sequence: ms.unsigned_abs(),
            stamp_mono_ns: ms * MS,
            position_m: std::array::from_fn(|i| 0.1 * t * t / (1.0 + i as f64)),
            velocity_m_s: std::array::from_fn(|i| 0.2 * t / (1.0 + i as f64)),
            acceleration_m_s2: std::array::from_fn(|i| 0.2 / (1.0 + i as f64)),
            ..Setpoint::ZEROED
        };
        reference.advance(ms * MS);
        reference.offer(ms * MS, &target).unwrap();
        last = Some(target);
    }
    last.unwrap()
}

#[test]
fn lost_setpoints_ramp_to_rest_within_limits_and_along_the_tangent() {
    let mut reference = at_rest();
    let last = speed_up(&mut reference, 300);
    let (mut position, mut velocity) = (*reference.position_m(), reference.velocity_m_s());
    assert!(velocity[0] > 0.05, "the premise: it moves");
    let mut rested_ms = None;
    for ms in 301..900 {
        reference.advance(ms * MS);
        let (next, next_velocity) = (*reference.position_m(), reference.velocity_m_s());
        assert!(largest_difference(&next, &position) <= 0.08 * 1e-3);
        assert!(largest_difference(&next_velocity, &velocity) <= 0.4 * 1e-3 * (1.0 + 1e-9));
        let direction = next_velocity[0] / last.velocity_m_s[0];
        assert!((next_velocity[8] - direction * last.velocity_m_s[8]).abs() < 1e-15);
        if ms <= 320 {
            assert_eq!(reference.mode(), Mode::Following);
        }
        if reference.mode() == Mode::AtRestAfterLoss {
            rested_ms.get_or_insert(ms);
        }
        (position, velocity) = (next, next_velocity);
    }
    // v / a = 0.0598 / 0.4 = 149.5 ms of braking after 20 ms of silence.
    assert_eq!(rested_ms, Some(470));
    assert_eq!((reference.ramps_to_rest(), velocity), (1, [0.0; TENDONS]));
}

#[test]
fn a_driver_that_was_held_up_does_not_jump_after_the_motion() {
    let mut reference = at_rest();
    let last = speed_up(&mut reference, 300);
    let (before, velocity) = (*reference.position_m(), reference.velocity_m_s());
    let ahead = |ahead_s: f64| {
        let mut setpoint = last;
        setpoint.stamp_mono_ns = 400 * MS;
        setpoint.acceleration_m_s2 = [0.0; TENDONS];
        for (position_m, velocity_m_s) in setpoint.position_m.iter_mut().zip(&velocity) {
            *position_m += ahead_s * velocity_m_s;
        }
        setpoint
    };
    // A pause of the whole machine: the controller goes on from where it was.
    for ahead_s in [0.020, 0.024] {
        let mut paused = reference.clone();
        paused.step(400 * MS, Some(&ahead(ahead_s)));
        assert_eq!(paused.mode(), Mode::Following, "{ahead_s} s further");
    }
    // The controller went on for 100 ms; a cycle without a set-point came between.
    let mut waking = reference.clone();
    waking.step(390 * MS, None);
    waking.step(400 * MS, Some(&ahead(0.100)));
    assert_eq!(waking.mode(), Mode::Ramping);
    let jump = reference.step(400 * MS, Some(&ahead(0.100)));
    assert_eq!(reference.mode(), Mode::Ramping);
    assert!(largest_difference(&jump.position_m, &before) <= 0.08 * 5e-3);
}

#[test]
fn slow_cycles_ramp_to_rest_without_a_halt_before() {
    for period_ms in [10, 20] {
        let limits = ReferenceLimits {
            longest_cycle_ns: 2 * period_ms * MS,
            ..LIMITS
        };
        let mut reference = Reference::new(limits, 0, &TendonState::default());
        speed_up(&mut reference, 300);
        assert_ramps_without_a_halt(reference, 300, period_ms);
    }
}

/// No set-point comes after so many ms, in cycles of this length.
fn assert_ramps_without_a_halt(mut reference: Reference, from_ms: i64, period_ms: i64) {
    let mut position = reference.position_m()[0];
    let mut speed = reference.velocity_m_s()[0];
    assert!(speed > 0.05, "the premise: it moves");
    for cycle in 1..20 {
        reference.advance((from_ms + cycle * period_ms) * MS);
        let next = reference.position_m()[0];
        let moved = (next - position) / seconds(period_ms * MS);
        let most = 0.4 * seconds(period_ms * MS) * 1.001;
        assert!(moved <= speed + 1e-9 && speed - moved <= most, "{cycle}");
        (position, speed) = (next, moved);
    }
    assert_eq!(reference.mode(), Mode::AtRestAfterLoss);
}

/// Follows a constant velocity in cycles of this length until a time.
fn follow_slowly(reference: &mut Reference, last: &Setpoint, until_ms: i64, period_ms: i64) {
    for ms in (300 + period_ms..=until_ms).step_by(period_ms as usize) {
        let mut target = *last;
        target.stamp_mono_ns = ms * MS;
        target.acceleration_m_s2 = [0.0; TENDONS];
        for (position_m, velocity_m_s) in target.position_m.iter_mut().zip(&last.velocity_m_s) {
            *position_m += velocity_m_s * seconds((ms - 300) * MS);
        }
        reference.step(ms * MS, Some(&target));
        assert_eq!(reference.mode(), Mode::Following, "{ms} ms");
    }
}

#[test]
fn a_loop_that_is_slower_than_it_was_set_up_for_ramps_to_rest_without_a_halt() {
    let mut reference = at_rest();
    let last = speed_up(&mut reference, 300);
    follow_slowly(&mut reference, &last, 400, 10);
    assert_ramps_without_a_halt(reference, 400, 10);
}

#[test]
fn a_set_point_in_a_long_cycle_is_not_lost() {
    let limits = ReferenceLimits {
        longest_cycle_ns: 50 * MS,
        ..LIMITS
    };
    let mut reference = Reference::new(limits, 0, &TendonState::default());
    let last = speed_up(&mut reference, 300);
    follow_slowly(&mut reference, &last, 500, 25);
}

#[test]
fn a_reference_that_is_to_rest_takes_no_set_point_on_the_way() {
    let mut reference = at_rest();
    let last = speed_up(&mut reference, 300);
    reference.ramp_to_rest();
    let next = Setpoint {
        stamp_mono_ns: 301 * MS,
        ..last
    };
    assert_eq!(reference.offer(301 * MS, &next), Err(Refusal::NotAtRest));
    (301..600).for_each(|ms| reference.advance(ms * MS));
    assert_eq!(reference.velocity_m_s(), [0.0; TENDONS]);
}

#[test]
fn a_ramp_is_finished_and_then_only_a_target_at_rest_there_is_taken() {
    let mut reference = at_rest();
    let last = speed_up(&mut reference, 300);
    (301..=330).for_each(|ms| reference.advance(ms * MS));
    let mut late = last;
    late.stamp_mono_ns = 330 * MS;
    assert_eq!(reference.offer(330 * MS, &late), Err(Refusal::NotAtRest));
    assert_eq!(reference.mode(), Mode::Ramping);
    (331..600).for_each(|ms| reference.advance(ms * MS));
    late.stamp_mono_ns = 600 * MS;
    assert_eq!(reference.offer(600 * MS, &late), Err(Refusal::PositionStep));
    let here = Setpoint {
        stamp_mono_ns: 601 * MS,
        position_m: *reference.position_m(),
        velocity_m_s: [0.0; TENDONS],
        acceleration_m_s2: [0.0; TENDONS],
        ..last
    };
    reference.offer(601 * MS, &here).unwrap();
    assert_eq!(
        (reference.mode(), reference.refused()),
        (Mode::Following, 2)
    );
    assert_eq!(*reference.position_m(), here.position_m);
}

#[test]
fn a_first_set_point_must_be_fresh_or_the_next_one_might_be_anywhere() {
    let target = |stamp_mono_ns, position| Setpoint {
        sequence: 1,
        stamp_mono_ns,
        position_m: [position; TENDONS],
        ..Setpoint::ZEROED
    };
    let now_ns = 60_000 * MS;
    let mut reference = Reference::new(LIMITS, now_ns, &TendonState::default());
    for stamp_ns in [i64::MIN, 0, now_ns - 21 * MS] {
        let refusal = reference.offer(now_ns, &target(stamp_ns, 0.0));
        assert_eq!(refusal, Err(Refusal::Stamp));
        assert_eq!(reference.mode(), Mode::Idle);
    }
    reference
        .offer(now_ns, &target(now_ns - 20 * MS, 0.0))
        .unwrap();
    let jump = reference.offer(now_ns, &target(now_ns, 0.01));
    assert_eq!(jump, Err(Refusal::PositionStep));
}

#[test]
fn every_broken_rule_is_named_latched_and_changes_nothing() {
    type Spoil = fn(&mut Setpoint);
    let cases: [(Refusal, Spoil); 6] = [
        (Refusal::NotFinite, |t| t.position_m[3] = f64::NAN),
        (Refusal::Stamp, |t| t.stamp_mono_ns = 300 * MS),
        (Refusal::PositionStep, |t| t.position_m[1] += 2e-4),
        (Refusal::Velocity, |t| t.velocity_m_s[2] = -0.09),
        (Refusal::VelocityStep, |t| t.velocity_m_s[2] += 6e-4),
        (Refusal::Acceleration, |t| t.acceleration_m_s2[0] = 0.5),
    ];
    for (expected, spoil) in cases {
        let mut reference = at_rest();
        let mut target = speed_up(&mut reference, 300);
        target.stamp_mono_ns += MS;
        spoil(&mut target);
        reference.advance(301 * MS);
        let (position, velocity) = (*reference.position_m(), reference.velocity_m_s());
        assert_eq!(reference.offer(301 * MS, &target), Err(expected));
        assert_eq!(reference.mode(), Mode::Fault(expected));
        assert_eq!(
            (*reference.position_m(), reference.velocity_m_s()),
            (position, velocity)
        );
        // Set-points that keep coming keep the fault latched; silence ends it, at rest.
        for ms in 302..700 {
            reference.advance(ms * MS);
            assert!(reference.offer(ms * MS, &target).is_err());
            assert_eq!(reference.mode(), Mode::Fault(expected));
        }
        (700..810).for_each(|ms| reference.advance(ms * MS));
        assert_eq!(reference.mode(), Mode::AtRestAfterLoss);
    }
}

#[test]
fn a_robot_that_was_moving_when_it_restarted_ramps_to_rest_first() {
    let mut reference = Reference::new(
        LIMITS,
        0,
        &TendonState {
            position_m: [0.1; TENDONS],
            velocity_m_s: [0.04; TENDONS],
        },
    );
    assert_eq!(reference.mode(), Mode::Ramping);
    (1..=101).for_each(|ms| reference.advance(ms * MS));
    assert_eq!(reference.mode(), Mode::AtRestAfterLoss);
    // v² / 2a
    assert!((reference.position_m()[4] - 0.102).abs() < 1e-12);
}
