//! A motion from its knots alone: quintic Hermite by de Casteljau, tendon limits and clearance by dense sampling.
//!
//! Nothing here comes from the crates `pcc-model`, `collision` or `trajectory`.

use shared_types::message;

use crate::brute_force::{Ball, Body, Configuration};
use crate::motion::raise;

/// Looks at the limits in each segment.
const LOOKS_AT_LIMITS: usize = 100;
/// A speed below this share of a motion's own peak, between its begin and its end, is a stop.
const STOP_SHARE: f64 = 1e-3;
/// Looks at the speed in each segment.
const LOOKS_AT_SPEED: usize = 400;
/// Where the body is nearer than this to a ball, it is looked at again each time that no point of it has moved farther, m.
const FINEST_MOVE_M: f64 = 1e-4;

/// What is known at one instant of a motion: the base frame's units, s.
#[derive(Clone, Copy, Debug)]
pub struct Knot {
    /// When, s.
    pub time_s: f64,
    /// Configuration, its velocity and its acceleration.
    pub values: [Configuration; 3],
}

impl From<&message::Knot> for Knot {
    fn from(knot: &message::Knot) -> Self {
        Self {
            time_s: knot.time_s,
            values: [
                knot.configuration_rad,
                knot.velocity_rad_s,
                knot.acceleration_rad_s2,
            ],
        }
    }
}

/// Velocity, acceleration and jerk of tendons: limits, or the largest ones found.
pub type Limits = [f64; 3];

/// The control points of a quintic between two knots.
struct Segment {
    duration_s: f64,
    control: Vec<Configuration>,
}

impl Segment {
    fn between(from: &Knot, to: &Knot) -> Self {
        let duration_s = to.time_s - from.time_s;
        let [h, h2] = [duration_s / 5.0, duration_s * duration_s / 20.0];
        let [p, v, a] = &from.values;
        let [q, w, b] = &to.values;
        let point = |value: &dyn Fn(usize) -> f64| std::array::from_fn(value);
        let control = vec![
            *p,
            point(&|i| p[i] + h * v[i]),
            point(&|i| p[i] + 2.0 * h * v[i] + h2 * a[i]),
            point(&|i| q[i] - 2.0 * h * w[i] + h2 * b[i]),
            point(&|i| q[i] - h * w[i]),
            *q,
        ];
        Self {
            duration_s,
            control,
        }
    }

    /// The control points of the derivative.
    fn derivative(&self) -> Self {
        let factor = (self.control.len() - 1) as f64 / self.duration_s;
        let difference =
            |pair: &[Configuration]| std::array::from_fn(|i| factor * (pair[1][i] - pair[0][i]));
        Self {
            duration_s: self.duration_s,
            control: self.control.windows(2).map(difference).collect(),
        }
    }

    /// De Casteljau's.
    fn at(&self, fraction: f64) -> Configuration {
        let mut points = self.control.clone();
        while points.len() > 1 {
            let between = |pair: &[Configuration]| {
                std::array::from_fn(|i| pair[0][i] + fraction * (pair[1][i] - pair[0][i]))
            };
            points = points.windows(2).map(between).collect();
        }
        points[0]
    }
}

fn segments(knots: &[Knot]) -> impl Iterator<Item = Segment> {
    knots
        .windows(2)
        .map(|pair| Segment::between(&pair[0], &pair[1]))
}

/// Configuration, velocity and acceleration at a time of the motion; none outside it.
#[must_use]
pub fn state_at(knots: &[Knot], time_s: f64) -> Option<[Configuration; 3]> {
    let pair = knots
        .windows(2)
        .find(|pair| (pair[0].time_s..=pair[1].time_s).contains(&time_s))?;
    let mut curve = Segment::between(&pair[0], &pair[1]);
    let fraction = (time_s - pair[0].time_s) / curve.duration_s;
    Some(std::array::from_fn(|_| {
        let value = curve.at(fraction);
        curve = curve.derivative();
        value
    }))
}

