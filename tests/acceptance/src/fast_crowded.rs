//! Cases of 8 to 16 balls that no planner has chosen: in the hard ones rrt-connect has found a path already when they are drawn.

use std::path::PathBuf;

use anyhow::Context;
use datasets::scenes::{Setting, Target, draw_target};
use datasets::{Dataset, Meta, Row, Split};
use pcc_model::Robot;
use planning::straight_path;
use serde_json::json;
use tests::programs::repository;

use crate::runs::folder;

/// Seed of the scenes: no data set was made with it.
const SEED: u64 = 9015;
/// Starts of each target.
const STARTS: usize = 3;

/// The scenes of each index: 8 balls, 9, and so on up to 16, and again.
pub(crate) fn crowded(index: u64) -> Setting {
    Setting::General(Some(8 + (index % 9) as usize))
}

/// Writes a data set with at least so many cases: every start of every target that is drawn.
pub(crate) fn make(cases: usize) -> anyhow::Result<PathBuf> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let unit = robot.to_unit().context("equal sections are needed")?;
    let drawn =
        (0..).filter_map(|index| Some((index, draw_target(&unit, crowded(index), SEED, index)?)));
    let rows = drawn.flat_map(|(index, target)| rows(index as i32, &target));
    let mut meta = Meta::new(json!({ "setting": "8 to 16 balls", "seed": SEED }));
    meta.clearance_margin = robot.largest_tube_radius();
    let out = folder().join(format!("cases-crowded-{SEED}-{cases}"));
    let rows = rows.take(cases).collect();
    Dataset { rows, meta }.write(&out)?;
    Ok(out)
}

fn rows(target_index: i32, target: &Target) -> Vec<Row> {
    let starts = (0..).zip(&target.starts).take(STARTS);
    let row = |(start_index, start)| Row {
        path: straight_path(start, &target.generator),
        target_tip: target.tip,
        target_index,
        start_index,
        ik_index: 0,
        split: Split::Test,
        balls: target.scene.balls().to_vec(),
        check: None,
    };
    starts.map(row).collect()
}
