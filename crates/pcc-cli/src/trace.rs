//! `pcc trace`: how noise becomes a path, step by step, for pictures of the reverse process.

use crate::number::{self, balls_of};
use crate::option_faults::MotionOptions;
use crate::output_files::make_writable_for;
use crate::planner::{ModelArguments, load};
use crate::robot::unit_robot;
use crate::sampler::{PlannerName, name_of};
use anyhow::{Context, anyhow, bail};
use clap::{ArgAction, Args};
use collision::{Ball, MAX_EXTENT, Scene};
use datasets::ArchiveWriter;
use pcc_model::{Configuration, DOF, Point, UnitRobot};
use planning::random_configuration;
use planning::{Goal, Guidance, MovingObstacles, PlannerError, Problem, WAYPOINTS, Waypoints};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use shared_types::valid::MAX_LENGTH_M;
use std::path::{Path, PathBuf};

/// Random configurations that are tried for a start that is clear.
const START_DRAWS: usize = 1000;

/// Arguments of `pcc trace`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Tip position to reach, section lengths (-1000 to 1000), base frame.
    #[arg(long, required = true, num_args = 3, action = ArgAction::Set, value_parser = number::real(-MAX_LENGTH_M, MAX_LENGTH_M, " section lengths"), value_names = ["X", "Y", "Z"])]
    tip: Vec<f64>,
    /// Start configuration, radians (-π to π, and within the robot's bending limit); without it the straight one.
    #[arg(long, num_args = 6, action = ArgAction::Set, value_parser = number::radians(), value_name = "RAD")]
    start: Option<Vec<f64>>,
    /// Start from a random configuration that is clear, drawn from the seed.
    #[arg(long, conflicts_with = "start")]
    random_start: bool,
    /// An obstacle, section lengths (coordinates from -1e7 to 1e7, a radius from 0 to 1e7); may be given up to 64 times.
    #[arg(long, num_args = 4, action = ArgAction::Append, value_parser = number::real(-MAX_EXTENT, MAX_EXTENT, " section lengths"), value_names = ["X", "Y", "Z", "RADIUS"])]
    ball: Vec<f64>,
    /// Which of the diffusion planners.
    #[arg(long, value_enum, default_value = "diffusion-post")]
    planner: PlannerName,
    /// Seed of the noise (0 to 2^64 - 1).
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    seed: u64,
    #[command(flatten)]
    models: ModelArguments,
    /// Robot file.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// Archive to write: `paths [S+1,64,6]` (radians) and `tips [S+1,64,3]` (section lengths) before each of the S steps and
    /// at the end.
    #[arg(long)]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let Some(guidance) = arguments.planner.sampler().and_then(Guidance::of) else {
        bail!(
            "--planner {}: diffusion, diffusion-post and diffusion-guided are allowed",
            name_of(&arguments.planner)
        );
    };
    make_writable_for(&arguments.out)?;
    let robot = unit_robot(&arguments.robot)?;
    let planner = load(arguments.planner, robot, &arguments.models, 1)?.planner;
    let problem = arguments.problem(planner.robot())?;
    let trace = planner.trace(&problem, guidance, arguments.seed);
    let trace = trace.map_err(|error| arguments.explain(error))?;
    write(&arguments.out, planner.robot(), &trace)?;
    let last = &trace[trace.len() - 1];
    let miss =
        (planner.robot().tip(&last[WAYPOINTS - 1]) - problem.goal_tip(planner.robot())).norm();
    say!(
        "{}: {} steps, the last path's tip is {miss:.4} section lengths from the target",
        arguments.out.display(),
        trace.len() - 1
    );
    Ok(())
}

impl Arguments {
    /// An error of the planner, with the options that are at fault.
    fn explain(&self, error: PlannerError) -> anyhow::Error {
        let options = MotionOptions {
            start: self.start.as_deref(),
            tip: Some(&self.tip),
            configuration: None,
            balls: &self.ball,
        };
        let PlannerError::Infeasible(reason) = &error else {
            return error.into();
        };
        match options.explain(reason.outcome()) {
            Some(fault) => anyhow!("{reason} ({fault})"),
            None => error.into(),
        }
    }

    fn problem(&self, robot: &UnitRobot) -> anyhow::Result<Problem> {
        let balls = balls_of(&self.ball, MAX_EXTENT, "section lengths")?.into_iter();
        let balls = balls.map(|[x, y, z, radius]| Ball {
            centre: Point::new(x, y, z),
            radius,
        });
        let problem = |start, scene: &Scene| Problem {
            start,
            goal: Goal::Tip(Point::from_column_slice(&self.tip)),
            scene: scene.clone(),
            moving: MovingObstacles::default(),
        };
        let scene = Scene::new(balls.collect())?;
        if !self.random_start {
            let start = self.start.as_deref();
            let start = start.map_or_else(Configuration::zeros, Configuration::from_column_slice);
            return Ok(problem(start, &scene));
        }
        let mut rng = Pcg64::seed_from_u64(self.seed);
        (0..START_DRAWS)
            .map(|_| problem(random_configuration(robot, &mut rng), &scene))
            .find(|problem| problem.check_start(robot).is_ok())
            .with_context(|| format!("none of {START_DRAWS} random starts is clear of the balls"))
    }
}

fn write(
    file: &Path,
    robot: &UnitRobot,
    trace: &[Waypoints],
) -> Result<(), datasets::ArchiveError> {
    let mut archive = ArchiveWriter::create(file)?;
    let configurations = trace.iter().flatten();
    let values = configurations.clone().flat_map(|q| <[f64; DOF]>::from(*q));
    archive.write("paths", &[trace.len(), WAYPOINTS, DOF], values)?;
    let tips = configurations.flat_map(|q| <[f64; 3]>::from(robot.tip(q)));
    archive.write("tips", &[trace.len(), WAYPOINTS, 3], tips)?;
    archive.finish()
}
