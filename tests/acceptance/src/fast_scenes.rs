//! What the checks of the default planner ask for: requests in unseen scenes, and a daemon to ask.

use std::time::Instant;

use anyhow::Context;
use client::{Client, PlanAnswer};
use collision::Scene;
use datasets::scenes::{Setting, draw_target};
use pcc_model::UnitRobot;
use shared_types::message::Ball;
use shared_types::valid::{Goal, PlanRequest};
use tests::process::Process;
use tests::stack::{NO_DEADLINE, PATIENCE, Part};
use tests::world::{Settings, World};
use toml::Value;

use crate::runs::weights_folder;

/// Seed of the scenes that the daemon is asked about: no data set was made with it.
const SEED: u64 = 9010;

/// Requests of a setting, as [`requests_of`] draws them.
pub(crate) fn requests(robot: &UnitRobot, setting: Setting) -> impl Iterator<Item = PlanRequest> {
    requests_of(robot, move |_| setting)
}

/// Requests for the unit robot, whose lengths are metres as they are section lengths, in scenes of a setting for each index.
///
/// Ten candidates, no deadline; the seed of each is its index.
pub(crate) fn requests_of(
    robot: &UnitRobot,
    setting: impl Fn(u64) -> Setting,
) -> impl Iterator<Item = PlanRequest> {
    let targets = (0..).filter_map(move |index| draw_target(robot, setting(index), SEED, index));
    let requests = targets.flat_map(|target| {
        let goal = Goal::Tip {
            position_m: target.tip.into(),
            tolerance_m: None,
        };
        let balls = wire_balls(&target.scene);
        target.starts.into_iter().map(move |start| PlanRequest {
            balls: balls.clone(),
            candidate_count: 10,
            deadline: Some(NO_DEADLINE),
            ..PlanRequest::new(start.into(), goal)
        })
    });
    (0..)
        .zip(requests)
        .map(|(seed, request)| PlanRequest { seed, ..request })
}

/// The balls of a scene as a request has them.
pub(crate) fn wire_balls(scene: &Scene) -> Vec<Ball> {
    let ball = |ball: &collision::Ball| Ball {
        centre_m: ball.centre.into(),
        radius_m: ball.radius,
    };
    scene.balls().iter().map(ball).collect()
}

/// A daemon of its own, with the weights in use, and a client.
pub(crate) struct Served {
    pub(crate) client: Client,
    pub(crate) daemon: Process,
    pub(crate) world: World,
}

impl Served {
    /// Starts it with the shipped configuration but for these keys, and waits until it serves.
    pub(crate) fn start(keys: Vec<(&'static str, Value)>) -> anyhow::Result<Self> {
        let weights = weights_folder().canonicalize()?;
        let weights = weights.to_str().context("path")?.to_owned();
        let mut daemon = vec![("weights", Value::String(weights))];
        daemon.extend(keys);
        let world = World::new(&Settings {
            daemon,
            ..Settings::default()
        });
        let daemon = Part::Daemon.start(&world);
        let mut client = Client::connect(&world.options)?;
        let served = client.wait_for_daemon(PATIENCE);
        served.with_context(|| daemon.log())?;
        Ok(Self {
            client,
            daemon,
            world,
        })
    }

    /// The answer to a request and the time from sending to having it, s.
    pub(crate) fn ask(&mut self, request: &PlanRequest) -> anyhow::Result<(PlanAnswer, f64)> {
        let clock = Instant::now();
        let answer = self.client.plan(request, PATIENCE);
        let seconds = clock.elapsed().as_secs_f64();
        Ok((answer.with_context(|| self.daemon.log())?, seconds))
    }
}
