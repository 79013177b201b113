//! What would have happened had the robot stopped at once, and stood still.

use pcc_model::Robot;
use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use tests::brute_force::{Ball, Body, Tendons};
use tests::knots::state_at;
use tests::listener::Heard;
use trajectory::{BRAKING_SHARE, Playback, RateLaw};

use super::figures::motion_of;
use super::paths::path;

/// Time from the publication of balls until the stop begins: a period of supervision, nanoseconds.
const SUPERVISION_PERIOD_NS: i64 = 1_000_000;
/// Length of a cycle of the loop, s.
const CYCLE_S: f64 = 1e-3;
/// Time between two looks at a robot that stands, nanoseconds.
const LOOK_NS: i64 = 1_000_000;

/// Whether a robot that begins to stop along its path one period of supervision after balls were published, and then stands still, stays
/// clear of them until they are gone. Both times in nanoseconds of `CLOCK_MONOTONIC`; how it brakes is the controller's own law.
pub(super) fn stays_clear_after_a_stop(
    body: &Body,
    robot: &Robot,
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
        let stop = stop_along(
            robot,
            heard,
            cycle.trajectory_id,
            &cycle.commanded_configuration_rad,
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

/// The configurations, cycle by cycle, of a stop along the motion of this id from where it commands this configuration.
fn stop_along(robot: &Robot, heard: &Heard, id: u32, from: &[f64; 6]) -> Vec<[f64; 6]> {
    let motion = motion_of(&heard.motions, id);
    let Some((motion, (_, path))) = motion.and_then(|motion| Some((motion, path(motion)?))) else {
        return vec![*from];
    };
    let duration_s = path.duration();
    let law = RateLaw::new(
        &robot.tendons,
        robot.tendon_limits.acceleration * BRAKING_SHARE,
    );
    let at = |time_s: f64| state_at(&motion.knots, time_s).map_or(*from, |[position, ..]| position);
    let off = |time_s: f64| {
        let place = at(time_s);
        let squares = place.iter().zip(from).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>()
    };
    let times = (0..=(duration_s / CYCLE_S) as usize).map(|step| step as f64 * CYCLE_S);
    let mut time = times
        .min_by(|a, b| off(*a).total_cmp(&off(*b)))
        .unwrap_or(0.0);
    let (mut rate, mut hint, mut places) = (1.0, 0, Vec::new());
    while rate > 0.0 && time < duration_s {
        places.push(at(time));
        let playback = Playback {
            knots: path.knots(),
            time,
            rate,
        };
        let step = law.step(&playback, &mut hint, 0.0, CYCLE_S);
        (time, rate) = (time + step.advance, step.rate);
    }
    places.push(at(time.min(duration_s)));
    places
}
