//! Making paths for training and tests: targets, starts, end shapes, and the teacher's certified paths.

use super::format::{Row, Split};
use crate::end_shapes::end_shapes;
use crate::path::{Waypoints, resample, straight_path};
use crate::problem::{Goal, Problem};
use crate::rrt_connect::{RrtSettings, rrt_connect};
use crate::scenes::{Setting, Target, draw_target};
use crate::teacher::teach;
use collision::certify_polyline;
use pcc_model::{Configuration, Robot, SECTIONS};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

/// Split by target, 80 / 10 / 10 (docs/evaluation.md), from a generator of its own.
const SPLIT_SEED: u64 = 999;
/// The tree works with this much room to spare, so that the teacher starts from a clear path.
const TREE_MARGIN: f64 = 0.02;

/// Version of [`generate_block`]: another one makes other rows from the same recipe.
pub const TEACHER_VERSION: u32 = 1;

/// What is generated.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    /// The kind of scenes.
    pub setting: Setting,
    /// Seed of everything random.
    pub seed: u64,
    /// Starts used of each target.
    pub starts: usize,
    /// End shapes used of each start.
    pub ends: usize,
    /// Trees grown where the straight segment leads the teacher to no certified path; of what it makes of them the shortest
    /// is kept.
    pub trees: usize,
    /// Puts every row into the test split (for sets that are only evaluated on).
    pub test_only: bool,
}

/// What became of the paths asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockReport {
    /// Targets drawn.
    pub targets: usize,
    /// Targets without a valid tip or start.
    pub dropped_targets: usize,
    /// Targets with a path.
    pub targets_with_paths: usize,
    /// Paths asked for, those of dropped targets too.
    pub requested_paths: usize,
    /// Paths missing because a target that was not dropped has fewer starts than asked for.
    pub missing_starts: usize,
    /// Paths missing because a start has fewer clear end shapes than asked for.
    pub missing_ends: usize,
    /// Starts without a clear end shape.
    pub dropped_starts: usize,
    /// Paths the teacher could not certify.
    pub dropped_paths: usize,
    /// Paths that needed the tree.
    pub from_tree: usize,
    /// Paths kept.
    pub kept: usize,
}

impl std::ops::AddAssign for BlockReport {
    fn add_assign(&mut self, other: Self) {
        self.targets += other.targets;
        self.dropped_targets += other.dropped_targets;
        self.targets_with_paths += other.targets_with_paths;
        self.requested_paths += other.requested_paths;
        self.missing_starts += other.missing_starts;
        self.missing_ends += other.missing_ends;
        self.dropped_starts += other.dropped_starts;
        self.dropped_paths += other.dropped_paths;
        self.from_tree += other.from_tree;
        self.kept += other.kept;
    }
}

/// Generates the rows of the targets with the given indices; the result depends on the recipe and the indices alone.
#[must_use]
pub fn generate_block(
    robot: &Robot,
    recipe: &Recipe,
    targets: std::ops::Range<u64>,
) -> (Vec<Row>, BlockReport) {
    let mut rows = Vec::new();
    let mut report = BlockReport::default();
    for index in targets {
        report.targets += 1;
        report.requested_paths += recipe.starts * recipe.ends;
        let before = rows.len();
        match draw_target(robot, recipe.setting, recipe.seed, index) {
            Some(target) => target_rows(robot, recipe, index, &target, &mut rows, &mut report),
            None => report.dropped_targets += 1,
        }
        report.targets_with_paths += usize::from(rows.len() > before);
    }
    (rows, report)
}

fn target_rows(
    robot: &Robot,
    recipe: &Recipe,
    index: u64,
    target: &Target,
    rows: &mut Vec<Row>,
    report: &mut BlockReport,
) {
    let mut rng = Pcg64::new(u128::from(recipe.seed), u128::from(index) + 1);
    report.missing_starts += recipe.starts.saturating_sub(target.starts.len()) * recipe.ends;
    for (start_index, start) in target.starts.iter().enumerate().take(recipe.starts) {
        let problem = Problem {
            start: *start,
            goal: Goal::Tip(target.tip),
            scene: target.scene.clone(),
        };
        let Ok(mut ends) = end_shapes(robot, &problem, 10.max(recipe.ends), &mut rng) else {
            report.dropped_starts += 1;
            report.missing_ends += recipe.ends;
            continue;
        };
        report.missing_ends += recipe.ends.saturating_sub(ends.shapes.len());
        ends.shapes.shuffle(&mut rng);
        for (ik_index, end) in ends.shapes.iter().enumerate().take(recipe.ends) {
            let Some(path) = taught_path(robot, recipe.trees, &problem, end, &mut rng, report)
            else {
                report.dropped_paths += 1;
                continue;
            };
            report.kept += 1;
            rows.push(Row {
                path,
                target_tip: target.tip,
                target_index: index as i32,
                start_index: start_index as i16,
                ik_index: ik_index as i16,
                split: split_of(recipe, index),
                balls: target.scene.balls().to_vec(),
                check: None,
            });
        }
    }
}

fn taught_path(
    robot: &Robot,
    trees: usize,
    problem: &Problem,
    end: &Configuration,
    rng: &mut Pcg64,
    report: &mut BlockReport,
) -> Option<Waypoints> {
    let (scene, start) = (&problem.scene, &problem.start);
    let certified = |path: &Waypoints| certify_polyline(robot, scene, path).is_free();
    let direct = teach(robot, scene, &straight_path(start, end));
    if certified(&direct) {
        return Some(direct);
    }
    let grown = robot.with_tube_growth(&[TREE_MARGIN; SECTIONS]);
    let settings = RrtSettings::default();
    let guided = (0..trees).filter_map(|_| {
        let polyline = rrt_connect(&grown, scene, start, &[*end], &settings, rng, &|| false)?;
        let path = teach(robot, scene, &resample(&polyline));
        certified(&path).then_some(path)
    });
    let shortest = guided.min_by(|a, b| tip_length(robot, a).total_cmp(&tip_length(robot, b)));
    report.from_tree += usize::from(shortest.is_some());
    shortest
}

fn tip_length(robot: &Robot, path: &[Configuration]) -> f64 {
    let edges = path.windows(2);
    edges
        .map(|w| (robot.tip(&w[1]) - robot.tip(&w[0])).norm())
        .sum()
}

pub(super) fn split_of(recipe: &Recipe, target: u64) -> Split {
    if recipe.test_only {
        return Split::Test;
    }
    match Pcg64::new(u128::from(SPLIT_SEED), u128::from(target)).random_range(0..10) {
        0 => Split::Validation,
        1 => Split::Test,
        _ => Split::Train,
    }
}
