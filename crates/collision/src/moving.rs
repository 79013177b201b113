//! The certificate against balls that move at constant velocity.

use crate::bound::Displacement;
use crate::certificate::{Verdict, segment_displacement};
use crate::scene::Ball;
use pcc_model::{Configuration, Point, Robot, SECTIONS};
use trajectory::{QuinticSegment, Trajectory};

/// Bisections of one curve segment.
const DEPTH: u32 = 10;

/// A ball that moves at constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBall {
    /// The ball at the trajectory's time zero.
    pub ball: Ball,
    /// Its velocity, length/s, base frame.
    pub velocity: Point,
}

impl MovingBall {
    fn at(&self, time: f64) -> Ball {
        Ball {
            centre: self.ball.centre + self.velocity * time,
            radius: self.ball.radius,
        }
    }
}

struct Checker<'a> {
    robot: &'a Robot,
    ball: &'a MovingBall,
    tube_radius: f64,
}

impl Checker<'_> {
    fn clearances(&self, shape: &Configuration, time: f64) -> [f64; SECTIONS] {
        let (backbone, ball) = (self.robot.backbone(shape), self.ball.at(time));
        std::array::from_fn(|k| backbone.distance(k, &ball.centre) - ball.radius - self.tube_radius)
    }

    /// d(a) + d(b) > Λ + w Δt, the ball's centre taken at each end.
    fn is_covered(&self, clear: [&[f64; SECTIONS]; 2], body: &Displacement, duration: f64) -> bool {
        let ball = self.ball.velocity.norm() * duration;
        (0..SECTIONS).all(|k| clear[0][k] + clear[1][k] > body.sections[k] + ball)
    }

    fn curve(
        &self,
        curve: &QuinticSegment,
        clear: [&[f64; SECTIONS]; 2],
        begin: f64,
        depth: u32,
    ) -> Verdict {
        if self.is_covered(
            clear,
            &segment_displacement(self.robot, curve),
            curve.duration,
        ) {
            return Verdict::Free;
        }
        let at = begin + 0.5 * curve.duration;
        if depth == 0 {
            return Verdict::Undecided { at };
        }
        let (first, second) = curve.halves();
        let between = self.clearances(&second.control[0], at);
        if between.iter().any(|c| *c < 0.0) {
            return Verdict::Colliding { at };
        }
        match self.curve(&first, [clear[0], &between], begin, depth - 1) {
            Verdict::Free => self.curve(&second, [&between, clear[1]], at, depth - 1),
            found => found,
        }
    }

    fn trajectory(&self, trajectory: &Trajectory, from_time: f64) -> Verdict {
        let knots = trajectory.knots();
        let first = knots
            .partition_point(|k| k.time <= from_time)
            .saturating_sub(1)
            .min(knots.len() - 2);
        let mut before = self.clearances(&knots[first].position, knots[first].time);
        for i in first..knots.len() - 1 {
            let after = self.clearances(&knots[i + 1].position, knots[i + 1].time);
            for (clearances, at) in [(&before, knots[i].time), (&after, knots[i + 1].time)] {
                if clearances.iter().any(|c| *c < 0.0) {
                    return Verdict::Colliding { at };
                }
            }
            let verdict = self.curve(
                &QuinticSegment::between(&knots[i], &knots[i + 1]),
                [&before, &after],
                knots[i].time,
                DEPTH,
            );
            if !verdict.is_free() {
                return verdict;
            }
            before = after;
        }
        Verdict::Free
    }
}

/// Certifies the executed curve from `from_time` (s) on against moving balls, for a tube grown by `growth`.
#[must_use]
pub fn certify_moving(
    robot: &Robot,
    balls: &[MovingBall],
    trajectory: &Trajectory,
    from_time: f64,
    growth: f64,
) -> Verdict {
    let check = |ball| {
        Checker {
            robot,
            ball,
            tube_radius: robot.tube_radius + growth,
        }
        .trajectory(trajectory, from_time)
    };
    balls
        .iter()
        .map(check)
        .find(|v| !v.is_free())
        .unwrap_or(Verdict::Free)
}
