//! An upper bound of the time that a stop on a motion takes.
//!
//! v/a is the shortest stop from full speed, not the longest: where the motion itself brakes or turns with all of a tendon's
//! acceleration, the rate cannot fall until that is over. So the bound is computed for each motion, by dynamic programming from its end: the
//! time that a stop takes from each of a grid of places and rates, braked as in the middle of each piece between two places.

use crate::limits::tendon_rows::{LANES, Lanes};
use crate::scaling::rate_law::RateLaw;
use crate::{Knot, State, evaluate};

/// Number of rates of the table, besides 0.
const RATES: usize = 12;
/// Longest piece of a motion between two places of the table, s, unless there would be more than [`MOST_PIECES`].
const PIECE_S: f64 = 0.01;
/// Pieces of a motion between its knots, beyond which they are longer.
const MOST_PIECES: f64 = 400.0;
/// Factor on the bound that covers places and rates between those of the table, and the length of the controller's steps.
const MARGIN: f64 = 1.05;

/// Times to rest, s, by rate from 0 (the first) to 1 (the last).
type Times = [f64; RATES + 1];

impl RateLaw {
    /// An upper bound of the time, s, that a stop takes from any place of a motion, at any rate from 0 to 1; 0 without a knot.
    ///
    /// The motion ends at rest. The bound allows for cycles up to 1.5 ms; allocates nothing.
    pub fn longest_stop(&self, knots: &[Knot]) -> f64 {
        let Some(last) = knots.last() else {
            return 0.0;
        };
        let longest_piece = PIECE_S.max(last.time / MOST_PIECES);
        let (mut times, mut longest) = ([0.0; RATES + 1], 0.0_f64);
        let mut hint = knots.len() - 1;
        for pair in knots.windows(2).rev() {
            let duration = pair[1].time - pair[0].time;
            let pieces = (duration / longest_piece).ceil().max(1.0);
            let piece = duration / pieces;
            for before in (0..pieces as usize).rev() {
                let middle = pair[0].time + (before as f64 + 0.5) * piece;
                let middle = evaluate(knots, &mut hint, middle);
                times = self.times_to_rest(&middle, piece, &times);
                longest = times.iter().copied().fold(longest, f64::max);
            }
        }
        longest * MARGIN + longest_piece
    }

    /// Times to rest from the begin of a piece of the motion, `piece` seconds of its own long, by the motion's state in its middle and
    /// the times to rest from its end.
    fn times_to_rest(&self, middle: &State, piece: f64, ahead: &Times) -> Times {
        let rates: [f64; RATES] = std::array::from_fn(|index| rate_of(index + 1));
        // dr/dt is ṙ/r along the motion's own time; 0 where it comes to rest before the end of the piece.
        let next = |rate: f64, slope: f64| (rate * rate + 2.0 * slope * piece).max(0.0).sqrt();
        let slopes = self.slowest_slopes(middle, &rates);
        let half_way = |index: usize| 0.5 * (rates[index] + next(rates[index], slopes[index]));
        let slopes = self.slowest_slopes(middle, &std::array::from_fn(half_way));
        let mut times = [0.0; RATES + 1];
        for ((time, rate), slope) in times[1..].iter_mut().zip(rates).zip(slopes) {
            *time = match next(rate, slope) {
                0.0 => rate / -slope,
                next => 2.0 * piece / (rate + next) + between(ahead, next),
            };
        }
        times
    }

    /// The most negative ṙ, 1/s, that keeps every tendon within what it may use at a state of the motion (as at rate 1), for each of the
    /// rates at which that is played: the lower ends of [`RateLaw::rate_slopes`].
    fn slowest_slopes(&self, state: &State, rates: &[f64; RATES]) -> [f64; RATES] {
        let mut slowest = [[f64::NEG_INFINITY; LANES]; RATES];
        for block in self.rows.blocks() {
            let room = Room::of(
                block.times(&state.velocity),
                block.times(&state.acceleration),
                self.acceleration_limit,
            );
            for (slowest, rate) in slowest.iter_mut().zip(rates) {
                room.raise_to_slowest(rate * rate, slowest);
            }
        }
        slowest.map(|lanes| lanes.into_iter().fold(f64::NEG_INFINITY, f64::max).min(0.0))
    }
}

/// What four tendons leave for a fall of the rate at a state of the motion. A tendon of speed s and acceleration b (as at rate 1) that may
/// use a keeps |b r² + s ṙ| ≤ max(a, |b| r²).
struct Room {
    /// a / |s|, infinite of a tendon that rests.
    limit: Lanes,
    /// |b| / |s|.
    own: Lanes,
    /// b / s.
    bend: Lanes,
}

impl Room {
    fn of(speeds: Lanes, bends: Lanes, acceleration_limit: f64) -> Self {
        let share = |lane: usize| match speeds[lane] {
            0.0 => 0.0,
            speed => bends[lane] / speed,
        };
        let bend: Lanes = std::array::from_fn(share);
        Self {
            limit: speeds.map(|speed| acceleration_limit / speed.abs()),
            own: bend.map(f64::abs),
            bend,
        }
    }

