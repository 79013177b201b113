//! A tree of configurations with the lengths of the tip's paths along its branches.

use pcc_model::Configuration;

/// A tree that begins in its first node.
pub(super) struct Tree {
    pub(super) nodes: Vec<Configuration>,
    parents: Vec<Option<usize>>,
    /// Length of the tip's path from each node's parent, section lengths.
    edges: Vec<f64>,
}

impl Tree {
    pub(super) fn rooted(root: Configuration) -> Self {
        Self {
            nodes: vec![root],
            parents: vec![None],
            edges: vec![0.0],
        }
    }

    /// Adds a node behind an edge of this length; returns its place.
    pub(super) fn push(&mut self, node: Configuration, parent: usize, edge: f64) -> usize {
        self.nodes.push(node);
        self.parents.push(Some(parent));
        self.edges.push(edge);
        self.nodes.len() - 1
    }

    /// Puts a node behind another parent, which must not come after it.
    pub(super) fn rewire(&mut self, node: usize, parent: usize, edge: f64) {
        self.parents[node] = Some(parent);
        self.edges[node] = edge;
    }

    /// A node and its ancestors.
    fn branch(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(node), |node| self.parents[*node])
    }

    /// Length of the tip's path from the root to a node, section lengths.
    pub(super) fn cost(&self, node: usize) -> f64 {
        self.branch(node).map(|node| self.edges[node]).sum()
    }

    /// Length of the shortest tip path to one of some nodes, section lengths; infinite where there is none.
    pub(super) fn shortest(&self, nodes: &[Option<usize>]) -> f64 {
        let costs = nodes.iter().flatten().map(|node| self.cost(*node));
        costs.fold(f64::INFINITY, f64::min)
    }

    /// The configurations from the root to the one of some nodes to which the tip's path is shortest.
    pub(super) fn shortest_path(&self, nodes: &[Option<usize>]) -> Option<Vec<Configuration>> {
        let nodes = nodes.iter().flatten();
        let nearest = nodes.min_by(|a, b| self.cost(**a).total_cmp(&self.cost(**b)))?;
        Some(self.path_to(*nearest))
    }

    /// The configurations from the root to a node.
    fn path_to(&self, node: usize) -> Vec<Configuration> {
        let mut path: Vec<_> = self.branch(node).map(|node| self.nodes[node]).collect();
        path.reverse();
        path
    }
}
