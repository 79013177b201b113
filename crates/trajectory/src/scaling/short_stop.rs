//! Stops of a state whose acceleration matters more than its velocity, as near the ends of motions: there the averaged stop of
//! [`super::stopping`] takes up to four times as long as the limits ask for.
//!
//! * A ramp, where the state brakes already: the acceleration falls to 0 as the velocity does. Other parabolas: it falls as a quadratic of time.
//! * A swing: along the velocity the fastest stop there is, the acceleration falling at the jerk limit to where it stays or turns, and rising at
//!   it to 0; what of the acceleration points aside falls as a parabola beside it.

use crate::limits::tendon_rows::TendonRows;
use crate::scaling::stop_profile::{Part, fastest_with_long_parts, jerk_rounding, sum_s};
use crate::{Knot, LimitUse, Trajectory};
use pcc_model::{Configuration, TendonLimits};

/// A limit that is exceeded by this part of itself or less is kept: that much is rounding.
const ROUNDING: f64 = 2e-7;
/// Halvings of the interval in which the shortest parabola's duration lies.
const HALVINGS: usize = 12;
/// Rounds in which the duration of a swing and the share of the jerk limit that what points aside needs are fitted to each other.
const ROUNDS: usize = 4;
/// Halvings of the room that a swing leaves to what points aside.
const ROOMS: usize = 4;
/// An acceleration aside of this share of the limit or less needs no room worth halving.
const STRAIGHT: f64 = 1e-6;
/// Stops are at least so long, in times in which the acceleration rises to its limit: less is nothing to win, and knots keep apart.
const SHORTEST_STOP: f64 = 1e-3;

/// The shortest of the stops of this file from a state that keeps the acceleration and jerk limits, if one is shorter than `longest_s`.
pub(super) fn shorter_stop(
    from: &Knot,
    rows: &TendonRows,
    limits: &TendonLimits,
    longest_s: f64,
) -> Option<Trajectory> {
    let keeps = |motion: &Trajectory| {
        let most = LimitUse::default().raised_by_motion(motion, rows, limits);
        most.acceleration.max(most.jerk) <= 1.0 + ROUNDING
    };
    let least_s = SHORTEST_STOP * limits.acceleration / limits.jerk;
    let swing = fastest_swing(from, rows, limits, keeps);
    let ramp_s = -2.0 * from.velocity.dot(&from.acceleration) / from.acceleration.norm_squared();
    let ramp = Some(ramp_s).filter(|ramp_s| *ramp_s > least_s);
    let ramp = ramp.and_then(|ramp_s| parabola(from, ramp_s).filter(keeps));
    let others = [swing, ramp].into_iter().flatten();
    let stops = others.filter(|it| (least_s..longest_s).contains(&it.duration()));
    let fastest = stops.min_by(|a, b| a.duration().total_cmp(&b.duration()));
    let bound_s = fastest.as_ref().map_or(longest_s, Trajectory::duration);
    let parabola = shortest([least_s, bound_s], |duration_s| {
        parabola(from, duration_s).filter(keeps)
    });
    parabola.filter(|it| it.duration() < bound_s).or(fastest)
}

/// The motion of the shortest duration found between two of which there is a motion; none where there is none of the longer one.
fn shortest(
    [mut too_short_s, longest_s]: [f64; 2],
    of: impl Fn(f64) -> Option<Trajectory>,
) -> Option<Trajectory> {
    let mut found = of(longest_s)?;
    for _ in 0..HALVINGS {
        let middle_s = 0.5 * (too_short_s + found.duration());
        match of(middle_s) {
            Some(shorter) => found = shorter,
            None => too_short_s = middle_s,
        }
    }
    Some(found)
}

/// The stop in this time whose acceleration is a quadratic of time.
fn parabola(from: &Knot, duration_s: f64) -> Option<Trajectory> {
    let way =
        from.velocity * (0.5 * duration_s) + from.acceleration * (duration_s * duration_s / 12.0);
    let end = Knot::resting(duration_s, from.position + way);
    Trajectory::new(vec![*from, end]).ok()
}

/// The swing that leaves the least of the room that is known to be enough for what points aside.
fn fastest_swing(
    from: &Knot,
    rows: &TendonRows,
    limits: &TendonLimits,
    keeps: impl Fn(&Trajectory) -> bool,
) -> Option<Trajectory> {
    let directions = directions(from);
    let of = |room| swing(from, directions, rows, limits, room).filter(&keeps);
    let mut found = of(1.0);
    if rows.largest(&directions[1]) <= STRAIGHT * limits.acceleration {
        return found;
    }
    let [mut too_little, mut enough] = [0.0, 1.0];
    for _ in 0..ROOMS {
        let room = 0.5 * (too_little + enough);
        match of(room) {
            Some(swing) => (found, enough) = (Some(swing), room),
            None => too_little = room,
        }
    }
    found
}

/// The direction of a velocity, or of the acceleration where there is none, and what of the acceleration points aside.
fn directions(from: &Knot) -> [Configuration; 2] {
    let along = if from.velocity.norm() > 0.0 {
        from.velocity.normalize()
    } else {
        from.acceleration.normalize()
    };
    [
        along,
        from.acceleration - along * from.acceleration.dot(&along),
    ]
}

