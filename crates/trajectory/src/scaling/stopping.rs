//! From a moving state to rest, with no path to follow: the shorter of three parts of constant jerk ([`super::three_part_stop`]) and of an averaged
//! deceleration.
//!
//! As in `jerk`, the averaged deceleration is a moving average over τ of one with steps of acceleration: before the start constant
//! acceleration, so that the average begins with the given state exactly; then constant deceleration straight ahead;
//! then rest. Such an average is cubic in time between a few instants, so four knots are the whole of it.

use crate::limits::tendon_rows::{TendonRows, limits_are_valid};
use crate::scaling::three_part_stop::three_part_stop;
use crate::{Knot, Trajectory};
use pcc_model::{Configuration, TendonLimits, TendonMap};

/// Duration of a motion that goes nowhere, s.
const REST_DURATION: f64 = 1e-3;
/// A limit that is exceeded by this part of itself or less is kept: that much is rounding.
const ROUNDING: f64 = 1e-9;
/// The deceleration lasts at least this part of the average's width, so that knots keep apart.
const SHORTEST_PART: f64 = 0.1;
/// Jerk that the rounding of positions may add, ÷ the jerk limit.
const JERK_ROUNDING: f64 = 1e-7;
/// The average is at least this part of the deceleration.
const TIME_ROUNDING: f64 = 1e-6;
/// The most corrections of the width by the steps of acceleration within it.
const ROUNDS: usize = 4;

/// Why a state has no stopping motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StoppingError {
    /// NaN or an infinity, or a norm that overflows.
    #[error("the state to stop from is not finite")]
    NotFinite,
    /// A limit that is zero, negative or not finite.
    #[error("tendon limits must be finite and above zero, got {0:?}")]
    Limits(TendonLimits),
    /// The state accelerates a tendon beyond its limit already.
    #[error("the state accelerates a tendon by {use_of_limit} of its limit; 1 is the most")]
    Acceleration {
        /// Tendon acceleration ÷ its limit.
        use_of_limit: f64,
    },
    /// Times or their powers leave the range of f64.
    #[error("the stop cannot be timed within f64's range under {0:?}")]
    NotTimeable(TendonLimits),
}

/// Knots that a motion has more where it begins with a stop of [`stopping_motion`], at most.
pub const STOPPING_KNOTS: usize = 3;

/// A motion from `from` (its time is not read) to rest within the acceleration and jerk limits: the shorter of an averaged deceleration and three
/// parts of constant jerk. Where velocity and acceleration point the same way, straight ahead.
///
/// It begins with exactly this position, velocity and acceleration, in whatever directions, and has four knots at
/// most. The slowest tendon mostly brakes as soon as the limits allow, others may brake later; a state that still accelerates becomes faster first, by as
/// much as its acceleration takes to turn, whatever the velocity limit says.
///
/// # Errors
/// See [`StoppingError`].
pub fn stopping_motion(
    from: &Knot,
    tendons: &TendonMap,
    limits: &TendonLimits,
) -> Result<Trajectory, StoppingError> {
    let from = Knot { time: 0.0, ..*from };
    let sizes = [from.position, from.velocity, from.acceleration].map(|v| v.norm_squared());
    if !sizes.iter().all(|size| size.is_finite()) {
        return Err(StoppingError::NotFinite);
    }
    if !limits_are_valid(limits) {
        return Err(StoppingError::Limits(*limits));
    }
    let rows = TendonRows::of(tendons);
    let use_of_limit = rows.largest(&from.acceleration) / limits.acceleration;
    if use_of_limit > 1.0 + ROUNDING {
        return Err(StoppingError::Acceleration { use_of_limit });
    }
    let rests = from.velocity.norm() == 0.0 && from.acceleration.norm() == 0.0;
    if rests {
        let knots = vec![from, Knot::resting(REST_DURATION, from.position)];
        return Trajectory::new(knots).map_err(|_| StoppingError::NotTimeable(*limits));
    }
    let averaged = Trajectory::new(Braking::from(&from, &rows, limits).knots(from))
        .map_err(|_| StoppingError::NotTimeable(*limits))?;
    let shorter = three_part_stop(&averaged, &rows, limits);
    Ok(shorter.unwrap_or(averaged))
}

/// The motion that is averaged: positions are relative to the one at time 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Braking {
    /// Width of the average, s.
    width: f64,
    /// Velocity at time 0, rad/s.
    pub(crate) velocity: Configuration,
    /// Acceleration before time 0, rad/s².
    pub(crate) before: Configuration,
    /// Duration of the deceleration, s.
    pub(crate) duration: f64,
}

