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
    /// When it was seen where it is told to have been, s of the trajectory's time: it comes to no place again that it had passed then. −∞
    /// where that is not known.
    pub seen: f64,
}

/// Which balls cover one that may be early or late: either suffices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cover {
    /// From the earliest place to the latest one, moving along with the ball.
    MovingAlong,
    /// From where the ball was seen to the latest place.
    SinceSeen,
}

impl Cover {
    /// Both, the one that is always known first.
    pub const ALL: [Self; 2] = [Self::MovingAlong, Self::SinceSeen];
}

/// Distance from the base that no part of the robot is beyond, a length.
pub(crate) fn reach(robot: &Robot) -> f64 {
    let length: f64 = robot.section_lengths.iter().sum();
    length + robot.largest_tube_radius()
}

impl TimeSpread {
    /// Balls that cover all of `balls` during `times` (s of the trajectory), at most eight for each; those that the robot cannot reach are left
    /// out. None where it is not known when the balls were seen, and that is asked for.
    #[must_use]
    pub fn cover(
        self,
        cover: Cover,
        balls: &[MovingBall],
        robot: &Robot,
        times: [f64; 2],
    ) -> Option<Vec<MovingBall>> {
        let reach = reach(robot);
        let chain = match cover {
            Cover::MovingAlong => self.moving_along(times),
            Cover::SinceSeen => self.since_seen(times)?,
        };
        let covering = balls.iter().flat_map(|ball| chain.cover(ball));
        let covering = covering.filter(|ball| ball.comes_within(reach, times));
        Some(covering.collect())
    }

    fn moving_along(self, [from, _]: [f64; 2]) -> Chain {
        Chain {
            first: [from + self.earliest, 1.0],
            last: from + self.latest,
            from,
            longest: self.latest - self.earliest,
        }
    }

    fn since_seen(self, [from, until]: [f64; 2]) -> Option<Chain> {
        let is_known = self.seen.is_finite();
        is_known.then_some(Chain {
            first: [self.seen, 0.0],
            last: from + self.latest,
            from,
            longest: until + self.latest - self.seen,
        })
    }
}

/// Balls in a row on the path of a ball: where the first and the last one are on it, by the times at which the ball is expected there.
#[derive(Clone, Copy)]
struct Chain {
    /// Time of the first one's place at `from`, and by how much that grows a second.
    first: [f64; 2],
    /// Time of the last one's place at `from`; it grows by a second a second.
    last: f64,
    /// Time of the trajectory, s.
    from: f64,
    /// The longest time between both, s.
    longest: f64,
}

impl Chain {
    /// Balls that cover all places of a ball between the first and the last one.
    fn cover(self, moving: &MovingBall) -> impl Iterator<Item = MovingBall> {
        let MovingBall { ball, velocity } = *moving;
        let way = velocity.norm() * self.longest;
        let pieces = (way / (SPACING * ball.radius)).ceil();
        let pieces = pieces.clamp(1.0, MAX_COVERING_BALLS as f64 - 1.0);
        let radius = ball.radius.hypot(0.5 * way / pieces);
        (0..=pieces as usize).map(move |i| {
            let share = i as f64 / pieces;
            let between = |first: f64, last: f64| first + share * (last - first);
            let rate = between(self.first[1], 1.0);
            let time_s = between(self.first[0], self.last) - rate * self.from;
            MovingBall {
                ball: Ball {
                    centre: ball.centre + velocity * time_s,
                    radius,
                },
                velocity: velocity * rate,
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
        seen: -0.1,
    };
    const TIMES: [f64; 2] = [0.1, 0.7];

    /// Whether the surface of a ball at a time is covered then.
    fn is_covered(covering: &[MovingBall], ball: &Ball, time: f64) -> bool {
        (0..8).all(|tilt| {
            let angle = f64::from(tilt) * std::f64::consts::FRAC_PI_4;
            let side = Point::new(angle.cos(), angle.sin(), 0.0) * ball.radius;
            let surface = ball.centre + side;
            covering.iter().any(|other| {
                let other = other.at(time);
                (surface - other.centre).norm() <= other.radius + 1e-12
            })
        })
    }

    #[test]
    fn all_places_within_the_spread_and_since_it_was_seen_are_covered_and_hardly_more() {
        for (speed, radius) in [
            (0.1, 0.3),
            (0.5, 0.1),
            (2.0, 0.05),
            (-1.0, 0.0),
            (30.0, 0.1),
        ] {
            let ball = moving(speed, radius);
            let along: Vec<_> = SPREAD.moving_along(TIMES).cover(&ball).collect();
            let since: Vec<_> = SPREAD.since_seen(TIMES).unwrap().cover(&ball).collect();
            assert!(along.len().max(since.len()) <= MAX_COVERING_BALLS);
            for time in [0.1, 0.4, 0.7] {
                for step in 0..=100 {
                    let share = f64::from(step) / 100.0;
                    let off_s = -0.65 + 1.5 * share;
                    let place = ball.at(time + off_s);
                    assert!(is_covered(&along, &place, time), "{speed} {radius} {off_s}");
                    let place_s = -0.1 + share * (time + 0.85 + 0.1);
                    let place = ball.at(place_s);
                    assert!(
                        is_covered(&since, &place, time),
                        "{speed} {radius} {place_s}"
                    );
                }
            }
        }
        let slim: Vec<_> = SPREAD
            .moving_along(TIMES)
            .cover(&moving(0.5, 0.1))
            .collect();
        assert!(slim.iter().all(|ball| ball.ball.radius <= 0.125 + 1e-12));
    }

    #[test]
    fn where_a_ball_was_before_it_was_seen_is_not_covered() {
        let ball = moving(1.0, 0.05);
        let since: Vec<_> = SPREAD.since_seen(TIMES).unwrap().cover(&ball).collect();
        for time in [0.1, 0.4, 0.7] {
            assert!(!is_covered(&since, &ball.at(-0.4), time));
        }
        let unknown = TimeSpread {
            seen: f64::NEG_INFINITY,
            ..SPREAD
        };
        assert!(unknown.since_seen(TIMES).is_none());
    }
}
