//! Going slower along a motion, and stopping on it, without leaving its path.
//!
//! Played at rate r = d(motion time)/dt, a motion of velocity q′ and acceleration q″ has velocity q′ r and
//! acceleration q″ r² + q′ ṙ. A motion within its limits leaves room to change the rate: each tendon bounds ṙ to an
//! interval, which holds 0 while r ≤ 1. The strongest ṙ in all of them, cycle by cycle, stops as soon as the limits
//! allow (extreme path acceleration, as in Bobrow, Dubowsky and Gibson, "Time-Optimal Control of Robotic
//! Manipulators Along Specified Paths", IJRR 1985).
//!
//! A change of rate is judged by the motion itself where the cycle begins and ends and at every knot that it passes:
//! jerk may step at knots, so an extrapolation from the beginning of the cycle would be wrong by the step.

use crate::limits::tendon_rows::{TendonRows, lanes};
use crate::{Knot, State, evaluate};
use pcc_model::{Configuration, TendonMap};

/// Share of the acceleration limit that a change of rate may use in the controller. The rest covers the time between the instants
/// that the law judges: the mean acceleration of a step h exceeds that of its ends by at most jerk × h / 8.
pub const BRAKING_SHARE: f64 = 0.998;

/// Bisections of a change of rate that would exceed the limit within the cycle: to 0.1 % of it.
const BISECTIONS: usize = 10;
/// The limit is kept up to this factor, so that rounding does not weaken a stop.
const ROUNDING: f64 = 1.0 + 1e-9;

/// A motion that is being played.
#[derive(Clone, Copy, Debug)]
pub struct Playback<'a> {
    /// The motion; at least one knot.
    pub knots: &'a [Knot],
    /// Motion time, s.
    pub time: f64,
    /// Motion time per time, 0 to 1.
    pub rate: f64,
}

/// The rate of the next cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateStep {
    /// Rate at the end of the cycle, 0 to 1.
    pub rate: f64,
    /// Motion time that passes during the cycle, s: the rate changes linearly, so it is the mean rate × the cycle.
    pub advance: f64,
}

/// Chooses the playing rate of a motion so that every tendon keeps its acceleration limit.
///
/// Velocity limits hold by themselves while the motion keeps them and the rate is at most 1.
#[derive(Clone, Debug)]
pub struct RateLaw {
    pub(super) rows: TendonRows,
    pub(super) acceleration_limit: f64,
}

/// A cycle whose change of rate is to be found.
struct Cycle<'a> {
    playback: Playback<'a>,
    /// Index of the segment in which the cycle begins.
    segment: usize,
    /// The motion's own state (as at rate 1) where the cycle begins.
    state: State,
    /// Length of the cycle, s.
    seconds: f64,
}

impl RateLaw {
    /// A law for these tendons; `acceleration_limit` in tendon length per s².
    pub fn new(tendons: &TendonMap, acceleration_limit: f64) -> Self {
        Self {
            rows: TendonRows::of(tendons),
            acceleration_limit,
        }
    }

    /// The rate after one cycle of `cycle` seconds, as near to `target` as the limits allow.
    ///
    /// Both rates are taken as within 0..=1 (NaN as 0, a stop). A tendon's acceleration keeps the limit where the cycle
    /// begins, at the knots that it passes and where it ends; where the motion itself uses more than this limit, it
    /// keeps the acceleration of an unchanged rate, which is therefore always allowed. `hint` is
    /// [`evaluate`]'s. Nothing changes in a cycle that takes no time. Allocates nothing; the work is bounded by the knots
    /// that lie in the cycle.
    ///
    /// # Panics
    /// If there is no knot.
    pub fn step(
        &self,
        playback: &Playback<'_>,
        hint: &mut usize,
        target: f64,
        cycle: f64,
    ) -> RateStep {
        let (rate, target) = (within_unit(playback.rate), within_unit(target));
        let takes_time = cycle > 0.0 && cycle.is_finite();
        if !takes_time {
            let advance = 0.0;
            return RateStep { rate, advance };
        }
        let state = evaluate(playback.knots, hint, playback.time);
        let cycle = Cycle {
            playback: Playback { rate, ..*playback },
            segment: *hint,
            state,
            seconds: cycle,
        };
        let [slowest, fastest] = self.rate_slopes(&cycle.state, rate);
        let strongest = (target - rate).clamp(slowest * cycle.seconds, fastest * cycle.seconds);
        let next = within_unit(rate + self.change_within(&cycle, strongest));
        RateStep {
            rate: next,
            advance: cycle.advance(next - rate),
        }
    }