impl Braking {
    /// The narrowest average found that keeps the jerk limit; 2a/j always does.
    pub(crate) fn from(state: &Knot, rows: &TendonRows, limits: &TendonLimits) -> Self {
        let narrowest = narrowest_width(state, rows, limits);
        let widest = narrowest.max(2.0 * limits.acceleration / limits.jerk);
        let best = Self::with_width(widest, state, rows, limits);
        let mut width = best.needed_width(rows, limits).max(narrowest);
        for _ in 0..ROUNDS {
            let tried = Self::with_width(width, state, rows, limits);
            let needed = tried.needed_width(rows, limits);
            if needed <= width * (1.0 + ROUNDING) {
                return if width < best.width { tried } else { best };
            }
            width = needed;
        }
        best
    }

    /// The braking whose average over `width` seconds begins in a state, as strong as the acceleration limit allows.
    pub(crate) fn with_width(
        width: f64,
        state: &Knot,
        rows: &TendonRows,
        limits: &TendonLimits,
    ) -> Self {
        let velocity = state.velocity + state.acceleration * (0.5 * width);
        let shortest = rows.largest(&velocity) / limits.acceleration;
        let gap = SHORTEST_PART * width;
        let mut duration = shortest.max(gap);
        if (duration - width).abs() < gap {
            duration = if duration <= width {
                width
            } else {
                width + gap
            };
        }
        Self {
            width,
            velocity,
            before: state.acceleration,
            duration,
        }
    }

    /// Width of the average, s.
    pub(crate) fn width(&self) -> f64 {
        self.width
    }

    /// The width of the average, s, at which the largest step of tendon acceleration, spread over it, just keeps the jerk limit.
    fn needed_width(&self, rows: &TendonRows, limits: &TendonLimits) -> f64 {
        let braking = self.velocity / -self.duration;
        let steps = [braking - self.before, braking, self.before];
        let largest = steps.iter().map(|step| rows.largest(step));
        largest.fold(0.0, f64::max) / limits.jerk
    }

    /// The averaged motion from a state on, its knots.
    pub(crate) fn knots(&self, from: Knot) -> Vec<Knot> {
        let (width, duration) = (self.width, self.duration);
        let end = width + duration;
        // The mean over the history is the given position.
        let origin = from.position - self.area(0.0, -width) / width;
        let mut knots = vec![from];
        for time in [width.min(duration), width.max(duration)] {
            if knots.last().is_some_and(|last| last.time < time) {
                knots.push(self.averaged(origin, time));
            }
        }
        knots.push(Knot::resting(end, origin + self.position(duration)));
        knots
    }

    /// The average's displacement from where it comes to rest, with its derivatives.
    pub(crate) fn before_rest(&self, time: f64) -> Knot {
        self.averaged(-self.position(self.duration), time)
    }

    /// Where the average comes to rest that begins at `start`.
    pub(crate) fn rest_of(&self, start: &Configuration) -> Configuration {
        start - self.area(0.0, -self.width) / self.width + self.position(self.duration)
    }

    fn averaged(&self, origin: Configuration, time: f64) -> Knot {
        let early = time - self.width;
        Knot {
            time,
            position: origin + self.area(time, early) / self.width,
            velocity: (self.position(time) - self.position(early)) / self.width,
            acceleration: (self.speed(time) - self.speed(early)) / self.width,
        }
    }

    /// Acceleration at `time`, s, before 0 or after it, rad/s².
    fn acceleration(&self, time: f64) -> Configuration {
        if time < 0.0 {
            self.before
        } else {
            self.velocity / -self.duration
        }
    }

    fn speed(&self, time: f64) -> Configuration {
        let time = time.min(self.duration);
        self.velocity + self.acceleration(time) * time
    }

    fn position(&self, time: f64) -> Configuration {
        let time = time.min(self.duration);
        (self.velocity + self.acceleration(time) * (0.5 * time)) * time
    }

    /// ∫ position dt from `early` to `late`, s; rad s.
    fn area(&self, late: f64, early: f64) -> Configuration {
        let until = |time: f64| {
            let moving = time.min(self.duration);
            let area = self.velocity * 0.5 + self.acceleration(moving) * (moving / 6.0);
            area * (moving * moving) + self.position(time) * (time - moving)
        };
        until(late) - until(early)
    }
}

