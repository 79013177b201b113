//! RRT-Connect (Kuffner & LaValle 2000) in configuration space on certified edges, with several goals at once.
//!
//! It departs from the paper in that every edge is certified for the whole body and the whole motion instead of
//! being sampled, in that the second tree is rooted in all goal shapes, and in that distances weigh the bending of a section
//! by how much of the body it moves (decision 0012).

use crate::neighbours::Neighbours;
use crate::random_configuration::random_configuration;
use crate::request::Interrupt;
use collision::{Scene, certify_edge};
use pcc_model::{Configuration, Robot, SECTIONS};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::ops::Range;

/// Bisection depth of an edge's certificate; undecided edges count as colliding.
const EDGE_DEPTH: u32 = 7;

/// Weight of each section's bending in a distance: the nearer to the base, the more of the body moves. Chosen with the unit robot.
const WEIGHTS: [f64; SECTIONS] = [1.8, 1.0, 0.3];
/// Rounds in which corners are rounded at most: each halves what is left of them.
const ROUNDINGS: usize = 5;
/// A corner that moves less than this is round, rad.
const ROUND_RAD: f64 = 1e-3;

/// Longest edge, rad: the norm of the sections' bendings times [`WEIGHTS`].
const STEP_RAD: f64 = 0.6;
/// Corners this near to each other are one, rad.
const DUPLICATE_RAD: f64 = 1e-9;

/// Samples between two questions whether to go on.
const INTERRUPT_EVERY: usize = 16;

/// Budgets of one search, all of them counts.
#[derive(Clone, Copy, Debug)]
pub struct RrtSettings {
    /// Random samples at most.
    pub samples: usize,
    /// Attempts to shorten the path found.
    pub shortcuts: usize,
}

impl Default for RrtSettings {
    fn default() -> Self {
        Self {
            samples: 3000,
            shortcuts: 120,
        }
    }
}

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

enum Extension {
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

    fn push(&mut self, node: Node) {
        self.weighted.push(&weighted(&node.shape));
        self.nodes.push(node);
    }

    fn nearest(&self, shape: &Configuration) -> usize {
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

    fn extend(&mut self, search: &Search, from: usize, target: &Configuration) -> Extension {
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
    fn branch(&self, leaf: usize) -> Vec<Configuration> {
        std::iter::successors(Some(leaf), |&i| self.nodes[i].parent)
            .map(|i| self.nodes[i].shape)
            .collect()
    }
}

/// What edges are certified for, and the budget.
pub(crate) struct Search<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) scene: &'a Scene,
    pub(crate) settings: &'a RrtSettings,
    pub(crate) interrupt: Interrupt<'a>,
}

impl Search<'_> {
    pub(crate) fn edge_is_free(&self, a: &Configuration, b: &Configuration) -> bool {
        certify_edge(self.robot, self.scene, a, b, EDGE_DEPTH).is_free()
    }

    /// Grows both trees in turn until they meet; the polyline from a root of the first to a root of the second.
    ///
    /// Takes what it needs from the `samples` that are left. May be called again with the same trees after an even number of samples.
    pub(crate) fn grow(
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
            let meeting = trees[active].nodes[leaf].shape;
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

    /// Rounds the corners of a certified polyline to a cubic B-spline where that is certified, too: every edge is halved, then
    /// every old corner moves towards the middle of its neighbours (as OMPL's `smoothBSpline`).
    pub(crate) fn round(&self, polyline: &[Configuration]) -> Vec<Configuration> {
        let mut path = polyline.to_vec();
        for _ in 0..ROUNDINGS {
            if (self.interrupt)() {
                break;
            }
            let mut finer = halved(&path);
            let corners = (2..finer.len() - 1).step_by(2);
            if corners
                .filter(|&corner| self.round_corner(&mut finer, corner))
                .count()
                == 0
            {
                break;
            }
            path = finer;
        }
        path
    }

    /// Whether a corner was moved.
    fn round_corner(&self, path: &mut [Configuration], corner: usize) -> bool {
        let [before, at, after] = [path[corner - 1], path[corner], path[corner + 1]];
        let inner = at * 0.5 + (before + after) * 0.25;
        let moves = (inner - at).norm() > ROUND_RAD
            && self.edge_is_free(&before, &inner)
            && self.edge_is_free(&inner, &after);
        if moves {
            path[corner] = inner;
        }
        moves
    }

    /// Replaces what lies between two random points of a polyline by the edge between them where that is free; both ends stay.
    pub(crate) fn shorten(
        &self,
        mut path: Vec<Configuration>,
        rng: &mut Pcg64,
    ) -> Vec<Configuration> {
        for _ in 0..self.settings.shortcuts {
            if path.len() < 3 || (self.interrupt)() {
                break;
            }
            let [(i, a), (j, b)] = two_points(&path, rng);
            if j > i && self.edge_is_free(&a, &b) {
                cut_short(&mut path, i..j, [a, b]);
            }
        }
        path
    }
}

