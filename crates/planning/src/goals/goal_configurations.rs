//! Goal configurations: diverse, clear ones by multi-start inverse kinematics, ones near to the start and far ones in turn.

use crate::error::Infeasible;
use crate::goals::inverse_kinematics::{is_solved, solve_tips};
use crate::problem::{Goal, Problem};
use crate::request::Interrupt;
use crate::search::random_configuration::random_configuration;
use pcc_model::{Configuration, UnitRobot};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Rounds of seeds at most: another one follows where those before left too few configurations.
const ROUNDS: usize = 10;
/// Seeds of a round.
const SEEDS: usize = 32;
/// Seeds that one worker takes between two looks at the interrupt: half of the first round, to which the start adds one.
const SEEDS_AT_ONCE: usize = (SEEDS + 1).div_ceil(2);
/// Wanted clearance (section lengths) and distance between configurations (rad), relaxed in this order until enough are found.
const WISHES: [[f64; 2]; 5] = [
    [0.1, 0.5],
    [0.04, 0.5],
    [0.02, 0.25],
    [0.0, 0.1],
    [0.0, 0.01],
];

struct Solution {
    configuration: Configuration,
    clearance: f64,
}

/// Finds up to `count` configurations (radians) with the tip on the problem's goal that keep `robot` clear, repeatable for a given
/// generator state.
///
/// # Errors
/// [`Infeasible::GoalOutOfReach`] or [`Infeasible::GoalInCollision`].
pub fn goal_configurations(
    robot: &UnitRobot,
    problem: &Problem,
    count: usize,
    rng: &mut Pcg64,
) -> Result<Vec<Configuration>, Infeasible> {
    goal_configurations_until(robot, problem, count, rng, &|| false)
}

/// Finds goal configurations as [`goal_configurations`] does; if interrupted, returns those found so far, which may be none.
pub(crate) fn goal_configurations_until(
    robot: &UnitRobot,
    problem: &Problem,
    count: usize,
    rng: &mut Pcg64,
    interrupt: Interrupt,
) -> Result<Vec<Configuration>, Infeasible> {
    match &problem.goal {
        Goal::Configuration(configuration) => fixed_goal(robot, problem, configuration),
        Goal::Tip(target) => {
            let mut found = Pool {
                solutions: Vec::new(),
                closest: f64::INFINITY,
            };
            for _ in 0..ROUNDS {
                let first = found.solutions.is_empty().then_some(problem.start);
                let random = (0..SEEDS).map(|_| random_configuration(robot, rng));
                let seeds: Vec<Configuration> = first.into_iter().chain(random).collect();
                found.try_seeds(robot, problem, target, &seeds, interrupt);
                let chosen = found.choose(&problem.start, count, &WISHES[..2]);
                if chosen.len() == count {
                    return Ok(chosen);
                }
            }
            let configurations = found.choose(&problem.start, count, &WISHES);
            if configurations.is_empty() && !interrupt() {
                Err(found.failure())
            } else {
                Ok(configurations)
            }
        }
    }
}

/// Checks that some clear configuration reaches the goal, for samplers that choose their own.
///
/// # Errors
/// [`Infeasible::GoalOutOfReach`] or [`Infeasible::GoalInCollision`].
pub(crate) fn check_goal(
    robot: &UnitRobot,
    problem: &Problem,
    seed: u64,
) -> Result<(), Infeasible> {
    let mut rng = Pcg64::seed_from_u64(seed);
    goal_configurations(robot, problem, 1, &mut rng).map(drop)
}

fn fixed_goal(
    robot: &UnitRobot,
    problem: &Problem,
    configuration: &Configuration,
) -> Result<Vec<Configuration>, Infeasible> {
    let excess = robot.limit_excess(configuration);
    if excess > 1e-6 {
        return Err(Infeasible::GoalOutOfReach { miss: excess });
    }
    let clearance = problem.scene.clearance_at(robot, configuration);
    if clearance < 0.0 {
        return Err(Infeasible::GoalInCollision {
            configurations: 1,
            clearance,
        });
    }
    Ok(vec![*configuration])
}

struct Pool {
    solutions: Vec<Solution>,
    closest: f64,
}

impl Pool {
    fn try_seeds(
        &mut self,
        robot: &UnitRobot,
        problem: &Problem,
        target: &pcc_model::Point,
        seeds: &[Configuration],
        interrupt: Interrupt,
    ) {
        let tried: Vec<_> = seeds
            .par_chunks(SEEDS_AT_ONCE)
            .filter(|_| !interrupt())
            .flat_map_iter(|seeds| solve_tips(robot, target, seeds))
            .filter(|_| !interrupt())
            .map(|(configuration, distance)| {
                let clearance =
                    is_solved(distance).then(|| problem.scene.clearance_at(robot, &configuration));
                (configuration, distance, clearance)
            })
            .collect();
        for (configuration, distance, clearance) in tried {
            self.closest = self.closest.min(distance);
            self.solutions.extend(clearance.map(|clearance| Solution {
                configuration,
                clearance,
            }));
        }
    }

    /// Fills up to `count` places, in turn with the configuration nearest to the start and with the one farthest from all
    /// chosen so far: short motions and different ones.
    fn choose(
        &self,
        start: &Configuration,
        count: usize,
        wishes: &[[f64; 2]],
    ) -> Vec<Configuration> {
        let mut chosen: Vec<Configuration> = Vec::with_capacity(count);
        // How far each solution is from all chosen so far.
        let mut apart_rad = vec![f64::INFINITY; self.solutions.len()];
        for &[clearance, separation] in wishes {
            while chosen.len() < count {
                let nearest_is_next = chosen.len().is_multiple_of(2);
                let rank = |&i: &usize| match nearest_is_next {
                    true => (self.solutions[i].configuration - start).norm(),
                    false => -apart_rad[i],
                };
                let open = (0..self.solutions.len()).filter(|&i| {
                    self.solutions[i].clearance >= clearance && apart_rad[i] >= separation
                });
                let Some(next) = open.min_by(|a, b| rank(a).total_cmp(&rank(b))) else {
                    break;
                };
                let configuration = self.solutions[next].configuration;
                for (apart, solution) in apart_rad.iter_mut().zip(&self.solutions) {
                    *apart = apart.min((solution.configuration - configuration).norm());
                }
                chosen.push(configuration);
            }
        }
        chosen
    }

    fn failure(&self) -> Infeasible {
        let clearance = self
            .solutions
            .iter()
            .map(|s| s.clearance)
            .fold(f64::NEG_INFINITY, f64::max);
        match self.solutions.len() {
            0 => Infeasible::GoalOutOfReach { miss: self.closest },
            configurations => Infeasible::GoalInCollision {
                configurations,
                clearance,
            },
        }
    }
}
