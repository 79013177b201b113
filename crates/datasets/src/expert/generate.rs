//! Making paths for training and tests: targets, starts, goal configurations, and the expert's certified paths.

use super::path_optimizer::teach;
use super::report::BlockReport;
use crate::recipe::Recipe;
use crate::row::Row;
use crate::scenes::{Target, draw_target};
use collision::certify_polyline;
use pcc_model::{Configuration, SECTIONS, UnitRobot};
use planning::{
    Goal, Problem, RrtSettings, Waypoints, goal_configurations, resample, rrt_connect,
    straight_path,
};
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

/// The tree works with this much room to spare, so that the expert starts from a clear path.
const TREE_MARGIN: f64 = 0.02;

/// Version of [`generate_block`]: another one makes other rows from the same recipe.
pub const EXPERT_VERSION: u32 = 1;

/// Generates the rows of the targets with the given indices; the result depends on the recipe and the indices alone.
#[must_use]
pub fn generate_block(
    robot: &UnitRobot,
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
    robot: &UnitRobot,
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
        let Ok(mut ends) = goal_configurations(robot, &problem, 10.max(recipe.ends), &mut rng)
        else {
            report.dropped_starts += 1;
            report.missing_ends += recipe.ends;
            continue;
        };
        report.missing_ends += recipe.ends.saturating_sub(ends.len());
        ends.shuffle(&mut rng);
        for (ik_index, end) in ends.iter().enumerate().take(recipe.ends) {
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
    report: &mut BlockReport,
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
    let shortest = guided.min_by(|a, b| tip_length(robot, a).total_cmp(&tip_length(robot, b)));
    report.from_tree += usize::from(shortest.is_some());
    shortest
}

fn tip_length(robot: &UnitRobot, path: &[Configuration]) -> f64 {
    let edges = path.windows(2);
    edges
        .map(|w| (robot.tip(&w[1]) - robot.tip(&w[0])).norm())
        .sum()
}
