//! What is asked: a start shape, a goal, and the scene between them.

use collision::Scene;
use pcc_model::{Configuration, Point, Robot};
use thiserror::Error;

/// Where the motion ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// A tip position in the base frame, in section lengths; the end shape is the planner's choice.
    Tip(Point),
    /// One exact end shape (homing), in radians.
    Configuration(Configuration),
}

/// One planning problem in units of the section length.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Shape at the start, radians; the robot is at rest.
    pub start: Configuration,
    /// Where the motion ends.
    pub goal: Goal,
    /// The obstacles.
    pub scene: Scene,
}

/// Why a problem has no solution, found before any path is searched.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum Infeasible {
    /// A section of the start shape is bent beyond the robot's limit.
    #[error(
        "start out of limits: a section is bent {excess_rad:.4} rad beyond the allowed {limit_rad:.4} rad"
    )]
    StartOutOfLimits {
        /// Angle above the limit, rad.
        excess_rad: f64,
        /// The limit, rad.
        limit_rad: f64,
    },
    /// The body touches an obstacle at the start.
    #[error("start in collision: clearance {clearance:.4} section lengths, at least 0 is needed")]
    StartInCollision {
        /// Signed clearance, section lengths.
        clearance: f64,
    },
    /// The robot moves faster, or changes its motion faster, than it may.
    #[error(
        "start cannot stop: it uses {share:.3} times a tendon limit until it rests, at most 1 is allowed"
    )]
    StartTooFast {
        /// Largest part of a limit that is used, until the robot rests.
        share: f64,
    },
    /// The robot cannot come to rest straight ahead without contact or within its bending limits.
    #[error(
        "start cannot stop: braking straight ahead is not certified free of contact and within the bending limits"
    )]
    StartCannotStop,
    /// No shape within the limits puts the tip on the goal.
    #[error(
        "goal out of reach: the closest shape found within the bending limit misses it by {miss:.4} section lengths"
    )]
    GoalOutOfReach {
        /// Distance of the closest tip found, section lengths; for a configuration the angle above the limit.
        miss: f64,
    },
    /// Every shape found that reaches the goal touches an obstacle.
    #[error(
        "goal in collision: the clearest of {shapes} end shapes has clearance {clearance:.4} section lengths, at least 0 is needed"
    )]
    GoalInCollision {
        /// End shapes that reach the goal.
        shapes: usize,
        /// Their largest clearance, section lengths.
        clearance: f64,
    },
}

/// Bending above the limit that a motion may have, its start included, rad (docs/evaluation.md "Certified").
///
/// A robot that ramped to rest by itself has left its path on the tangent: along the limit that is up to 7e-4 rad too
/// far at the shipped robots' limits, and it must still get away from there.
pub(crate) const BENDING_SLACK_RAD: f64 = 5e-3;

impl Problem {
    /// Checks what can be known of the start alone.
    ///
    /// # Errors
    /// [`Infeasible::StartOutOfLimits`] or [`Infeasible::StartInCollision`].
    pub fn check_start(&self, robot: &Robot) -> Result<(), Infeasible> {
        let excess_rad = robot.limit_excess(&self.start);
        if excess_rad > BENDING_SLACK_RAD {
            return Err(Infeasible::StartOutOfLimits {
                excess_rad,
                limit_rad: robot.bending_limit,
            });
        }
        let clearance = self
            .scene
            .clearance(&robot.backbone(&self.start), &robot.tube_radii);
        if clearance < 0.0 {
            return Err(Infeasible::StartInCollision { clearance });
        }
        Ok(())
    }

    /// The tip position the motion ends at, base frame, section lengths.
    #[must_use]
    pub fn goal_tip(&self, robot: &Robot) -> Point {
        match &self.goal {
            Goal::Tip(tip) => *tip,
            Goal::Configuration(shape) => robot.tip(shape),
        }
    }
}
