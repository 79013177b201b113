//! Targets, their terminal solutions and their starts.

use super::kinematics::{Vector, project_section, tip_step};
use super::sampled::Samples;
use super::solver::{ITERATIONS, TOLERANCE};
use crate::scenes::{STARTS, in_workspace};
use collision::Ball;
use fearless_simd::{Level, dispatch};
use pcc_model::{Configuration, DOF, Point, UnitRobot};
use planning::random_configuration;
use planning::sampled_collision::REPULSION;
use rand_pcg::Pcg64;

/// Terminal solutions of a target.
pub const TERMINALS: usize = 10;
/// Seeds of the terminal solutions, the configuration that generated the target among them.
const SEEDS: usize = 32;
/// Distance that terminal solutions, and starts, keep from each other, rad.
const SEPARATION: f64 = 0.5;
/// Distance of a random start's tip from the target, section lengths.
const START_DISTANCE: f64 = 0.6;
/// Configurations drawn for a target, in groups of [`GROUP`].
const TARGET_GROUPS: usize = 4096;
/// Configurations drawn for the starts of a target, in groups of [`GROUP`].
const START_GROUPS: usize = 4;
/// Configurations drawn at once; four of them make the authors' batch of 32, which is all they try for the starts.
const GROUP: usize = 8;

/// Some configurations, component by component.
type SideBySide<const N: usize> = [[f64; N]; DOF];

/// A robot and the balls around it, with the reference's inverse kinematics and its criterion of collision.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    pub(super) robot: &'a UnitRobot,
    pub(super) balls: &'a [Ball],
}

impl<'a> Surroundings<'a> {
    /// Balls around a robot.
    #[must_use]
    pub fn new(robot: &'a UnitRobot, balls: &'a [Ball]) -> Self {
        Self { robot, balls }
    }

    /// Distance of the deepest of a configuration's nine points to a ball, less the tube radius, section lengths; +∞ without balls.
    #[must_use]
    pub fn clearance(&self, configuration: &Configuration) -> f64 {
        let mut samples = Samples::<1>::new();
        let components = std::array::from_fn(|d| &configuration.as_slice()[d..=d]);
        samples.look(&self.robot.section_lengths, self.balls, components);
        samples.distances[0] - self.robot.largest_tube_radius()
    }

    /// The configuration in which damped Newton steps from a seed have brought the tip within 1e-3 of a point; none where 200 do not.
    #[must_use]
    pub fn reach(&self, tip: &Point, seed: &Configuration) -> Option<Configuration> {
        let (point, mut configuration) = ((*tip).into(), *seed);
        for _ in 0..=ITERATIONS {
            let lengths = &self.robot.section_lengths;
            let step = tip_step(lengths, &configuration.into(), &point, &[0.0; DOF]);
            if step.squared_distance <= TOLERANCE * TOLERANCE {
                return Some(configuration);
            }
            configuration = self.robot.project_to_limits(&step.next.into());
        }
        None
    }

    /// The configuration of least residual with its tip on a point, among those of 32 random seeds that are clear by the margin of
    /// repulsion.
    pub fn best_terminal(&self, tip: &Point, rng: &mut Pcg64) -> Option<Configuration> {
        let seeds = std::array::from_fn(|_| random_configuration(self.robot, rng));
        self.clear_solutions(&seeds, tip).into_iter().next()
    }

    /// Whether each of some shapes is clear by the margin of repulsion.
    fn are_clear<const N: usize>(&self, shapes: &SideBySide<N>) -> [bool; N] {
        let margin = REPULSION * self.robot.largest_tube_radius();
        let mut samples = Samples::<N>::new();
        let components = std::array::from_fn(|d| &shapes[d][..]);
        samples.look(&self.robot.section_lengths, self.balls, components);
        samples.distances.map(|distance| distance >= margin)
    }

