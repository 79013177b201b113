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

use crate::brute_force::Body;
use crate::shortest_stop::shortest_stop;
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

/// A configuration to go to among balls by the fastest of ten candidates, planned like every request.
#[derive(Clone, Copy, Debug)]
pub struct Destination<'a> {
    /// The configuration, rad.
    pub end: [f64; 6],
    /// What stands in the way, m.
    pub balls: &'a [Ball],
    /// Seed of the request.
    pub seed: u64,
}

impl Destination<'_> {
    /// Duration of the motion from rest, s; none where the planner finds no motion.
    fn go_s(&self, stack: &mut Stack, start: [f64; 6]) -> Result<Option<f64>, ClientError> {
        let request = PlanRequest {
            candidate_count: CANDIDATES,
            seed: self.seed,
            deadline: Some(DEADLINE),
            balls: self.balls.to_vec(),
            ..PlanRequest::new(start, Goal::Configuration(self.end))
        };
        let answer = stack.client.plan(&request, PATIENCE)?;
        let durations_s = answer.candidates().map(|it| it.summary.duration_s);
        Ok(durations_s.min_by(f64::total_cmp))
    }
}

/// What stopping first costs.
#[derive(Clone, Copy, Debug)]
pub struct StopThenGo {
    /// A lower bound of every stop within the limits: the time in which the slowest tendon can come to rest, s.
    pub least_stop_s: f64,
    /// The planner's own stop, s.
    pub own_stop_s: f64,
    /// From where that ends to the destination, s; none where the planner finds no motion.
    pub go_s: Option<f64>,
    /// Configuration to stop from and its rates, rad, rad/s, rad/s².
    from: [[f64; 6]; 3],
    /// Where the planner's own stop ends, rad.
    own_rest: [f64; 6],
}

/// What the shortest stop costs, beside the planner's own.
#[derive(Clone, Copy, Debug)]
pub struct ShortestStopThenGo {
    /// The least and the largest duration that the shortest stop may have, s.
    pub stop_s: [f64; 2],
    /// From where it rests to the destination, s; none where the planner finds no motion.
    pub go_s: Option<f64>,
}

/// Stops in the state of a knot as the planner does, then goes to the destination.
///
/// # Errors
/// [`ClientError`].
pub fn stop_then_go(
    stack: &mut Stack,
    body: &Body,
    state: &crate::knots::Knot,
    destination: &Destination<'_>,
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
    let own_rest = stop.end().into();
    Ok(StopThenGo {
        least_stop_s: least_stop_of_tendons_s(body, &robot.tendon_limits, state),
        own_stop_s: stop.duration(),
        go_s: destination.go_s(stack, own_rest)?,
        from: state.values,
        own_rest,
    })
}

impl StopThenGo {
    /// The shortest stop within the limits, which rests as near to the planner's own as it can, and going on from there. Where the solver does not say
    /// where it rests, it is taken to rest where the planner's own stop does.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn by_the_shortest_stop(
        &self,
        stack: &mut Stack,
        body: &Body,
        destination: &Destination<'_>,
    ) -> Result<ShortestStopThenGo, ClientError> {
        let [from, velocity, acceleration] = self.from;
        let between_s = [self.least_stop_s, self.own_stop_s];
        let own_displacement = std::array::from_fn(|angle| self.own_rest[angle] - from[angle]);
        let limits = &stack.world.robot.tendon_limits;
        let rates = [velocity, acceleration];
        let stop = shortest_stop(body, limits, &rates, between_s, &own_displacement);
        let go_s = match stop.displacement_rad {
            Some(moved) => {
                let rest = std::array::from_fn(|angle| from[angle] + moved[angle]);
                destination.go_s(stack, rest)?
            }
            None => self.go_s,
        };
        Ok(ShortestStopThenGo {
            stop_s: stop.between_s,
            go_s,
        })
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

/// A random time between two.
pub fn random_pause(shortest: Duration, longest: Duration, random: &mut Pcg64) -> Duration {
    shortest + (longest - shortest).mul_f64(random.random_range(0.0..1.0))
}

#[cfg(test)]
mod least_stops {
    use super::least_stop_s;

    #[test]
    fn a_stop_of_the_least_time_is_known_in_simple_cases() {
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
