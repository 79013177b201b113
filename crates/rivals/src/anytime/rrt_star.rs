//! RRT* (Karaman and Frazzoli, 2011) with as many neighbours as it needs, and samples that may lie on a shorter path alone.

use super::attempt::{Attempt, nearest, neighbours};
use super::tree::Tree;
use pcc_model::Configuration;
use rand::RngExt;
use rand_pcg::Pcg64;

/// Share of the samples that are goal configurations.
const GOAL_BIAS: f64 = 0.1;
/// Longest edge, rad.
const LONGEST_EDGE: f64 = 1.5;

/// The path of the shortest tip path to a goal configuration that is found in time.
pub(super) fn path(attempt: &Attempt, rng: &mut Pcg64) -> Option<Vec<Configuration>> {
    let mut tree = Tree::rooted(attempt.query.start);
    let mut reached = vec![None; attempt.goals.len()];
    let mut shortest = f64::INFINITY;
    while !attempt.is_over(shortest) {
        let goal = rng.random_range(0..attempt.goals.len());
        let is_goal = rng.random::<f64>() < GOAL_BIAS && reached[goal].is_none();
        let sample = match is_goal {
            true => Some(attempt.goals[goal]),
            false => attempt.sample(shortest, &tree.nodes, rng),
        };
        let Some(node) = sample.and_then(|sample| grow(attempt, &mut tree, &sample)) else {
            continue;
        };
        if tree.nodes[node] == attempt.goals[goal] {
            reached[goal] = Some(node);
        }
        shortest = tree.shortest(&reached);
    }
    tree.shortest_path(&reached)
}

/// Adds a node towards a sample behind the parent of the shortest tip path, and puts its neighbours behind it where theirs become shorter.
fn grow(attempt: &Attempt, tree: &mut Tree, sample: &Configuration) -> Option<usize> {
    let nodes = || tree.nodes.iter().enumerate();
    let from = tree.nodes[*nearest(sample, nodes(), 1).first()?];
    let way = sample - from;
    let node = match way.norm() {
        length if length <= LONGEST_EDGE => *sample,
        length => from + way * (LONGEST_EDGE / length),
    };
    let near = nearest(&node, nodes(), neighbours(tree.nodes.len()));
    let mut parents: Vec<(f64, f64, usize)> = near
        .iter()
        .map(|&i| {
            let edge = attempt.tip_length(&tree.nodes[i], &node);
            (tree.cost(i) + edge, edge, i)
        })
        .collect();
    parents.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_free = |&(_, _, i): &(f64, f64, usize)| attempt.edge_is_free(&tree.nodes[i], &node);
    let (cost, edge, parent) = parents.iter().copied().find(is_free)?;
    let last = tree.push(node, parent, edge);
    for (_, edge, other) in parents.into_iter().filter(|it| it.2 != parent) {
        let is_shorter = cost + edge < tree.cost(other);
        if is_shorter && attempt.edge_is_free(&node, &tree.nodes[other]) {
            tree.rewire(other, last, edge);
        }
    }
    Some(last)
}
