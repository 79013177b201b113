//! RRT and RRT* as the paper's comparison has them: nodes alone are looked at, costs are tip lengths.

use crate::query::Query;
use crate::tip_spacing::equally_spaced;
use datasets::reference::{LARGEST_STEP, Surroundings, random_workspace_point};
use pcc_model::{Configuration, Point};
use planning::{Waypoints, random_configuration};
use rand::RngExt;
use rand_pcg::Pcg64;

/// Nodes that are tried.
const ITERATIONS: usize = 100;
/// Share of the samples that are the goal.
const GOAL_BIAS: f64 = 0.1;
/// Length of an edge: rad in configuration space, section lengths on tip positions.
const STEP: f64 = 0.2;
/// Distance within which RRT* looks for parents, in the same units.
const REWIRE_RADIUS: f64 = 0.3;
/// Distance from the target within which a tip has reached it, section lengths.
const GOAL_TOLERANCE: f64 = 0.1;

/// What is sampled, and what nodes are near by.
#[derive(Clone, Copy)]
pub(crate) enum Space {
    /// Configurations, towards one of the goal's.
    Configuration { goal: Configuration },
    /// Tip positions; each node's configuration is solved for from its parent's.
    Tip,
}

/// When a tree is finished.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Growth {
    /// At the first node in the goal: RRT.
    First,
    /// After all iterations; parents are chosen, and changed, for short tip paths: RRT*.
    Shortest,
}

#[derive(Clone, Copy)]
struct Node {
    configuration: Configuration,
    tip: Point,
    parent: Option<usize>,
}

/// A sample that a tree is to grow towards.
enum Sample {
    Configuration(Configuration),
    Tip(Point),
}

struct Tree<'a> {
    query: &'a Query<'a>,
    place: &'a Surroundings<'a>,
    space: Space,
    nodes: Vec<Node>,
}

/// Grows a tree from the start; the path to its first, or nearest by tip length, node in the goal.
pub(crate) fn grow(
    query: &Query,
    place: &Surroundings,
    space: Space,
    growth: Growth,
    rng: &mut Pcg64,
) -> Option<Waypoints> {
    let tree = Tree::grown(query, place, space, growth, rng);
    let in_goal = (0..tree.nodes.len()).filter(|&i| tree.is_in_goal(&tree.nodes[i]));
    let nearest = in_goal.min_by(|&a, &b| tree.tip_length(a).total_cmp(&tree.tip_length(b)))?;
    Some(equally_spaced(query.robot, &tree.path_to(nearest)))
}

impl<'a> Tree<'a> {
    fn grown(
        query: &'a Query<'a>,
        place: &'a Surroundings<'a>,
        space: Space,
        growth: Growth,
        rng: &mut Pcg64,
    ) -> Self {
        let root = Node {
            configuration: query.start,
            tip: query.robot.tip(&query.start),
            parent: None,
        };
        let mut tree = Self {
            query,
            place,
            space,
            nodes: vec![root],
        };
        for _ in 0..ITERATIONS {
            let sample = tree.sample(rng);
            let Some(node) = tree.extension(&sample) else {
                continue;
            };
            let node = match growth {
                Growth::First => node,
                Growth::Shortest => tree.with_best_parent(node),
            };
            tree.nodes.push(node);
            match growth {
                Growth::First if tree.is_in_goal(&node) => break,
                Growth::First => {}
                Growth::Shortest => tree.rewire_to_last(),
            }
        }
        tree
    }

    fn sample(&self, rng: &mut Pcg64) -> Sample {
        let is_goal = rng.random::<f64>() < GOAL_BIAS;
        match self.space {
            Space::Configuration { goal } if is_goal => Sample::Configuration(goal),
            Space::Configuration { .. } => {
                Sample::Configuration(random_configuration(self.query.robot, rng))
            }
            Space::Tip if is_goal => Sample::Tip(self.query.target),
            Space::Tip => Sample::Tip(random_workspace_point(rng)),
        }
    }

    /// A clear node one step from the nearest one towards a sample; none where it is not clear, cannot be solved for or bends too far away.
    fn extension(&self, sample: &Sample) -> Option<Node> {
        let parent = self.nearest(sample);
        let from = &self.nodes[parent];
        let configuration = match sample {
            Sample::Configuration(wanted) => {
                let way = wanted - from.configuration;
                from.configuration + way * (STEP / way.norm().max(STEP))
            }
            Sample::Tip(wanted) => {
                let way = wanted - from.tip;
                let point = from.tip + way * (STEP / way.norm().max(STEP));
                self.place.reach(&point, &from.configuration)?
            }
        };
        let node = Node {
            configuration,
            tip: self.query.robot.tip(&configuration),
            parent: Some(parent),
        };
        let is_free = joins(from, &node) && self.place.clearance(&configuration) >= 0.0;
        is_free.then_some(node)
    }

