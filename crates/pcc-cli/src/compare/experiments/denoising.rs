//! How noise becomes a path: from a random and from the straight start, and around a ball.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use super::hardware::{Hardware, ball_that_appears};
use crate::compare::drawing::{COLOURS, Camera, GREY, Scene3d, blend};
use crate::compare::figure_name::FigureName;
use crate::sampler::PlannerName;
use anyhow::Context;
use collision::{Ball, Scene};
use pcc_model::{Configuration, DOF, Point};
use planning::{Goal, Guidance, MovingObstacles, Problem, WAYPOINTS, random_configuration};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::PI;

/// Target of the denoising from two starts, section lengths.
const TARGET: [f64; 3] = [1.5, 0.0, 2.4];
/// Seed of the random start, and how finely it is written, per radian.
const START_SEED: u64 = 3;
const START_DIGITS: f64 = 1e3;
/// Candidates.
const DRAWS: u64 = 10;
/// Steps of the paper's sampler at which its paths are shown; where it has others, as far along.
const SHOWN: [usize; 6] = [0, 20, 34, 42, 46, 50];
/// Waypoints whose bodies are shown.
const BODIES: [usize; 4] = [0, 21, 42, 63];
/// Every so many-th waypoint's tip is kept.
const TIP_STRIDE: usize = 3;
const AZIMUTH: f64 = -0.35 * PI;
const ELEVATION: f64 = 0.1 * PI;

/// Paths of one task while they are drawn.
#[derive(Deserialize, Serialize)]
struct Traces {
    snapshots: Vec<Snapshot>,
}

/// The candidates after so many steps.
#[derive(Deserialize, Serialize)]
struct Snapshot {
    step: usize,
    /// Tips of each candidate, section lengths.
    tips: Vec<Vec<[f64; 3]>>,
    /// Configurations of the first candidate, rad.
    bodies: Vec<[f64; DOF]>,
}

/// What is to be reached.
struct Task {
    start: Configuration,
    target: Point,
    balls: Vec<Ball>,
    planner: PlannerName,
}

impl Traces {
    fn of(bench: &Bench, name: &str, task: &Task) -> anyhow::Result<Self> {
        let loaded = bench.planner(task.planner)?;
        let start: [f64; DOF] = task.start.into();
        let balls: Vec<[f64; 4]> = task.balls.iter().map(numbers).collect();
        let target: [f64; 3] = task.target.into();
        let settings = json!({ "start": start, "target": target, "balls": balls, "draws": DRAWS, "shown": SHOWN });
        bench.keep(name, &loaded.records, &settings, || {
            let sampler = task.planner.sampler();
            let guidance = sampler.and_then(Guidance::of).context("no diffusion")?;
            let problem = Problem {
                start: task.start,
                goal: Goal::Tip(task.target),
                scene: Scene::new(task.balls.clone())?,
                moving: MovingObstacles::default(),
            };
            let seed = |draw| bench.arguments.seed.wrapping_add(draw);
            let traces =
                (0..DRAWS).map(|draw| loaded.planner.trace(&problem, guidance, seed(draw)));
            let traces = traces.collect::<Result<Vec<_>, _>>()?;
            let steps = traces[0].len() - 1;
            let mut shown = SHOWN.map(|it| it * steps / SHOWN[SHOWN.len() - 1]).to_vec();
            shown.dedup();
            let snapshot = |step: usize| {
                let tips = traces.iter().map(|trace| {
                    let shown = trace[step].iter().step_by(TIP_STRIDE);
                    shown.map(|it| bench.robot.tip(it).into()).collect()
                });
                Snapshot {
                    step,
                    tips: tips.collect(),
                    bodies: BODIES.map(|at| traces[0][step][at].into()).to_vec(),
                }
            };
            Ok(Self {
                snapshots: shown.into_iter().map(snapshot).collect(),
            })
        })
    }

