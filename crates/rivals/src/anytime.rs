//! Planners that go on after their first path, for short tip paths, until their time is over: RRT* and BIT* on certified edges, towards
//! several goal configurations at once. The paper does not have them; they are what an expert would put beside it.

mod attempt;
mod bit_star;
mod informed;
mod rrt_star;
mod tree;

use self::attempt::Attempt;
use crate::query::Query;
use pcc_model::{Configuration, SECTIONS};
use rand_pcg::Pcg64;
use std::time::{Duration, Instant};

/// Time of an attempt.
const BUDGET: Duration = Duration::from_millis(50);
/// Room around the tubes that is tried in turn, section lengths, as by RRT-Connect: rounding corners needs some. Each has an equal part of
/// the time for a first path; the one that finds it has all that is left.
const MARGINS: [f64; 3] = [0.04, 0.01, 0.0];

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
    ///
    /// It takes 50 ms; more where goal configurations with smaller margins are not found until then, and less where there are none. Its parallel parts go to the pool of the thread, which is to have no other work
    /// meanwhile.
    pub fn attempt(self, query: &Query, rng: &mut Pcg64) -> Option<Vec<Configuration>> {
        let begun = Instant::now();
        self.search(query, rng, &|share| {
            begun.elapsed() >= BUDGET.mul_f64(share)
        })
    }

    /// One attempt. `is_over` says whether a share of its time is over: each margin has an equal part for a first path, and with one all of it.
    fn search(
        self,
        query: &Query,
        rng: &mut Pcg64,
        is_over: &dyn Fn(f64) -> bool,
    ) -> Option<Vec<Configuration>> {
        let parts = (1..).map(f64::from).zip(MARGINS);
        let mut paths = parts.map(|(part, margin)| {
            let robot = query.robot.with_tube_padding(&[margin; SECTIONS]);
            let query = Query {
                robot: &robot,
                ..*query
            };
            let share = part / MARGINS.len() as f64;
            let is_over = |has_path| is_over(if has_path { 1.0 } else { share });
            let attempt = Attempt::new(&query, &is_over, rng)?;
            match self {
                Self::RrtStar => rrt_star::path(&attempt, rng),
                Self::BitStar => bit_star::path(attempt, rng),
            }
        });
        paths.find_map(|path| path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use collision::{Scene, certify_edge};
    use datasets::scenes::reference_layout;
    use pcc_model::UnitRobot;
    use std::cell::Cell;

    /// Looks at the clock after which a test's attempt is over.
    const LOOKS: f64 = 4000.0;

    /// A path by as much work on every machine.
    fn found(planner: Anytime, query: &Query, seed: u128) -> Vec<Configuration> {
        let looks = Cell::new(0.0);
        let is_over = |share: f64| {
            looks.set(looks.get() + 1.0);
            looks.get() > LOOKS * share
        };
        let path = planner.search(query, &mut Pcg64::new(seed, 1), &is_over);
        path.unwrap()
    }

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
                let path = found(planner, &query, seed);
                assert_eq!(path[0], start);
                let end = robot.tip(&path[path.len() - 1]);
                assert!((end - query.target).norm() < 1e-3, "{end}");
                let is_free =
                    |w: &[Configuration]| certify_edge(&robot, &scene, &w[0], &w[1], 7).is_free();
                assert!(path.windows(2).all(is_free));
            }
        }
    }

    /// A query without balls.
    fn free_query(robot: &UnitRobot) -> Query<'_> {
        let bent = Configuration::from([0.5, -0.2, 0.3, 0.1, 0.2, -0.3]);
        Query {
            robot,
            balls: &[],
            start: Configuration::from([-0.5, 0.2, -0.3, -0.1, -0.2, 0.3]),
            target: robot.tip(&bent),
        }
    }

    #[test]
    fn an_attempt_takes_its_time() {
        let robot = unit_robot();
        for planner in [Anytime::RrtStar, Anytime::BitStar] {
            let begun = Instant::now();
            planner.attempt(&free_query(&robot), &mut Pcg64::new(1, 1));
            assert!(begun.elapsed() >= BUDGET);
        }
    }

    #[test]
    fn a_path_becomes_shorter_than_the_direct_one() {
        let robot = unit_robot();
        let query = free_query(&robot);
        let start = query.start;
        for planner in [Anytime::RrtStar, Anytime::BitStar] {
            let path = found(planner, &query, 1);
            let attempt = Attempt::new(&query, &|_| true, &mut Pcg64::new(1, 1)).unwrap();
            let edges = path.windows(2).map(|w| attempt.tip_length(&w[0], &w[1]));
            let direct = attempt.goals.iter();
            let direct = direct.map(|goal| attempt.tip_length(&start, goal));
            let direct = direct.fold(f64::INFINITY, f64::min);
            let (found, least) = (edges.sum::<f64>(), attempt.least_to_go(&robot.tip(&start)));
            assert!(found < direct && found >= least, "{least} {found} {direct}");
        }
    }
}