/// Puts an edge in the place of the corners after the first of these edges up to the last one. Points gather at the ends, so what is
/// nearly a duplicate goes, but never an end.
fn cut_short(path: &mut Vec<Configuration>, edges: Range<usize>, edge: [Configuration; 2]) {
    let end = path[path.len() - 1];
    path.splice(edges.start + 1..=edges.end, edge);
    path.dedup_by(|x, y| (*x - *y).norm() < DUPLICATE_RAD);
    if path.len() > 1 {
        path.pop();
    }
    path.push(end);
}

/// The same polyline with a corner in the middle of every edge.
fn halved(path: &[Configuration]) -> Vec<Configuration> {
    let mut halved = Vec::with_capacity(2 * path.len());
    for edge in path.windows(2) {
        halved.extend([edge[0], edge[0].lerp(&edge[1], 0.5)]);
    }
    halved.extend(path.last());
    halved
}

fn two_points(path: &[Configuration], rng: &mut Pcg64) -> [(usize, Configuration); 2] {
    let last = (path.len() - 1) as f64;
    let (a, b) = (rng.random::<f64>() * last, rng.random::<f64>() * last);
    [a.min(b), a.max(b)].map(|s| {
        let edge = (s as usize).min(path.len() - 2);
        (edge, path[edge].lerp(&path[edge + 1], s - edge as f64))
    })
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
    robot: &Robot,
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

    fn search<'a>(robot: &'a Robot, scene: &'a Scene, settings: &'a RrtSettings) -> Search<'a> {
        Search {
            robot,
            scene,
            settings,
            interrupt: &|| false,
        }
    }

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

    #[test]
    fn a_polyline_that_is_shortened_again_and_again_keeps_its_ends() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let mut rng = Pcg64::seed_from_u64(1);
        for _ in 0..20 {
            let way: Vec<_> = (0..5)
                .map(|_| random_configuration(&robot, &mut rng))
                .collect();
            let short = search.shorten(way.clone(), &mut rng);
            assert_eq!([short[0], short[short.len() - 1]], [way[0], way[4]]);
            let edge = |w: &[Configuration]| (w[1] - w[0]).norm();
            let length = |way: &[Configuration]| way.windows(2).map(edge).sum::<f64>();
            assert!(length(&short) < length(&way));
        }
    }

    #[test]
    fn corners_are_rounded_where_there_is_room_and_ends_stay() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let bent = |x: f64, y: f64| Configuration::from_column_slice(&[x, y, 0.0, 0.0, 0.0, 0.0]);
        let polyline = [bent(0.0, 0.0), bent(0.8, 0.0), bent(0.8, 0.8)];
        let round = search.round(&polyline);
        let turn = |path: &[Configuration]| {
            let turns = path.windows(3).map(|w| {
                let [a, b] = [w[1] - w[0], w[2] - w[1]];
                (a.dot(&b) / (a.norm() * b.norm())).clamp(-1.0, 1.0).acos()
            });
            turns.fold(0.0, f64::max)
        };
        assert!(
            turn(&polyline) > 1.5 && turn(&round) < 0.3,
            "{}",
            turn(&round)
        );
        assert_eq!(
            [round[0], round[round.len() - 1]],
            [polyline[0], polyline[2]]
        );
        let segment = [polyline[0], polyline[2]];
        assert_eq!(search.round(&segment), segment);
    }

    #[test]
    fn a_corner_beside_an_obstacle_is_rounded_as_far_as_edges_stay_free() {
        let robot = unit_robot();
        let bent = |x: f64, y: f64| Configuration::from_column_slice(&[x, y, 0.0, 0.0, 0.0, 0.0]);
        let polyline = [bent(-0.5, 0.0), bent(0.0, 0.6), bent(0.5, 0.0)];
        let ball = Ball {
            centre: robot.tip(&bent(0.0, 0.0)),
            radius: 0.45,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let is_free =
            |path: &[Configuration]| path.windows(2).all(|w| search.edge_is_free(&w[0], &w[1]));
        assert!(is_free(&polyline) && !search.edge_is_free(&polyline[0], &polyline[2]));
        let round = search.round(&polyline);
        assert!(round.len() > polyline.len() && is_free(&round));
    }

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
