//! BIT* (Gammell, Srinivasa and Barfoot, 2015): batches of samples, and edges between them in the order of the path that they may lead to.

use super::attempt::{Attempt, nearest, neighbours};
use super::tree::Tree;
use pcc_model::{Configuration, Point};
use rand_pcg::Pcg64;
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};

/// Samples of a batch.
const BATCH: usize = 100;
/// In place of the start's sample.
const START: usize = usize::MAX;

/// What waits in a queue, the shortest path that it may lead to first.
struct Waiting<T> {
    /// Lower bound of that path's length with the tree as it was, section lengths.
    least: f64,
    what: T,
}

impl<T> Ord for Waiting<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        other.least.total_cmp(&self.least)
    }
}

impl<T> PartialOrd for Waiting<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> PartialEq for Waiting<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<T> Eq for Waiting<T> {}

/// An edge that may be made: from a node of the tree to a sample.
struct Edge {
    from: usize,
    to: usize,
}

struct BitStar<'a> {
    attempt: Attempt<'a>,
    tree: Tree,
    /// The goal configurations, then what was drawn.
    samples: Vec<Configuration>,
    tips: Vec<Point>,
    /// The node of the tree that a sample has become.
    node_of: Vec<Option<usize>>,
    /// The samples through which a path may be shorter than the shortest one known.
    useful: Vec<usize>,
    /// The two samples of each edge that is not free, the lower one first.
    refused: HashSet<[usize; 2]>,
    /// The sample that each of the tree's nodes was.
    sample_of: Vec<usize>,
    /// The tip positions of the tree's nodes.
    node_tips: Vec<Point>,
    nodes: BinaryHeap<Waiting<usize>>,
    edges: BinaryHeap<Waiting<Edge>>,
}

/// The path of the shortest tip path to a goal configuration that is found in time.
pub(super) fn path(attempt: Attempt, rng: &mut Pcg64) -> Option<Vec<Configuration>> {
    let mut search = BitStar {
        tree: Tree::rooted(attempt.query.start),
        samples: Vec::new(),
        tips: Vec::new(),
        node_of: Vec::new(),
        useful: Vec::new(),
        refused: HashSet::new(),
        sample_of: vec![START],
        node_tips: vec![attempt.tip(&attempt.query.start)],
        nodes: BinaryHeap::new(),
        edges: BinaryHeap::new(),
        attempt,
    };
    for goal in search.attempt.goals.clone() {
        search.add(goal);
    }
    while !search.attempt.is_over(search.shortest()) {
        if search.nodes.is_empty() && search.edges.is_empty() {
            search.begin_batch(rng);
        }
        search.step();
    }
    search.tree.shortest_path(search.goal_nodes())
}

impl BitStar<'_> {
    fn add(&mut self, sample: Configuration) {
        self.tips.push(self.attempt.tip(&sample));
        self.useful.push(self.samples.len());
        self.samples.push(sample);
        self.node_of.push(None);
    }

    /// The nodes that the goal configurations have become.
    fn goal_nodes(&self) -> &[Option<usize>] {
        &self.node_of[..self.attempt.goals.len()]
    }

    /// Length of the shortest tip path known, section lengths; infinite where none is.
    fn shortest(&self) -> f64 {
        self.tree.shortest(self.goal_nodes())
    }

    /// Leaves samples out that can be on no shorter path, draws more that may, and lets every node of the tree look at its neighbours.
    fn begin_batch(&mut self, rng: &mut Pcg64) {
        let shortest = self.shortest();
        let start = self.node_tips[0];
        let least = |tip: &Point| (tip - start).norm() + self.attempt.least_to_go(tip);
        self.useful
            .retain(|sample| least(&self.tips[*sample]) < shortest);
        for _ in 0..BATCH {
            if self.attempt.is_over(shortest) {
                break;
            }
            let drawn = self.attempt.sample(shortest, &self.tree.nodes, rng);
            drawn.into_iter().for_each(|sample| self.add(sample));
        }
        for node in 0..self.tree.nodes.len() {
            self.wait(node);
        }
    }

    /// Puts a node of the tree into the queue of those that look at their neighbours.
    fn wait(&mut self, node: usize) {
        let least = self.tree.cost(node) + self.attempt.least_to_go(&self.node_tips[node]);
        self.nodes.push(Waiting { least, what: node });
    }

    /// Lets the first node look at its neighbours, or makes the first edge, whichever may lead to the shorter path.
    fn step(&mut self) {
        let least = |first: Option<f64>| first.unwrap_or(f64::INFINITY);
        let of_nodes = least(self.nodes.peek().map(|it| it.least));
        let of_edges = least(self.edges.peek().map(|it| it.least));
        if of_nodes.min(of_edges) >= self.shortest() {
            self.nodes.clear();
            self.edges.clear();
        } else if of_nodes <= of_edges {
            if let Some(node) = self.nodes.pop() {
                self.look_around(node.what);
            }
        } else if let Some(edge) = self.edges.pop() {
            self.make(&edge.what);
        }
    }

    /// Puts the edges from a node to its neighbours that may lead to a shorter path into the queue.
    fn look_around(&mut self, node: usize) {
        let (shortest, cost) = (self.shortest(), self.tree.cost(node));
        let useful = self.useful.iter().map(|&it| (it, &self.samples[it]));
        let count = neighbours(self.useful.len());
        for to in nearest(&self.tree.nodes[node], useful, count) {
            let step = (self.tips[to] - self.node_tips[node]).norm();
            let least = cost + step + self.attempt.least_to_go(&self.tips[to]);
            let is_shorter = |other: usize| cost + step < self.tree.cost(other);
            let may_help = least < shortest && self.node_of[to].is_none_or(is_shorter);
            if may_help && !self.refused.contains(&self.ends(node, to)) {
                let what = Edge { from: node, to };
                self.edges.push(Waiting { least, what });
            }
        }
    }

    /// The samples at both ends of an edge, whichever way it leads.
    fn ends(&self, node: usize, sample: usize) -> [usize; 2] {
        let other = self.sample_of[node];
        [other.min(sample), other.max(sample)]
    }

    /// Makes an edge part of the tree if it is free and the tip's path to its end becomes shorter by it.
    fn make(&mut self, &Edge { from, to }: &Edge) {
        let (a, b) = (self.tree.nodes[from], self.samples[to]);
        let known = |search: &Self| search.node_of[to].map(|node| search.tree.cost(node));
        let least = self.tree.cost(from) + (self.tips[to] - self.node_tips[from]).norm();
        if known(self).is_some_and(|cost| least >= cost) {
            return;
        }
        let edge = self.attempt.tip_length(&a, &b);
        let cost = self.tree.cost(from) + edge;
        let is_better = cost + self.attempt.least_to_go(&self.tips[to]) < self.shortest()
            && known(self).is_none_or(|known| cost < known);
        if !is_better {
            return;
        }
        if !self.attempt.edge_is_free(&a, &b) {
            self.refused.insert(self.ends(from, to));
            return;
        }
        match self.node_of[to] {
            Some(node) => self.tree.rewire(node, from, edge),
            None => {
                let node = self.tree.push(b, from, edge);
                self.sample_of.push(to);
                self.node_tips.push(self.tips[to]);
                self.node_of[to] = Some(node);
                self.wait(node);
            }
        }
    }
}
