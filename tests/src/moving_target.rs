//! A target of the tip that moves: on circles and on random walks.

use std::f64::consts::TAU;
use std::time::Duration;

use rand::RngExt;
use rand_pcg::Pcg64;

use crate::geometry::seeded;

/// Positions a second.
const RATE: f64 = 100.0;
/// Where targets move: the middle of a box in front of the base, and half of its sides, section lengths of 1 m: m.
const MIDDLE_M: [f64; 3] = [0.7, 0.0, 2.2];
const HALF_SIDES_M: [f64; 3] = [0.6, 0.7, 0.25];
/// Time in which a walk forgets where it was going, s.
const FORGETS_S: f64 = 0.8;

/// A target and where it is at each time.
#[derive(Clone, Debug)]
pub struct MovingTarget {
    /// What it does.
    pub name: String,
    positions_m: Vec<[f64; 3]>,
}

impl MovingTarget {
    /// On a tilted circle of this radius (m) with this speed (m/s).
    #[must_use]
    pub fn circle(radius_m: f64, speed_m_s: f64, lasts: Duration) -> Self {
        let at = |time_s: f64| {
            let (sine, cosine) = (time_s * speed_m_s / radius_m).sin_cos();
            let offset = [0.8 * cosine, sine, 0.3 * cosine].map(|part| part * radius_m);
            std::array::from_fn(|axis| MIDDLE_M[axis] + offset[axis])
        };
        Self {
            name: format!("circle of {radius_m} m at {speed_m_s} m/s"),
            positions_m: times(lasts).map(at).collect(),
        }
    }

    /// On a random walk with this root mean square speed (m/s), reflected by the sides of a box.
    #[must_use]
    pub fn walk(seed: u64, speed_m_s: f64, lasts: Duration) -> Self {
        let mut random = seeded(seed);
        let (mut position, mut velocity) = (MIDDLE_M, [0.0; 3]);
        let share = 1.0 / (RATE * FORGETS_S);
        let kick = speed_m_s * (2.0 * share / 3.0).sqrt();
        let mut step = |_| {
            for axis in 0..3 {
                velocity[axis] += kick * normal(&mut random) - share * velocity[axis];
                position[axis] += velocity[axis] / RATE;
                let off = position[axis] - MIDDLE_M[axis];
                if off.abs() > HALF_SIDES_M[axis] {
                    velocity[axis] = -velocity[axis].abs() * off.signum();
                }
            }
            position
        };
        Self {
            name: format!("random walk {seed} at {speed_m_s} m/s"),
            positions_m: times(lasts).map(&mut step).collect(),
        }
    }

    /// Where it is after some time, s: between two positions on their straight line, after the last one there.
    #[must_use]
    pub fn at(&self, elapsed_s: f64) -> [f64; 3] {
        let last = self.positions_m.len() - 1;
        let place = (elapsed_s * RATE).clamp(0.0, last as f64);
        let index = (place as usize).min(last.saturating_sub(1));
        let next = (index + 1).min(last);
        let share = place - index as f64;
        std::array::from_fn(|axis| {
            let [from, to] = [index, next].map(|index| self.positions_m[index][axis]);
            from + share * (to - from)
        })
    }

    /// Its velocity after some time, m/s, by the two positions around it.
    #[must_use]
    pub fn velocity_m_s(&self, elapsed_s: f64) -> [f64; 3] {
        let [before, after] = [-0.5, 0.5].map(|step| self.at(elapsed_s + step / RATE));
        std::array::from_fn(|axis| (after[axis] - before[axis]) * RATE)
    }

    /// For how long it moves.
    #[must_use]
    pub fn lasts(&self) -> Duration {
        Duration::from_secs_f64(self.positions_m.len() as f64 / RATE)
    }
}

fn times(lasts: Duration) -> impl Iterator<Item = f64> {
    let count = (lasts.as_secs_f64() * RATE) as usize;
    (0..count).map(|index| index as f64 / RATE)
}

/// A number of a normal distribution of unit variance (Box and Muller).
fn normal(random: &mut Pcg64) -> f64 {
    let radius = (-2.0 * random.random_range(f64::MIN_POSITIVE..1.0).ln()).sqrt();
    radius * random.random_range(0.0..TAU).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_move_as_fast_as_they_say_and_stay_near_their_box() {
        let lasts = Duration::from_secs(60);
        for (target, speed) in [
            (MovingTarget::circle(0.5, 0.4, lasts), 0.4),
            (MovingTarget::walk(3, 0.3, lasts), 0.3),
        ] {
            let steps = target.positions_m.windows(2).map(|pair| {
                let step = |axis: usize| (pair[1][axis] - pair[0][axis]).powi(2);
                (step(0) + step(1) + step(2)) * RATE * RATE
            });
            let mean = steps.sum::<f64>() / (target.positions_m.len() - 1) as f64;
            assert!((mean.sqrt() / speed - 1.0).abs() < 0.3, "{}", mean.sqrt());
            for position in &target.positions_m {
                for axis in 0..3 {
                    assert!((position[axis] - MIDDLE_M[axis]).abs() < HALF_SIDES_M[axis] + 0.1);
                }
            }
        }
    }

    #[test]
    fn between_two_positions_it_is_between_them() {
        let target = MovingTarget::circle(0.5, 0.4, Duration::from_secs(1));
        let [before, between, after] = [0.10, 0.105, 0.11].map(|time_s| target.at(time_s));
        for axis in 0..3 {
            assert!((between[axis] - 0.5 * (before[axis] + after[axis])).abs() < 1e-12);
        }
        assert_eq!(target.at(5.0), target.at(0.99));
    }
}
