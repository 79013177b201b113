//! Motions to and fro on a running stack, and the balls that get in their way.

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

/// Where the motions go to and fro, rad.
pub(super) const ENDS: [[f64; 6]; 2] = [[0.0; 6], [0.9, 0.2, 0.5, 0.6, -0.3, 0.7]];
/// Nanoseconds of a second.
pub(super) const SECOND_NS: i64 = 1_000_000_000;

/// The shipped daemon, or one that expects a scene.
pub(super) fn settings(expects_a_scene: bool) -> Settings {
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
pub(super) fn running_with(controller: &[(&str, i64)]) -> anyhow::Result<Stack> {
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
pub(super) fn request(stack: &mut Stack) -> PlanRequest {
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
        // Checks of publication and supervision: nothing of the live scene is planned around.
        ignores_live_scene: true,
        execute: true,
        seed: 3,
        ..PlanRequest::new(start.into(), Goal::Configuration(goal))
    }
}

/// Has a motion executed, or says why not.
pub(super) fn execute(stack: &mut Stack) -> Result<u32, MoveError> {
    let request = request(stack);
    stack.try_motion(&request)
}

/// Waits until the robot is on its way along a trajectory for `seconds`; false where it was refused or cut short before.
pub(super) fn comes_to(stack: &mut Stack, id: u32, seconds: f64) -> Result<bool, TimedOut> {
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
pub(super) fn refusal(stack: &mut Stack) -> anyhow::Result<String> {
    match execute(stack) {
        Ok(id) => anyhow::bail!("trajectory {id} was published"),
        Err(MoveError::Refused {
            outcome: Outcome::ExecutionRefused,
            reason,
        }) => Ok(reason),
        Err(error) => Err(error.into()),
    }
}

/// A resting ball around the middle of the body as it is commanded now.
pub(super) fn on_the_body(stack: &mut Stack) -> MovingBall {
    let shape = stack.commanded();
    let middle = stack.world.robot.backbone(&shape).point(1, 0.5);
    ball(middle, 0.3, Point::zeros())
}

pub(super) fn ball(centre: Point, radius_m: f64, velocity: Point) -> MovingBall {
    MovingBall {
        centre_m: centre.into(),
        radius_m,
        velocity_m_s: velocity.into(),
    }
}