    /// Raises each lane to the most negative ṙ that its tendon allows at a rate of this square.
    #[inline(always)]
    fn raise_to_slowest(&self, square: f64, slowest: &mut Lanes) {
        for (lane, slowest) in slowest.iter_mut().enumerate() {
            let most = self.limit[lane].max(self.own[lane] * square);
            *slowest = slowest.max(-most - self.bend[lane] * square);
        }
    }
}

/// A rate of the table, from 0 to 1.
fn rate_of(index: usize) -> f64 {
    index as f64 / RATES as f64
}

/// The time, s, that a stop takes from a rate between those of the table.
fn between(times: &Times, rate: f64) -> f64 {
    let place = (rate * RATES as f64).clamp(0.0, RATES as f64);
    let below = (place as usize).min(RATES - 1);
    let share = place - below as f64;
    times[below] + share * (times[below + 1] - times[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_paths::{cornered_path, smooth_path, unit_limits, unit_tendons};
    use crate::{BRAKING_SHARE, ParameterizationOptions, Playback, TimeParameterizer, Trajectory};
    use pcc_model::Configuration;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    fn law() -> RateLaw {
        RateLaw::new(&unit_tendons(), unit_limits().acceleration * BRAKING_SHARE)
    }

    fn timed(path: &[Configuration]) -> Trajectory {
        let options = ParameterizationOptions::default();
        TimeParameterizer::default()
            .parameterize(path, &unit_tendons(), &unit_limits(), &options)
            .unwrap()
    }

    fn motions() -> Vec<Trajectory> {
        let mut random = Pcg64::seed_from_u64(31);
        let mut paths = vec![vec![Configuration::zeros(), Configuration::repeat(0.7)]];
        paths.extend((0..12).map(|_| smooth_path(&mut random, 64)));
        paths.extend((0..12).map(|_| cornered_path(&mut random, 4)));
        paths.iter().map(|path| timed(path)).collect()
    }

    /// What a stop from this time of the motion and this rate takes in cycles of `cycle_s`.
    fn stop(motion: &Trajectory, [mut time, mut rate]: [f64; 2], cycle_s: f64) -> f64 {
        let (law, knots, mut hint, mut cycles) = (law(), motion.knots(), 0, 0);
        while rate > 0.0 && time < motion.duration() {
            let playback = Playback { knots, time, rate };
            let step = law.step(&playback, &mut hint, 0.0, cycle_s);
            (time, rate) = (time + step.advance, step.rate);
            cycles += 1;
        }
        f64::from(cycles) * cycle_s
    }

    #[test]
    fn no_stop_takes_longer_than_the_bound_and_the_bound_is_not_much_longer() {
        let mut random = Pcg64::seed_from_u64(32);
        for motion in motions() {
            let bound = law().longest_stop(motion.knots());
            let mut longest = 0.0_f64;
            for index in 0..160 {
                let time = motion.duration() * f64::from(index) / 160.0;
                let rate = match index % 4 {
                    0 => random.random_range(0.05..1.0),
                    _ => 1.0,
                };
                let cycle_s = [0.25e-3, 1e-3, 1.5e-3][index as usize % 3];
                let took = stop(&motion, [time, rate], cycle_s);
                assert!(took <= bound, "{took} s from {time} s at {rate}: {bound}");
                longest = longest.max(took);
            }
            assert!(
                bound <= 1.4 * longest + 0.03,
                "{bound} for stops of at most {longest} s"
            );
        }
    }

    #[test]
    fn the_slopes_of_all_rates_are_those_of_each_rate() {
        let law = law();
        let rates: [f64; RATES] = std::array::from_fn(|index| rate_of(index + 1));
        for motion in motions() {
            let mut hint = 0;
            for look in 0..=50 {
                let time = motion.duration() * f64::from(look) / 50.0;
                let state = evaluate(motion.knots(), &mut hint, time);
                let slowest = law.slowest_slopes(&state, &rates);
                for (rate, slope) in rates.iter().zip(slowest) {
                    let alone = law.rate_slopes(&state, *rate)[0];
                    let is_same = slope == alone || (slope - alone).abs() <= 1e-9 * alone.abs();
                    assert!(is_same, "{slope} and {alone} at {time} s");
                }
            }
        }
    }

    #[test]
    fn slower_motions_have_shorter_stops_and_resting_ones_none() {
        let motion = &motions()[1];
        let fast = law().longest_stop(motion.knots());
        let slowed: Vec<Knot> = motion
            .knots()
            .iter()
            .map(|knot| Knot {
                time: knot.time * 4.0,
                velocity: knot.velocity / 4.0,
                acceleration: knot.acceleration / 16.0,
                ..*knot
            })
            .collect();
        let slow = law().longest_stop(&slowed);
        assert!(slow < 0.6 * fast, "{slow} s, and {fast} s");
        assert_eq!(law().longest_stop(&[]), 0.0);
    }
}