    fn pictures(
        &self,
        bench: &Bench,
        task: &Task,
        has_bodies: bool,
    ) -> anyhow::Result<Vec<Picture>> {
        let points = self
            .snapshots
            .iter()
            .flat_map(|it| it.tips.iter().flatten());
        let points = points.map(|tip| (Point::from(*tip), 0.05));
        let balls = task.balls.iter().map(|ball| (ball.centre, ball.radius));
        let camera = Camera::fitting(
            AZIMUTH,
            ELEVATION,
            points.chain(balls).chain([(task.target, 0.3)]),
        );
        let steps = self.snapshots.last().map_or(0, |it| it.step);
        let picture = |snapshot: &Snapshot| {
            let mut scene = Scene3d::new(&bench.robot, camera);
            task.balls.iter().for_each(|ball| scene.ball(ball));
            for (tips, colour) in snapshot.tips.iter().zip(COLOURS) {
                let tips: Vec<Point> = tips.iter().copied().map(Point::from).collect();
                scene.path(&tips, colour, 2);
                tips.iter().for_each(|tip| scene.dot(tip, colour));
            }
            if has_bodies {
                for (index, body) in snapshot.bodies.iter().enumerate() {
                    let share = index as f64 / (BODIES.len() - 1) as f64;
                    scene.body(&Configuration::from(*body), blend(GREY, COLOURS[0], share));
                }
            }
            scene.ends(&bench.robot.tip(&task.start), &task.target);
            let caption = format!("after {} of {steps} steps", snapshot.step);
            Ok(Picture::new(scene.svg()?, caption))
        };
        self.snapshots.iter().map(picture).collect()
    }
}

/// Denoising from a random and from the straight start.
pub(super) fn from_two_starts(bench: &Bench) -> anyhow::Result<Figure> {
    let target = Point::from(TARGET);
    let task = |start| Task {
        start,
        target,
        balls: Vec::new(),
        planner: PlannerName::Diffusion,
    };
    let random = task(random_start(bench)?);
    let straight = task(Configuration::zeros());
    let mut pictures = Vec::new();
    for (task, name, id) in [
        (&random, "denoising-random", "denoising-random-start"),
        (&straight, "denoising-straight", "denoising-straight-start"),
    ] {
        let traces = Traces::of(bench, name, task)?;
        let drawn = traces.pictures(bench, task, true)?.into_iter().enumerate();
        let start = if id.contains("random") {
            "random"
        } else {
            "straight"
        };
        pictures.extend(drawn.map(|(index, picture)| Picture {
            id: (index == 0).then_some(id),
            begins_row: index == 0,
            caption: format!("{start} start, {}", picture.caption),
            ..picture
        }));
    }
    Ok(Figure {
        name: FigureName::Denoising,
        title: "Denoising from a random and from the straight start",
        pictures,
        caption: format!(
            "The paper's sampler (<code>diffusion</code>, {}, no guidance, no balls) between noise and path: tip paths of {DRAWS} candidates, \
             and bodies of one of them at four waypoints, from the start (grey) to its end (blue). Diamond: tip of the start; star: target.",
            bench.models().sampling()
        ),
        made_by: None,
    })
}

/// A random start that the paper's sampler could meet, written with few digits.
fn random_start(bench: &Bench) -> anyhow::Result<Configuration> {
    let mut rng = Pcg64::seed_from_u64(START_SEED);
    let mut draw = || {
        random_configuration(&bench.robot, &mut rng)
            .map(|it| (it * START_DIGITS).round() / START_DIGITS)
    };
    let is_upright = |it: &Configuration| bench.robot.tip(it).z > 1.5;
    (0..1000)
        .map(|_| draw())
        .find(is_upright)
        .context("no start")
}

/// Tip paths around a ball by denoising step, and the motion that was executed.
pub(super) fn around_a_ball(bench: &Bench, hardware: &Hardware) -> anyhow::Result<Figure> {
    let run = &hardware.obstacle;
    let ball = ball_that_appears();
    let task = Task {
        start: run.start(),
        target: run.target(),
        balls: vec![ball],
        planner: PlannerName::DiffusionPost,
    };
    let traces = Traces::of(bench, "around-a-ball", &task)?;
    let mut pictures = traces.pictures(bench, &task, false)?;
    pictures.push(run.bodies(bench, &task.balls)?.in_new_row());
    Ok(Figure {
        name: FigureName::AroundABall,
        title: "Tip paths around a ball by denoising step, and the executed motion",
        pictures,
        caption: format!(
            "Tip paths of {DRAWS} candidates of <code>diffusion-post</code> while they are denoised, from where the motion of the demonstration's third \
             experiment begins (diamond) to its target (star), around a ball of radius 0.4 L; and that motion, which is one of <code>default</code> and none of these candidates, as it was measured, its body at {} instants.",
            super::hardware::SNAPSHOTS
        ),
        made_by: None,
    })
}

fn numbers(ball: &Ball) -> [f64; 4] {
    [ball.centre.x, ball.centre.y, ball.centre.z, ball.radius]
}

const _: () = assert!(BODIES[BODIES.len() - 1] == WAYPOINTS - 1);
