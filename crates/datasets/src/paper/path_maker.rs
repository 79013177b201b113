//! Paths of the paper's generator: the straight way of the tip, and its repair where that collides.

use super::repair::Repairer;
use super::settings::LARGEST_STEP;
use super::solver::PathSolver;
use collision::Ball;
use pcc_model::{Configuration, Point, UnitRobot};
use planning::{WAYPOINTS, Waypoints};

/// Why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstruction {
    /// The straight way of the tip cannot be followed.
    TipLine,
    /// Neighbouring waypoints of a clear path are too far from each other.
    LargeStep,
    /// The repair leaves a collision, or too large a step.
    Collision,
}

/// Makes paths from a start to a goal configuration.
pub struct PathMaker<'a> {
    robot: &'a UnitRobot,
    solver: PathSolver,
    repairer: Repairer<'a>,
}

impl<'a> PathMaker<'a> {
    /// For one robot.
    #[must_use]
    pub fn new(robot: &'a UnitRobot) -> Self {
        Self {
            robot,
            solver: PathSolver::new(robot),
            repairer: Repairer::new(robot),
        }
    }

    /// The path along which the tip goes straight to a point, or, among balls, where the repair has pushed it: 64 waypoints, radians.
    ///
    /// # Errors
    /// Why there is none.
    pub fn path(
        &mut self,
        balls: &[Ball],
        tip: &Point,
        start: &Configuration,
        end: &Configuration,
    ) -> Result<Waypoints, Obstruction> {
        let solver = &mut self.solver;
        solver.start(self.robot, tip, start, end);
        if !solver.solve() {
            return Err(Obstruction::TipLine);
        }
        let steps_are_small = |solver: &PathSolver| solver.largest_step() <= LARGEST_STEP;
        if self.repairer.is_clear(solver, balls) {
            if !steps_are_small(solver) {
                return Err(Obstruction::LargeStep);
            }
        } else if !(self.repairer.repair(solver, balls) && steps_are_small(solver)) {
            return Err(Obstruction::Collision);
        }
        Ok((0..WAYPOINTS).map(|h| solver.frame(h)).collect())
    }
}
