//! Planners that go on after their first path, for short tip paths, until their time is over: RRT* and BIT* on certified edges, towards
//! several goal configurations at once. The paper does not have them; they are what an expert would put beside it.

pub(crate) mod bit_star;
pub(crate) mod rrt_star;
mod tree;

use crate::query::Query;
use collision::{Scene, certify_edge};
use pcc_model::{Configuration, Point};
use planning::{Goal, MovingObstacles, Problem, goal_configurations, random_configuration};
use rand_pcg::Pcg64;
use std::time::{Duration, Instant};

/// Time of an attempt.
const BUDGET: Duration = Duration::from_millis(50);
/// Goal configurations that an attempt is towards.
const GOALS: usize = 10;
/// Bisection depth of an edge's certificate, as that of RRT-Connect; undecided edges count as colliding.
const EDGE_DEPTH: u32 = 7;
/// Chords by which the length of the tip's path along an edge is measured.
const CHORDS: usize = 8;
/// Random configurations that are drawn at most for one that may lie on a shorter path.
const MOST_DRAWS: usize = 100;

/// An attempt: what it is asked for, its goal configurations, and when its time is over.
struct Attempt<'a> {
    query: &'a Query<'a>,
    scene: Scene,
    goals: Vec<Configuration>,
    until: Instant,
}

impl<'a> Attempt<'a> {
    /// None where no configuration with the tip on the target is found clear.
    fn new(query: &'a Query, rng: &mut Pcg64) -> Option<Self> {
        let until = Instant::now() + BUDGET;
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
            until,
        })
    }

    fn is_over(&self) -> bool {
        Instant::now() >= self.until
    }

    fn edge_is_free(&self, a: &Configuration, b: &Configuration) -> bool {
        certify_edge(self.query.robot, &self.scene, a, b, EDGE_DEPTH).is_free()
    }

    fn tip(&self, configuration: &Configuration) -> Point {
        self.query.robot.tip(configuration)
    }

    /// Length of the tip's path along an edge, section lengths.
    fn tip_length(&self, a: &Configuration, b: &Configuration) -> f64 {
        let tips = (0..=CHORDS).map(|i| self.tip(&a.lerp(b, i as f64 / CHORDS as f64)));
        let tips: Vec<Point> = tips.collect();
        tips.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// Lower bound of the length of a tip path from the start to the target through a tip position, section lengths.
    fn least_through(&self, tip: &Point) -> f64 {
        (tip - self.tip(&self.query.start)).norm() + self.least_to_go(tip)
    }

    /// Lower bound of the length of a tip path from a position to the target, section lengths.
    fn least_to_go(&self, tip: &Point) -> f64 {
        (self.query.target - tip).norm()
    }

    /// A random configuration through which a path may be shorter than the shortest one known.
    fn sample(&self, shortest: f64, rng: &mut Pcg64) -> Option<Configuration> {
        (0..MOST_DRAWS).find_map(|_| {
            let drawn = random_configuration(self.query.robot, rng);
            (self.least_through(&self.tip(&drawn)) < shortest).then_some(drawn)
        })
    }
}

/// Neighbours of a node among so many of them, in a space of as many dimensions as a configuration has, by which RRT* and BIT* come to the
/// shortest path in the end: e (1 + 1/d) ln n (Karaman and Frazzoli, 2011).
fn neighbours(count: usize) -> usize {
    const FACTOR: f64 = std::f64::consts::E * (1.0 + 1.0 / pcc_model::DOF as f64);
    (FACTOR * (count.max(2) as f64).ln()).ceil() as usize
}

/// The places of the nearest of some configurations, nearest first.
fn nearest(of: &Configuration, among: &[Configuration], count: usize) -> Vec<usize> {
    let square = |(i, other): (usize, &Configuration)| ((other - of).norm_squared(), i);
    let mut squares: Vec<(f64, usize)> = among.iter().enumerate().map(square).collect();
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
    use crate::fixtures::unit_robot;
    use datasets::scenes::reference_layout;

    #[test]
    fn paths_lead_along_certified_edges_to_the_target() {
        let robot = unit_robot();
        let balls = reference_layout(4);
        let start = Configuration::from([-0.5, 0.2, -0.3, -0.1, -0.2, 0.3]);
        let bent = Configuration::from([0.5, -0.2, 0.3, 0.1, 0.2, -0.3]);
        let query = Query {
            robot: &robot,
            balls: &balls,
            start,
            target: robot.tip(&bent),
        };
        let scene = Scene::new(balls.clone()).unwrap();
        for plan in [rrt_star::path, bit_star::path] {
            for seed in 0..3 {
                let path = plan(&query, &mut Pcg64::new(seed, 1)).unwrap();
                assert_eq!(path[0], start);
                let end = robot.tip(&path[path.len() - 1]);
                assert!((end - query.target).norm() < 1e-3, "{end}");
                let is_free =
                    |w: &[Configuration]| certify_edge(&robot, &scene, &w[0], &w[1], 7).is_free();
                assert!(path.windows(2).all(is_free));
            }
        }
    }

    #[test]
    fn the_nearest_come_first() {
        let line: Vec<_> = (0..9)
            .map(|i| Configuration::repeat(f64::from((7 * i) % 9)))
            .collect();
        let found = nearest(&Configuration::repeat(3.1), &line, 3);
        let values: Vec<f64> = found.iter().map(|i| line[*i][0]).collect();
        assert_eq!(values, [3.0, 4.0, 2.0]);
        assert_eq!(nearest(&Configuration::zeros(), &line, 20).len(), 9);
        assert!(nearest(&Configuration::zeros(), &[], 2).is_empty());
    }
}