/// The width, s, below which times or positions of knots would not be told apart well enough.
fn narrowest_width(state: &Knot, rows: &TendonRows, limits: &TendonLimits) -> f64 {
    let rounding = 4.0 * f64::EPSILON * state.position.norm() * rows.gain();
    // A quintic's jerk is up to 60 ÷ h³ times a displacement.
    let shortest = (60.0 * rounding / (JERK_ROUNDING * limits.jerk)).cbrt();
    let longest = rows.largest(&state.velocity) / limits.acceleration;
    (shortest / SHORTEST_PART).max(TIME_ROUNDING * longest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limit_use;
    use crate::test_paths::{unit_limits, unit_tendons};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    fn random_vector(random: &mut Pcg64, largest_use: f64, limit: f64) -> Configuration {
        let rows = TendonRows::of(&unit_tendons());
        let vector = Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
        let size = largest_use * limit * random.random_range(0.0..1.0);
        vector * (size / rows.largest(&vector))
    }

    fn random_state(random: &mut Pcg64) -> Knot {
        let limits = unit_limits();
        let mut size = || [0.0, 1e-6, 1.0][random.random_range(0..3)];
        let sizes = [size(), size()];
        Knot {
            time: 7.0,
            position: Configuration::from_fn(|_, _| random.random_range(-1.0..1.0)),
            velocity: random_vector(random, sizes[0], limits.velocity),
            acceleration: random_vector(random, sizes[1], limits.acceleration),
        }
    }

    #[test]
    fn any_state_stops_within_limits_and_begins_exactly() {
        let mut random = Pcg64::seed_from_u64(61);
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let mut moved = 0;
        for _ in 0..5000 {
            let from = random_state(&mut random);
            let motion = stopping_motion(&from, &tendons, &limits).unwrap();
            let knots = motion.knots();
            assert_eq!(knots[0], Knot { time: 0.0, ..from });
            let last = knots[knots.len() - 1];
            assert_eq!(last, Knot::resting(last.time, last.position));
            assert!(knots.len() <= 4);
            let most = limit_use(&motion, &tendons, &limits);
            let largest = most.acceleration.max(most.jerk);
            assert!(largest <= 1.0 + 1e-6, "{most:?} from {from:?}");
            moved += usize::from(motion.duration() != REST_DURATION);
        }
        assert!(moved > 4000, "only {moved} states moved");
    }

    #[test]
    fn a_stop_from_full_speed_takes_little_more_than_the_limits_ask_for() {
        let mut random = Pcg64::seed_from_u64(62);
        let (rows, limits) = (TendonRows::of(&unit_tendons()), unit_limits());
        for _ in 0..100 {
            let mut from = random_state(&mut random);
            let direction = Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
            from.velocity = direction * (limits.velocity / rows.largest(&direction));
            from.acceleration = Configuration::zeros();
            let motion = stopping_motion(&from, &unit_tendons(), &limits).unwrap();
            let fastest = limits.velocity / limits.acceleration + limits.acceleration / limits.jerk;
            assert!(
                (motion.duration() - fastest).abs() < 1e-8,
                "{}",
                motion.duration()
            );
        }
    }

    #[test]
    fn bad_states_are_named() {
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let rest = Knot::resting(0.0, Configuration::zeros());
        let stop = |from: &Knot, limits| stopping_motion(from, &tendons, &limits).unwrap_err();
        for bad in [f64::NAN, f64::INFINITY, 1e200] {
            let vector = Configuration::repeat(bad);
            let states = [
                Knot {
                    position: vector,
                    ..rest
                },
                Knot {
                    velocity: vector,
                    ..rest
                },
                Knot {
                    acceleration: vector,
                    ..rest
                },
            ];
            for from in states {
                assert_eq!(stop(&from, limits), StoppingError::NotFinite);
            }
        }
        let none = TendonLimits {
            jerk: 0.0,
            ..limits
        };
        assert_eq!(stop(&rest, none), StoppingError::Limits(none));
        let hasty = Knot {
            acceleration: Configuration::repeat(10.0),
            ..rest
        };
        let error = stop(&hasty, limits);
        assert!(
            matches!(error, StoppingError::Acceleration { use_of_limit } if use_of_limit > 1.0)
        );
    }

    #[test]
    fn extreme_limits_are_answered() {
        let from = Knot {
            velocity: Configuration::repeat(0.1),
            ..Knot::resting(0.0, Configuration::repeat(0.2))
        };
        let extremes = [1e-9, 1.0, 1e9];
        for acceleration in extremes {
            for jerk in extremes {
                let limits = TendonLimits {
                    velocity: 1.0,
                    acceleration,
                    jerk,
                };
                let motion = stopping_motion(&from, &unit_tendons(), &limits).unwrap();
                assert!(motion.duration() > 0.0);
            }
        }
    }
}
