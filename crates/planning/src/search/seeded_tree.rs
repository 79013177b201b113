//! Paths to further goal configurations, found from the motions that a request has already.
//!
//! RRT-Connect (Kuffner & LaValle 2000) whose first tree begins as these motions: where paths from the start are hard to
//! find, most of one that is known serves for another goal configuration as well.

use crate::search::edges::Search;
use crate::search::tree::Tree;
use pcc_model::Configuration;
use rand_pcg::Pcg64;

/// Step between the waypoints of a path that become nodes.
const STRIDE: usize = 4;

/// A tree that begins with the paths of known motions, and the search that extends it.
pub(crate) struct SeededTree<'a> {
    pub(crate) search: Search<'a>,
    tree: Tree,
    /// Samples that are left for all searches of this tree together.
    samples: usize,
}

impl<'a> SeededTree<'a> {
    /// A tree of the start alone.
    pub(crate) fn from(start: &Configuration, search: Search<'a>) -> Self {
        Self {
            samples: search.settings.samples,
            search,
            tree: Tree::rooted(&[*start]),
        }
    }

    /// Adds a path from the start (64 waypoints, radians), as far as its chords certify.
    pub(crate) fn add(&mut self, path: &[Configuration]) {
        let last = path.len() - 1;
        let mut node = Some(0);
        for h in (STRIDE..last).step_by(STRIDE).chain([last]) {
            node = node.and_then(|node| self.tree.add(&self.search, node, &path[h]));
        }
    }

    /// A polyline from the start to a goal configuration, shortened; none where it was interrupted before.
    pub(crate) fn reach(
        &mut self,
        goal: &Configuration,
        rng: &mut Pcg64,
    ) -> Option<Vec<Configuration>> {
        if (self.search.interrupt)() {
            return None;
        }
        let polyline = match self.tree.connect(&self.search, goal) {
            Some(node) => self.tree.path_to(node),
            None => self.grow_to(goal, rng)?,
        };
        Some(self.search.shorten(polyline, rng))
    }

    fn grow_to(&mut self, goal: &Configuration, rng: &mut Pcg64) -> Option<Vec<Configuration>> {
        let known = std::mem::take(&mut self.tree);
        let mut trees = [known, Tree::rooted(&[*goal])];
        let found = self.search.grow(&mut trees, &mut self.samples, rng);
        let [known, _] = trees;
        self.tree = known;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::path::waypoints::straight_path;
    use crate::search::edges::RrtSettings;
    use collision::{Ball, Scene};
    use pcc_model::Point;
    use rand::SeedableRng;

    fn scene() -> Scene {
        let ball = Ball {
            centre: Point::new(0.0, 0.0, 2.9),
            radius: 0.25,
        };
        Scene::new(vec![ball]).unwrap()
    }

    #[test]
    fn a_goal_beside_a_known_motion_is_reached_without_a_sample() {
        let (robot, scene) = (unit_robot(), scene());
        let settings = RrtSettings {
            samples: 0,
            ..RrtSettings::default()
        };
        let search = || Search {
            robot: &robot,
            scene: &scene,
            settings: &settings,
            interrupt: &|| false,
        };
        let bent = |x: f64, y: f64| Configuration::from_column_slice(&[x, y, x, y, x, y]);
        let (start, above, goal) = (bent(-0.5, 0.0), bent(0.0, 0.5), bent(0.5, 0.0));
        let mut rng = Pcg64::seed_from_u64(1);
        let mut tree = SeededTree::from(&start, search());
        assert_eq!(tree.reach(&goal, &mut rng), None, "the ball is in between");
        let mut path = straight_path(&start, &above);
        path.extend(straight_path(&above, &bent(0.4, 0.1)).into_iter().skip(1));
        tree.add(&path);
        let found = tree.reach(&goal, &mut rng).unwrap();
        assert_eq!([found[0], found[found.len() - 1]], [start, goal]);
        assert!(
            found
                .windows(2)
                .all(|w| search().edge_is_free(&w[0], &w[1]))
        );
    }

    #[test]
    fn what_one_goal_takes_of_the_samples_is_not_there_for_the_next() {
        let (robot, settings) = (unit_robot(), RrtSettings::default());
        let around = Ball {
            centre: Point::new(0.0, 0.0, 2.9),
            radius: 0.25,
        };
        let wall = |angle: f64| Ball {
            centre: Point::new(1.2 * angle.cos(), 1.2 * angle.sin(), 2.0),
            radius: 0.35,
        };
        let walls = (0..12).map(|i| wall(f64::from(i) * std::f64::consts::TAU / 12.0));
        let scene = Scene::new(walls.chain([around]).collect()).unwrap();
        let search = Search {
            robot: &robot,
            scene: &scene,
            settings: &settings,
            interrupt: &|| false,
        };
        let mut tree = SeededTree::from(&Configuration::zeros(), search);
        let goal = Configuration::from_column_slice(&[1.2, 0.0, 0.3, 0.0, 0.0, 0.0]);
        let mut rng = Pcg64::seed_from_u64(1);
        assert_eq!(tree.reach(&goal, &mut rng), None, "walled in");
        assert_eq!(tree.samples, 0);
    }
}