    /// Eight random configurations with their tips, where they are clear and the tip is in the workspace.
    fn draw(&self, rng: &mut Pcg64) -> impl Iterator<Item = (Configuration, Point)> + use<'_> {
        let shapes: [Configuration; GROUP] =
            std::array::from_fn(|_| random_configuration(self.robot, rng));
        let clear = self.are_clear(&side_by_side(&shapes));
        let usable = shapes.into_iter().zip(clear).filter(|(_, clear)| *clear);
        usable
            .map(|(shape, _)| (shape, self.robot.tip(&shape)))
            .filter(|(_, tip)| in_workspace(tip))
    }

    /// A tip that can be reached by a clear configuration, with that configuration.
    pub(super) fn target(&self, rng: &mut Pcg64) -> Option<(Configuration, Point)> {
        (0..TARGET_GROUPS).find_map(|_| self.draw(rng).next())
    }

    /// Ten clear and distinct configurations with their tips on a point, best residual first.
    pub(super) fn terminals(
        &self,
        generator: &Configuration,
        tip: &Point,
        rng: &mut Pcg64,
    ) -> Option<[Configuration; TERMINALS]> {
        let mut seeds = [*generator; SEEDS];
        for seed in &mut seeds[1..] {
            *seed = random_configuration(self.robot, rng);
        }
        let mut distinct = Vec::with_capacity(TERMINALS);
        for shape in self.clear_solutions(&seeds, tip) {
            if distinct.len() < TERMINALS && is_apart(&distinct, &shape) {
                distinct.push(shape);
            }
        }
        distinct.try_into().ok()
    }

    /// The configurations to which seeds bring the tip on a point and that are clear by the margin of repulsion, best residual first.
    fn clear_solutions(&self, seeds: &[Configuration; SEEDS], tip: &Point) -> Vec<Configuration> {
        let mut shapes = side_by_side(seeds);
        let residuals = self.solve(&mut shapes, tip);
        let clear = self.are_clear(&shapes);
        let mut found = Vec::with_capacity(SEEDS);
        for (i, residual) in residuals.into_iter().enumerate() {
            if clear[i] && residual <= TOLERANCE * TOLERANCE {
                found.push((residual, shape_of(&shapes, i)));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, shape)| shape).collect()
    }

    /// Damped Newton steps of the seeds towards a tip, each until it is there; their squared residuals.
    fn solve(&self, shapes: &mut SideBySide<SEEDS>, tip: &Point) -> [f64; SEEDS] {
        let mut next = *shapes;
        let mut residuals = [f64::INFINITY; SEEDS];
        for _ in 0..=ITERATIONS {
            for d in 0..DOF {
                for i in 0..SEEDS {
                    let is_there = residuals[i] <= TOLERANCE * TOLERANCE;
                    shapes[d][i] = if is_there { shapes[d][i] } else { next[d][i] };
                }
            }
            let tip = [tip.x, tip.y, tip.z];
            dispatch!(
                Level::new(),
                _ => step_seeds(self.robot, &tip, shapes, &mut next, &mut residuals)
            );
            if residuals.iter().all(|r| *r <= TOLERANCE * TOLERANCE) {
                break;
            }
        }
        residuals
    }

    /// The starts of a target: the straight shape if it is clear, and random ones.
    pub(super) fn starts(
        &self,
        target: &Point,
        rng: &mut Pcg64,
    ) -> Option<[Configuration; STARTS]> {
        let mut starts = Vec::with_capacity(STARTS);
        let straight = Configuration::zeros();
        if self.are_clear(&side_by_side(&[straight; GROUP]))[0] {
            starts.push(straight);
        }
        for _ in 0..START_GROUPS {
            for (shape, tip) in self.draw(rng) {
                let is_away = (tip - target).norm() >= START_DISTANCE && shape.norm() >= SEPARATION;
                if starts.len() < STARTS && is_away && is_apart(&starts, &shape) {
                    starts.push(shape);
                }
            }
            if starts.len() == STARTS {
                break;
            }
        }
        starts.try_into().ok()
    }
}

