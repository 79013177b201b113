//! Balls that cover a moving ball wherever it can be while it is earlier or later than expected.

use crate::certify::moving_balls::MovingBall;
use crate::obstacle::ball::Ball;
use pcc_model::{Point, Robot};

/// Most balls that cover one moving ball.
const MAX_COVERING_BALLS: usize = 8;
/// Largest distance of two covering balls' centres where there are enough, radii: they are a quarter larger then.
const SPACING: f64 = 1.5;

/// By how much what moves may be behind or ahead of where it is expected, s: from `earliest` (below 0 for places that it has passed) to
/// `latest`, for places that it comes to later.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSpread {
    /// Time from the expected place to the earliest one, s, at most 0.
    pub earliest: f64,
    /// Time from the expected place to the latest one, s, at least 0.
    pub latest: f64,
}

impl TimeSpread {
    /// Balls that cover all of `balls` during `times` (s of the trajectory), at most eight for each; those that the robot cannot reach
    /// are left out. They move along with the ball that they cover.
    #[must_use]
    pub fn cover(self, balls: &[MovingBall], robot: &Robot, times: [f64; 2]) -> Vec<MovingBall> {
        let length: f64 = robot.section_lengths.iter().sum();
        let reach = length + robot.largest_tube_radius();
        let covering = balls.iter().flat_map(|ball| self.cover_one(ball));
        covering
            .filter(|ball| ball.comes_within(reach, times))
            .collect()
    }

    fn cover_one(self, moving: &MovingBall) -> impl Iterator<Item = MovingBall> {
        let Self { earliest, latest } = self;
        let MovingBall { ball, velocity } = *moving;
        let way = velocity.norm() * (latest - earliest);
        let pieces = (way / (SPACING * ball.radius)).ceil();
        let pieces = pieces.clamp(1.0, MAX_COVERING_BALLS as f64 - 1.0);
        let radius = ball.radius.hypot(0.5 * way / pieces);
        (0..=pieces as usize).map(move |i| {
            let time_s = earliest + (latest - earliest) * (i as f64 / pieces);
            MovingBall {
                ball: Ball {
                    centre: ball.centre + velocity * time_s,
                    radius,
                },
                velocity,
            }
        })
    }
}

impl MovingBall {
    /// Whether the ball comes within `reach`, a length, of the base between two times, s; where that is not a number, it does.
    fn comes_within(&self, reach: f64, [from, to]: [f64; 2]) -> bool {
        let (begin, way) = (self.at(from).centre, self.velocity * (to - from).max(0.0));
        let place = (-begin.dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let nearest: Point = begin + way * place;
        let is_beyond = nearest.norm() > reach + self.ball.radius;
        !is_beyond
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(speed: f64, radius: f64) -> MovingBall {
        MovingBall {
            ball: Ball {
                centre: Point::new(1.0, 0.0, 1.0),
                radius,
            },
            velocity: Point::new(0.0, speed, 0.0),
        }
    }

    const SPREAD: TimeSpread = TimeSpread {
        earliest: -0.65,
        latest: 0.85,
    };

    #[test]
    fn all_places_within_the_spread_are_covered_and_hardly_more() {
        for (speed, radius) in [
            (0.1, 0.3),
            (0.5, 0.1),
            (2.0, 0.05),
            (-1.0, 0.0),
            (30.0, 0.1),
        ] {
            let ball = moving(speed, radius);
            let covering: Vec<MovingBall> = SPREAD.cover_one(&ball).collect();
            assert!(covering.len() <= MAX_COVERING_BALLS);
            for time in [0.0, 0.7] {
                for step in 0..=100 {
                    let off_s = -0.65 + 1.5 * f64::from(step) / 100.0;
                    let true_ball = ball.at(time + off_s);
                    for tilt in 0..8 {
                        let angle = f64::from(tilt) * std::f64::consts::FRAC_PI_4;
                        let side = Point::new(angle.cos(), angle.sin(), 0.0) * radius;
                        let surface = true_ball.centre + side;
                        let inside = |other: &MovingBall| {
                            let other = other.at(time);
                            (surface - other.centre).norm() <= other.radius + 1e-12
                        };
                        assert!(covering.iter().any(inside), "{speed} {radius} {off_s}");
                    }
                }
            }
        }
        let slim: Vec<MovingBall> = SPREAD.cover_one(&moving(0.5, 0.1)).collect();
        assert!(slim.iter().all(|ball| ball.ball.radius <= 0.125 + 1e-12));
    }
}
