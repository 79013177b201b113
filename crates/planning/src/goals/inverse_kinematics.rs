//! Tip inverse kinematics by damped Newton steps inside the bending discs.

use crate::goals::newton::{
    Configurations, Jacobians, bending_squares, damped_steps, within_limits,
};
use crate::problem::Goal;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4, mask64x4};
use pcc_model::{
    Configuration, LANES, Point, SECTIONS, UnitRobot, norms_squared, one_by_one, side_by_side,
};

/// Iterations of one seed: a count, so that answers do not depend on time.
const ITERATIONS: usize = 40;
/// A section bent this near to its limit is at it, rad.
const AT_LIMIT_RAD: f64 = 1e-9;
/// Tip residual taken as solved, section lengths.
const SOLVED: f64 = 1e-9;

/// Solves for a configuration within the limits whose tip is at `target` (base frame, section lengths), from `seed`.
///
/// Returns the configuration and the remaining tip distance; a distance above 1e-9 means that this seed did not reach it.
pub(crate) fn solve_tip(
    robot: &UnitRobot,
    target: &Point,
    seed: &Configuration,
) -> (Configuration, f64) {
    solve_tips(robot, target, std::slice::from_ref(seed))[0]
}

/// Solves for a configuration and its tip distance from each of many seeds, as [`solve_tip`] does from one; four at a time.
pub(crate) fn solve_tips(
    robot: &UnitRobot,
    target: &Point,
    seeds: &[Configuration],
) -> Vec<(Configuration, f64)> {
    dispatch!(Level::new(), simd => solve_at(simd, robot, target, seeds))
}

/// A configuration that Newton steps move from a seed towards the target.
#[derive(Clone, Copy)]
struct Seeker {
    /// Index of the seed.
    number: usize,
    configuration: Configuration,
    distance: f64,
    steps: usize,
}

impl Seeker {
    fn new((number, configuration): (usize, &Configuration)) -> Self {
        Self {
            number,
            configuration: *configuration,
            distance: f64::INFINITY,
            steps: 0,
        }
    }

    /// Whether to stop after a step that left the tip at this distance from the target: it has arrived, or the iterations are over.
    fn is_done(&self, distance: f64) -> bool {
        let stalled = self.steps > 12 && distance > 0.98 * self.distance && distance > 1e-3;
        distance < SOLVED || stalled || self.steps == ITERATIONS
    }
}

/// The configuration that each seed leads to, and its distance. A seed that is done makes room for the next one.
#[inline(always)]
fn solve_at<S: Simd>(
    simd: S,
    robot: &UnitRobot,
    target: &Point,
    seeds: &[Configuration],
) -> Vec<(Configuration, f64)> {
    let mut solved = vec![(Configuration::zeros(), f64::INFINITY); seeds.len()];
    let mut waiting = seeds.iter().enumerate().map(Seeker::new);
    let mut seekers = [const { None }; LANES];
    seekers.fill_with(|| waiting.next());
    while seekers.iter().any(Option::is_some) {
        let configurations =
            seekers.map(|seeker| seeker.map_or_else(Configuration::zeros, |s| s.configuration));
        let (next, distances, solvable) =
            newton_steps(robot, &side_by_side(simd, &configurations), target);
        let (next, solvable) = (one_by_one(&next), solvable.to_bitmask());
        for (lane, place) in seekers.iter_mut().enumerate() {
            let Some(seeker) = place else { continue };
            if seeker.is_done(distances[lane]) || (solvable >> lane) & 1 == 0 {
                solved[seeker.number] = (seeker.configuration, distances[lane]);
                *place = waiting.next();
            } else {
                seeker.configuration = next[lane];
                seeker.distance = distances[lane];
                seeker.steps += 1;
            }
        }
    }
    solved
}

/// The configurations within the limits after one step to the target, the tips' distances before it, and the lanes in which the step can
/// be computed.
///
/// Where a section would leave its disc it may only turn: clipped steps would come nearer by a share at a time.
#[inline(always)]
fn newton_steps<S: Simd>(
    robot: &UnitRobot,
    configurations: &Configurations<S>,
    target: &Point,
) -> (Configurations<S>, f64x4<S>, mask64x4<S>) {
    let tips = robot.moving_tips(configurations);
    let [x, y, z] = tips.positions;
    let errors = [target.x - x, target.y - y, target.z - z];
    let free = [x * 0.0 + 1.0; SECTIONS];
    let mut jacobians = tips.jacobians;
    let (mut steps, solvable) = damped_steps(&jacobians, &free, &errors);
    if hold_limits(robot, configurations, &steps, &mut jacobians) {
        let (held, held_solvable) = damped_steps(&jacobians, &free, &errors);
        for (step, held) in steps.iter_mut().zip(held) {
            *step = held_solvable.select(held, *step);
        }
    }
    for (step, from) in steps.iter_mut().zip(configurations) {
        *step += *from;
    }
    let distances = norms_squared(&errors).sqrt();
    (within_limits(robot, &steps), distances, solvable)
}

