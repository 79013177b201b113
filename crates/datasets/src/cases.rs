//! Cases to evaluate planners on, none of them left out because a planner fails there.

use pcc_model::UnitRobot;
use planning::straight_path;

use crate::format::counts::Counts;
use crate::recipe::Recipe;
use crate::row::{Check, Row};
use crate::scenes::draw_target;

/// Version of [`generate_cases`]; raise it with every change that makes other rows from the same recipe.
pub const CASES_VERSION: u32 = 1;

/// One row for each start of the targets with the given indices, whether or not any planner solves it.
///
/// The format has no case without a path, so each row's path is the straight segment to the configuration that the target was drawn
/// with, judged exactly. The result depends on the recipe and the indices alone.
#[must_use]
pub fn generate_cases(
    robot: &UnitRobot,
    recipe: &Recipe,
    targets: std::ops::Range<u64>,
) -> (Vec<Row>, Counts) {
    let mut rows = Vec::new();
    let mut counts = Counts::with_reasons(&["target_or_start_sampling"], &["missing_starts"]);
    for index in targets {
        counts.requested_targets += 1;
        counts.requested_paths += recipe.starts;
        let Some(target) = draw_target(robot, recipe.setting, recipe.seed, index) else {
            counts.drop_target("target_or_start_sampling");
            continue;
        };
        counts.actual_targets += 1;
        let missing = recipe.starts.saturating_sub(target.starts.len());
        counts.drop_paths("missing_starts", missing);
        for (start_index, start) in target.starts.iter().enumerate().take(recipe.starts) {
            let path = straight_path(start, &target.generator);
            rows.push(Row {
                check: Some(Check::of(robot, &target.scene, &path)),
                path,
                target_tip: target.tip,
                target_index: index as i32,
                start_index: start_index as i16,
                ik_index: 0,
                split: recipe.split_of(index),
                balls: target.scene.balls().to_vec(),
            });
        }
    }
    counts.actual_paths = rows.len();
    (rows, counts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expert::generate::generate_block;
    use crate::fixtures::unit_robot;
    use crate::scenes::Setting;
    use std::collections::BTreeSet;

    #[test]
    fn every_start_is_a_case_also_where_the_expert_fails() {
        let robot = unit_robot();
        let recipe = Recipe {
            setting: Setting::Hard,
            seed: 9002,
            starts: 3,
            ends: 1,
            trees: 1,
            test_only: true,
        };
        let targets = 0..96;
        let (rows, counts) = generate_cases(&robot, &recipe, targets.clone());
        let drawn: usize = targets
            .clone()
            .filter_map(|index| draw_target(&robot, recipe.setting, recipe.seed, index))
            .map(|target| target.starts.len().min(recipe.starts))
            .sum();
        assert_eq!((rows.len(), counts.actual_paths), (drawn, drawn));
        let collide = rows
            .iter()
            .filter(|row| row.check.is_some_and(|c| !c.is_certified));
        assert!(collide.count() > 0, "segments of hard cases collide");
        let key = |row: &Row| (row.target_index, row.start_index);
        let cases: BTreeSet<_> = rows.iter().map(key).collect();
        let (of_expert, _) = generate_block(&robot, &recipe, targets);
        let of_expert: BTreeSet<_> = of_expert.iter().map(key).collect();
        assert!(of_expert.is_subset(&cases));
        assert!(of_expert.len() < cases.len(), "the expert leaves none out");
        for row in &rows {
            let end = robot.tip(row.path.last().unwrap());
            assert!((end - row.target_tip).norm() < 1e-9);
        }
    }
}
