//! Trees of configurations that certified edges join to roots.

use crate::search::edges::Search;
use crate::search::nearest_neighbours::Neighbours;
use pcc_model::{Configuration, SECTIONS};

/// Weight of each section's bending in a distance: the nearer to the base, the more of the body moves. Chosen with the unit robot.
const WEIGHTS: [f64; SECTIONS] = [1.8, 1.0, 0.3];
/// Longest edge, rad: the norm of the sections' bendings times [`WEIGHTS`].
const STEP_RAD: f64 = 0.6;

/// A configuration that is reached from another one.
struct Node {
    configuration: Configuration,
    parent: Option<usize>,
}

/// Configurations that certified edges join to roots.
#[derive(Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// The configurations of the nodes, weighted.
    weighted: Neighbours,
}

/// A configuration, or a difference of two, scaled so that its norm is the distance between them.
fn weighted(configuration: &Configuration) -> Configuration {
    Configuration::from_fn(|i, _| configuration[i] * WEIGHTS[i / 2])
}

/// How far a step towards a configuration came.
pub(super) enum Extension {
    Reached(usize),
    Advanced(usize),
    Trapped,
}

impl Tree {
    pub(super) fn rooted(configurations: &[Configuration]) -> Self {
        let root = |configuration: &Configuration| Node {
            configuration: *configuration,
            parent: None,
        };
        let mut tree = Self::default();
        for node in configurations.iter().map(root) {
            tree.push(node);
        }
        tree
    }

    /// The configuration of a node.
    pub(crate) fn at(&self, node: usize) -> Configuration {
        self.nodes[node].configuration
    }

    fn push(&mut self, node: Node) {
        self.weighted.push(&weighted(&node.configuration));
        self.nodes.push(node);
    }

    /// The node nearest to a configuration.
    pub(crate) fn nearest(&self, configuration: &Configuration) -> usize {
        self.weighted.nearest(&weighted(configuration))
    }

    /// Adds the configuration at the end of an edge from a node, if that is free; its node.
    pub(crate) fn add(
        &mut self,
        search: &Search,
        from: usize,
        configuration: &Configuration,
    ) -> Option<usize> {
        if !search.edge_is_free(&self.nodes[from].configuration, configuration) {
            return None;
        }
        self.push(Node {
            configuration: *configuration,
            parent: Some(from),
        });
        Some(self.nodes.len() - 1)
    }

    /// Steps from a node towards a configuration, as far as an edge may be long.
    pub(crate) fn extend(
        &mut self,
        search: &Search,
        from: usize,
        target: &Configuration,
    ) -> Extension {
        let configuration = self.nodes[from].configuration;
        let distance = weighted(&(target - configuration)).norm();
        let reached = distance <= STEP_RAD;
        let next = if reached {
            *target
        } else {
            configuration.lerp(target, STEP_RAD / distance)
        };
        match self.add(search, from, &next) {
            Some(node) if reached => Extension::Reached(node),
            Some(node) => Extension::Advanced(node),
            None => Extension::Trapped,
        }
    }

    /// Steps from the nearest configuration to the target; the target's node, if it is reached.
    pub(crate) fn connect(&mut self, search: &Search, target: &Configuration) -> Option<usize> {
        let mut from = self.nearest(target);
        loop {
            match self.extend(search, from, target) {
                Extension::Reached(index) => return Some(index),
                Extension::Advanced(index) => from = index,
                Extension::Trapped => return None,
            }
        }
    }

    /// The configurations from a root to a node.
    pub(super) fn path_to(&self, node: usize) -> Vec<Configuration> {
        let mut path = self.branch(node);
        path.reverse();
        path
    }

    /// The configurations from a node to its root.
    pub(super) fn branch(&self, leaf: usize) -> Vec<Configuration> {
        std::iter::successors(Some(leaf), |&i| self.nodes[i].parent)
            .map(|i| self.nodes[i].configuration)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{search, unit_robot};
    use crate::search::edges::RrtSettings;
    use collision::Scene;

    #[test]
    fn bending_near_the_base_is_farther_and_edges_are_as_long_as_is_allowed() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let [base, tip] = [0, 4].map(|axis| Configuration::ith(axis, 1.0));
        let mut tree = Tree::rooted(&[base, tip]);
        assert_eq!(tree.nearest(&Configuration::zeros()), 1);
        let node = tree.connect(&search, &-base).unwrap();
        let steps = tree.path_to(node);
        assert_eq!(steps[0], tip);
        let lengths = steps.windows(2).map(|s| weighted(&(s[1] - s[0])).norm());
        let longest = lengths.fold(0.0, f64::max);
        assert!((longest - STEP_RAD).abs() < 1e-12, "{longest}");
        assert!(steps.len() > 3);
    }
}
