//! Going slower along a motion, and stopping on it, without leaving its path.
//!
//! Played at rate r = d(motion time)/dt, a motion of velocity q′ and acceleration q″ has velocity q′ r and
//! acceleration q″ r² + q′ ṙ. A motion within its limits leaves room to change the rate: each tendon bounds ṙ to an
//! interval, which holds 0 while r ≤ 1. The strongest ṙ in all of them, cycle by cycle, stops as soon as the limits
//! allow (extreme path acceleration, as in Bobrow, Dubowsky and Gibson, "Time-Optimal Control of Robotic
//! Manipulators Along Specified Paths", IJRR 1985).

use crate::State;
use crate::tendon::TendonRows;
use pcc_model::{Configuration, TendonMap};

/// Bisections of a change of rate that would exceed the limit at the end of the cycle: to 0.1 % of it.
const BISECTIONS: usize = 10;
/// The limit is kept up to this factor, so that rounding does not weaken a stop.
const ROUNDING: f64 = 1.0 + 1e-9;

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
    rows: TendonRows,
    acceleration_limit: f64,
}

impl RateLaw {
    /// A law for these tendons; `acceleration_limit` in tendon length per s².
    pub fn new(tendons: &TendonMap, acceleration_limit: f64) -> Self {
        Self {
            rows: TendonRows::of(tendons),
            acceleration_limit,
        }
    }

    /// The rate after one cycle of `cycle` seconds from `rate`, as near to `target` as the limits allow.
    ///
    /// `state` is the motion's own state (as at rate 1) at the present motion time. Both rates are taken as within
    /// 0..=1 (NaN as 0, a stop). The limit holds at the start and, extrapolating `state` by its jerk, at the end
    /// of the cycle. Nothing changes in a cycle that takes no time. Allocates nothing; the work is bounded.
    pub fn step(&self, state: &State, rate: f64, target: f64, cycle: f64) -> RateStep {
        let (rate, target) = (within_unit(rate), within_unit(target));
        let takes_time = cycle > 0.0 && cycle.is_finite();
        if !takes_time {
            let advance = 0.0;
            return RateStep { rate, advance };
        }
        let [slowest, fastest] = self.rate_slopes(state, rate);
        let strongest = (target - rate).clamp(slowest * cycle, fastest * cycle);
        let change = self.change_within(state, rate, strongest, cycle);
        let next = within_unit(rate + change);
        RateStep {
            rate: next,
            advance: 0.5 * (rate + next) * cycle,
        }
    }

    /// The interval of ṙ, 1/s, that keeps |q″ r² + q′ ṙ| within the limit for every tendon; it always holds 0.
    fn rate_slopes(&self, state: &State, rate: f64) -> [f64; 2] {
        let mut slopes = [f64::NEG_INFINITY, f64::INFINITY];
        for block in self.rows.blocks() {
            let bends = block.times(&state.acceleration);
            for (slope, bend) in block.times(&state.velocity).into_iter().zip(bends) {
                if slope != 0.0 {
                    let bounds = [-self.acceleration_limit, self.acceleration_limit]
                        .map(|a| (a - bend * rate * rate) / slope);
                    slopes[0] = slopes[0].max(bounds[0].min(bounds[1]));
                    slopes[1] = slopes[1].min(bounds[0].max(bounds[1]));
                }
            }
        }
        [slopes[0].min(0.0), slopes[1].max(0.0)]
    }

