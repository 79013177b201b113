//! What would have happened had the robot stopped at once, and stood still.

use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use tests::brute_force::{Ball, Body, Tendons};
use tests::knots::{Knot, state_at};
use tests::listener::Heard;

use super::figures::motion_of;

/// Time from the publication of balls until the stop begins: a period of supervision, nanoseconds.
const SUPERVISION_PERIOD_NS: i64 = 1_000_000;
/// Share of the acceleration limit with which a robot brakes along its path: the controller's.
const BRAKING_SHARE: f64 = 0.998;
/// Length of a cycle of the loop, s.
const CYCLE_S: f64 = 1e-3;
/// Time between two looks at a robot that stands, nanoseconds.
const LOOK_NS: i64 = 1_000_000;

/// Whether a robot that begins to stop along its path one period of supervision after balls were published, and then stands still, stays
/// clear of them until they are gone. Both times in nanoseconds of `CLOCK_MONOTONIC`. It brakes as hard as its tendons' limit of
/// acceleration (m/s²) allows.
pub(super) fn stays_clear_after_a_stop(
    body: &Body,
    acceleration_limit: f64,
    heard: &Heard,
    balls: &[Ball],
    [published_ns, gone_ns]: [i64; 2],
) -> bool {
    let from_ns = published_ns + SUPERVISION_PERIOD_NS;
    let later = heard
        .cycles
        .partition_point(|it| it.stamp_mono_ns < from_ns);
    let later = &heard.cycles[later..];
    let Some(cycle) = later.first() else {
        return false;
    };
    let from_ns = cycle.stamp_mono_ns;
    let stop: Vec<(i64, [f64; 6])> = if cycle.state == LoopState::Executing.code() {
        let from = &cycle.commanded_configuration_rad;
        let motion = motion_of(&heard.motions, cycle.trajectory_id);
        let stop = motion.map_or_else(
            || vec![*from],
            |motion| stop_along(body, acceleration_limit, &motion.knots, from),
        );
        let stamps = (from_ns..).step_by((CYCLE_S * 1e9) as usize);
        stamps.zip(stop).collect()
    } else {
        until_rest(later)
    };
    let stamped: Vec<(i64, Tendons)> = stop
        .iter()
        .map(|(stamp_ns, configuration)| (*stamp_ns, body.tendons(configuration)))
        .collect();
    let Some((rests_ns, at)) = stop.last() else {
        return false;
    };
    let is_clear =
        |stamp_ns: i64| body.clearance(at, balls, stamp_ns) - body.chord_error_m() >= 0.0;
    body.least_clearance(&stamped, |_| balls).at_least_m() >= 0.0
        && (*rests_ns..=gone_ns)
            .step_by(LOOK_NS as usize)
            .all(is_clear)
}

/// What is commanded from the first of these cycles on until the robot rests: where it brakes already, it does as it did.
fn until_rest(cycles: &[Cycle]) -> Vec<(i64, [f64; 6])> {
    let brakes = |cycle: &&Cycle| cycle.state == LoopState::Stopping.code();
    let braking = cycles.iter().take_while(brakes).count();
    let until_rest = cycles.iter().take(braking + 1);
    until_rest
        .map(|cycle| (cycle.stamp_mono_ns, cycle.commanded_configuration_rad))
        .collect()
}

/// The configurations, cycle by cycle, of a stop along a motion from where it commands this configuration.
fn stop_along(
    body: &Body,
    acceleration_limit: f64,
    knots: &[Knot],
    from: &[f64; 6],
) -> Vec<[f64; 6]> {
    let duration_s = knots.last().map_or(0.0, |last| last.time_s);
    let at = |time_s: f64| state_at(knots, time_s).map_or(*from, |[position, ..]| position);
    let off = |time_s: f64| {
        let place = at(time_s);
        let squares = place.iter().zip(from).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>()
    };
    let times = (0..=(duration_s / CYCLE_S) as usize).map(|step| step as f64 * CYCLE_S);
    let mut time_s = times
        .min_by(|a, b| off(*a).total_cmp(&off(*b)))
        .unwrap_or(0.0);
    let (mut rate, mut places) = (1.0, Vec::new());
    while rate > 0.0
        && let Some([position, velocity, acceleration]) = state_at(knots, time_s)
    {
        places.push(position);
        let of_tendons = [velocity, acceleration].map(|it| body.tendons(&it));
        let limit = acceleration_limit * BRAKING_SHARE;
        let slower = (rate + CYCLE_S * strongest_braking(of_tendons, limit, rate)).max(0.0);
        time_s += CYCLE_S * 0.5 * (rate + slower);
        rate = slower;
    }
    places.push(at(time_s.min(duration_s)));
    places
}

/// The change of the rate, 1/s, with which a motion becomes slower soonest while all tendons keep the limit: at a rate r one of velocity v and
/// acceleration a has the acceleration a r² + v dr/dt.
fn strongest_braking([velocity, acceleration]: [Tendons; 2], limit: f64, rate: f64) -> f64 {
    let of_tendon = |(velocity, acceleration): (&f64, &f64)| {
        let goes_on = acceleration * rate * rate;
        let ends = [-limit, limit].map(|end| (end - goes_on) / velocity);
        ends[0].min(ends[1])
    };
    let changes = velocity.iter().zip(&acceleration).map(of_tendon);
    changes.fold(f64::NEG_INFINITY, f64::max).min(0.0)
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn the_slowest_tendon_decides_how_hard_a_robot_brakes() {
        // The first tendon turns at 1 m/s and must not brake by more than 2 m/s², of which its own deceleration takes a half at full rate.
        let mut velocity = [0.0; 9];
        let mut acceleration = [0.0; 9];
        (velocity[0], acceleration[0]) = (1.0, -1.0);
        velocity[1] = 0.1;
        let change = |rate| strongest_braking([velocity, acceleration], 2.0, rate);
        assert!((change(1.0) + 1.0).abs() < 1e-12);
        assert!((change(0.5) + 1.75).abs() < 1e-12);
        // It rests, and may be stopped at once.
        assert_eq!(
            strongest_braking([[0.0; 9]; 2], 2.0, 1.0),
            f64::NEG_INFINITY
        );
    }
}
