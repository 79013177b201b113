//! A motion whose end is moved while the robot follows it.
//!
//! The displacement that is added begins and ends at rest: the integral of a cubic B-spline over time, whose jerk is continuous, so that many
//! small displacements one soon after the other need hardly more jerk than their sum (C. de Boor, "A Practical Guide to Splines", chapter IX).
//! Where both are polynomials of the fifth degree at most between the knots of the sum, its quintics are the sum exactly.

use crate::{Knot, Trajectory};
use pcc_model::Configuration;
use std::iter;

/// Pieces of a displacement, each a polynomial of time.
const PIECES: usize = 4;
/// Knots keep at least so far apart, s: in a shorter segment the rounding of positions would show in acceleration and jerk.
const KNOTS_APART_S: f64 = 4e-4;
/// Displacements that are tried until their knots keep apart from those of the motion, each one `PIECES` × [`KNOTS_APART_S`] longer: 0.1 s in all.
const TRIES: u32 = 64;

impl Trajectory {
    /// What remains of the motion from a time on, s, that is not next to a knot; none where the motion has ended by then.
    pub fn remaining_from(&self, time_s: f64) -> Option<Self> {
        let first = Knot::of(0.0, &self.at(time_s));
        let later = self.knots().iter().filter(|knot| knot.time > time_s);
        let later = later.map(|knot| Knot {
            time: knot.time - time_s,
            ..*knot
        });
        Self::new(iter::once(first).chain(later).collect()).ok()
    }

    /// The motion with its end moved by a displacement (rad) within so many seconds from its begin on, or up to 0.1 s more; it has a knot more
    /// for each piece of the displacement. None where these cannot be apart from the motion's.
    pub fn with_end_moved(&self, by: &Configuration, within_s: f64) -> Option<Self> {
        let piece_s = self.piece_apart_from_knots(within_s / PIECES as f64)?;
        let own = self.knots().iter().map(|knot| knot.time);
        let mut times: Vec<f64> = own.chain(ends_of_pieces(piece_s)).collect();
        times.sort_by(f64::total_cmp);
        let moved = |time: f64| self.moved_by(by, piece_s, time);
        let mut knots: Vec<Knot> = times.into_iter().map(moved).collect();
        knots[0] = self.knots()[0];
        let end = knots.last_mut()?;
        *end = Knot::resting(end.time, self.end() + by);
        Self::new(knots).ok()
    }

    fn moved_by(&self, by: &Configuration, piece_s: f64, time: f64) -> Knot {
        let here = self.at(time);
        let [way, slope, bend] = step(time / piece_s);
        Knot {
            time,
            position: here.position + by * way,
            velocity: here.velocity + by * (slope / piece_s),
            acceleration: here.acceleration + by * (bend / (piece_s * piece_s)),
        }
    }

    /// The first length of pieces from this one on whose ends are apart from every knot, s.
    fn piece_apart_from_knots(&self, shortest_s: f64) -> Option<f64> {
        let is_apart = |piece_s: &f64| {
            ends_of_pieces(*piece_s).all(|time| {
                let mut knots = self.knots().iter();
                knots.all(|knot| (knot.time - time).abs() >= KNOTS_APART_S)
            })
        };
        let mut lengths = (0..TRIES).map(|more| shortest_s + f64::from(more) * KNOTS_APART_S);
        lengths.find(is_apart)
    }
}

fn ends_of_pieces(piece_s: f64) -> impl Iterator<Item = f64> {
    (1..=PIECES).map(move |piece| piece as f64 * piece_s)
}

