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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use collision::{Scene, certify_edge};
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
}
