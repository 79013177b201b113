//! A planning problem: a start configuration, a goal, and the obstacles between them.

use crate::error::Infeasible;
use crate::moving_obstacles::MovingObstacles;
use collision::Scene;
use pcc_model::{Configuration, Point, UnitRobot};

/// Where the motion ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// A tip position in the base frame, in section lengths; the goal configuration is the planner's choice.
    Tip(Point),
    /// One exact goal configuration (homing), in radians.
    Configuration(Configuration),
}

/// A goal that a motion passes on its way to another one, without rest where that can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Via {
    /// What is passed.
    pub goal: Goal,
    /// Largest distance of the tip from where the goal wants it, section lengths.
    pub tip_tolerance: f64,
}

/// One planning problem in units of the section length.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Configuration at the start, radians; the robot is at rest.
    pub start: Configuration,
    /// Where the motion ends.
    pub goal: Goal,
    /// The obstacles at rest.
    pub scene: Scene,
    /// The obstacles that move, at the motion's time zero.
    pub moving: MovingObstacles,
}

/// Bending above the limit that a start may have, and a motion from rest through several goals, rad.
///
/// A robot that ramped to rest by itself has left its path on the tangent: along the limit that is up to 7e-4 rad too
/// far at the shipped robots' limits, and it must still get away from there.
pub(crate) const BENDING_SLACK_RAD: f64 = 5e-3;

impl Problem {
    /// Checks what can be known of the start alone.
    ///
    /// # Errors
    /// [`Infeasible::StartOutOfLimits`] or [`Infeasible::StartInCollision`].
    pub fn check_start(&self, robot: &UnitRobot) -> Result<(), Infeasible> {
        let excess_rad = robot.limit_excess(&self.start);
        if excess_rad > BENDING_SLACK_RAD {
            return Err(Infeasible::StartOutOfLimits {
                excess_rad,
                limit_rad: robot.bending_limit,
            });
        }
        let at_rest = self.scene.clearance_at(robot, &self.start);
        let clearance = at_rest.min(self.moving.clearance_at(robot, &self.start));
        if clearance < 0.0 {
            return Err(Infeasible::StartInCollision { clearance });
        }
        Ok(())
    }

    /// The tip position the motion ends at, base frame, section lengths.
    #[must_use]
    pub fn goal_tip(&self, robot: &UnitRobot) -> Point {
        match &self.goal {
            Goal::Tip(tip) => *tip,
            Goal::Configuration(configuration) => robot.tip(configuration),
        }
    }
}