/// Configurations and their velocities at `looks` instants of each segment, the first one at its begin, and at the end of the motion.
pub fn states(knots: &[Knot], looks: usize) -> impl Iterator<Item = [Configuration; 2]> {
    let within = segments(knots).flat_map(move |segment| {
        let velocity = segment.derivative();
        (0..looks).map(move |look| {
            let fraction = look as f64 / looks as f64;
            [segment.at(fraction), velocity.at(fraction)]
        })
    });
    let end = knots.last().map(|knot| [knot.values[0], knot.values[1]]);
    within.chain(end)
}

/// How far a motion slows down between its begin and its end.
#[derive(Clone, Copy, Debug)]
pub struct Stops {
    /// Times at which it stands still: its speed is below a thousandth of its own peak.
    pub count: usize,
    /// The least speed at which it slows down and then goes faster again ÷ its peak; 1 where it does not.
    pub least_speed: f64,
}

/// Looks for stops on the way.
#[must_use]
pub fn stops_between(knots: &[Knot]) -> Stops {
    let speed = |[_, velocity]: [Configuration; 2]| velocity.iter().map(|v| v * v).sum::<f64>();
    let speeds: Vec<f64> = states(knots, LOOKS_AT_SPEED)
        .map(|state| speed(state).sqrt())
        .collect();
    let peak = speeds.iter().copied().fold(0.0, f64::max);
    let stands = |speed: &f64| *speed < STOP_SHARE * peak;
    let begin = speeds.iter().position(|it| !stands(it)).unwrap_or(0);
    let end = speeds.iter().rposition(|it| !stands(it)).unwrap_or(0);
    let between = speeds.get(begin..=end).unwrap_or(&[]);
    let begun = between
        .windows(2)
        .filter(|pair| !stands(&pair[0]) && stands(&pair[1]));
    let dips = between.windows(3);
    let dips = dips.filter(|dip| dip[1] <= dip[0] && dip[1] <= dip[2]);
    Stops {
        count: begun.count(),
        least_speed: dips.map(|dip| dip[1]).fold(peak, f64::min) / peak,
    }
}

/// Largest tendon velocity, acceleration and jerk that are found, over their limits.
#[must_use]
pub fn limit_use(body: &Body, knots: &[Knot], limits: &Limits) -> Limits {
    limit_use_at(body, knots, limits, 0.0)
}

/// As [`limit_use`], with at least `rate_hz` looks a second at each segment.
#[must_use]
pub fn limit_use_at(body: &Body, knots: &[Knot], limits: &Limits, rate_hz: f64) -> Limits {
    let mut used = [0.0; 3];
    for segment in segments(knots) {
        let looks = (rate_hz * segment.duration_s).ceil() as usize;
        let looks = looks.max(LOOKS_AT_LIMITS);
        let mut derivative = segment;
        for (used, limit) in used.iter_mut().zip(limits) {
            derivative = derivative.derivative();
            for look in 0..=looks {
                let rates = derivative.at(look as f64 / looks as f64);
                for rate in body.tendons(&rates) {
                    raise(used, rate.abs() / limit);
                }
            }
        }
    }
    used
}

/// The largest bending of a section that is found, rad.
#[must_use]
pub fn largest_bending_rad(knots: &[Knot]) -> f64 {
    let mut largest_rad = 0.0;
    for segment in segments(knots) {
        for look in 0..=LOOKS_AT_LIMITS {
            let configuration = segment.at(look as f64 / LOOKS_AT_LIMITS as f64);
            for pair in configuration.chunks(2) {
                raise(&mut largest_rad, pair[0].hypot(pair[1]));
            }
        }
    }
    largest_rad
}

