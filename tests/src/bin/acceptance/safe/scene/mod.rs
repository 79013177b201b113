//! The live scene's age, clock and owner, and supervision after a stall.

mod executed;
mod flood;
mod lag;
mod owners;
mod stall;

use std::thread;
use std::time::Duration;

use pcc_model::{Configuration, Point};
use shared_types::codes::{Outcome, Sampler};
use shared_types::message::MovingBall;
use shared_types::valid::{Goal, PlanRequest};
use tests::stack::{MoveError, Part, Stack};
use tests::world::Settings;
use toml::{Table, Value};

use crate::{Report, Scale};

/// Where the motions go to and fro, rad.
const ENDS: [[f64; 6]; 2] = [[0.0; 6], [0.9, 0.2, 0.5, 0.6, -0.3, 0.7]];
/// Share of the limits that the motions use: at all of them the simulated robot is farther from its set-points after a pause than its
/// tracking tolerance allows, and the controller stops by itself.
const SPEED: f64 = 0.4;
/// Nanoseconds of a second.
const SECOND_NS: i64 = 1_000_000_000;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, scene";
    report.group("scene: supervision after a stall", command, |report| {
        stall::whole_machine(report, scale)
    });
    report.group("scene: old trajectories", command, stall::old_trajectory);
    report.group("scene: stamps", command, owners::stamps);
    report.group("scene: owners", command, |report| {
        owners::dead_publisher(report, scale)?;
        owners::restarted_daemon(report, scale)?;
        owners::nobody_serves_command(report)
    });
    report.group("scene: path time that lags", command, |report| {
        lag::paused_beside_a_ball(report, scale)
    });
    report.group("scene: flood", command, |report| flood::run(report, scale));
}

/// The shipped daemon, or one that expects a scene.
fn settings(expects_a_scene: bool) -> Settings {
    let mut live_scene = Table::new();
    live_scene.insert("expected".into(), expects_a_scene.into());
    Settings {
        daemon: if expects_a_scene {
            vec![("live_scene", Value::Table(live_scene))]
        } else {
            Vec::new()
        },
        ..Settings::default()
    }
}

/// A straight motion in configuration space to the end of [`ENDS`] that the robot is farther from.
fn request(stack: &mut Stack) -> PlanRequest {
    let start = stack.commanded();
    let distance = |end: &[f64; 6]| (Configuration::from(*end) - start).norm();
    let goal = if distance(&ENDS[0]) > distance(&ENDS[1]) {
        ENDS[0]
    } else {
        ENDS[1]
    };
    PlanRequest {
        sampler: Sampler::Straight,
        candidate_count: 1,
        deadline: Some(Duration::from_secs(10)),
        execute: true,
        seed: 3,
        limits_scale: SPEED,
        ..PlanRequest::new(start.into(), Goal::Configuration(goal))
    }
}

/// Has a motion executed, or says why not.
fn execute(stack: &mut Stack) -> Result<u32, MoveError> {
    let request = request(stack);
    stack.try_motion(&request)
}

/// Why a motion was not executed; an error where it was.
fn refusal(stack: &mut Stack) -> anyhow::Result<String> {
    match execute(stack) {
        Ok(id) => anyhow::bail!("trajectory {id} was published"),
        Err(MoveError::Refused {
            outcome: Outcome::ExecutionRefused,
            reason,
        }) => Ok(reason),
        Err(error) => Err(error.into()),
    }
}

/// Holds everything, as when a whole machine pauses.
fn pause_all(stack: &mut Stack, pause: Duration) {
    for part in [Part::Controller, Part::Robot, Part::Daemon] {
        stack.process(part).signal(libc::SIGSTOP);
    }
    thread::sleep(pause);
}

/// Lets everything go on, the daemon first: its heart beats again before the controller looks, which else stops by itself.
fn resume_all(stack: &mut Stack) {
    stack.process(Part::Daemon).signal(libc::SIGCONT);
    thread::sleep(Duration::from_millis(25));
    for part in [Part::Controller, Part::Robot] {
        stack.process(part).signal(libc::SIGCONT);
    }
}

/// A resting ball around the middle of the body as it is commanded now.
fn on_the_body(stack: &mut Stack) -> MovingBall {
    let shape = stack.commanded();
    let middle = stack.world.robot.backbone(&shape).point(1, 0.5);
    ball(middle, 0.3, Point::zeros())
}

fn ball(centre: Point, radius_m: f64, velocity: Point) -> MovingBall {
    MovingBall {
        centre_m: centre.into(),
        radius_m,
        velocity_m_s: velocity.into(),
    }
}
