//! Time of a request as the number of balls grows: `scene_growth <weights folder> <robot file>`.
//!
//! The balls are points of a cloud on a cylinder around the workspace and a few near the way, of 0.05 section lengths; for each
//! number the median and the least of 41 requests of ten candidates on two threads, with the stages' medians, in ms.

use collision::{Ball, Scene, tracking_padding};
use denoiser::{FastModel, Manifest};
use pcc_model::{Configuration, Point, Robot};
use planning::{Goal, Models, MovingObstacles, Planner, Problem, Request, Sampler, Stage};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::path::Path;
use std::time::Instant;

const REPETITIONS: usize = 41;

fn cloud() -> Vec<Ball> {
    let mut random = Pcg64::seed_from_u64(1);
    (0..1000)
        .map(|_| {
            let turn = random.random_range(0.0..std::f64::consts::TAU);
            let away = random.random_range(1.2..2.2);
            Ball {
                centre: Point::new(
                    away * turn.cos(),
                    away * turn.sin(),
                    random.random_range(-0.5..2.2),
                ),
                radius: 0.05,
            }
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    1e3 * values[values.len() / 2]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, weights, robot] = arguments.as_slice() else {
        return Err("arguments: <weights folder> <robot file>".into());
    };
    let robot = Robot::from_file(Path::new(robot))?;
    let robot = robot
        .to_unit()
        .ok_or("the three sections must be equally long")?;
    let file = Manifest::open(Path::new(weights))?.weights("fast")?;
    let models = Models {
        fast: Some(FastModel::from_weights(&file, robot.bending_limit)?),
        ..Models::default()
    };
    let planner = Planner::new(robot, models, 2)?;
    let request = Request {
        candidates: 10,
        seed: 1,
        sampler: Sampler::Default,
        limits_scale: 1.0,
        padding: tracking_padding(planner.robot(), 0.01),
        knots: 96,
        corrections: planning::MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    };
    let cloud = cloud();
    println!("balls  median    min  condition sample correct time certify select  candidates");
    for count in [
        0, 1, 2, 4, 8, 12, 16, 17, 24, 25, 32, 64, 128, 256, 512, 1000,
    ] {
        let problem = Problem {
            start: Configuration::from_row_slice(&[0.0, -0.3, 0.0, -0.3, 0.0, -0.3]),
            goal: Goal::Tip(Point::new(0.9, 0.5, 2.5)),
            scene: Scene::new(cloud[..count].to_vec())?,
            moving: MovingObstacles::default(),
        };
        let (mut times, mut stages, mut candidates) = (Vec::new(), Vec::new(), 0);
        for _ in 0..REPETITIONS {
            let clock = Instant::now();
            let plan = planner.plan(&problem, &request, &|| false)?;
            times.push(clock.elapsed().as_secs_f64());
            stages.push(plan.stages);
            candidates = plan.candidates.len();
        }
        let least = 1e3 * times.iter().copied().fold(f64::INFINITY, f64::min);
        let of = |stage: Stage| median(stages.iter().map(|times| times[stage]).collect());
        println!(
            "{count:5} {:7.2} {least:6.2}  {:9.3} {:6.3} {:7.3} {:4.3} {:7.3} {:6.3}  {candidates}",
            median(times),
            of(Stage::Condition),
            of(Stage::Sample),
            of(Stage::Correct),
            of(Stage::Time),
            of(Stage::Certify),
            of(Stage::Select),
        );
    }
    Ok(())
}
