//! Planners that go on after their first path, for short tip paths, until their time is over: RRT* and BIT* on certified edges, towards
//! several goal configurations at once. The paper does not have them; they are what an expert would put beside it.

mod bit_star;
mod informed;
mod rrt_star;
mod tree;

use crate::query::Query;
use collision::{Scene, certify_edge};
use datasets::reference::Surroundings;
use pcc_model::{Configuration, Point, SECTIONS};
use planning::{Goal, MovingObstacles, Problem, goal_configurations, random_configuration};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::time::{Duration, Instant};

/// Time of an attempt.
const BUDGET: Duration = Duration::from_millis(50);
/// Room around the tubes that is tried in turn, section lengths, as by RRT-Connect: rounding corners needs some. Each has an equal part of
/// the time for a first path; the one that finds it has all that is left.
const MARGINS: [f64; 3] = [0.04, 0.01, 0.0];
/// Goal configurations that an attempt is towards.
const GOALS: usize = 10;
/// Bisection depth of an edge's certificate, as that of RRT-Connect; undecided edges count as colliding.
const EDGE_DEPTH: u32 = 7;
/// Chords by which the length of the tip's path along an edge is measured.
const CHORDS: usize = 8;

/// An expert's planner that goes on after its first path, for 50 ms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anytime {
    /// RRT* on certified edges, to the nearest of several goal configurations by tip length.
    RrtStar,
    /// BIT*, likewise.
    BitStar,
}

impl Anytime {
    /// One attempt: the corners of certified edges (radians) along which the shortest tip path that was found in time leads; none where none was.
    pub fn attempt(self, query: &Query, rng: &mut Pcg64) -> Option<Vec<Configuration>> {
        let begun = Instant::now();
        let parts = (1..).zip(MARGINS);
        let mut paths = parts.map(|(part, margin)| {
            let robot = query.robot.with_tube_padding(&[margin; SECTIONS]);
            let query = Query {
                robot: &robot,
                ..*query
            };
            let until_first = begun + BUDGET * part / MARGINS.len() as u32;
            let attempt = Attempt::new(&query, [until_first, begun + BUDGET], rng)?;
            match self {
                Self::RrtStar => rrt_star::path(&attempt, rng),
                Self::BitStar => bit_star::path(attempt, rng),
            }
        });
        paths.find_map(|path| path)
    }
}

/// An attempt: what it is asked for, its goal configurations, and when its time is over.
struct Attempt<'a> {
    query: &'a Query<'a>,
    scene: Scene,
    goals: Vec<Configuration>,
    /// While it has no path, and once it has one.
    until: [Instant; 2],
}

impl<'a> Attempt<'a> {
    /// None where no configuration with the tip on the target is found clear.
    fn new(query: &'a Query, until: [Instant; 2], rng: &mut Pcg64) -> Option<Self> {
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

    /// Whether its time is over, where the shortest tip path that is known has this length, section lengths; infinite where none is.
    fn is_over(&self, shortest: f64) -> bool {
        Instant::now() >= self.until[usize::from(shortest.is_finite())]
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

    /// Lower bound of the length of a tip path from a position to the target, section lengths.
    fn least_to_go(&self, tip: &Point) -> f64 {
        (self.query.target - tip).norm()
    }

    /// A configuration through which a path may be shorter than the shortest one known (section lengths, infinite where none is): a random one,
    /// or one near the tree, whose tip is brought to a random position on such a path. None where that fails.
    fn sample(
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
        for planner in [Anytime::RrtStar, Anytime::BitStar] {
            for seed in 0..3 {
                let path = planner.attempt(&query, &mut Pcg64::new(seed, 1)).unwrap();
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
    fn the_time_is_used_and_the_tip_path_becomes_shorter_in_it() {
        let robot = unit_robot();
        let start = Configuration::from([-0.5, 0.2, -0.3, -0.1, -0.2, 0.3]);
        let bent = Configuration::from([0.5, -0.2, 0.3, 0.1, 0.2, -0.3]);
        let query = Query {
            robot: &robot,
            balls: &[],
            start,
            target: robot.tip(&bent),
        };
        for planner in [Anytime::RrtStar, Anytime::BitStar] {
            let begun = Instant::now();
            let path = planner.attempt(&query, &mut Pcg64::new(1, 1)).unwrap();
            assert!(begun.elapsed() >= BUDGET);
            let until = [Instant::now(); 2];
            let attempt = Attempt::new(&query, until, &mut Pcg64::new(1, 1)).unwrap();
            let edges = path.windows(2).map(|w| attempt.tip_length(&w[0], &w[1]));
            let direct = attempt.goals.iter();
            let direct = direct.map(|goal| attempt.tip_length(&start, goal));
            let direct = direct.fold(f64::INFINITY, f64::min);
            let (found, least) = (edges.sum::<f64>(), attempt.least_to_go(&robot.tip(&start)));
            assert!(found < direct && found >= least, "{least} {found} {direct}");
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
