//! What was executed, from the controller's cycles, by geometry that shares nothing with the certificate: the body is integrated
//! along its length in small turns, and distances are those of the points found.

use nalgebra::{Rotation3, Vector3};
use pcc_model::{Point, Robot};
use shared_types::codes::LoopState;
use shared_types::message::{Cycle, MovingBall};
use tests::listener::Listener;
use tests::process::{TimedOut, wait_for};

use super::SECOND_NS;

/// Points on each section's backbone.
const POINTS: usize = 60;

/// Points of the backbone, each with the radius of its section's tube, m.
fn body(robot: &Robot, configuration: &[f64; 6]) -> Vec<(Point, f64)> {
    let (mut place, mut frame) = (Vector3::zeros(), Rotation3::identity());
    let mut points = Vec::with_capacity(3 * POINTS);
    for (k, bend) in configuration.chunks_exact(2).enumerate() {
        let step = 1.0 / POINTS as f64;
        let turn = Rotation3::new(Vector3::new(bend[0], bend[1], 0.0) * step);
        let half = Rotation3::new(Vector3::new(bend[0], bend[1], 0.0) * (0.5 * step));
        for _ in 0..POINTS {
            place += (frame * half) * Vector3::z() * (robot.section_lengths[k] * step);
            frame *= turn;
            points.push((place, robot.tube_radii[k]));
        }
    }
    points
}

/// Least distance between a ball that was as told at `stamp_mono_ns` and the commanded body while it moved, m.
pub(super) fn clearance(
    robot: &Robot,
    cycles: &[Cycle],
    ball: &MovingBall,
    stamp_mono_ns: i64,
) -> f64 {
    let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
    let in_motion = cycles.iter().filter(|cycle| moving.contains(&cycle.state));
    let clearance = |cycle: &Cycle| {
        let seconds = (cycle.stamp_mono_ns - stamp_mono_ns) as f64 / SECOND_NS as f64;
        let centre = Point::from(ball.centre_m) + Point::from(ball.velocity_m_s) * seconds;
        let body = body(robot, &cycle.commanded_configuration_rad);
        let distances = body.iter().map(|(p, radius)| (p - centre).norm() - radius);
        distances.fold(f64::INFINITY, f64::min) - ball.radius_m
    };
    // A cycle is a millisecond, in which nothing here moves by more than a few.
    in_motion.map(clearance).fold(f64::INFINITY, f64::min)
}

/// Waits for the first cycle after a time in which the loop brakes; its stamp, nanoseconds.
///
/// # Errors
/// [`TimedOut`] if it never does.
pub(super) fn wait_for_braking(
    listener: &Listener,
    after_mono_ns: i64,
    limit: std::time::Duration,
) -> Result<i64, TimedOut> {
    wait_for("the controller brakes", limit, || {
        listener.with(|heard| {
            let brakes = |cycle: &&Cycle| {
                cycle.stamp_mono_ns > after_mono_ns && cycle.state == LoopState::Stopping.code()
            };
            heard.cycles.iter().find(brakes).map(|c| c.stamp_mono_ns)
        })
    })
}

#[cfg(test)]
mod unit {
    use super::*;
    use pcc_model::Configuration;
    use tests::programs::repository;

    #[test]
    fn the_integrated_body_ends_at_the_tip() {
        let robot = Robot::from_file(&repository().join("config/robots/unit.toml")).unwrap();
        let shape = [0.9, 0.2, 0.5, 0.6, -0.3, 0.7];
        let (tip, _) = *body(&robot, &shape).last().unwrap();
        assert!((tip - robot.tip(&Configuration::from(shape))).norm() < 1e-3);
    }
}
