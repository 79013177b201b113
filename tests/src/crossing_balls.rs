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
        let way = Way::between(robot, &start, &goal);
        let balls = (0..count).map(|_| ball(&mut random, &way, fastest_m_s));
        let (balls, seen_s) = balls.unzip();
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

/// The straight way between two configurations at a speed that the tendons allow.
struct Way<'a> {
    robot: &'a UnitRobot,
    ends: [Configuration; 2],
    lasts_s: f64,
}

impl<'a> Way<'a> {
    fn between(robot: &'a UnitRobot, start: &Configuration, goal: &Configuration) -> Self {
        let mut pulled = [0.0; 9];
        robot.tendons.lengths(&(goal - start), &mut pulled);
        let farthest = pulled.iter().fold(0.0_f64, |most, way| most.max(way.abs()));
        Self {
            robot,
            ends: [*start, *goal],
            lasts_s: farthest / robot.tendon_limits.velocity,
        }
    }

    /// A random place of the body at a random time of the way, and the time, s.
    fn met(&self, random: &mut Pcg64) -> ([f64; 3], f64) {
        let share = random.random_range(0.2..1.0);
        let [from, to] = &self.ends;
        let backbone = self.robot.backbone(&from.lerp(to, share));
        let section = random.random_range(1..3);
        let place = backbone.point(section, random.random_range(0.0..1.0));
        (place.into(), share * self.lasts_s)
    }
}

/// A ball that meets a robot on its straight way, and when it comes into reach, s, from the begin on.
fn ball(random: &mut Pcg64, way: &Way, fastest_m_s: f64) -> (MovingBall, f64) {
    let speed = fastest_m_s * random.random_range(0.3..1.0);
    let height: f64 = random.random_range(-0.6..0.6);
    let (sine, cosine) = random.random_range(0.0..TAU).sin_cos();
    let level = (1.0 - height * height).sqrt();
    let velocity_m_s = [level * cosine, level * sine, height].map(|part| part * speed);
    let radius_m = random.random_range(0.08..0.25);
    let (met, met_s) = way.met(random);
    let mut moving = MovingBall {
        centre_m: met,
        radius_m,
        velocity_m_s,
    };
    let reach = REACH_M + radius_m;
    let outside = (0..6_000).map(|step| -f64::from(step) * 0.01);
    let mut outside = outside.skip_while(|&time_s| norm(place(&moving, time_s)) < reach);
    let comes_s = met_s + outside.next().unwrap_or(-60.0);
    moving.centre_m = place(&moving, -met_s);
    (moving, comes_s.max(0.0))
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
    fn balls_cross_the_reach_and_leave_it() {
        let robot = unit_robot();
        for seed in 0..50 {
            let crossing = Crossing::draw(&robot, seed, 0.8);
            assert!((1..=4).contains(&crossing.balls.len()));
            let gone_s = crossing.gone_s();
            assert!(crossing.seen_after(0.0).len() <= crossing.seen_after(20.0).len());
            assert_eq!(crossing.seen_after(20.0).len(), crossing.balls.len());
            for moving in &crossing.balls {
                let least = (0..6_000).map(|step| norm(place(moving, f64::from(step) * 0.01)));
                assert!(least.fold(f64::INFINITY, f64::min) < 3.3);
                assert!(norm(place(moving, gone_s)) > REACH_M);
            }
        }
    }
}
