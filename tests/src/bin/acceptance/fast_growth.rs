//! What candidates and balls cost, from one to the most that there can be.

use std::f64::consts::TAU;
use std::path::Path;

use anyhow::Context;
use client::PlanAnswer;
use datasets::scenes::Setting;
use pcc_model::Robot;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::message::Ball;
use shared_types::valid::PlanRequest;
use tests::programs::repository;
use toml::Value;

use crate::fast_scenes::{Served, demand, motion, requests, scene};
use crate::report::Report;
use crate::scale::Scale;
use crate::second_look::Judged;
use crate::spread::median;

const CANDIDATES: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
const BALLS: [usize; 12] = [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000];
/// A request's time is the fastest of so many: what disturbs one of them is no cost.
const REPETITIONS: usize = 3;
/// A doubling that costs more than this is a cliff.
const CLIFF: f64 = 3.2;
/// Radius of the points of a cloud, m.
const POINT_RADIUS: f64 = 0.03;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance fast, requests to planner-daemon";
    report.group("growth with candidates", command, |report| {
        with_candidates(report, scale)
    });
    let command = "acceptance fast, requests to planner-daemon, points in its static scene";
    report.group("growth with balls", command, |report| {
        with_balls(report, scale)
    });
}

/// The daemon's keys for answers of 64 candidates.
pub(crate) fn most_candidates() -> Vec<(&'static str, Value)> {
    vec![
        ("candidates", Value::Integer(64)),
        ("shared_memory_budget_mb", Value::Float(400.0)),
        ("resident_memory_budget_mb", Value::Float(800.0)),
    ]
}

fn with_candidates(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut served = Served::start(most_candidates())?;
    let robot = served.world.unit_robot();
    let all = requests(&robot, Setting::General(Some(4)));
    let all: Vec<PlanRequest> = all.take(scale.pick(8, 50)).collect();
    let mut curve = CANDIDATES.map(|count| (count, Vec::new()));
    for request in &all {
        for (candidate_count, times) in &mut curve {
            let request = PlanRequest {
                candidate_count: *candidate_count,
                ..request.clone()
            };
            times.push(fastest(&mut served, &request)?.1);
        }
    }
    show(report, "growth: candidates, 4 balls", &curve);
    Ok(())
}

fn with_balls(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let robot = robot.to_unit().context("equal sections are needed")?;
    let all = requests(&robot, Setting::General(Some(8)));
    let all: Vec<PlanRequest> = all.take(scale.pick(3, 12)).collect();
    let mut curve = BALLS.map(|count| (count, Vec::new()));
    let (mut answered, mut judged) = (0, Judged::default());
    let folder = tempfile::tempdir()?;
    for request in &all {
        for (count, times) in &mut curve {
            let cloud = cloud(&request.balls, *count, request.seed);
            let file = folder.path().join(format!("cloud-{count}.toml"));
            std::fs::write(&file, scene_file(&cloud))?;
            let mut served = Served::start(vec![("scene", static_scene(&file)?)])?;
            let asked = PlanRequest {
                balls: Vec::new(),
                ..request.clone()
            };
            let (answer, ms) = fastest(&mut served, &asked)?;
            times.push(ms);
            answered += usize::from(answer.selected().is_some());
            let scene = scene(&cloud)?;
            let demand = demand(&robot, &scene, &asked);
            for candidate in answer.candidates() {
                let name = || format!("seed {}, {count} balls", request.seed);
                judged.add(&demand, motion(candidate.knots), true, name);
            }
        }
    }
    show(report, "growth: balls, ten candidates", &curve);
    let line = "growth: requests answered, whatever the number of balls";
    report.all_of(line, answered, all.len() * BALLS.len());
    judged.check(report, "growth, against all the balls");
    Ok(())
}

/// The daemon's table that names a static scene.
fn static_scene(file: &Path) -> anyhow::Result<Value> {
    let file = file.to_str().context("path")?.to_owned();
    let table = toml::Table::from_iter([("file".to_owned(), Value::String(file))]);
    Ok(Value::Table(table))
}

fn scene_file(balls: &[Ball]) -> String {
    let ball = |ball: &Ball| {
        let ([x, y, z], radius) = (ball.centre_m, ball.radius_m);
        format!("[[balls]]\ncentre_m = [{x:?}, {y:?}, {z:?}]\nradius_m = {radius:?}\n")
    };
    balls.iter().map(ball).collect()
}

/// The last answer to a request asked several times, and the shortest time that it took, ms.
fn fastest(served: &mut Served, request: &PlanRequest) -> anyhow::Result<(PlanAnswer, f64)> {
    let (mut answer, mut fastest) = served.ask(request)?;
    for _ in 1..REPETITIONS {
        let (again, seconds) = served.ask(request)?;
        (answer, fastest) = (again, fastest.min(seconds));
    }
    Ok((answer, 1e3 * fastest))
}

/// Points strewn over the surfaces of balls, as a decimated point cloud has them; inside, so that what was clear stays so.
fn cloud(balls: &[Ball], count: usize, seed: u64) -> Vec<Ball> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut point = |index: usize| {
        let ball = &balls[index % balls.len()];
        let height: f64 = rng.random_range(-1.0..1.0);
        let (sine, cosine) = rng.random_range(0.0..TAU).sin_cos();
        let across = (1.0 - height * height).sqrt();
        let direction = [across * cosine, across * sine, height];
        let away = ball.radius_m - POINT_RADIUS;
        Ball {
            centre_m: [0, 1, 2].map(|axis| ball.centre_m[axis] + away * direction[axis]),
            radius_m: POINT_RADIUS,
        }
    };
    (0..count).map(&mut point).collect()
}

/// The curve, and its doublings that cost too much.
fn show(report: &mut Report, name: &str, curve: &[(usize, Vec<f64>)]) {
    let curve: Vec<(usize, f64)> = curve.iter().map(|(at, ms)| (*at, median(ms))).collect();
    let points = curve.iter().map(|(at, ms)| format!("{at}: {ms:.2} ms"));
    report.shown(
        &format!("{name}, median of a request"),
        points.collect::<Vec<_>>().join(", "),
    );
    let doublings = curve.windows(2).filter(|pair| pair[0].0 > 0);
    let cliffs = doublings.filter(|pair| pair[1].1 > CLIFF * pair[0].1);
    let cliffs = cliffs.map(|pair| {
        format!(
            "{} to {}: {:.1} times",
            pair[0].0,
            pair[1].0,
            pair[1].1 / pair[0].1
        )
    });
    let line = format!("{name}, doublings that cost more than {CLIFF} times");
    report.none_of(&line, &cliffs.collect::<Vec<_>>());
}
