//! Making paths for training and tests: targets, starts, goal configurations, and the expert's certified paths.

use super::path_optimizer::teach;
use crate::format::counts::Counts;
use crate::recipe::Recipe;
use crate::row::Row;
use crate::scenes::{Target, draw_target};
use collision::certify_polyline;
use pcc_model::{Configuration, SECTIONS, UnitRobot};
use planning::{
    Goal, MovingObstacles, Problem, RrtSettings, Waypoints, goal_configurations, resample,
    rrt_connect, straight_path,
};
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

/// The tree works with this much room to spare, so that the expert starts from a clear path.
const TREE_MARGIN: f64 = 0.02;

/// Why a target is dropped: no target with a start could be drawn; none of its paths kept.
const OF_TARGETS: [&str; 2] = ["target_or_start_sampling", "zero_retained_paths"];
/// Why a path is missing: too few starts; too few goal configurations; the expert found no certified path.
const OF_PATHS: [&str; 3] = ["missing_starts", "missing_end_shapes", "not_certified"];

/// Version of [`generate_block`]; raise it with every change that makes other rows from the same recipe.
pub const EXPERT_VERSION: u32 = 1;

/// Generates the rows of the targets with the given indices; the result depends on the recipe and the indices alone.
#[must_use]
pub fn generate_block(
    robot: &UnitRobot,
    recipe: &Recipe,
    targets: std::ops::Range<u64>,
) -> (Vec<Row>, Counts) {
    let mut rows = Vec::new();
    let mut counts = Counts::with_reasons(&OF_TARGETS, &OF_PATHS);
    for index in targets {
        counts.requested_targets += 1;
        counts.requested_paths += recipe.starts * recipe.ends;
        let before = rows.len();
        let Some(target) = draw_target(robot, recipe.setting, recipe.seed, index) else {
            counts.drop_target(OF_TARGETS[0]);
            continue;
        };
        target_rows(robot, recipe, index, &target, &mut rows, &mut counts);
        if rows.len() > before {
            counts.actual_targets += 1;
        } else {
            counts.drop_target(OF_TARGETS[1]);
        }
    }
    counts.actual_paths = rows.len();
    (rows, counts)
}

fn target_rows(
    robot: &UnitRobot,
    recipe: &Recipe,
    index: u64,
    target: &Target,
    rows: &mut Vec<Row>,
    counts: &mut Counts,
) {
    let mut rng = Pcg64::new(u128::from(recipe.seed), u128::from(index) + 1);
    let missing_starts = recipe.starts.saturating_sub(target.starts.len());
    counts.drop_paths(OF_PATHS[0], missing_starts * recipe.ends);
    for (start_index, start) in target.starts.iter().enumerate().take(recipe.starts) {
        let problem = Problem {
            start: *start,
            goal: Goal::Tip(target.tip),
            scene: target.scene.clone(),
            moving: MovingObstacles::default(),
        };
        let Ok(mut ends) = goal_configurations(robot, &problem, 10.max(recipe.ends), &mut rng)
        else {
            counts.drop_paths(OF_PATHS[1], recipe.ends);
            continue;
        };
        counts.drop_paths(OF_PATHS[1], recipe.ends.saturating_sub(ends.len()));
        ends.shuffle(&mut rng);
        for (ik_index, end) in ends.iter().enumerate().take(recipe.ends) {
            let Some(path) = taught_path(robot, recipe.trees, &problem, end, &mut rng) else {
                counts.drop_paths(OF_PATHS[2], 1);
                continue;
            };
            rows.push(Row {
                path,
                target_tip: target.tip,
                target_index: index as i32,
                start_index: start_index as i16,
                ik_index: ik_index as i16,
                split: recipe.split_of(index),
                balls: target.scene.balls().to_vec(),
                check: None,
            });
        }
    }
}

fn taught_path(
    robot: &UnitRobot,
    trees: usize,
    problem: &Problem,
    end: &Configuration,
    rng: &mut Pcg64,
) -> Option<Waypoints> {
    let (scene, start) = (&problem.scene, &problem.start);
    let certified = |path: &Waypoints| certify_polyline(robot, scene, path).is_free();
    let direct = teach(robot, scene, &straight_path(start, end));
    if certified(&direct) {
        return Some(direct);
    }
    let padded = robot.with_tube_padding(&[TREE_MARGIN; SECTIONS]);
    let settings = RrtSettings::default();
    let guided = (0..trees).filter_map(|_| {
        let polyline = rrt_connect(&padded, scene, start, &[*end], &settings, rng, &|| false)?;
        let path = teach(robot, scene, &resample(&polyline));
        certified(&path).then_some(path)
    });
    guided.min_by(|a, b| tip_length(robot, a).total_cmp(&tip_length(robot, b)))
}

fn tip_length(robot: &UnitRobot, path: &[Configuration]) -> f64 {
    let edges = path.windows(2);
    edges
        .map(|w| (robot.tip(&w[1]) - robot.tip(&w[0])).norm())
        .sum()
}
