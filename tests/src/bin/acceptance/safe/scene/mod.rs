//! The live scene's age, clock and owner, and supervision after a stall.

mod crossing;
mod executed;
mod flood;
mod lag;
mod owners;
mod stall;

use std::fs;
use std::time::Duration;

use pcc_model::{Configuration, Point};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, Outcome, Sampler};
use shared_types::message::MovingBall;
use shared_types::valid::{Goal, PlanRequest};
use tests::process::{TimedOut, wait_for};
use tests::stack::{MoveError, PATIENCE, Part, Stack};
use tests::world::{Settings, World};
use toml::{Table, Value};

use crate::{Report, Scale};

/// Where the motions go to and fro, rad.
const ENDS: [[f64; 6]; 2] = [[0.0; 6], [0.9, 0.2, 0.5, 0.6, -0.3, 0.7]];
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
        owners::dead_publisher(report)?;
        owners::silent_source(report, scale)?;
        owners::restarted_daemon(report, scale)?;
        owners::ended_program(report, scale)?;
        owners::nobody_serves_command(report)
    });
    report.group("scene: path time that lags", command, |report| {
        lag::late_beside_a_ball(report, scale)
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

/// All three processes of a shipped configuration in which the controller has other values for some keys.
fn running_with(controller: &[(&str, i64)]) -> anyhow::Result<Stack> {
    let world = World::new(&settings(false));
    let file = world.config("controller.toml");
    let mut table: Table = fs::read_to_string(&file)?.parse()?;
    for (key, value) in controller {
        table.insert((*key).to_owned(), Value::Integer(*value));
    }
    fs::write(&file, table.to_string())?;
    let mut stack = Stack::within(world);
    for part in Part::ALL {
        stack.start(part);
    }
    stack.wait_until_ready()?;
    Ok(stack)
}

/// A straight motion, as fast as the limits allow, in configuration space to the end of [`ENDS`] that the robot is farther from.
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
        ..PlanRequest::new(start.into(), Goal::Configuration(goal))
    }
}

/// Has a motion executed, or says why not.
fn execute(stack: &mut Stack) -> Result<u32, MoveError> {
    let request = request(stack);
    stack.try_motion(&request)
}

/// Waits until the robot is on its way along a trajectory for `seconds`; false where it was refused or cut short before.
fn comes_to(stack: &mut Stack, id: u32, seconds: f64) -> Result<bool, TimedOut> {
    let (view, asked_ns) = (&mut stack.controller, mono_now_ns());
    wait_for("the motion goes on, or is over", PATIENCE, || {
        let state = view.latest_state().ok().flatten()?;
        let values = &state.values;
        let on_it = values.trajectory_id == id && values.trajectory_time_s >= seconds;
        if on_it && state.state == LoopState::Executing {
            return Some(true);
        }
        let rests = matches!(state.state, LoopState::Holding | LoopState::Fault);
        let begun = values.stamp_mono_ns > asked_ns + 2 * SECOND_NS;
        let over = values.refused_trajectory_id == id || (rests && begun);
        over.then_some(false)
    })
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

/// Sends a signal to all three processes, one right after the other.
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
