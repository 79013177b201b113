//! Repair of a colliding path by an artificial potential field: push, smooth the tip line, follow it again.

use super::kinematics::DAMPING;
use super::sampled::Samples;
use super::solver::PathSolver;
use super::spline::LineSmoother;
use collision::Ball;
use nalgebra::{Cholesky, Matrix3};
use pcc_model::{Configuration, Point, UnitRobot};
use planning::WAYPOINTS;
use planning::sampled_collision::{REPULSION, way_out};

/// Rounds at most.
const ROUNDS: usize = 10;

/// Pushes paths out of the balls.
pub(super) struct Repairer<'a> {
    robot: &'a UnitRobot,
    smoother: LineSmoother,
    samples: Samples<WAYPOINTS>,
    tips: [Point; WAYPOINTS],
}

impl<'a> Repairer<'a> {
    pub(super) fn new(robot: &'a UnitRobot) -> Self {
        Self {
            robot,
            smoother: LineSmoother::new(),
            samples: Samples::new(),
            tips: [Point::zeros(); WAYPOINTS],
        }
    }

    /// Whether every frame is clear by the tube radius.
    pub(super) fn is_clear(&mut self, solver: &PathSolver, balls: &[Ball]) -> bool {
        let (robot, components) = (self.robot, solver.components());
        self.samples.look(&robot.section_lengths, balls, components);
        self.samples
            .distances
            .iter()
            .all(|d| *d >= robot.largest_tube_radius())
    }

    /// Repairs the path that [`Self::is_clear`] has just found not to be; whether it is clear now.
    pub(super) fn repair(&mut self, solver: &mut PathSolver, balls: &[Ball]) -> bool {
        for _ in 0..ROUNDS {
            self.push(solver, balls);
            for (h, tip) in self.tips.iter_mut().enumerate() {
                *tip = self.robot.tip(&solver.frame(h));
            }
            self.smoother.smooth(&mut self.tips);
            solver.set_line(|h| self.tips[h]);
            if !solver.solve() {
                return false;
            }
            if self.is_clear(solver, balls) {
                return true;
            }
        }
        false
    }

    /// Pushes the frames that were last looked at.
    fn push(&self, solver: &mut PathSolver, balls: &[Ball]) {
        let margin = REPULSION * self.robot.largest_tube_radius();
        for h in 1..WAYPOINTS - 1 {
            if self.samples.distances[h] < margin {
                let (section, fraction, ball) = self.samples.deepest(h);
                let shape = solver.frame(h);
                let pushed = self.pushed(&shape, section, fraction, &balls[ball], margin);
                solver.set_frame(h, &pushed);
            }
        }
    }

    /// The shape after one damped step that brings a point of it out of a ball.
    fn pushed(
        &self,
        shape: &Configuration,
        section: usize,
        fraction: f64,
        ball: &Ball,
        margin: f64,
    ) -> Configuration {
        let backbone = self.robot.backbone(shape);
        let from_centre = backbone.point(section, fraction) - ball.centre;
        let move_out = way_out(&from_centre, ball.radius + margin);
        let jacobian = backbone.point_jacobian(section, fraction);
        let normal = jacobian * jacobian.transpose() + Matrix3::identity() * DAMPING;
        let Some(factor) = Cholesky::new(normal) else {
            return *shape;
        };
        self.robot
            .project_to_limits(&(shape + jacobian.transpose() * factor.solve(&move_out)))
    }
}