    /// The strongest change of rate up to `strongest` that keeps the limit at the end of the cycle; else 0.
    fn change_within(&self, state: &State, rate: f64, strongest: f64, cycle: f64) -> f64 {
        if self.end_is_within(state, rate, strongest, cycle) {
            return strongest;
        }
        let (mut within, mut beyond) = (0.0, strongest);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (within + beyond);
            if self.end_is_within(state, rate, middle, cycle) {
                within = middle;
            } else {
                beyond = middle;
            }
        }
        within
    }

    /// Whether the limit holds at the end of a cycle in which the rate changes by `change`.
    fn end_is_within(&self, state: &State, rate: f64, change: f64, cycle: f64) -> bool {
        let end_rate = rate + change;
        let advance = 0.5 * (rate + end_rate) * cycle;
        let bend = state.acceleration + state.jerk * advance;
        let slope = state.velocity + (state.acceleration + state.jerk * (0.5 * advance)) * advance;
        let acceleration: Configuration = bend * (end_rate * end_rate) + slope * (change / cycle);
        let largest = self.acceleration_limit * ROUNDING;
        self.rows.blocks().iter().all(|block| {
            let values = block.times(&acceleration);
            values.iter().all(|value| value.abs() <= largest)
        })
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
    use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
    use crate::{AllocationOptions, Trajectory, allocate, evaluate};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const CYCLE: f64 = 1e-3;

    fn motion(random: &mut Pcg64) -> Trajectory {
        let path = smooth_path(random, 64);
        allocate(
            &path,
            &unit_tendons(),
            &unit_limits(),
            &AllocationOptions::default(),
        )
        .unwrap()
    }

    fn largest(vector: &Configuration) -> f64 {
        static ROWS: std::sync::LazyLock<TendonRows> =
            std::sync::LazyLock::new(|| TendonRows::of(&unit_tendons()));
        ROWS.largest(vector)
    }

    /// Plays `motion` from `time` and `rate` towards the rates that `target` gives; checks every cycle and
    /// returns the rates.
    fn play(
        motion: &Trajectory,
        mut time: f64,
        mut rate: f64,
        cycles: usize,
        target: impl Fn(usize) -> f64,
    ) -> Vec<f64> {
        let limits = unit_limits();
        let law = RateLaw::new(&unit_tendons(), limits.acceleration);
        let (mut hint, mut rates, mut positions) = (0, vec![rate], Vec::new());
        // Within a cycle jerk may move the acceleration by jerk × cycle beyond its extrapolation, no more.
        let allowed = limits.acceleration + 0.1 * limits.jerk * CYCLE;
        for cycle in 0..cycles {
            let state = evaluate(motion.knots(), &mut hint, time);
            let step = law.step(&state, rate, target(cycle), CYCLE);
            let slope = (step.rate - rate) / CYCLE;
            positions.push(state.position);
            time += step.advance;
            let end = evaluate(motion.knots(), &mut hint, time);
            for (at, rate) in [(&state, rate), (&end, step.rate)] {
                assert!(largest(&(at.velocity * rate)) <= limits.velocity * (1.0 + 1e-9));
                let acceleration =
                    largest(&(at.acceleration * (rate * rate) + at.velocity * slope));
                assert!(
                    acceleration <= allowed,
                    "{acceleration} over {allowed} at rate {rate}"
                );
            }
            rate = step.rate;
            rates.push(rate);
        }
        assert_differences(&positions);
        rates
    }

    /// The set-points alone: first and second differences are means of velocity and acceleration over cycles.
    fn assert_differences(positions: &[Configuration]) {
        let limits = unit_limits();
        for three in positions.windows(3) {
            let velocity = (three[1] - three[0]) / CYCLE;
            let acceleration = (three[2] - three[1] * 2.0 + three[0]) / (CYCLE * CYCLE);
            assert!(largest(&velocity) <= limits.velocity * (1.0 + 1e-6));
            assert!(largest(&acceleration) <= limits.acceleration + 0.2 * limits.jerk * CYCLE);
        }
    }

    #[test]
    fn a_cycle_that_takes_no_time_changes_nothing() {
        let law = RateLaw::new(&unit_tendons(), unit_limits().acceleration);
        let still = State::resting(Configuration::zeros());
        for cycle in [0.0, -CYCLE, f64::NAN, f64::INFINITY] {
            let step = law.step(&still, 0.5, 0.0, cycle);
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
            let rates = play(&motion, time, rate, 600, |_| 0.0);
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
        let motion = allocate(
            &path,
            &unit_tendons(),
            &limits,
            &AllocationOptions::default(),
        )
        .unwrap();
        let state = motion.at(0.5 * motion.duration());
        let speed = largest(&state.velocity);
        assert!(speed > 0.99 * limits.velocity);
        let rates = play(&motion, 0.5 * motion.duration(), 1.0, 600, |_| 0.0);
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
            let rates = play(&motion, start, 1.0, 4000, |cycle| targets[cycle / 200 % 20]);
            let reached = (0..20)
                .filter(|i| (rates[200 * i + 199] - targets[*i]).abs() < 1e-3)
                .count();
            assert!(reached >= 10, "only {reached} of 20 targets were reached");
        }
    }

    #[test]
    fn where_the_motion_rests_the_rate_is_free() {
        let law = RateLaw::new(&unit_tendons(), 0.39);
        let state = State::resting(Configuration::repeat(0.3));
        assert_eq!(
            law.step(&state, 0.2, 1.0, CYCLE),
            RateStep {
                rate: 1.0,
                advance: 0.6 * CYCLE
            }
        );
        assert_eq!(
            law.step(&state, f64::NAN, f64::NAN, CYCLE),
            RateStep {
                rate: 0.0,
                advance: 0.0
            }
        );
        assert_eq!(law.step(&state, 7.0, -3.0, CYCLE).rate, 0.0);
    }
}