/// Least clearance that is found, m: after each look the body moves by no more than the clearance before the next one, or by 0.1 mm;
/// infinite without balls, not a number where a look gives none. Below minus [`Body::chord_error_m`], the body is in a ball for certain.
#[must_use]
pub fn least_clearance_m(body: &Body, knots: &[Knot], balls: &[Ball]) -> f64 {
    let mut least = f64::INFINITY;
    for segment in segments(knots) {
        // Of a convex combination of its control points.
        let speeds = segment.derivative().control;
        let most = speeds.iter().map(|speed| body.speed_at_most_m_s(speed));
        let most_m = most.fold(f64::MIN_POSITIVE, f64::max) * segment.duration_s;
        let mut fraction = 0.0;
        loop {
            let clearance_m = body.clearance(&segment.at(fraction), balls, 0);
            if clearance_m.is_nan() {
                return clearance_m;
            }
            least = least.min(clearance_m);
            if fraction >= 1.0 || balls.is_empty() {
                break;
            }
            let room_m = clearance_m - body.chord_error_m();
            fraction = (fraction + room_m.max(FINEST_MOVE_M) / most_m).min(1.0);
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::programs::repository;

    fn unit() -> Body {
        let file = repository().join("config/robots/unit.toml");
        Body::from_robot_file(&fs::read_to_string(file).unwrap())
    }

    /// t³ in one component, which a quintic is exactly.
    fn cubic() -> [Knot; 2] {
        [0.0, 0.9_f64].map(|t| {
            let of = |value: f64| [value, 0.0, 0.0, 0.0, 0.0, 0.0];
            Knot {
                time_s: t,
                values: [of(t.powi(3) - 0.3), of(3.0 * t.powi(2)), of(6.0 * t)],
            }
        })
    }

    #[test]
    fn a_cubic_uses_what_it_uses() {
        let body = unit();
        let used = limit_use_at(&body, &cubic(), &[1.0; 3], 1e4);
        let [most, _] = [1.0, 0.0].map(|component| {
            let tendons = body.tendons(&[component, 0.0, 0.0, 0.0, 0.0, 0.0]);
            tendons.into_iter().fold(0.0, |m: f64, x| m.max(x.abs()))
        });
        for (used, rate) in used.iter().zip([3.0 * 0.81, 6.0 * 0.9, 6.0]) {
            assert!((used - most * rate).abs() < 1e-10, "{used}");
        }
    }

    #[test]
    fn states_are_those_of_the_curve_in_their_order() {
        let states: Vec<_> = states(&cubic(), 9).collect();
        assert_eq!(states.len(), 10);
        for (look, [position, velocity]) in states.iter().enumerate() {
            let t = 0.1 * look as f64;
            assert!((position[0] - (t.powi(3) - 0.3)).abs() < 1e-12);
            assert!((velocity[0] - 3.0 * t.powi(2)).abs() < 1e-12);
        }
    }

    #[test]
    fn bending_between_two_knots_is_seen() {
        assert!((largest_bending_rad(&cubic()) - (0.9_f64.powi(3) - 0.3)).abs() < 1e-10);
        let mut swung = cubic();
        // It sets out fast and comes back.
        for (knot, speed) in swung.iter_mut().zip([20.0, -20.0]) {
            knot.values = [[0.0; 6], [speed, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 6]];
        }
        assert!((largest_bending_rad(&swung) - 5.625).abs() < 1e-10);
    }

    #[test]
    fn a_ball_that_is_passed_between_two_knots_is_seen() {
        let body = unit();
        let balls = [Ball::resting([0.0, 0.0, 3.15], 0.1)];
        for knot in cubic() {
            assert!(body.clearance(&knot.values[0], &balls, 0) > 0.3);
        }
        let least_m = least_clearance_m(&body, &cubic(), &balls);
        assert!((least_m + 0.15).abs() < 2e-4, "{least_m}");
        assert_eq!(least_clearance_m(&body, &cubic(), &[]), f64::INFINITY);
    }
}