/// From 0 at 0 to 1 from [`PIECES`] on: the integral of the cubic B-spline over the integers, with its first two derivatives.
fn step(x: f64) -> [f64; 3] {
    if x >= PIECES as f64 {
        return [1.0, 0.0, 0.0];
    }
    let mut sums = [0.0; 3];
    for (begin, factor) in [1.0, -4.0, 6.0, -4.0].into_iter().enumerate() {
        let y = (x - begin as f64).max(0.0);
        let powers = [y.powi(4) / 24.0, y.powi(3) / 6.0, y * y / 2.0];
        for (sum, power) in sums.iter_mut().zip(powers) {
            *sum += factor * power;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
    use crate::{TimeParameterizer, limit_use};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    fn motion(seed: u64) -> Trajectory {
        let path = smooth_path(&mut Pcg64::seed_from_u64(seed), 64);
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let mut parameterizer = TimeParameterizer::default();
        parameterizer
            .parameterize(&path, &tendons, &limits, &Default::default())
            .unwrap()
    }

    fn displacement() -> Configuration {
        Configuration::from([0.02, -0.01, 0.03, 0.01, -0.02, 0.005])
    }

    #[test]
    fn what_is_left_is_the_same_curve() {
        let motion = motion(91);
        let from_s = 0.37 * motion.duration();
        let left = motion.remaining_from(from_s).unwrap();
        assert!((left.duration() - (motion.duration() - from_s)).abs() < 1e-12);
        for i in 0..=1000 {
            let time = left.duration() * f64::from(i) / 1000.0;
            let [here, there] = [left.at(time), motion.at(from_s + time)];
            assert!((here.position - there.position).amax() < 1e-13);
            assert!((here.acceleration - there.acceleration).amax() < 1e-9);
        }
        assert!(motion.remaining_from(motion.duration()).is_none());
    }

    #[test]
    fn the_end_is_moved_smoothly_and_exactly_by_the_sum_of_both() {
        let motion = motion(92);
        for within_s in [0.2, 0.9, motion.duration() + 0.3] {
            let moved = motion.with_end_moved(&displacement(), within_s).unwrap();
            assert_eq!(moved.knots()[0], motion.knots()[0]);
            assert_eq!(moved.end(), motion.end() + displacement());
            assert_eq!(moved.knots().len(), motion.knots().len() + PIECES);
            let gaps = moved
                .knots()
                .windows(2)
                .map(|pair| pair[1].time - pair[0].time);
            assert!(gaps.fold(f64::INFINITY, f64::min) >= 0.9 * KNOTS_APART_S);
            let piece_s = motion
                .piece_apart_from_knots(within_s / PIECES as f64)
                .unwrap();
            assert!(PIECES as f64 * piece_s - within_s < 0.02);
            for i in 0..=2000 {
                let time = moved.duration() * f64::from(i) / 2000.0;
                let (state, expected) = (
                    moved.at(time),
                    motion.moved_by(&displacement(), piece_s, time),
                );
                assert!((state.position - expected.position).amax() < 1e-13);
                assert!((state.velocity - expected.velocity).amax() < 1e-10);
                assert!((state.acceleration - expected.acceleration).amax() < 1e-7);
            }
        }
    }

    #[test]
    fn an_end_moved_again_and_again_needs_little_more_than_the_speed_asks_for() {
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let mut motion = Trajectory::new(vec![
            Knot::resting(0.0, Configuration::zeros()),
            Knot::resting(0.1, Configuration::zeros()),
        ])
        .unwrap();
        let (mut most, mut knots): (f64, usize) = (0.0, 0);
        for _ in 0..100 {
            motion = motion
                .with_end_moved(&(0.07 * displacement()), 0.42)
                .unwrap();
            let used = limit_use(&motion, &tendons, &limits);
            most = most.max(used.acceleration).max(used.jerk);
            knots = knots.max(motion.knots().len());
            motion = motion.remaining_from(0.0203).unwrap();
        }
        let speed = 0.07 * displacement() / 0.0203;
        assert!((motion.at(0.0).velocity - speed).amax() < 1e-3 * speed.amax());
        assert!(most < 1.0, "{most}");
        assert!(knots <= 100, "{knots}");
    }

    #[test]
    fn a_step_is_smooth() {
        let h = 1e-4;
        for i in 1..60 {
            let x = 0.1 * f64::from(i);
            let [before, here, after] = [x - h, x, x + h].map(step);
            for order in [0, 1] {
                let slope = (after[order] - before[order]) / (2.0 * h);
                assert!((slope - here[order + 1]).abs() < 1e-6, "{x}");
            }
        }
        assert_eq!((step(0.0), step(4.0)), ([0.0; 3], [1.0, 0.0, 0.0]));
        assert!((step(2.0)[0] - 0.5).abs() < 1e-15);
    }
}
