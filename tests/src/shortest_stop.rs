//! The shortest stop of a robot within the acceleration and jerk limits of its tendons: by a linear program for each duration, which shares
//! no code with the planner's.

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus};
use pcc_model::TendonLimits;

use crate::brute_force::{Body, Configuration};

/// Steps of constant jerk into which a stop is divided.
const STEPS: usize = 48;
/// By how much such steps make the shortest stop longer than it is, at most.
const EXCESS_OF_STEPS: f64 = 0.02;
/// Halvings of the interval in which the shortest duration lies.
const HALVINGS: usize = 12;
const DOF: usize = 6;

/// The least and the largest duration that the shortest stop from a velocity (rad/s) and an acceleration (rad/s²) may have, s, where it lies
/// between two durations: the largest one is that of a stop within the limits, the least one leaves out what the program's steps may have added.
#[must_use]
pub fn shortest_stop_s(
    body: &Body,
    limits: &TendonLimits,
    rates: &[Configuration; 2],
    between_s: [f64; 2],
) -> [f64; 2] {
    let [mut least_s, mut most_s] = between_s;
    for _ in 0..HALVINGS {
        let middle_s = 0.5 * (least_s + most_s);
        match can_stop(limits, &body.tendon_rows_m, rates, middle_s) {
            true => most_s = middle_s,
            false => least_s = middle_s,
        }
    }
    [(most_s / (1.0 + EXCESS_OF_STEPS)).max(between_s[0]), most_s]
}

/// Whether a stop of this duration keeps the limits: the least share of both limits that one needs is at most 1. What the solver does not
/// solve counts as one that does, so that no stop is told to take longer than it must.
fn can_stop(
    limits: &TendonLimits,
    rows: &[[f64; DOF]],
    [velocity, acceleration]: &[Configuration; 2],
    duration_s: f64,
) -> bool {
    let step_s = duration_s / STEPS as f64;
    let share = STEPS * DOF;
    let mut program = Program::default();
    // The jerks of all steps take the velocity and the acceleration away.
    for angle in 0..DOF {
        let jerks = (0..STEPS).map(|step| step * DOF + angle);
        program.is_zero(
            jerks.clone().map(|jerk| (jerk, step_s)),
            acceleration[angle],
        );
        let gains = (0..STEPS).map(|step| {
            let after_s = (STEPS - step) as f64 * step_s;
            step_s * (after_s - 0.5 * step_s)
        });
        let velocity = velocity[angle] + acceleration[angle] * duration_s;
        program.is_zero(jerks.zip(gains), velocity);
    }
    for row in rows {
        let now: f64 = (0..DOF).map(|angle| row[angle] * acceleration[angle]).sum();
        for step in 0..STEPS {
            let of_step = |step: usize| (0..DOF).map(move |angle| (step * DOF + angle, row[angle]));
            program.is_within(
                &of_step(step).collect::<Vec<_>>(),
                0.0,
                (share, limits.jerk),
            );
            let after = (0..=step).flat_map(of_step);
            let after = after.map(|(variable, factor)| (variable, factor * step_s));
            program.is_within(
                &after.collect::<Vec<_>>(),
                now,
                (share, limits.acceleration),
            );
        }
    }
    program
        .least(share)
        .is_none_or(|needed| needed <= 1.0 + 1e-6)
}

/// A linear program in sparse rows: equations first, then inequalities, `row · x + slack = bound`.
#[derive(Default)]
struct Program {
    equations: Vec<(Vec<(usize, f64)>, f64)>,
    inequalities: Vec<(Vec<(usize, f64)>, f64)>,
}

impl Program {
    /// `terms · x + constant = 0`.
    fn is_zero(&mut self, terms: impl Iterator<Item = (usize, f64)>, constant: f64) {
        self.equations.push((terms.collect(), -constant));
    }

    /// |`terms · x + constant`| ≤ `limit` × the variable `share`.
    fn is_within(&mut self, terms: &[(usize, f64)], constant: f64, (share, limit): (usize, f64)) {
        for sign in [1.0, -1.0] {
            let signed = terms
                .iter()
                .map(|(variable, factor)| (*variable, sign * factor));
            let row = signed.chain([(share, -limit)]).collect();
            self.inequalities.push((row, -sign * constant));
        }
    }

    /// The least value of a variable, the last one; none where there is no solution.
    fn least(self, variable: usize) -> Option<f64> {
        let count = variable + 1;
        let cones = [
            ZeroConeT(self.equations.len()),
            NonnegativeConeT(self.inequalities.len()),
        ];
        let all: Vec<_> = self
            .equations
            .into_iter()
            .chain(self.inequalities)
            .collect();
        let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for (row, (terms, _)) in all.iter().enumerate() {
            for (column, value) in terms {
                rows.push(row);
                columns.push(*column);
                values.push(*value);
            }
        }
        let matrix = CscMatrix::new_from_triplets(all.len(), count, rows, columns, values);
        let bounds: Vec<f64> = all.iter().map(|(_, bound)| *bound).collect();
        let mut cost = vec![0.0; count];
        cost[variable] = 1.0;
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .build()
            .ok()?;
        let quadratic = CscMatrix::zeros((count, count));
        let mut solver =
            DefaultSolver::new(&quadratic, &cost, &matrix, &bounds, &cones, settings).ok()?;
        solver.solve();
        let is_solved = matches!(
            solver.solution.status,
            SolverStatus::Solved | SolverStatus::AlmostSolved
        );
        is_solved.then(|| solver.solution.x[variable])
    }
}

#[cfg(test)]
mod tests {
    use pcc_model::Robot;

    use super::*;
    use crate::programs::repository;

    #[test]
    fn a_stop_from_a_velocity_alone_takes_two_ramps_and_the_time_between() {
        let file = repository().join("config/robots/unit.toml");
        let body = Body::from_robot_file(&std::fs::read_to_string(&file).unwrap());
        let limits = &Robot::from_file(&file).unwrap().tendon_limits;
        let mut velocity = [0.0; DOF];
        let rows = &body.tendon_rows_m;
        let fastest = rows.iter().map(|row| row[0].abs()).fold(0.0, f64::max);
        velocity[0] = 0.5 * limits.velocity / fastest;
        let expected_s =
            0.5 * limits.velocity / limits.acceleration + limits.acceleration / limits.jerk;
        let rates = [velocity, [0.0; DOF]];
        let found_s = shortest_stop_s(&body, limits, &rates, [0.0, 3.0 * expected_s]);
        let [least_s, most_s] = found_s;
        assert!(
            least_s < expected_s && expected_s < most_s * (1.0 + 1e-3),
            "{found_s:?} for {expected_s}"
        );
    }
}
