//! Requests at random instants of motion: what is asked for, and what the same goal costs a robot that stops first.

use std::time::Duration;

use client::ClientError;
use collision::{Ball as Obstacle, Scene};
use datasets::scenes::{Setting, draw_target};
use pcc_model::{Configuration, Point, UnitRobot};
use rand::RngExt;
use rand_pcg::Pcg64;
use shared_types::message::Ball;
use shared_types::valid::{Goal, PlanRequest};
use trajectory::{Knot, stopping_motion};

use crate::stack::{PATIENCE, Stack};

/// Room of targets and starts beside the tube, section lengths, as in the data sets.
const ROOM: f64 = 0.1;
/// Candidates of a request.
const CANDIDATES: usize = 10;

/// A scene in which the robot stands clear, and its balls on the wire.
#[derive(Clone, Debug)]
pub struct ReplanScene {
    scene: Scene,
    /// The balls of every request, m.
    pub balls: Vec<Ball>,
}

impl ReplanScene {
    /// The first general scene from `index` on in which a robot in this configuration has room; and how many were passed over.
    #[must_use]
    pub fn around(
        robot: &UnitRobot,
        standing: &Configuration,
        seed: u64,
        index: u64,
    ) -> (Self, usize) {
        let scenes = (index..).filter_map(|index| {
            draw_target(robot, Setting::General(None), seed, index).map(|target| target.scene)
        });
        for (passed_over, scene) in scenes.enumerate() {
            if scene.clearance_at(robot, standing) >= ROOM {
                let balls = scene.balls().iter().map(wire).collect();
                return (Self { scene, balls }, passed_over);
            }
        }
        unreachable!("scenes go on without end")
    }

    /// The tip of a random configuration with room, section lengths.
    #[must_use]
    pub fn tip(&self, robot: &UnitRobot, random: &mut Pcg64) -> Point {
        loop {
            let configuration = random_configuration(robot, random);
            if self.scene.clearance_at(robot, &configuration) >= ROOM {
                return robot.tip(&configuration);
            }
        }
    }
}

fn wire(ball: &Obstacle) -> Ball {
    Ball {
        centre_m: ball.centre.into(),
        radius_m: ball.radius,
    }
}

/// A configuration in which each section bends evenly over the disc of what it may.
pub fn random_configuration(robot: &UnitRobot, random: &mut Pcg64) -> Configuration {
    let mut configuration = Configuration::zeros();
    for section in 0..3 {
        let bending = robot.bending_limit * random.random_range(0.0_f64..1.0).sqrt();
        let (sine, cosine) = random.random_range(0.0..std::f64::consts::TAU).sin_cos();
        configuration[2 * section] = bending * cosine;
        configuration[2 * section + 1] = bending * sine;
    }
    configuration
}

/// Deadline of replans and of what they are compared with: none is cut short.
const DEADLINE: Duration = Duration::from_secs(1);

/// A request for a tip from where the robot is, to be executed; m.
#[must_use]
pub fn replan(tip_m: [f64; 3], balls: &[Ball], seed: u64) -> PlanRequest {
    let goal = Goal::tip(tip_m);
    PlanRequest {
        candidate_count: CANDIDATES,
        seed,
        deadline: Some(DEADLINE),
        execute: true,
        balls: balls.to_vec(),
        ..PlanRequest::from_robot(goal)
    }
}

/// What stopping first costs.
#[derive(Clone, Copy, Debug)]
pub struct StopThenGo {
    /// The shortest stop within the limits, s.
    pub stop_s: f64,
    /// From where it ends to the goal configuration, s; none where the planner finds no motion.
    pub go_s: Option<f64>,
}

/// Stops in the state of a knot straight ahead, then goes to a configuration by the fastest of ten candidates, planned like every request.
///
/// # Errors
/// [`ClientError`].
pub fn stop_then_go(
    stack: &mut Stack,
    state: &crate::knots::Knot,
    end: [f64; 6],
    balls: &[Ball],
    seed: u64,
) -> Result<StopThenGo, ClientError> {
    let robot = &stack.world.robot;
    let [position, velocity, acceleration] = state.values.map(Configuration::from);
    let from = Knot {
        time: 0.0,
        position,
        velocity,
        acceleration,
    };
    let stop = stopping_motion(&from, &robot.tendons, &robot.tendon_limits)
        .expect("a state of a certified motion can stop");
    let request = PlanRequest {
        candidate_count: CANDIDATES,
        seed,
        deadline: Some(DEADLINE),
        balls: balls.to_vec(),
        ..PlanRequest::new(stop.end().into(), Goal::Configuration(end))
    };
    let answer = stack.client.plan(&request, PATIENCE)?;
    let durations = answer
        .report()
        .candidates
        .iter()
        .map(|candidate| candidate.duration_s);
    let fastest = durations.fold(f64::INFINITY, f64::min);
    Ok(StopThenGo {
        stop_s: stop.duration(),
        go_s: fastest.is_finite().then_some(fastest),
    })
}

/// A random time up to `longest`.
pub fn random_pause(shortest: Duration, longest: Duration, random: &mut Pcg64) -> Duration {
    shortest + (longest - shortest).mul_f64(random.random_range(0.0..1.0))
}
