use super::*;

const LIMITS: TendonLimits = TendonLimits {
    velocity: 1.0,
    acceleration: 10.0,
    jerk: 100.0,
};

/// A sine within the limits, sampled each millisecond.
fn setpoint(i: i64) -> Setpoint {
    let t = i as f64 * 1e-3;
    Setpoint {
        sequence: i.unsigned_abs(),
        stamp_mono_ns: i * 1_000_000,
        position_m: [0.09 * (10.0 * t).sin(); 9],
        velocity_m_s: [0.9 * (10.0 * t).cos(); 9],
        acceleration_m_s2: [-9.0 * (10.0 * t).sin(); 9],
        ..Setpoint::ZEROED
    }
}

/// A robot that follows it 0.3 ms later.
fn robot(i: i64) -> RobotState {
    let followed = setpoint(i);
    RobotState {
        sequence: followed.sequence,
        stamp_mono_ns: followed.stamp_mono_ns + 300_000,
        accepted_sequence: followed.sequence,
        state: MotorState::Following.code(),
        accepted_setpoint_m: std::array::from_fn(|tendon| {
            followed.position_m[tendon] + followed.velocity_m_s[tendon] * 3e-4
        }),
        accepted_velocity_m_s: followed.velocity_m_s,
        ..RobotState::ZEROED
    }
}

fn judged(setpoints: Vec<Setpoint>, robot: Vec<RobotState>) -> Verdict {
    let mut judge = Judge::new(LIMITS);
    judge.look(&Heard {
        setpoints,
        robot,
        ..Heard::default()
    });
    judge.verdict().clone()
}

#[test]
fn a_motion_within_its_limits_is_no_offence_and_what_it_uses_is_known() {
    let setpoints: Vec<Setpoint> = (1..2000).map(setpoint).collect();
    let verdict = judged(setpoints, (1..2000).map(robot).collect());
    assert_eq!(verdict.offences, Vec::<String>::new());
    for used in [
        verdict.velocity,
        verdict.acceleration,
        verdict.sent.position,
        verdict.sent.velocity,
    ] {
        assert!((0.89..0.91).contains(&used), "{verdict:?}");
    }
    assert!(verdict.reference_error_m < 1e-15, "{verdict:?}");
    assert_eq!((verdict.lost, verdict.unmatched), ([0; 3], 0));
}

#[test]
fn what_a_killed_controller_sent_last_is_lost_once() {
    let setpoints: Vec<Setpoint> = (1..50).map(setpoint).collect();
    let mut states: Vec<RobotState> = (1..53).map(robot).collect();
    let mut last = states[51];
    for _ in 0..10 {
        last.sequence += 1;
        last.stamp_mono_ns += 1_000_000;
        states.push(last);
    }
    let verdict = judged(setpoints, states);
    assert_eq!((verdict.lost, verdict.unmatched), ([0; 3], 13));
    assert_eq!(verdict.last_unheard, 3);
}

#[test]
fn what_was_sent_before_anybody_listened_is_not_unheard() {
    let verdict = judged(
        (40..60).map(setpoint).collect(),
        (30..60).map(robot).collect(),
    );
    assert_eq!((verdict.lost, verdict.unmatched), ([0; 3], 0));
    assert_eq!(verdict.last_unheard, 0);
}

#[test]
fn what_is_followed_unheard_and_goes_on_is_a_gap() {
    let mut setpoints: Vec<Setpoint> = (1..60).map(setpoint).collect();
    setpoints.drain(49..52);
    let verdict = judged(setpoints, (1..60).map(robot).collect());
    assert_eq!((verdict.lost, verdict.unmatched), ([3, 0, 0], 3));
    assert_eq!(verdict.last_unheard, 0);
}

#[test]
fn a_step_in_one_tendon_is_an_offence_however_small_the_pause() {
    let mut jump: Vec<Setpoint> = (1..100).map(setpoint).collect();
    jump[50..]
        .iter_mut()
        .for_each(|sample| sample.position_m[4] += 2e-3);
    assert_eq!(judged(jump, Vec::new()).offence_count, 1);
    let mut kink: Vec<Setpoint> = (1..100).map(setpoint).collect();
    kink[50..]
        .iter_mut()
        .for_each(|sample| sample.velocity_m_s[4] += 0.02);
    assert_eq!(judged(kink, Vec::new()).offence_count, 1);
}

#[test]
fn a_number_that_is_none_is_an_offence() {
    let mut spoilt: Vec<Setpoint> = (1..100).map(setpoint).collect();
    spoilt[50].velocity_m_s[4] = f64::NAN;
    let verdict = judged(spoilt, Vec::new());
    assert!(verdict.velocity.is_nan() && verdict.sent.velocity.is_nan());
    assert_eq!(verdict.offence_count, 3, "{verdict:?}");
}

#[test]
fn steps_from_one_controller_to_the_next_count_and_what_was_not_heard_is_known() {
    let mut two: Vec<Setpoint> = (1..100).map(setpoint).collect();
    two.drain(20..23);
    for (i, sample) in two[50..].iter_mut().enumerate() {
        sample.sequence = 2 + i as u64;
        sample.stamp_mono_ns += 40_000_000;
    }
    let verdict = judged(two.clone(), Vec::new());
    assert_eq!((verdict.lost[0], verdict.restarts), (3, 1));
    assert_eq!(verdict.first_unheard, [1, 0, 0]);
    assert_eq!(verdict.offence_count, 0, "{verdict:?}");
    two[50..]
        .iter_mut()
        .for_each(|sample| sample.position_m[0] += 0.05);
    assert_eq!(judged(two, Vec::new()).offence_count, 1);
}

#[test]
fn who_takes_hold_begins_at_the_robots_reference() {
    for (reference_m, offences) in [(0.02, 0), (0.021, 1)] {
        let executing = Setpoint {
            state: LoopState::Executing.code(),
            ..setpoint(1)
        };
        let taking_hold = Setpoint {
            sequence: 2,
            stamp_mono_ns: 102_000_000,
            position_m: [0.02; 9],
            ..Setpoint::ZEROED
        };
        let at_rest = RobotState {
            sequence: 1,
            stamp_mono_ns: 101_500_000,
            state: MotorState::AtRestAfterLoss.code(),
            accepted_setpoint_m: [reference_m; 9],
            ..RobotState::ZEROED
        };
        let verdict = judged(vec![executing, taking_hold], vec![at_rest]);
        assert_eq!(verdict.offence_count, offences, "{verdict:?}");
        assert_eq!((verdict.sent.pairs, verdict.taken.pairs), (0, 1));
    }
}

#[test]
fn a_robot_that_leaves_its_set_points_or_jumps_at_a_restart_is_seen() {
    let setpoints: Vec<Setpoint> = (1..100).map(setpoint).collect();
    let mut states: Vec<RobotState> = (1..100).map(robot).collect();
    states[30].accepted_setpoint_m[2] += 1e-6;
    let verdict = judged(setpoints.clone(), states.clone());
    assert!((verdict.reference_error_m - 1e-6).abs() < 1e-12);
    states[50..].iter_mut().for_each(|state| {
        state.state = MotorState::AtRestAfterLoss.code();
    });
    let verdict = judged(setpoints.clone(), states[..51].to_vec());
    assert_eq!(verdict.offence_count, 0, "{verdict:?}");
    states[50].accepted_velocity_m_s = [0.0; 9];
    let verdict = judged(setpoints, states[..51].to_vec());
    assert_eq!(verdict.offence_count, 1, "at rest at once");
}
