//! Cases with any number of balls, for the cost of balls alone: small ones anywhere, the start clear of them.

use std::path::PathBuf;

use collision::{Ball, Scene};
use datasets::{Dataset, Meta, Row, Split};
use pcc_model::{Configuration, Point, Robot};
use planning::WAYPOINTS;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::json;
use tests::programs::repository;

use crate::runs::folder;

const RADIUS: f64 = 0.05;
/// Centres fill a cylinder around the robot, section lengths.
const CYLINDER_RADIUS: f64 = 1.9;
const CYLINDER_HEIGHTS: std::ops::Range<f64> = 0.3..2.8;

/// Writes a data set with so many cases of so many balls.
pub(crate) fn with_balls(balls: usize, cases: usize) -> anyhow::Result<PathBuf> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let mut rng = Pcg64::seed_from_u64(9007);
    let start = Configuration::zeros();
    let end = Configuration::from_column_slice(&[0.6, 0.2, -0.5, 0.3, 0.4, -0.4]);
    let row = |index| Row {
        path: vec![start; WAYPOINTS - 1]
            .into_iter()
            .chain([end])
            .collect(),
        target_tip: robot.tip(&end),
        target_index: index,
        start_index: 0,
        ik_index: 0,
        split: Split::Test,
        balls: clear_balls(&robot, &start, balls, &mut rng),
        check: None,
    };
    let rows = (0..i32::try_from(cases)?).map(row).collect();
    let mut meta = Meta::new(json!({ "balls": balls }));
    meta.clearance_margin = robot.largest_tube_radius();
    let out = folder().join(format!("paper-{balls}-balls"));
    Dataset { rows, meta }.write(&out)?;
    Ok(out)
}

fn clear_balls(robot: &Robot, start: &Configuration, count: usize, rng: &mut Pcg64) -> Vec<Ball> {
    let backbone = robot.backbone(start);
    let mut balls = Vec::with_capacity(count);
    while balls.len() < count {
        let [x, y] = [(); 2].map(|()| rng.random_range(-CYLINDER_RADIUS..CYLINDER_RADIUS));
        let centre = Point::new(x, y, rng.random_range(CYLINDER_HEIGHTS));
        let ball = Ball {
            centre,
            radius: RADIUS,
        };
        let scene = Scene::new(vec![ball]);
        if scene.is_ok_and(|scene| scene.clearance(&backbone, &robot.tube_radii) > RADIUS) {
            balls.push(ball);
        }
    }
    balls
}
