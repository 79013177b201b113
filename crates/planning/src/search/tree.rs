//! Trees of configurations that certified edges join to roots.

use crate::search::edges::Search;
use crate::search::nearest_neighbours::Neighbours;
use pcc_model::{Configuration, SECTIONS};

/// Weight of each section's bending in a distance: the nearer to the base, the more of the body moves. Chosen with the unit robot.
const WEIGHTS: [f64; SECTIONS] = [1.8, 1.0, 0.3];
/// Longest edge, rad: the norm of the sections' bendings times [`WEIGHTS`].
const STEP_RAD: f64 = 0.6;

/// A shape that is reached from another one.
struct Node {
    shape: Configuration,
    parent: Option<usize>,
}

/// Shapes that certified edges join to roots.
#[derive(Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// The same, weighted.
    weighted: Neighbours,
}

/// A shape, or a difference of shapes, whose norm is the distance.
fn weighted(shape: &Configuration) -> Configuration {
    Configuration::from_fn(|i, _| shape[i] * WEIGHTS[i / 2])
}

/// How far a step towards a configuration came.
pub(crate) enum Extension {
    Reached(usize),
    Advanced(usize),
    Trapped,
}

impl Tree {
    pub(crate) fn rooted(shapes: &[Configuration]) -> Self {
        let root = |shape: &Configuration| Node {
            shape: *shape,
            parent: None,
        };
        let mut tree = Self::default();
        for node in shapes.iter().map(root) {
            tree.push(node);
        }
        tree
    }

    /// The configuration of a node.
    pub(crate) fn at(&self, node: usize) -> Configuration {
        self.nodes[node].shape
    }

    fn push(&mut self, node: Node) {
        self.weighted.push(&weighted(&node.shape));
        self.nodes.push(node);
    }

    /// The node nearest to a configuration.
    pub(crate) fn nearest(&self, shape: &Configuration) -> usize {
        self.weighted.nearest(&weighted(shape))
    }

    /// Adds the shape at the end of an edge from a node, if that is free; its node.
    pub(crate) fn add(
        &mut self,
        search: &Search,
        from: usize,
        shape: &Configuration,
    ) -> Option<usize> {
        if !search.edge_is_free(&self.nodes[from].shape, shape) {
            return None;
        }
        self.push(Node {
            shape: *shape,
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
        let shape = self.nodes[from].shape;
        let distance = weighted(&(target - shape)).norm();
        let reached = distance <= STEP_RAD;
        let next = if reached {
            *target
        } else {
            shape.lerp(target, STEP_RAD / distance)
        };
        match self.add(search, from, &next) {
            Some(node) if reached => Extension::Reached(node),
            Some(node) => Extension::Advanced(node),
            None => Extension::Trapped,
        }
    }

    /// Steps from the nearest shape to the target; the target's node, if it is reached.
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

    /// The shapes from a root to a node.
    pub(crate) fn path_to(&self, node: usize) -> Vec<Configuration> {
        let mut path = self.branch(node);
        path.reverse();
        path
    }

    /// The shapes from a node to its root.
    pub(crate) fn branch(&self, leaf: usize) -> Vec<Configuration> {
        std::iter::successors(Some(leaf), |&i| self.nodes[i].parent)
            .map(|i| self.nodes[i].shape)
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
