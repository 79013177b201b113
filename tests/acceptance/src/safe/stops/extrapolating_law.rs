//! How long stops took with the law of before, which extrapolated each cycle by the jerk at its beginning.
//!
//! Kept to compare stops with: at a step of jerk within a cycle it exceeds the acceleration limit.

use pcc_model::{Configuration, Robot};
use trajectory::{Knot, State, evaluate};

const BISECTIONS: usize = 10;
const ROUNDING: f64 = 1.0 + 1e-9;
const BRAKING_SHARE: f64 = 0.998;

/// The law and the longest of its steps, s.
pub(super) struct ExtrapolatingLaw {
    rows: Vec<Configuration>,
    limit: f64,
    step_s: f64,
}

impl ExtrapolatingLaw {
    pub(super) fn new(robot: &Robot, period_s: f64) -> Self {
        let matrix = robot.tendons.matrix();
        let row = |tendon| Configuration::from_fn(|column, _| matrix[(tendon, column)]);
        Self {
            rows: (0..robot.tendons.count()).map(row).collect(),
            limit: robot.tendon_limits.acceleration * BRAKING_SHARE,
            step_s: period_s,
        }
    }

    /// Time until the rate is 0 or the motion ends, s, in cycles of these lengths, s.
    pub(super) fn stop_s(
        &self,
        knots: &[Knot],
        [mut time, mut rate]: [f64; 2],
        cycles: impl Iterator<Item = f64>,
    ) -> f64 {
        let (end, mut hint, mut taken_s) = (knots[knots.len() - 1].time, 0, 0.0);
        for cycle_s in cycles {
            let mut left_s = cycle_s;
            while left_s > 0.0 {
                let step_s = left_s.min(self.step_s);
                left_s -= step_s;
                let state = evaluate(knots, &mut hint, time);
                let next = self.next_rate(&state, rate, step_s);
                time += 0.5 * (rate + next) * step_s;
                rate = next;
            }
            taken_s += cycle_s;
            if rate == 0.0 || time >= end {
                break;
            }
        }
        taken_s
    }

    fn next_rate(&self, state: &State, rate: f64, step_s: f64) -> f64 {
        let slowest = self.rows.iter().fold(f64::NEG_INFINITY, |slowest, row| {
            let (slope, bend) = (row.dot(&state.velocity), row.dot(&state.acceleration));
            if slope == 0.0 {
                return slowest;
            }
            let bounds = [-self.limit, self.limit].map(|a| (a - bend * rate * rate) / slope);
            slowest.max(bounds[0].min(bounds[1]))
        });
        let strongest = (-rate).max(slowest.min(0.0) * step_s);
        let change = if self.end_is_within(state, rate, strongest, step_s) {
            strongest
        } else {
            let (mut within, mut beyond) = (0.0, strongest);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (within + beyond);
                if self.end_is_within(state, rate, middle, step_s) {
                    within = middle;
                } else {
                    beyond = middle;
                }
            }
            within
        };
        (rate + change).clamp(0.0, 1.0)
    }

    fn end_is_within(&self, state: &State, rate: f64, change: f64, step_s: f64) -> bool {
        let end_rate = rate + change;
        let advance = 0.5 * (rate + end_rate) * step_s;
        let bend = state.acceleration + state.jerk * advance;
        let slope = state.velocity + (state.acceleration + state.jerk * (0.5 * advance)) * advance;
        let acceleration = bend * (end_rate * end_rate) + slope * (change / step_s);
        let largest = self.limit * ROUNDING;
        self.rows
            .iter()
            .all(|row| row.dot(&acceleration).abs() <= largest)
    }
}