/// A swing that leaves this share of the sum of both largest uses of the limits to what points aside.
fn swing(
    from: &Knot,
    [along, aside]: [Configuration; 2],
    rows: &TendonRows,
    limits: &TendonLimits,
    room: f64,
) -> Option<Trajectory> {
    let state = [from.velocity.dot(&along), from.acceleration.dot(&along)];
    let (gain, of_aside) = (rows.largest(&along), room * rows.largest(&aside));
    let acceleration = (limits.acceleration - of_aside / 3.0) / gain;
    let mut parts = fastest_with_long_parts(state, [acceleration, limits.jerk / gain])?;
    for _ in 0..ROUNDS {
        let jerk = (limits.jerk - 4.0 * of_aside / sum_s(&parts)) / gain - jerk_rounding(&parts);
        parts = fastest_with_long_parts(state, [acceleration, jerk])?;
    }
    in_knots(from, [along, aside], &parts)
}

/// The motion whose acceleration along a direction has these parts and loses what points aside as a parabola.
fn in_knots(from: &Knot, [along, aside]: [Configuration; 2], parts: &[Part]) -> Option<Trajectory> {
    let duration_s = sum_s(parts);
    let mut knots = vec![*from];
    let (mut time, mut place) = (0.0, 0.0);
    let (mut speed, mut rate) = (from.velocity.dot(&along), from.acceleration.dot(&along));
    for Part { lasts_s, jerk } in parts.iter().filter(|part| part.lasts_s > 0.0) {
        let h = lasts_s;
        place += h * (speed + h * (rate / 2.0 + h * jerk / 6.0));
        speed += h * (rate + h * jerk / 2.0);
        rate += h * jerk;
        time += h;
        let s = (time / duration_s).min(1.0);
        let falls = [
            s * s * (0.5 + s * (s / 4.0 - 2.0 / 3.0)),
            s * (1.0 + s * (s - 2.0)),
            1.0 + s * (3.0 * s - 4.0),
        ];
        knots.push(Knot {
            time,
            position: from.position + along * place + aside * (falls[0] * duration_s * duration_s),
            velocity: along * speed + aside * (falls[1] * duration_s),
            acceleration: along * rate + aside * falls[2],
        });
    }
    let end = knots.last_mut()?;
    *end = Knot::resting(end.time, end.position);
    Trajectory::new(knots).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limit_use;
    use crate::scaling::stop_profile::fastest;
    use crate::test_paths::{unit_limits, unit_tendons};

    /// States along one direction: velocity and acceleration as shares of the limits.
    fn stop(velocity: f64, acceleration: f64) -> Option<Trajectory> {
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let rows = TendonRows::of(&tendons);
        let along = Configuration::from([0.3, -0.5, 0.2, 0.4, -0.1, 0.6]);
        let unit = along / rows.largest(&along);
        let from = Knot {
            time: 0.0,
            position: along,
            velocity: unit * (velocity * limits.velocity),
            acceleration: unit * (acceleration * limits.acceleration),
        };
        let motion = shorter_stop(&from, &rows, &limits, 2.0)?;
        let most = limit_use(&motion, &tendons, &limits);
        assert!(most.acceleration.max(most.jerk) <= 1.0 + 1e-6, "{most:?}");
        assert_eq!(motion.knots()[0], from);
        Some(motion)
    }

    #[test]
    fn a_state_that_only_accelerates_swings_to_rest_as_fast_as_the_limits_allow() {
        let limits = unit_limits();
        let ramp_s = limits.acceleration / limits.jerk;
        let motion = stop(0.0, 0.7).unwrap();
        let expected_s = 0.7 * (1.0 + 2.0_f64.sqrt()) * ramp_s;
        assert!((motion.duration() - expected_s).abs() < 1e-9 * expected_s);
        assert!(motion.knots().len() <= 4);
    }

    #[test]
    fn the_end_of_a_motion_that_brakes_at_the_jerk_limit_is_its_own_stop() {
        let limits = unit_limits();
        let share = 0.6;
        let ramp_s = share * limits.acceleration / limits.jerk;
        let velocity = 0.5 * share * limits.acceleration * ramp_s / limits.velocity;
        let motion = stop(velocity, -share).unwrap();
        assert!(
            (motion.duration() / ramp_s - 1.0).abs() < 2e-3,
            "{} for {ramp_s}",
            motion.duration()
        );
    }

    #[test]
    fn a_stop_that_is_nearly_a_ramp_takes_hardly_longer_than_the_limits_ask_for() {
        let limits = unit_limits();
        let share = 0.6;
        let ramp_s = share * limits.acceleration / limits.jerk;
        for more in [1e-4, 1e-3, 1e-2, -1e-6, -1e-5] {
            let velocity = 0.5 * share * limits.acceleration * ramp_s * (1.0 + more);
            let motion = stop(velocity / limits.velocity, -share).unwrap();
            let parts = fastest(
                [velocity, -share * limits.acceleration],
                [limits.acceleration, limits.jerk],
            );
            let expected_s = sum_s(&parts.unwrap());
            let excess = motion.duration() / expected_s - 1.0;
            assert!((-1e-9..3e-3).contains(&excess), "{more}: {excess}");
        }
    }
}