    fn nearest(&self, sample: &Sample) -> usize {
        let distance = |node: &Node| match sample {
            Sample::Configuration(wanted) => (wanted - node.configuration).norm_squared(),
            Sample::Tip(wanted) => (wanted - node.tip).norm_squared(),
        };
        let distances = self.nodes.iter().map(distance).enumerate();
        distances
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |nearest| nearest.0)
    }

    /// Distance by which nodes are near, in the units of the space.
    fn distance(&self, a: &Node, b: &Node) -> f64 {
        match self.space {
            Space::Configuration { .. } => (a.configuration - b.configuration).norm(),
            Space::Tip => (a.tip - b.tip).norm(),
        }
    }

    /// Nodes near another one that an edge may join to it.
    fn near(&self, node: &Node) -> Vec<usize> {
        let is_near = |&i: &usize| {
            let other = &self.nodes[i];
            self.distance(other, node) <= REWIRE_RADIUS && joins(other, node)
        };
        (0..self.nodes.len()).filter(is_near).collect()
    }

    /// The node with the parent through which the tip comes to it on the shortest path.
    fn with_best_parent(&self, node: Node) -> Node {
        let through =
            |parent: &usize| self.tip_length(*parent) + tip_step(&self.nodes[*parent], &node);
        let own = node.parent.into_iter();
        let parents = own.chain(self.near(&node));
        let parent = parents.min_by(|a, b| through(a).total_cmp(&through(b)));
        Node { parent, ..node }
    }

    /// Makes the last node the parent of those near it to which the tip comes on a shorter path then.
    fn rewire_to_last(&mut self) {
        let last = self.nodes.len() - 1;
        let node = self.nodes[last];
        let length = self.tip_length(last);
        for near in self.near(&node) {
            if length + tip_step(&node, &self.nodes[near]) < self.tip_length(near) {
                self.nodes[near].parent = Some(last);
            }
        }
    }

    fn is_in_goal(&self, node: &Node) -> bool {
        (node.tip - self.query.target).norm() <= GOAL_TOLERANCE
    }

    /// A node and its ancestors.
    fn branch(&self, node: usize) -> impl Iterator<Item = &Node> {
        std::iter::successors(Some(&self.nodes[node]), |node| {
            node.parent.map(|parent| &self.nodes[parent])
        })
    }

    /// Length of the tip's path from the root to a node, section lengths.
    fn tip_length(&self, node: usize) -> f64 {
        let steps = self.branch(node).zip(self.branch(node).skip(1));
        steps.map(|(node, parent)| tip_step(node, parent)).sum()
    }

    fn path_to(&self, node: usize) -> Vec<Configuration> {
        let mut path: Vec<_> = self.branch(node).map(|node| node.configuration).collect();
        path.reverse();
        path
    }
}

/// Whether an edge may join two nodes: neighbouring waypoints may be that far from each other.
fn joins(a: &Node, b: &Node) -> bool {
    (a.configuration - b.configuration).norm() <= LARGEST_STEP
}

fn tip_step(a: &Node, b: &Node) -> f64 {
    (a.tip - b.tip).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use datasets::scenes::reference_layout;

    /// Trees of both kinds from the same samples among two balls: the edges that they may have, and shorter tip paths by rewiring.
    #[test]
    fn edges_are_short_nodes_clear_and_rewired_paths_shorter() {
        let robot = unit_robot();
        let balls = reference_layout(2);
        let start = Configuration::zeros();
        let bent = Configuration::from([0.5, 0.2, 0.3, -0.1, 0.2, 0.3]);
        let query = Query {
            robot: &robot,
            balls: &balls,
            start,
            target: robot.tip(&bent),
        };
        let place = Surroundings::new(&robot, &balls);
        let (mut found, mut lengths) = ([0; 2], [0.0; 2]);
        for seed in 0..20 {
            for (i, growth) in [Growth::First, Growth::Shortest].into_iter().enumerate() {
                let rng = || Pcg64::new(seed, 1);
                let tree = Tree::grown(&query, &place, Space::Tip, growth, &mut rng());
                assert!(tree.nodes.iter().all(|node| {
                    let is_joined = |parent: usize| joins(&tree.nodes[parent], node);
                    place.clearance(&node.configuration) >= 0.0 && node.parent.is_none_or(is_joined)
                }));
                let Some(path) = grow(&query, &place, Space::Tip, growth, &mut rng()) else {
                    continue;
                };
                let tips = robot.tips(&path);
                found[i] += 1;
                lengths[i] += tips.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
                assert_eq!(path[0], start);
                assert!((tips[tips.len() - 1] - query.target).norm() <= GOAL_TOLERANCE);
                assert!(
                    path.windows(2)
                        .all(|w| (w[1] - w[0]).norm() <= LARGEST_STEP)
                );
            }
        }
        assert!(found[0] >= 15 && found[0] == found[1], "{found:?}");
        assert!(lengths[1] < lengths[0], "{lengths:?}");
    }
}
