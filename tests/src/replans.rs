//! Requests at random instants of motion: what is asked for, and what the same goal costs a robot that stops first.

use std::time::Duration;

use client::ClientError;
use collision::{Ball as Obstacle, Scene};
use datasets::scenes::{Setting, draw_target};
use pcc_model::{Configuration, Point, TendonLimits, UnitRobot};
use rand::RngExt;
use rand_pcg::Pcg64;
use shared_types::message::Ball;
use shared_types::valid::{Goal, PlanRequest};
use trajectory::{Knot, stopping_motion};

use crate::brute_force::{self, Body};
use crate::shortest_stop::shortest_stop_s;
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
    /// The first general scene from `index` on, which is moved behind it, in which a robot in this configuration has room.
    #[must_use]
    pub fn around(robot: &UnitRobot, standing: &Configuration, seed: u64, index: &mut u64) -> Self {
        loop {
            let target = draw_target(robot, Setting::General(None), seed, *index);
            *index += 1;
            let scene = target.map(|target| target.scene);
            if let Some(scene) = scene.filter(|it| it.clearance_at(robot, standing) >= ROOM) {
                let balls = scene.balls().iter().map(wire).collect();
                return Self { scene, balls };
            }
        }
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
    /// A lower bound of every stop within the limits: the time in which the slowest tendon can come to rest, s.
    pub least_stop_s: f64,
    /// The stop straight ahead that the planner knows, s.
    pub stop_ahead_s: f64,
    /// Velocity and acceleration to stop from, rad/s and rad/s².
    rates: [brute_force::Configuration; 2],
    /// From where it ends to the goal configuration, s; none where the planner finds no motion.
    pub go_s: Option<f64>,
}

/// Stops in the state of a knot straight ahead, then goes to a configuration by the fastest of ten candidates, planned like every request.
///
/// # Errors
/// [`ClientError`].
pub fn stop_then_go(
    stack: &mut Stack,
    body: &Body,
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
    let durations_s = answer.candidates().map(|it| it.summary.duration_s);
    let fastest = durations_s.fold(f64::INFINITY, f64::min);
    Ok(StopThenGo {
        least_stop_s: least_stop_of_tendons_s(body, &robot.tendon_limits, state),
        stop_ahead_s: stop.duration(),
        rates: [state.values[1], state.values[2]],
        go_s: fastest.is_finite().then_some(fastest),
    })
}

impl StopThenGo {
    /// The least and the largest duration that the shortest stop within the limits may have, s.
    #[must_use]
    pub fn shortest_stop_s(&self, body: &Body, limits: &TendonLimits) -> [f64; 2] {
        let between_s = [self.least_stop_s, self.stop_ahead_s];
        shortest_stop_s(body, limits, &self.rates, between_s)
    }
}

/// The time in which the slowest tendon can come to rest from the state of a knot, s.
fn least_stop_of_tendons_s(body: &Body, limits: &TendonLimits, state: &crate::knots::Knot) -> f64 {
    let [_, velocity, acceleration] = &state.values;
    let tendons = body
        .tendons(velocity)
        .into_iter()
        .zip(body.tendons(acceleration));
    let stops = tendons.map(|(v, a)| least_stop_s([v, a], [limits.acceleration, limits.jerk]));
    stops.fold(0.0, f64::max)
}

/// The least time from a velocity and an acceleration to none of both, at an acceleration and a jerk of at most these: the acceleration falls at
/// the jerk limit to where it stays or turns, and rises at it to 0.
fn least_stop_s([v, a]: [f64; 2], [most_a, most_j]: [f64; 2]) -> f64 {
    // The velocity that is left where the acceleration alone is brought to 0.
    let left = v + a * a.abs() / (2.0 * most_j);
    let (v, a) = if left < 0.0 { (-v, -a) } else { (v, a) };
    let turn = (most_j * v + 0.5 * a * a).max(0.0).sqrt();
    if turn <= most_a {
        return (a + 2.0 * turn) / most_j;
    }
    let held_s = (v + a * a / (2.0 * most_j)) / most_a - most_a / most_j;
    (a + 2.0 * most_a) / most_j + held_s
}

/// A random time up to `longest`.
pub fn random_pause(shortest: Duration, longest: Duration, random: &mut Pcg64) -> Duration {
    shortest + (longest - shortest).mul_f64(random.random_range(0.0..1.0))
}

#[cfg(test)]
mod least_stops {
    use super::least_stop_s;

    /// Against small steps of jerk that end at rest.
    #[test]
    fn a_stop_of_the_least_time_ends_at_rest_and_is_known_in_simple_cases() {
        // From an acceleration alone that is just braked away.
        assert!((least_stop_s([-0.5, 1.0], [2.0, 1.0]) - 1.0).abs() < 1e-12);
        // From a velocity alone: two ramps, and a time at the limit between them.
        assert!((least_stop_s([1.0, 0.0], [10.0, 1.0]) - 2.0).abs() < 1e-12);
        assert!((least_stop_s([4.0, 0.0], [1.0, 1.0]) - 5.0).abs() < 1e-12);
        // The figures of a tendon of the unit robot that still accelerates.
        let stop_s = least_stop_s([0.05, 0.39], [0.39, 3.9]);
        assert!((stop_s - 0.378).abs() < 1e-3, "{stop_s}");
        // It makes no difference in which direction.
        let mirrored_s = least_stop_s([-0.05, -0.39], [0.39, 3.9]);
        assert!((stop_s - mirrored_s).abs() < 1e-12);
    }
}
