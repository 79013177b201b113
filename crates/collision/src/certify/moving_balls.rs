//! The certificate against balls that move at constant velocity.

use crate::certify::bisection::Certifier;
use crate::certify::motion_bound::{BackbonePose, MotionBound};
use crate::certify::obstacles::Obstacles;
use crate::certify::remaining_pieces::RemainingPieces;
use crate::certify::verdict::Verdict;
use crate::distance::chosen_sections::Chosen;
use crate::obstacle::ball::Ball;
use pcc_model::{Configuration, Point, Robot, SECTIONS};
use trajectory::Trajectory;

/// Balls that are certified together, with their clearances on the stack.
const GROUP: usize = 16;

/// A ball that moves at constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBall {
    /// The ball at the trajectory's time zero.
    pub ball: Ball,
    /// The ball's velocity, length/s, base frame.
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

/// At most [`GROUP`] moving balls.
pub(crate) struct MovingGroup<'a>(&'a [MovingBall]);

/// Where the body is at one instant, and the clearance of each section from each ball; +∞ where there is no ball, and for
/// sections that were not chosen.
#[derive(Clone, Copy)]
pub(crate) struct GroupState {
    pose: BackbonePose,
    clearances: [[f64; SECTIONS]; GROUP],
}

impl<'a> MovingGroup<'a> {
    /// The groups that moving balls are measured in.
    pub(crate) fn all(balls: &'a [MovingBall]) -> impl Iterator<Item = Self> {
        balls.chunks(GROUP).map(Self)
    }
}

impl Obstacles for MovingGroup<'_> {
    type State = GroupState;

    fn state(
        &self,
        robot: &Robot,
        configuration: &Configuration,
        time: f64,
        chosen: &Chosen,
    ) -> GroupState {
        let backbone = robot.backbone(configuration);
        let mut clearances = [[f64::INFINITY; SECTIONS]; GROUP];
        for (clearances, moving) in clearances.iter_mut().zip(self.0) {
            let ball = moving.at(time);
            for k in (0..SECTIONS).filter(|k| chosen[*k]) {
                let distance = backbone.distance(k, &ball.centre);
                clearances[k] = distance - ball.radius - robot.tube_radii[k];
            }
        }
        GroupState {
            clearances,
            pose: BackbonePose::new(configuration, &backbone),
        }
    }

    fn clearances(state: &GroupState) -> [f64; SECTIONS] {
        let of_section = |k: usize| state.clearances.iter().map(move |of_ball| of_ball[k]);
        std::array::from_fn(|k| of_section(k).fold(f64::INFINITY, lower))
    }

    /// In the frame of a ball, whose centre is taken at each end, its own path between is added to the body's.
    fn lowest(
        &self,
        from: &GroupState,
        to: &GroupState,
        robot: &Robot,
        bound: &MotionBound,
    ) -> [f64; SECTIONS] {
        let sweep = bound.sweep(robot, &from.pose, &to.pose);
        let (from, to) = (&from.clearances, &to.clearances);
        std::array::from_fn(|k| {
            let of_balls = self.0.iter().enumerate().map(|(i, moving)| {
                let path = moving.velocity.norm() * bound.duration;
                let reach = robot.tube_radii[k] + moving.ball.radius;
                sweep.lowest(k, [from[i][k], to[i][k]], reach, path)
            });
            of_balls.fold(f64::INFINITY, lower)
        })
    }
}

/// The lower one of two clearances; NaN where one is.
fn lower(a: f64, b: f64) -> f64 {
    if b < a || b.is_nan() { b } else { a }
}

/// Certifies the executed curve against moving balls from `from_time` (s) to the first knot at or after `until_time`.
///
/// Allocates nothing. A ball whose position or velocity is not finite is never certified.
#[must_use]
pub fn certify_moving(
    robot: &Robot,
    balls: &[MovingBall],
    trajectory: &Trajectory,
    [from_time, until_time]: [f64; 2],
) -> Verdict {
    let pieces = RemainingPieces::new(trajectory.knots(), from_time);
    let count = pieces.count_until(until_time);
    let certify = |obstacles| {
        let certifier = Certifier {
            robot,
            obstacles,
            has_corners: false,
        };
        certifier.chain(count, &|i| pieces.piece(i))
    };
    MovingGroup::all(balls)
        .map(certify)
        .find(|verdict| !verdict.is_free())
        .unwrap_or(Verdict::Free)
}
