//! RRT-Connect (Kuffner & LaValle 2000) in configuration space on certified edges, with several goals at once.
//!
//! It departs from the paper in that every edge is certified for the whole body and the whole motion instead of
//! being sampled, in that the second tree is rooted in all goal configurations, and in that distances weigh the bending of a section
//! by how much of the body it moves (decision 0012).

use crate::search::edges::{RrtSettings, Search};
use crate::search::random_configuration::random_configuration;
use crate::search::tree::{Extension, Tree};
use collision::Scene;
use pcc_model::{Configuration, UnitRobot};
use rand_pcg::Pcg64;

/// Samples between two questions whether to go on.
const INTERRUPT_EVERY: usize = 16;

impl Search<'_> {
    /// Grows both trees in turn until they meet; the polyline from a root of the first to a root of the second.
    ///
    /// Takes what it needs from the `samples` that are left. May be called again with the same trees after an even number of samples.
    pub(super) fn grow(
        &self,
        trees: &mut [Tree; 2],
        samples: &mut usize,
        rng: &mut Pcg64,
    ) -> Option<Vec<Configuration>> {
        for round in 0..*samples {
            if round.is_multiple_of(INTERRUPT_EVERY) && (self.interrupt)() {
                return None;
            }
            *samples -= 1;
            let sample = random_configuration(self.robot, rng);
            let (active, other) = (round % 2, 1 - round % 2);
            let from = trees[active].nearest(&sample);
            let (Extension::Reached(leaf) | Extension::Advanced(leaf)) =
                trees[active].extend(self, from, &sample)
            else {
                continue;
            };
            let meeting = trees[active].at(leaf);
            if let Some(other_leaf) = trees[other].connect(self, &meeting) {
                let leaves = if active == 0 {
                    [leaf, other_leaf]
                } else {
                    [other_leaf, leaf]
                };
                return Some(join(trees, leaves));
            }
        }
        None
    }

    /// A polyline from `start` to one of `goals`, shortened, or nothing within the budget.
    pub(crate) fn connect(
        &self,
        start: &Configuration,
        goals: &[Configuration],
        rng: &mut Pcg64,
    ) -> Option<Vec<Configuration>> {
        let direct = goals.iter().find(|goal| self.edge_is_free(start, goal));
        let path = match direct {
            Some(direct) => vec![*start, *direct],
            None => {
                let mut trees = [Tree::rooted(&[*start]), Tree::rooted(goals)];
                let mut samples = self.settings.samples;
                self.grow(&mut trees, &mut samples, rng)?
            }
        };
        Some(self.shorten(path, rng))
    }
}

fn join(trees: &[Tree; 2], leaves: [usize; 2]) -> Vec<Configuration> {
    let mut path = trees[0].path_to(leaves[0]);
    path.extend(trees[1].branch(leaves[1]).into_iter().skip(1));
    path
}

/// Finds a certified polyline (radians) from `start` to one of `goals`, shortened, or nothing within the budget.
///
/// `interrupt` is asked every 16 samples and returns true to give up.
#[must_use]
pub fn rrt_connect(
    robot: &UnitRobot,
    scene: &Scene,
    start: &Configuration,
    goals: &[Configuration],
    settings: &RrtSettings,
    rng: &mut Pcg64,
    interrupt: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Configuration>> {
    if goals.is_empty() {
        return None;
    }
    let search = Search {
        robot,
        scene,
        settings,
        interrupt,
    };
    search.connect(start, goals, rng)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use collision::Ball;
    use rand::SeedableRng;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_search_in_vain_gives_up_when_it_is_interrupted() {
        let robot = unit_robot();
        let goal = Configuration::from_column_slice(&[0.0, 0.8, 0.0, 0.8, 0.0, 0.0]);
        let ball = Ball {
            centre: robot.tip(&goal),
            radius: 0.3,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let asked = AtomicUsize::new(0);
        let interrupt = || asked.fetch_add(1, Ordering::Relaxed) == 3;
        let settings = RrtSettings::default();
        let start = Configuration::zeros();
        let mut rng = Pcg64::seed_from_u64(1);
        let found = rrt_connect(
            &robot,
            &scene,
            &start,
            &[goal],
            &settings,
            &mut rng,
            &interrupt,
        );
        assert!(found.is_none());
        assert_eq!(asked.into_inner(), 4, "it would have asked 188 times");
    }
}
