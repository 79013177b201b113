//! Balls that cross the workspace while the robot is on its way.

use std::f64::consts::TAU;

use pcc_model::{Configuration, UnitRobot};
use planning::random_configuration;
use rand::RngExt;
use rand_pcg::Pcg64;
use shared_types::message::MovingBall;

use crate::brute_force::Ball;
use crate::geometry::seeded;

/// Beyond this distance from the base no ball reaches the robot of three sections of 1 m, m.
const REACH_M: f64 = 3.3;
/// Where the paths of balls cross the workspace: the middle of a box, and half of its sides, m.
const MIDDLE_M: [f64; 3] = [0.0, 0.0, 1.9];
const HALF_SIDES_M: [f64; 3] = [1.2, 1.2, 0.9];
/// Balls come into reach within this time, s: about what a motion takes.
const LATEST_S: f64 = 3.0;
/// Distance between start and goal tip, at least, m.
const LEAST_WAY_M: f64 = 1.0;

/// What one run is about.
#[derive(Clone, Debug)]
pub struct Crossing {
    /// Where the robot rests first.
    pub start: Configuration,
    /// Where its tip is to go, m.
    pub tip_m: [f64; 3],
    /// Balls where they are at the run's begin, m and m/s.
    pub balls: Vec<MovingBall>,
    /// When each comes into reach, and is seen from then on, s.
    pub seen_s: Vec<f64>,
}

impl Crossing {
    /// The run of this number: 1 to 4 balls, up to a largest speed (m/s).
    #[must_use]
    pub fn draw(robot: &UnitRobot, seed: u64, fastest_m_s: f64) -> Self {
        let mut random = seeded(seed);
        let start = random_configuration(robot, &mut random);
        let goal = loop {
            let goal = random_configuration(robot, &mut random);
            if (robot.tip(&goal) - robot.tip(&start)).norm() >= LEAST_WAY_M {
                break goal;
            }
        };
        let count = random.random_range(1..=4);
        let (balls, seen_s) = (0..count).map(|_| ball(&mut random, fastest_m_s)).unzip();
        Self {
            start,
            balls,
            seen_s,
            tip_m: robot.tip(&goal).into(),
        }
    }

    /// The balls for a judge, by the clock time of the run's begin, nanoseconds.
    #[must_use]
    pub fn judged(&self, begun_ns: i64) -> Vec<Ball> {
        let judged = |moving: &MovingBall| Ball {
            centre_m: moving.centre_m,
            radius_m: moving.radius_m,
            velocity_m_s: moving.velocity_m_s,
            stamp_ns: begun_ns,
        };
        self.balls.iter().map(judged).collect()
    }

    /// The balls that were seen until after some time, s, where they are then.
    #[must_use]
    pub fn seen_after(&self, elapsed_s: f64) -> Vec<MovingBall> {
        let seen = self.balls.iter().zip(&self.seen_s);
        seen.filter(|(_, seen_s)| elapsed_s >= **seen_s)
            .map(|(moving, _)| MovingBall {
                centre_m: place(moving, elapsed_s),
                ..*moving
            })
            .collect()
    }

    /// Time after which no ball reaches the robot any more, s.
    #[must_use]
    pub fn gone_s(&self) -> f64 {
        let gone = |moving: &MovingBall| {
            let far = REACH_M + moving.radius_m;
            let is_far = |time_s: f64| norm(place(moving, time_s)) > far;
            let steps = (0..6_000).rev().map(|step| f64::from(step) * 0.01);
            steps.take_while(|&time_s| is_far(time_s)).last()
        };
        let gone = self.balls.iter().map(|moving| gone(moving).unwrap_or(60.0));
        gone.fold(0.0, f64::max)
    }
}

fn place(moving: &MovingBall, elapsed_s: f64) -> [f64; 3] {
    std::array::from_fn(|axis| moving.centre_m[axis] + elapsed_s * moving.velocity_m_s[axis])
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// A ball that comes into reach within the first seconds and passes a random place of the workspace, and when it comes into reach, s.
fn ball(random: &mut Pcg64, fastest_m_s: f64) -> (MovingBall, f64) {
    let speed = fastest_m_s * random.random_range(0.3..1.0);
    let height: f64 = random.random_range(-0.6..0.6);
    let (sine, cosine) = random.random_range(0.0..TAU).sin_cos();
    let level = (1.0 - height * height).sqrt();
    let velocity_m_s = [level * cosine, level * sine, height].map(|part| part * speed);
    let passed: [f64; 3] = std::array::from_fn(|axis| {
        MIDDLE_M[axis] + HALF_SIDES_M[axis] * random.random_range(-1.0..1.0)
    });
    let radius_m = random.random_range(0.08..0.25);
    let mut moving = MovingBall {
        centre_m: passed,
        radius_m,
        velocity_m_s,
    };
    let reach = REACH_M + radius_m;
    let outside = (0..6_000).map(|step| -f64::from(step) * 0.01);
    let mut outside = outside.skip_while(|&time_s| norm(place(&moving, time_s)) < reach);
    let first = outside.next().unwrap_or(-60.0);
    let seen_s = random.random_range(0.0..LATEST_S);
    moving.centre_m = place(&moving, first - seen_s);
    (moving, seen_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::programs::repository;
    use pcc_model::Robot;

    fn unit_robot() -> UnitRobot {
        let file = repository().join("config/robots/unit.toml");
        Robot::from_file(&file).unwrap().to_unit().unwrap()
    }

    #[test]
    fn balls_begin_and_end_out_of_reach_and_cross_it_in_between() {
        let robot = unit_robot();
        for seed in 0..50 {
            let crossing = Crossing::draw(&robot, seed, 0.8);
            assert!((1..=4).contains(&crossing.balls.len()));
            let gone_s = crossing.gone_s();
            assert!(crossing.seen_after(0.0).len() <= crossing.seen_after(3.0).len());
            assert_eq!(crossing.seen_after(3.0).len(), crossing.balls.len());
            for moving in &crossing.balls {
                assert!(norm(moving.centre_m) >= REACH_M);
                let least = (0..6_000).map(|step| norm(place(moving, f64::from(step) * 0.01)));
                assert!(least.fold(f64::INFINITY, f64::min) < 3.3);
                assert!(norm(place(moving, gone_s)) > REACH_M);
            }
        }
    }
}
