//! What candidates and balls cost, from one to the most that there can be.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::mpsc::{Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::Context;
use client::{PlanAnswer, ScenePublisher};
use datasets::scenes::Setting;
use pcc_model::{DOF, Robot};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::capacity::MAX_BALLS;
use shared_types::codes::Refusal;
use shared_types::ipc::IpcOptions;
use shared_types::message::{Ball, MovingBall};
use shared_types::valid::PlanRequest;
use tests::played_controller::PlayedController;
use tests::programs::repository;
use tests::stack::PATIENCE;
use toml::Value;

use crate::fast_kept::{Kept, check};
use crate::fast_scenes::{Served, requests};
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::median;

const CANDIDATES: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
const BALLS: [usize; 12] = [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000];
/// A request's time is the fastest of so many: what disturbs one of them is no cost.
const REPETITIONS: usize = 3;
/// A doubling that costs more than this is a cliff.
const CLIFF: f64 = 3.2;
/// Radius of the points of a cloud, m.
const POINT_RADIUS: f64 = 0.03;
/// Speed of the points of a live scene, m/s, how long they count, and how much deeper within the balls they begin, m.
const LIVE_SPEED: f64 = 0.01;
const LIFETIME: Duration = Duration::from_secs(2);
const LIVE_MARGIN: f64 = 0.08;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance fast, requests to planner-daemon";
    report.group("growth with candidates", command, |report| {
        with_candidates(report, scale)
    });
    let command = "acceptance fast, requests to planner-daemon, points in them";
    report.group("growth with balls of the request", command, |report| {
        with_balls(report, scale, Origin::Request)
    });
    let command = "acceptance fast, requests to planner-daemon, points in its static scene";
    report.group("growth with balls of the static scene", command, |report| {
        with_balls(report, scale, Origin::StaticScene)
    });
    let command = "acceptance fast, motions published by planner-daemon, points in its live scene";
    report.group("growth with balls of the live scene", command, |report| {
        with_live_balls(report, scale)
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
    let (mut answered, mut kept) = (0, Vec::new());
    for request in &all {
        for (candidate_count, times) in &mut curve {
            let request = PlanRequest {
                candidate_count: *candidate_count,
                ..request.clone()
            };
            let (answer, ms) = fastest(&mut served, &request)?;
            times.push(ms);
            answered += usize::from(answer.candidates().len() > 0);
            kept.push(Kept::of(request, &answer));
        }
    }
    let name = "growth: candidates, 4 balls";
    show(report, name, &curve);
    let line = format!("{name}: requests answered, whatever the number of candidates");
    report.all_of(&line, answered, all.len() * curve.len());
    check(report, name, &served.world.robot, &kept, 1);
    Ok(())
}

/// What tells the daemon of the points.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Origin {
    Request,
    StaticScene,
}

impl Origin {
    fn name(self) -> &'static str {
        match self {
            Self::Request => "balls of the request",
            Self::StaticScene => "balls of the static scene",
        }
    }

    fn counts(self) -> impl Iterator<Item = usize> {
        let most = match self {
            Self::Request => MAX_BALLS,
            Self::StaticScene => usize::MAX,
        };
        BALLS.into_iter().filter(move |count| *count <= most)
    }

    /// A daemon that knows the points, or a request that tells of them.
    fn ask(
        self,
        request: &PlanRequest,
        cloud: Vec<Ball>,
        folder: &Path,
    ) -> anyhow::Result<(PlanAnswer, f64)> {
        let (keys, balls) = match self {
            Self::Request => (Vec::new(), cloud),
            Self::StaticScene => {
                let file = folder.join(format!("cloud-{}.toml", cloud.len()));
                std::fs::write(&file, scene_file(&cloud))?;
                (vec![("scene", static_scene(&file)?)], Vec::new())
            }
        };
        let asked = PlanRequest {
            balls,
            ..request.clone()
        };
        fastest(&mut Served::start(keys)?, &asked)
    }
}

fn with_balls(report: &mut Report, scale: Scale, origin: Origin) -> anyhow::Result<()> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let robot = robot.to_unit().context("equal sections are needed")?;
    let all = requests(&robot, Setting::General(Some(8)));
    let all: Vec<PlanRequest> = all.take(scale.pick(3, 12)).collect();
    let mut curve: Vec<_> = origin.counts().map(|count| (count, Vec::new())).collect();
    let (mut answered, mut kept) = (0, Vec::new());
    let folder = tempfile::tempdir()?;
    for request in &all {
        for (count, times) in &mut curve {
            let cloud = cloud(&request.balls, *count, request.seed);
            let (answer, ms) = origin.ask(request, cloud.clone(), folder.path())?;
            times.push(ms);
            answered += usize::from(answer.selected().is_some());
            let request = PlanRequest {
                balls: cloud,
                ..request.clone()
            };
            kept.push(Kept::of(request, &answer));
        }
    }
    let name = format!("growth: {}", origin.name());
    show(report, &format!("{name}, ten candidates"), &curve);
    let line = format!("{name}: requests answered, whatever the number of balls");
    report.all_of(&line, answered, all.len() * curve.len());
    let line = format!("{name}, against all of them");
    check(report, &line, &robot, &kept, 1);
    Ok(())
}

