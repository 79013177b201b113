//! What RRT* and BIT* have in common: certified edges towards several goal configurations, lengths of tip paths, samples, neighbours.

use super::informed;
use crate::query::Query;
use collision::{Scene, certify_edge};
use datasets::reference::Surroundings;
use pcc_model::{Configuration, Point};
use planning::{Goal, MovingObstacles, Problem, goal_configurations, random_configuration};
use rand::RngExt;
use rand_pcg::Pcg64;

/// Goal configurations that an attempt is towards.
const GOALS: usize = 10;
/// Bisection depth of an edge's certificate, as that of RRT-Connect; undecided edges count as colliding.
const EDGE_DEPTH: u32 = 7;
/// Chords by which the length of the tip's path along an edge is measured.
const CHORDS: usize = 8;

/// An attempt: what it is asked for, its goal configurations, and when its time is over.
pub(super) struct Attempt<'a> {
    pub(super) query: &'a Query<'a>,
    scene: Scene,
    pub(super) goals: Vec<Configuration>,
    /// Whether its time is over, while it has no path or once it has one.
    is_over: &'a dyn Fn(bool) -> bool,
}

impl<'a> Attempt<'a> {
    /// None where no configuration with the tip on the target is found clear.
    pub(super) fn new(
        query: &'a Query,
        is_over: &'a dyn Fn(bool) -> bool,
        rng: &mut Pcg64,
    ) -> Option<Self> {
        let scene = Scene::new(query.balls.to_vec()).ok()?;
        let problem = Problem {
            start: query.start,
            goal: Goal::Tip(query.target),
            scene: scene.clone(),
            moving: MovingObstacles::default(),
        };
        let goals = goal_configurations(query.robot, &problem, GOALS, rng).ok()?;
        Some(Self {
            query,
            scene,
            goals,
            is_over,
        })
    }

    /// Whether its time is over, where the shortest tip path that is known has this length, section lengths; infinite where none is.
    pub(super) fn is_over(&self, shortest: f64) -> bool {
        (self.is_over)(shortest.is_finite())
    }

    pub(super) fn edge_is_free(&self, a: &Configuration, b: &Configuration) -> bool {
        certify_edge(self.query.robot, &self.scene, a, b, EDGE_DEPTH).is_free()
    }

    pub(super) fn tip(&self, configuration: &Configuration) -> Point {
        self.query.robot.tip(configuration)
    }

    /// Length of the tip's path along an edge, section lengths.
    pub(super) fn tip_length(&self, a: &Configuration, b: &Configuration) -> f64 {
        let tips = (0..=CHORDS).map(|i| self.tip(&a.lerp(b, i as f64 / CHORDS as f64)));
        let tips: Vec<Point> = tips.collect();
        tips.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// Lower bound of the length of a tip path from a position to the target, section lengths.
    pub(super) fn least_to_go(&self, tip: &Point) -> f64 {
        (self.query.target - tip).norm()
    }

    /// A configuration through which a path may be shorter than the shortest one known (section lengths, infinite where none is): a random one,
    /// or one near the tree, whose tip is brought to a random position on such a path. None where that fails.
    pub(super) fn sample(
        &self,
        shortest: f64,
        tree: &[Configuration],
        rng: &mut Pcg64,
    ) -> Option<Configuration> {
        let robot = self.query.robot;
        if shortest.is_infinite() {
            return Some(random_configuration(robot, rng));
        }
        let ends = [self.tip(&self.query.start), self.query.target];
        let tip = informed::position(ends, shortest, rng);
        let seed = match rng.random::<bool>() {
            true => random_configuration(robot, rng),
            false => tree[rng.random_range(0..tree.len())],
        };
        Surroundings::new(robot, self.query.balls).reach(&tip, &seed)
    }
}

/// Neighbours of a node among so many of them, in a space of as many dimensions as a configuration has, by which RRT* and BIT* come to the
/// shortest path in the end: e (1 + 1/d) ln n (Karaman and Frazzoli, 2011).
pub(super) fn neighbours(count: usize) -> usize {
    const FACTOR: f64 = std::f64::consts::E * (1.0 + 1.0 / pcc_model::DOF as f64);
    (FACTOR * (count.max(2) as f64).ln()).ceil() as usize
}

/// The places of the nearest of some configurations, nearest first.
pub(super) fn nearest<'a>(
    of: &Configuration,
    among: impl Iterator<Item = (usize, &'a Configuration)>,
    count: usize,
) -> Vec<usize> {
    let square = |(i, other): (usize, &Configuration)| ((other - of).norm_squared(), i);
    let mut squares: Vec<(f64, usize)> = among.map(square).collect();
    let count = count.min(squares.len());
    if count == 0 {
        return Vec::new();
    }
    squares.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0));
    squares.truncate(count);
    squares.sort_by(|a, b| a.0.total_cmp(&b.0));
    squares.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_come_first() {
        let line: Vec<_> = (0..9)
            .map(|i| Configuration::repeat(f64::from((7 * i) % 9)))
            .collect();
        let all = || line.iter().enumerate();
        let found = nearest(&Configuration::repeat(3.1), all(), 3);
        let values: Vec<f64> = found.iter().map(|i| line[*i][0]).collect();
        assert_eq!(values, [3.0, 4.0, 2.0]);
        assert_eq!(nearest(&Configuration::zeros(), all(), 20).len(), 9);
        assert!(nearest(&Configuration::zeros(), all().take(0), 2).is_empty());
    }
}
