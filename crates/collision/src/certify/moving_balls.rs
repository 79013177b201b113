//! The certificate against balls that move at constant velocity.

use crate::certify::bisection::{Certifier, Obstacles};
use crate::certify::motion_bound::{BackbonePose, MotionBound};
use crate::certify::remaining_pieces::RemainingPieces;
use crate::certify::verdict::Verdict;
use crate::distance::chosen_sections::Chosen;
use crate::obstacle::ball::Ball;
use pcc_model::{Backbone, Configuration, Point, Robot, SECTIONS};
use trajectory::Trajectory;

/// Balls that are certified together, with their clearances on the stack.
const GROUP: usize = 16;

/// A ball that moves at constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBall {
    /// The ball at the trajectory's time zero.
    pub ball: Ball,
    /// Its velocity, length/s, base frame.
    pub velocity: Point,
}

impl MovingBall {
    /// The ball `time` seconds after the trajectory's time zero.
    #[must_use]
    pub fn at(&self, time: f64) -> Ball {
        Ball {
            centre: self.ball.centre + self.velocity * time,
            radius: self.ball.radius,
        }
    }
}

/// At most [`GROUP`] moving balls, seen by a tube.
struct Moving<'a> {
    balls: &'a [MovingBall],
    tube_radii: &'a [f64; SECTIONS],
}

/// Where the body is at one instant, and how clear each section of it of each ball; +∞ where there is no ball, and for sections
/// that were not looked at.
struct Passing {
    pose: BackbonePose,
    clearances: [[f64; SECTIONS]; GROUP],
}

impl Obstacles for Moving<'_> {
    type Clearances = Passing;

    fn clearances(
        &self,
        shape: &Configuration,
        backbone: &Backbone,
        time: f64,
        chosen: &Chosen,
    ) -> Passing {
        let mut clearances = [[f64::INFINITY; SECTIONS]; GROUP];
        for (clearances, moving) in clearances.iter_mut().zip(self.balls) {
            let ball = moving.at(time);
            for (k, clearance) in clearances
                .iter_mut()
                .enumerate()
                .filter(|(k, _)| chosen[*k])
            {
                let distance = backbone.distance(k, &ball.centre);
                *clearance = distance - ball.radius - self.tube_radii[k];
            }
        }
        Passing {
            clearances,
            pose: BackbonePose::new(shape, backbone),
        }
    }

    fn touch(at: &Passing) -> bool {
        at.clearances.iter().flatten().any(|c| *c < 0.0)
    }

    /// The balls' centres are taken at each end; in the ball's own frame its way between is added to the body's.
    fn may_touch(
        &self,
        from: &Passing,
        to: &Passing,
        robot: &Robot,
        bound: &MotionBound,
    ) -> Chosen {
        let sweep = bound.sweep(robot, &from.pose, &to.pose);
        let (from, to) = (&from.clearances, &to.clearances);
        let is_clear = |k: usize| {
            self.balls.iter().enumerate().all(|(i, moving)| {
                let way = moving.velocity.norm() * bound.duration;
                let reach = self.tube_radii[k] + moving.ball.radius;
                sweep.lowest(k, from[i][k], to[i][k], reach, way) > 0.0
            })
        };
        std::array::from_fn(|k| !is_clear(k))
    }
}

/// Certifies the executed curve from `from_time` (s) to its end against moving balls.
///
/// Allocates nothing. A ball whose position or velocity is not finite is never certified.
#[must_use]
pub fn certify_moving(
    robot: &Robot,
    balls: &[MovingBall],
    trajectory: &Trajectory,
    from_time: f64,
) -> Verdict {
    certify_moving_until(robot, balls, trajectory, [from_time, f64::INFINITY])
}

/// Like [`certify_moving`], but only up to the first knot at or after the second time (s).
#[must_use]
pub fn certify_moving_until(
    robot: &Robot,
    balls: &[MovingBall],
    trajectory: &Trajectory,
    [from_time, until_time]: [f64; 2],
) -> Verdict {
    let pieces = RemainingPieces::new(trajectory.knots(), from_time);
    let count = pieces.count_until(until_time);
    let certify = |balls| {
        let certifier = Certifier {
            robot,
            obstacles: Moving {
                balls,
                tube_radii: &robot.tube_radii,
            },
            has_corners: false,
        };
        certifier.chain(count, &|i| pieces.piece(i))
    };
    balls
        .chunks(GROUP)
        .map(certify)
        .find(|verdict| !verdict.is_free())
        .unwrap_or(Verdict::Free)
}