/// Removes from the Jacobians the bending of sections that are at their limit and that the steps would bend further; whether there are
/// such sections.
#[inline(always)]
fn hold_limits<S: Simd>(
    robot: &UnitRobot,
    configurations: &Configurations<S>,
    steps: &Configurations<S>,
    jacobians: &mut Jacobians<S>,
) -> bool {
    let begin = robot.bending_limit - AT_LIMIT_RAD;
    let mut any = false;
    for (section, square) in bending_squares(configurations).into_iter().enumerate() {
        let (i, j) = (2 * section, 2 * section + 1);
        let outwards = configurations[i] * steps[i] + configurations[j] * steps[j];
        let held = outwards.simd_gt(0.0) & square.simd_ge(begin * begin);
        if held.any_true() {
            let scale = held.select(1.0 / square.sqrt(), square * 0.0);
            let (x, y) = (configurations[i] * scale, configurations[j] * scale);
            let [by_x, by_y] = &mut jacobians.as_chunks_mut().0[section];
            for (by_x, by_y) in by_x.iter_mut().zip(by_y) {
                let radial = *by_x * x + *by_y * y;
                *by_x -= radial * x;
                *by_y -= radial * y;
            }
            any = true;
        }
    }
    any
}

/// The configuration that reaches a goal, for a tip the one that is found from `seed`; none where no one is.
pub(crate) fn configuration_near(
    robot: &UnitRobot,
    goal: &Goal,
    seed: &Configuration,
) -> Option<Configuration> {
    match goal {
        Goal::Configuration(configuration) => Some(*configuration),
        Goal::Tip(target) => {
            let (configuration, distance) = solve_tip(robot, target, seed);
            is_solved(distance).then_some(configuration)
        }
    }
}

/// Whether a residual of [`solve_tip`] counts as reached.
pub(crate) fn is_solved(distance: f64) -> bool {
    distance < 1e-7
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::search::random_configuration::random_configuration;
    use pcc_model::Robot;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn shapes_at_the_bending_limit_are_reached() {
        let robot = unit_robot();
        let mut rng = Pcg64::seed_from_u64(1);
        let reached = (0..200).filter(|case| {
            let mut configuration = random_configuration(&robot, &mut rng);
            let section = 2 * (case % SECTIONS);
            let bend = configuration.fixed_rows::<2>(section).normalize() * robot.bending_limit;
            configuration.fixed_rows_mut::<2>(section).copy_from(&bend);
            let near = configuration * 0.95 + random_configuration(&robot, &mut rng) * 0.05;
            let (found, distance) = solve_tip(&robot, &robot.tip(&configuration), &near);
            assert!(robot.limit_excess(&found) < 1e-12);
            is_solved(distance)
        });
        assert_eq!(reached.count(), 200);
    }

    #[test]
    fn a_seed_leads_to_the_same_shape_whatever_is_beside_it_and_whatever_the_vectors() {
        let mut rng = Pcg64::seed_from_u64(2);
        // Within the angles that the series are made for, and beyond.
        for bending_limit in [FRAC_PI_2, 2.5] {
            let robot = Robot {
                bending_limit,
                ..(*unit_robot()).clone()
            };
            let robot = robot.to_unit().unwrap();
            let random = (0..30).map(|_| random_configuration(&robot, &mut rng));
            let seeds: Vec<_> = random.chain([Configuration::zeros()]).rev().collect();
            // Straight above the base, where the straight configuration has no way to go; within and out of reach.
            for target in [[0.0, 0.0, 2.5], [0.9, -0.3, 2.1], [2.0, 0.0, 2.6]] {
                let target = Point::from(target);
                for count in [1, 3, 5, 31] {
                    let some = &seeds[..count];
                    let together = solve_tips(&robot, &target, some);
                    let alone = some.iter().map(|seed| solve_tip(&robot, &target, seed));
                    assert_eq!(together, alone.collect::<Vec<_>>());
                    let plainest =
                        dispatch!(Level::baseline(), simd => solve_at(simd, &robot, &target, some));
                    assert_eq!(together, plainest);
                }
            }
        }
    }

    #[test]
    fn a_target_that_is_not_a_number_is_not_reached() {
        let robot = unit_robot();
        let target = Point::new(f64::NAN, 0.0, 2.0);
        let (_, distance) = solve_tip(&robot, &target, &Configuration::repeat(0.1));
        assert!(!is_solved(distance));
    }
}