    /// The interval of ṙ, 1/s, that keeps every tendon within what it may use at a state of the motion (as at rate 1) that is
    /// played at `rate`; it holds 0.
    pub(super) fn rate_slopes(&self, state: &State, rate: f64) -> [f64; 2] {
        let square = rate * rate;
        let mut slopes = [f64::NEG_INFINITY, f64::INFINITY];
        for block in self.rows.blocks() {
            let bends = block.times(&state.acceleration);
            for (slope, bend) in block.times(&state.velocity).into_iter().zip(bends) {
                if slope != 0.0 {
                    let unchanged = bend * square;
                    let most = self.acceleration_limit.max(unchanged.abs());
                    let bounds = [-most, most].map(|a| (a - unchanged) / slope);
                    slopes[0] = slopes[0].max(bounds[0].min(bounds[1]));
                    slopes[1] = slopes[1].min(bounds[0].max(bounds[1]));
                }
            }
        }
        [slopes[0].min(0.0), slopes[1].max(0.0)]
    }

    /// The strongest change of rate up to `strongest` that is allowed in the whole cycle; else 0.
    fn change_within(&self, cycle: &Cycle<'_>, strongest: f64) -> f64 {
        if self.allows(cycle, strongest) {
            return strongest;
        }
        let (mut within, mut beyond) = (0.0, strongest);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (within + beyond);
            if self.allows(cycle, middle) {
                within = middle;
            } else {
                beyond = middle;
            }
        }
        within
    }

    /// Whether a change of rate keeps the limit at every knot that the cycle then passes, and at its end.
    fn allows(&self, cycle: &Cycle<'_>, change: f64) -> bool {
        let Playback { knots, time, rate } = cycle.playback;
        let slope = change / cycle.seconds;
        let end_time = time + cycle.advance(change);
        let ahead = knots[cycle.segment..].iter();
        let passed = ahead
            .skip_while(|knot| knot.time <= time)
            .take_while(|knot| knot.time < end_time);
        for knot in passed {
            // dr/dt is ṙ/r along the motion's own time.
            let square = (rate * rate + 2.0 * slope * (knot.time - time)).max(0.0);
            if !self.is_within(
                &knot.velocity,
                &knot.acceleration,
                [rate * rate, square],
                slope,
            ) {
                return false;
            }
        }
        let end = evaluate(knots, &mut cycle.segment.clone(), end_time);
        let end_rate = rate + change;
        let squares = [rate * rate, end_rate * end_rate];
        self.is_within(&end.velocity, &end.acceleration, squares, slope)
    }

    /// Whether every tendon keeps the limit, or what it would use without a change of rate, at one instant of the
    /// motion; `squares` are r² where the cycle began and at this instant.
    fn is_within(
        &self,
        velocity: &Configuration,
        acceleration: &Configuration,
        [unchanged, square]: [f64; 2],
        slope: f64,
    ) -> bool {
        self.rows.blocks().iter().all(|block| {
            let (slopes, bends) = (block.times(velocity), block.times(acceleration));
            let excess = lanes(|i| {
                let most = self.acceleration_limit.max(bends[i].abs() * unchanged);
                (bends[i] * square + slopes[i] * slope).abs() - most * ROUNDING
            });
            excess.iter().all(|excess| *excess <= 0.0)
        })
    }
}

