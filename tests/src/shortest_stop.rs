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
/// Durations that differ by this part of themselves or less are not told apart.
const RESOLVED: f64 = 1e-7;
/// Halvings of the interval in which the shortest duration lies.
const HALVINGS: usize = 12;
const DOF: usize = 6;
/// A limit that is exceeded by this part of itself or less is kept.
const ROUNDING: f64 = 1e-6;
/// Unit of distances in the program, m.
const UNIT_M: f64 = 1e-3;

/// The shortest stop.
#[derive(Clone, Copy, Debug)]
pub struct ShortestStop {
    /// The least and the largest duration that it may have, s: the largest one is that of a stop within the limits where the solver solves, the least
    /// one leaves out what the program's steps may have added.
    pub between_s: [f64; 2],
    /// From its begin to where it rests, rad; none where the solver does not say.
    pub displacement_rad: Option<Configuration>,
}

/// The shortest stop from a velocity (rad/s) and an acceleration (rad/s²), where it takes between two durations, s. Of all that are as short it
/// is the one whose tendons rest nearest to those of another stop, whose displacement is given.
#[must_use]
pub fn shortest_stop(
    body: &Body,
    limits: &TendonLimits,
    rates: &[Configuration; 2],
    between_s: [f64; 2],
    other_displacement_rad: &Configuration,
) -> ShortestStop {
    let rows = &body.tendon_rows_m;
    let [mut least_s, mut most_s] = between_s;
    for _ in 0..HALVINGS {
        if most_s <= least_s * (1.0 + RESOLVED) {
            break;
        }
        let middle_s = 0.5 * (least_s + most_s);
        match can_stop(limits, rows, rates, middle_s) {
            true => most_s = middle_s,
            false => least_s = middle_s,
        }
    }
    let least_s = (least_s / (1.0 + EXCESS_OF_STEPS)).max(between_s[0]);
    ShortestStop {
        between_s: [least_s, most_s],
        displacement_rad: nearest_rest(limits, rows, rates, most_s, other_displacement_rad),
    }
}

/// Whether a stop of this duration keeps the limits: the least share of both limits that one needs is at most 1. What the solver does not
/// solve counts as one that does, so that no stop is told to take longer than it must.
fn can_stop(
    limits: &TendonLimits,
    rows: &[[f64; DOF]],
    rates: &[Configuration; 2],
    duration_s: f64,
) -> bool {
    let share = STEPS * DOF;
    let stop = Program::of_stop(limits, rows, rates, duration_s);
    let solution = stop.with_least(share);
    solution.is_none_or(|solution| solution[share] <= 1.0 + ROUNDING)
}

/// The displacement of the stop of this duration within the limits whose tendons rest nearest to those of another stop; none where the solver finds
/// none.
fn nearest_rest(
    limits: &TendonLimits,
    rows: &[[f64; DOF]],
    rates: &[Configuration; 2],
    duration_s: f64,
    other_displacement_rad: &Configuration,
) -> Option<Configuration> {
    let [share, distance] = [STEPS * DOF, STEPS * DOF + 1];
    let mut program = Program::of_stop(limits, rows, rates, duration_s);
    // A little more than `can_stop` asks for, so that what it found is within.
    program
        .inequalities
        .push((vec![(share, 1.0)], 1.0 + 10.0 * ROUNDING));
    let displacement = Displacement::of_stop(rates, duration_s);
    for row in rows {
        let terms = (0..DOF).flat_map(|angle| {
            displacement
                .terms(angle)
                .map(move |(jerk, gain)| (jerk, row[angle] * gain))
        });
        let coasted = (0..DOF).map(|angle| {
            row[angle] * (displacement.coasted_rad[angle] - other_displacement_rad[angle])
        });
        program.is_within(
            &terms.collect::<Vec<_>>(),
            coasted.sum(),
            (distance, UNIT_M),
        );
    }
    let jerks = program.with_least(distance)?;
    Some(std::array::from_fn(|angle| {
        let gained = displacement
            .terms(angle)
            .map(|(jerk, gain)| jerks[jerk] * gain);
        displacement.coasted_rad[angle] + gained.sum::<f64>()
    }))
}

/// Where the jerks of a stop's steps lead.
struct Displacement {
    step_s: f64,
    /// The displacement without any jerk, rad.
    coasted_rad: Configuration,
}

impl Displacement {
    fn of_stop([velocity, acceleration]: &[Configuration; 2], duration_s: f64) -> Self {
        let coasted =
            |angle: usize| (velocity[angle] + 0.5 * acceleration[angle] * duration_s) * duration_s;
        Self {
            step_s: duration_s / STEPS as f64,
            coasted_rad: std::array::from_fn(coasted),
        }
    }

    /// The jerks of an angle, and the displacement that each adds for its size.
    fn terms(&self, angle: usize) -> impl Iterator<Item = (usize, f64)> {
        let step_s = self.step_s;
        (0..STEPS).map(move |step| {
            let after_s = (STEPS - step - 1) as f64 * step_s;
            let gain = step_s * (step_s * (step_s / 6.0 + 0.5 * after_s) + 0.5 * after_s * after_s);
            (step * DOF + angle, gain)
        })
    }
}

/// A linear program in sparse rows: equations first, then inequalities, `row · x + slack = bound`.
#[derive(Default)]
struct Program {
    equations: Vec<(Vec<(usize, f64)>, f64)>,
    inequalities: Vec<(Vec<(usize, f64)>, f64)>,
}

impl Program {
    /// A stop of this duration: the jerks of all steps, step by step, and behind them the share of both limits that it needs.
    fn of_stop(
        limits: &TendonLimits,
        rows: &[[f64; DOF]],
        [velocity, acceleration]: &[Configuration; 2],
        duration_s: f64,
    ) -> Self {
        let step_s = duration_s / STEPS as f64;
        let share = STEPS * DOF;
        let mut program = Self::default();
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
                let of_step =
                    |step: usize| (0..DOF).map(move |angle| (step * DOF + angle, row[angle]));
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
    }

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

    /// All variables, where a variable, the last one, has its least value; none where there is no solution.
    fn with_least(self, variable: usize) -> Option<Vec<f64>> {
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
        is_solved.then_some(solver.solution.x)
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
        let mut displacement_rad = [0.0; DOF];
        displacement_rad[0] = 0.5 * velocity[0] * expected_s;
        let between_s = [0.0, 3.0 * expected_s];
        let stop = shortest_stop(&body, limits, &rates, between_s, &displacement_rad);
        let [least_s, most_s] = stop.between_s;
        assert!(
            least_s < expected_s && expected_s < most_s * (1.0 + 1e-3),
            "{stop:?} for {expected_s}"
        );
        let found_rad = stop.displacement_rad.unwrap();
        let error_rad = (0..DOF).map(|angle| (found_rad[angle] - displacement_rad[angle]).abs());
        let error_rad = error_rad.fold(0.0, f64::max);
        assert!(
            error_rad < 0.01 * displacement_rad[0].abs(),
            "{found_rad:?}"
        );
        // The tendon that brakes longest can rest nowhere else as soon.
        let elsewhere = shortest_stop(&body, limits, &rates, between_s, &[0.0; DOF]);
        let [found, other] = [found_rad[0], elsewhere.displacement_rad.unwrap()[0]];
        assert!((found - other).abs() < 0.02 * found.abs(), "{elsewhere:?}");
    }
}