/// A motion around balls is planned and published beside points of the live scene that lie within these balls and move slowly, so that
/// planning costs the same whatever their number; what grows is the time in which supervision certifies the motion against them.
fn with_live_balls(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut served = Served::start(Vec::new())?;
    let robot = served.world.unit_robot();
    let mut scenes = ScenePublisher::connect(&served.world.options, "growth")?;
    let all = requests(&robot, Setting::General(Some(8)));
    let all: Vec<PlanRequest> = all.take(scale.pick(3, 12)).collect();
    let mut curve = BALLS.map(|count| (count, Vec::new()));
    let (mut refused, mut kept) = (Vec::new(), Vec::new());
    let played = Played::start(&served.world.options, served.world.robot.hash())?;
    for request in &all {
        let request = PlanRequest {
            execute: true,
            ..request.clone()
        };
        played.hold_at(request.start_configuration_rad);
        for (count, times) in &mut curve {
            let mut fastest_ms = f64::INFINITY;
            for _ in 0..REPETITIONS {
                scenes.publish(&live_cloud(&request.balls, *count, request.seed), LIFETIME)?;
                scenes.confirm(PATIENCE)?;
                let (answer, seconds) = served.ask(&request)?;
                let report = answer.report();
                match report.trajectory_id {
                    Some(id) => played.refuse(id),
                    None => refused.push(format!("{count} balls: {}", report.reason)),
                }
                fastest_ms = fastest_ms.min(1e3 * seconds);
                kept.push(Kept::of(request.clone(), &answer));
            }
            times.push(fastest_ms);
        }
    }
    scenes.take_leave()?;
    let asked = all.len() * curve.len() * REPETITIONS;
    show_live(report, &curve, asked, &refused);
    // The points lie within the request's balls.
    let line = "growth: balls of the live scene, against the balls that they lie in";
    check(report, line, &served.world.robot, &kept, 1);
    Ok(())
}

/// The curve of the live scene, and which of the motions `asked` for were not published.
fn show_live(report: &mut Report, curve: &[(usize, Vec<f64>)], asked: usize, refused: &[String]) {
    let name = "growth: balls of the live scene";
    let line = format!("{name}, ten candidates, the selected one published");
    show(report, &line, curve);
    let line = format!("{name}, motions not published, of {asked}");
    report.none_of(&line, refused);
}

/// A controller that is played in a thread of its own; it ends when dropped.
struct Played {
    orders: Option<Sender<Order>>,
    thread: Option<JoinHandle<()>>,
}

enum Order {
    HoldAt([f64; DOF]),
    Refuse(u32),
}

impl Played {
    fn start(options: &IpcOptions, robot_hash: u64) -> anyhow::Result<Self> {
        let (orders, received) = channel();
        let (started, has_started) = channel();
        let options = options.clone();
        // Ports stay in their thread.
        let play = move || {
            let mut controller = match PlayedController::start(&options, robot_hash) {
                Ok(controller) => controller,
                Err(error) => return drop(started.send(Err(error))),
            };
            let _ = started.send(Ok(()));
            loop {
                match received.try_recv() {
                    Ok(Order::HoldAt(configuration)) => {
                        controller.state.commanded_configuration_rad = configuration;
                    }
                    Ok(Order::Refuse(id)) => {
                        controller.state.refused_trajectory_id = id;
                        controller.state.refusal = Refusal::BeginsInThePast.code();
                    }
                    Err(TryRecvError::Empty) => controller.play(Duration::from_millis(1)),
                    Err(TryRecvError::Disconnected) => break,
                }
            }
        };
        let thread = thread::spawn(play);
        has_started.recv()??;
        Ok(Self {
            orders: Some(orders),
            thread: Some(thread),
        })
    }

    fn hold_at(&self, configuration: [f64; DOF]) {
        self.order(Order::HoldAt(configuration));
    }

    /// Does not take a motion up, so that the next one may be published.
    fn refuse(&self, id: u32) {
        self.order(Order::Refuse(id));
    }

    /// Until the daemon has heard of it.
    fn order(&self, order: Order) {
        let orders = self
            .orders
            .as_ref()
            .expect("it is there until it is dropped");
        orders.send(order).expect("the controller is played");
        thread::sleep(Duration::from_millis(50));
    }
}

impl Drop for Played {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Points within balls that stay within them for as long as they count.
fn live_cloud(balls: &[Ball], count: usize, seed: u64) -> Vec<MovingBall> {
    let inner: Vec<Ball> = balls
        .iter()
        .map(|ball| Ball {
            radius_m: ball.radius_m - LIVE_MARGIN,
            ..*ball
        })
        .collect();
    let points = cloud(&inner, count, seed);
    let moving = |(index, point): (usize, Ball)| {
        let mut velocity_m_s = [0.0; 3];
        velocity_m_s[index % 3] = LIVE_SPEED;
        MovingBall {
            centre_m: point.centre_m,
            radius_m: point.radius_m,
            velocity_m_s,
        }
    };
    points.into_iter().enumerate().map(moving).collect()
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
    if balls.is_empty() {
        return "balls = []\n".to_owned();
    }
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
        &format!("{name}, a request's fastest of {REPETITIONS}, medians over requests"),
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
