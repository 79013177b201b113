//! Targets, their terminal solutions and their starts.

use super::kinematics::{Limbs, Shapes, tip_step};
use super::lanes::{LANES, Lanes};
use super::repair::REPULSION;
use super::sampled::distances;
use super::solver::{ITERATIONS, TOLERANCE};
use crate::scenes::{STARTS, in_workspace, random_configuration};
use collision::Ball;
use pcc_model::{Configuration, DOF, Point, Robot};
use rand_pcg::Pcg64;

/// Terminal solutions of a target.
pub const TERMINALS: usize = 10;
/// Seeds of the terminal solutions, the configuration that generated the target among them.
const SEEDS: usize = 32;
/// Distance that terminal solutions, and starts, keep from each other, rad.
const SEPARATION: f64 = 0.5;
/// Distance of a random start's tip from the target, section lengths.
const START_DISTANCE: f64 = 0.6;
/// Configurations drawn for a target, in groups of [`LANES`].
const TARGET_GROUPS: usize = 4096;
/// Configurations drawn for the starts of a target, in groups of [`LANES`].
const START_GROUPS: usize = 4;

/// A robot and the balls around it.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) robot: &'a Robot,
    pub(super) balls: &'a [Ball],
}

impl Place<'_> {
    /// Whether each of eight shapes is clear by the margin of repulsion.
    fn are_clear(&self, shapes: &Shapes) -> [bool; LANES] {
        let margin = REPULSION * self.robot.tube_radius;
        distances(&self.robot.section_lengths, self.balls, shapes)
            .0
            .map(|distance| distance >= margin)
    }

    /// Eight random configurations with their tips, where they are clear and the tip is in the workspace.
    fn draw(&self, rng: &mut Pcg64) -> impl Iterator<Item = (Configuration, Point)> + use<'_> {
        let shapes: [Configuration; LANES] =
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
        let mut found = Vec::with_capacity(SEEDS);
        for group in seeds.as_chunks::<LANES>().0 {
            let mut shapes = side_by_side(group);
            let residuals = self.solve(&mut shapes, tip);
            let clear = self.are_clear(&shapes);
            for (lane, residual) in residuals.0.into_iter().enumerate() {
                if clear[lane] && residual <= TOLERANCE * TOLERANCE {
                    found.push((residual, lane_of(&shapes, lane)));
                }
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut distinct = Vec::with_capacity(TERMINALS);
        for (_, shape) in found {
            if distinct.len() < TERMINALS && is_apart(&distinct, &shape) {
                distinct.push(shape);
            }
        }
        distinct.try_into().ok()
    }

    /// Damped Newton steps of eight shapes towards a tip, each until it is there; their squared residuals.
    fn solve(&self, shapes: &mut Shapes, tip: &Point) -> Lanes {
        let points = [0, 1, 2].map(|axis| Lanes::splat(tip[axis]));
        let (still, reached) = (
            [Lanes::splat(0.0); DOF],
            Lanes::splat(TOLERANCE * TOLERANCE),
        );
        let limbs = Limbs::of(self.robot);
        let mut found = tip_step(&limbs, shapes, &points, &still);
        for _ in 0..ITERATIONS {
            if !found.squared_distance.any_above(TOLERANCE * TOLERANCE) {
                break;
            }
            for (shape, next) in shapes.iter_mut().zip(found.next) {
                *shape = reached.choose_below(found.squared_distance, next, *shape);
            }
            found = tip_step(&limbs, shapes, &points, &still);
        }
        found.squared_distance
    }

    /// The starts of a target: the straight shape if it is clear, and random ones.
    pub(super) fn starts(
        &self,
        target: &Point,
        rng: &mut Pcg64,
    ) -> Option<[Configuration; STARTS]> {
        let mut starts = Vec::with_capacity(STARTS);
        let straight = Configuration::zeros();
        if self.are_clear(&side_by_side(&[straight; LANES]))[0] {
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

fn side_by_side(shapes: &[Configuration; LANES]) -> Shapes {
    std::array::from_fn(|d| Lanes(std::array::from_fn(|lane| shapes[lane][d])))
}

fn lane_of(shapes: &Shapes, lane: usize) -> Configuration {
    Configuration::from_fn(|d, _| shapes[d].0[lane])
}
