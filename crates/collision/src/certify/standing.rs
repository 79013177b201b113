//! The certificate of a robot that stands while balls pass.

use crate::certify::moving_ball_cover::{TimeSpread, reach};
use crate::certify::moving_balls::{MovingBall, certify_moving};
use pcc_model::{Configuration, Robot};
use trajectory::{Knot, Trajectory};

/// For how long a ball is expected to keep its velocity, s.
const FORESEEN_S: f64 = 60.0;

impl TimeSpread {
    /// Whether a robot that stands in a configuration (rad) from a time of the trajectory (s) on keeps clear of balls wherever they can be by
    /// then, for a minute or until they are out of its reach.
    ///
    /// A ball whose position or velocity is not finite comes everywhere.
    #[must_use]
    pub fn stands_clear(
        self,
        balls: &[MovingBall],
        robot: &Robot,
        configuration: &Configuration,
        from_s: f64,
    ) -> bool {
        let earliest_s = (from_s + self.earliest).max(self.seen);
        let reach = reach(robot);
        balls.iter().all(|ball| {
            Way::of(ball, earliest_s, reach).is_none_or(|way| way.is_clear_of(robot, configuration))
        })
    }
}

/// A straight way of a ball.
struct Way {
    /// The ball at its begin; its velocity is a length of the way a second, since a robot that stands does not mind how fast it comes.
    ball: MovingBall,
    length: f64,
}

impl Way {
    /// The way of a ball from a time (s) on until it is out of reach; none where it is by then.
    fn of(moving: &MovingBall, from_s: f64, reach: f64) -> Option<Self> {
        let (ball, speed) = (moving.at(from_s), moving.velocity.norm());
        let direction = moving.velocity / speed.max(f64::MIN_POSITIVE);
        // It leaves the sphere of reach at the farther one of its two places on the way.
        let along = ball.centre.dot(&direction);
        let reach = reach + ball.radius;
        let half_chord = (along * along - ball.centre.norm_squared() + reach * reach).sqrt();
        let is_outside = half_chord.is_nan() && ball.centre.iter().all(|it| it.is_finite());
        let length = (half_chord - along).min(speed * FORESEEN_S);
        let is_gone = is_outside || length < 0.0;
        (!is_gone).then_some(Self {
            ball: MovingBall {
                ball,
                velocity: direction,
            },
            length: length.max(f64::MIN_POSITIVE),
        })
    }

    fn is_clear_of(&self, robot: &Robot, configuration: &Configuration) -> bool {
        let knots = [0.0, self.length].map(|time| Knot::resting(time, *configuration));
        let standing = Trajectory::new(knots.to_vec());
        standing.is_ok_and(|standing| {
            certify_moving(robot, &[self.ball], &standing, [0.0, self.length]).is_free()
        })
    }
}