impl Cycle<'_> {
    /// Motion time, s, that passes in the cycle when the rate changes by `change` during it.
    fn advance(&self, change: f64) -> f64 {
        (self.playback.rate + 0.5 * change) * self.seconds
    }
}

fn within_unit(rate: f64) -> f64 {
    if rate.is_nan() {
        0.0
    } else {
        rate.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_paths::{cornered_path, smooth_path, unit_limits, unit_tendons};
    use crate::{ParameterizationOptions, TimeParameterizer, Trajectory};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const CYCLE: f64 = 1e-3;

    fn timed(path: &[Configuration]) -> Trajectory {
        let options = ParameterizationOptions::default();
        TimeParameterizer::default()
            .parameterize(path, &unit_tendons(), &unit_limits(), &options)
            .unwrap()
    }

    fn motion(random: &mut Pcg64) -> Trajectory {
        timed(&smooth_path(random, 64))
    }

    fn law() -> RateLaw {
        RateLaw::new(&unit_tendons(), unit_limits().acceleration)
    }

    fn largest(vector: &Configuration) -> f64 {
        static ROWS: std::sync::LazyLock<TendonRows> =
            std::sync::LazyLock::new(|| TendonRows::of(&unit_tendons()));
        ROWS.largest(vector)
    }

    /// Plays `motion` from `time` and `rate` towards the rates that `target` gives, in cycles of `cycle_s`; checks
    /// every cycle and returns the rates.
    fn play(
        motion: &Trajectory,
        [mut time, mut rate]: [f64; 2],
        cycle_s: f64,
        cycles: usize,
        target: impl Fn(usize) -> f64,
    ) -> Vec<f64> {
        let (limits, law) = (unit_limits(), law());
        let (mut hint, mut rates) = (0, vec![rate]);
        let mut states = Vec::new();
        for cycle in 0..cycles {
            let state = evaluate(motion.knots(), &mut hint, time);
            let knots = motion.knots();
            let playback = Playback { knots, time, rate };
            let step = law.step(&playback, &mut hint, target(cycle), cycle_s);
            let slope = (step.rate - rate) / cycle_s;
            states.push((state.position, state.velocity * rate));
            time += step.advance;
            let end = evaluate(motion.knots(), &mut hint, time);
            for (at, rate) in [(&state, rate), (&end, step.rate)] {
                assert!(largest(&(at.velocity * rate)) <= limits.velocity * (1.0 + 1e-9));
                let used = largest(&(at.acceleration * (rate * rate) + at.velocity * slope));
                let share = used / limits.acceleration;
                assert!(share <= 1.0 + 2e-9, "{share} of the limit at rate {rate}");
            }
            rate = step.rate;
            rates.push(rate);
        }
        assert_differences(&states, cycle_s);
        rates
    }

    /// The set-points alone: differences of positions and velocities are means of velocity and acceleration over a cycle.
    fn assert_differences(states: &[(Configuration, Configuration)], cycle_s: f64) {
        let limits = unit_limits();
        // Between the instants that are judged, jerk may bring the acceleration this far over the limit.
        let slack = 0.125 * limits.jerk * cycle_s;
        for pair in states.windows(2) {
            let velocity = (pair[1].0 - pair[0].0) / cycle_s;
            let acceleration = (pair[1].1 - pair[0].1) / cycle_s;
            assert!(largest(&velocity) <= limits.velocity * (1.0 + 1e-6));
            assert!(largest(&acceleration) <= limits.acceleration + slack);
        }
    }

    #[test]
    fn a_cycle_that_takes_no_time_changes_nothing() {
        let still = [Knot::resting(0.0, Configuration::zeros())];
        let playback = Playback {
            knots: &still,
            time: 0.0,
            rate: 0.5,
        };
        for cycle in [0.0, -CYCLE, f64::NAN, f64::INFINITY] {
            let step = law().step(&playback, &mut 0, 0.0, cycle);
            assert_eq!((step.rate, step.advance), (0.5, 0.0), "{cycle}");
        }
    }

    #[test]
    fn a_stop_from_anywhere_keeps_limits_and_ends_in_time() {
        let mut random = Pcg64::seed_from_u64(21);
        let limits = unit_limits();
        for _ in 0..40 {
            let motion = motion(&mut random);
            let time = motion.duration() * random.random_range(0.0..1.0);
            let rate = if random.random_bool(0.5) {
                1.0
            } else {
                random.random_range(0.0..1.0)
            };
            let rates = play(&motion, [time, rate], CYCLE, 600, |_| 0.0);
            assert!(rates.windows(2).all(|pair| pair[1] <= pair[0]));
            // v/a is the shortest stop from full speed on a straight path; bending takes some of a.
            let stopped = rates.iter().position(|rate| *rate == 0.0).unwrap();
            assert!(
                stopped as f64 * CYCLE <= 2.5 * limits.velocity / limits.acceleration,
                "{stopped} cycles"
            );
        }
    }

    #[test]
    fn a_stop_on_a_straight_line_is_as_short_as_the_limit_allows() {
        let path = [Configuration::zeros(), Configuration::repeat(1.0)];
        let limits = unit_limits();
        let motion = timed(&path);
        let state = motion.at(0.5 * motion.duration());
        let speed = largest(&state.velocity);
        assert!(speed > 0.99 * limits.velocity);
        let rates = play(&motion, [0.5 * motion.duration(), 1.0], CYCLE, 600, |_| 0.0);
        let stopped = rates.iter().position(|rate| *rate == 0.0).unwrap() as f64 * CYCLE;
        let shortest = speed / limits.acceleration;
        assert!(
            stopped >= shortest - CYCLE && stopped <= shortest + 3.0 * CYCLE,
            "{stopped} against {shortest}"
        );
    }

    #[test]
    fn changing_targets_keep_limits_and_are_reached() {
        let mut random = Pcg64::seed_from_u64(22);
        for _ in 0..20 {
            let motion = motion(&mut random);
            let targets: Vec<f64> = (0..20).map(|_| random.random_range(0.0..1.0)).collect();
            let start = 0.2 * motion.duration();
            let rates = play(&motion, [start, 1.0], CYCLE, 4000, |cycle| {
                targets[cycle / 200 % 20]
            });
            let reached = (0..20)
                .filter(|i| (rates[200 * i + 199] - targets[*i]).abs() < 1e-3)
                .count();
            assert!(reached >= 10, "only {reached} of 20 targets were reached");
        }
    }

    #[test]
    fn steps_of_jerk_within_a_cycle_are_seen() {
        let mut random = Pcg64::seed_from_u64(23);
        let straight = [Configuration::zeros(), Configuration::repeat(0.4)];
        let mut motions = vec![timed(&straight)];
        motions.extend((0..3).map(|_| timed(&cornered_path(&mut random, 4))));
        for motion in &motions {
            for (cycle_s, stops) in [(0.25e-3, 40), (1e-3, 250), (2.5e-3, 150), (10e-3, 100)] {
                let cycles = (0.6 / cycle_s) as usize;
                for i in 0..stops {
                    let time = motion.duration() * f64::from(i) / f64::from(stops);
                    play(motion, [time, 1.0], cycle_s, cycles, |_| 0.0);
                }
            }
        }
    }

    #[test]
    fn where_the_motion_rests_the_rate_is_free() {
        let still = [Knot::resting(0.0, Configuration::repeat(0.3))];
        let step = |rate, target| {
            let playback = Playback {
                knots: &still,
                time: 0.0,
                rate,
            };
            law().step(&playback, &mut 0, target, CYCLE)
        };
        let free = step(0.2, 1.0);
        assert_eq!(free.rate, 1.0);
        assert!((free.advance - 0.6 * CYCLE).abs() < 1e-15, "{free:?}");
        let (rate, advance) = (0.0, 0.0);
        assert_eq!(step(f64::NAN, f64::NAN), RateStep { rate, advance });
        assert_eq!(step(7.0, -3.0).rate, 0.0);
    }
}