fn is_apart(others: &[Configuration], shape: &Configuration) -> bool {
    others
        .iter()
        .all(|other| (other - shape).norm() >= SEPARATION)
}

fn side_by_side<const N: usize>(shapes: &[Configuration; N]) -> SideBySide<N> {
    std::array::from_fn(|d| std::array::from_fn(|i| shapes[i][d]))
}

fn shape_of<const N: usize>(shapes: &SideBySide<N>, i: usize) -> Configuration {
    Configuration::from_fn(|d, _| shapes[d][i])
}

/// Writes each seed after one Newton step, brought inside the bending limit, into `next`, and the squared tip distance before the step
/// (section lengths²) into `residuals`.
#[inline(always)]
fn step_seeds(
    robot: &UnitRobot,
    tip: &Vector,
    shapes: &SideBySide<SEEDS>,
    next: &mut SideBySide<SEEDS>,
    residuals: &mut [f64; SEEDS],
) {
    for i in 0..SEEDS {
        let mut shape = [0.0; DOF];
        for d in 0..DOF {
            shape[d] = shapes[d][i];
        }
        let step = tip_step(&robot.section_lengths, &shape, tip, &[0.0; DOF]);
        for (component, value) in next.iter_mut().zip(step.next) {
            component[i] = value;
        }
        residuals[i] = step.squared_distance;
    }
    for [x, y] in next.as_chunks_mut::<2>().0 {
        project_section(robot.bending_limit, x, y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::scenes::reference_layout;
    use collision::Scene;

    /// Clearance of the reference's nine points beyond the ball.
    fn sampled_clearance(place: &Surroundings, shape: &Configuration) -> f64 {
        let mut samples = Samples::<1>::new();
        let components = std::array::from_fn(|d| &shape.as_slice()[d..=d]);
        samples.look(&place.robot.section_lengths, place.balls, components);
        samples.distances[0]
    }

    #[test]
    fn terminals_and_starts_keep_what_is_promised() {
        let (robot, balls) = (unit_robot(), reference_layout(4));
        let place = Surroundings {
            robot: &robot,
            balls: &balls,
        };
        let mut rng = Pcg64::new(5, 1);
        let (mut solved, mut started) = (0, 0);
        for _ in 0..20 {
            let (generator, tip) = place.target(&mut rng).unwrap();
            assert!(in_workspace(&tip) && (robot.tip(&generator) - tip).norm() < 1e-12);
            let terminals = place.terminals(&generator, &tip, &mut rng);
            let starts = place.starts(&tip, &mut rng);
            solved += usize::from(terminals.is_some());
            started += usize::from(starts.is_some());
            for (i, shape) in terminals.iter().flatten().enumerate() {
                assert!((robot.tip(shape) - tip).norm() <= TOLERANCE);
                assert!(sampled_clearance(&place, shape) >= 0.3);
                assert!(robot.limit_excess(shape) < 1e-12);
                assert!(is_apart(&terminals.as_ref().unwrap()[..i], shape));
            }
            for shape in starts.iter().flatten().skip(1) {
                assert!((robot.tip(shape) - tip).norm() >= 0.6 && shape.norm() >= 0.5);
                assert!(sampled_clearance(&place, shape) >= 0.3);
            }
            assert!(starts.is_none_or(|starts| starts[0] == Configuration::zeros()));
        }
        assert!(solved > 10 && started > 10, "{solved} {started}");
    }

    #[test]
    fn the_generating_configuration_is_the_best_terminal() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let place = Surroundings {
            robot: &robot,
            balls: scene.balls(),
        };
        let mut rng = Pcg64::new(1, 1);
        let (generator, tip) = place.target(&mut rng).unwrap();
        assert_eq!(
            place.terminals(&generator, &tip, &mut rng).unwrap()[0],
            generator
        );
    }
}
