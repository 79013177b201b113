//! Repair of a colliding path by an artificial potential field: push, smooth the tip line, follow it again.

use super::kinematics::DAMPING;
use super::lanes::LANES;
use super::sampled::{deepest, distances};
use super::solver::PathSolver;
use super::spline::LineSmoother;
use crate::path::WAYPOINTS;
use collision::Ball;
use nalgebra::{Cholesky, Matrix3};
use pcc_model::{Configuration, Point, Robot};

/// Rounds at most.
const ROUNDS: usize = 10;
/// Margin of repulsion over the margin of acceptance.
pub(super) const REPULSION: f64 = 1.5;
/// Nearer to the axis of a ball than this, a point is pushed along it, section lengths.
const AXIS: f64 = 1e-9;

/// Pushes paths out of the balls.
pub(super) struct Repairer<'a> {
    robot: &'a Robot,
    smoother: LineSmoother,
    tips: [Point; WAYPOINTS],
}

impl<'a> Repairer<'a> {
    pub(super) fn new(robot: &'a Robot) -> Self {
        Self {
            robot,
            smoother: LineSmoother::new(),
            tips: [Point::zeros(); WAYPOINTS],
        }
    }

    /// Whether every frame is clear by the tube radius, after at most [`ROUNDS`] rounds.
    pub(super) fn make_clear(&mut self, solver: &mut PathSolver, balls: &[Ball]) -> bool {
        for _ in 0..ROUNDS {
            if self.is_clear(solver, balls) {
                return true;
            }
            self.push(solver, balls);
            for (h, tip) in self.tips.iter_mut().enumerate() {
                *tip = self.robot.tip(&solver.frame(h));
            }
            self.smoother.smooth(&mut self.tips);
            solver.set_line(|h| self.tips[h]);
            if !solver.solve() {
                return false;
            }
        }
        self.is_clear(solver, balls)
    }

    fn is_clear(&self, solver: &PathSolver, balls: &[Ball]) -> bool {
        let margin = self.robot.tube_radius;
        balls.is_empty()
            || (0..WAYPOINTS).step_by(LANES).all(|first| {
                let shapes = solver.shapes(first);
                let nearest = distances(&self.robot.section_lengths, balls, &shapes);
                nearest.0.iter().all(|distance| *distance >= margin)
            })
    }

    fn push(&self, solver: &mut PathSolver, balls: &[Ball]) {
        let margin = REPULSION * self.robot.tube_radius;
        for first in (0..WAYPOINTS).step_by(LANES) {
            let shapes = solver.shapes(first);
            let deepest = deepest(&self.robot.section_lengths, balls, &shapes);
            for lane in 0..LANES {
                let h = first + lane;
                let is_end = h == 0 || h == WAYPOINTS - 1;
                if is_end || deepest.distance.0[lane] >= margin {
                    continue;
                }
                let (section, fraction, ball) = deepest.of(lane);
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

/// The way of a point to a sphere around the origin: horizontally at its height, vertically only on the axis.
fn way_out(from_centre: &Point, radius: f64) -> Point {
    let (out, height) = (from_centre.x.hypot(from_centre.y), from_centre.z);
    if out < AXIS {
        return Point::new(0.0, 0.0, (radius - height.abs()).copysign(height));
    }
    let wanted = (radius * radius - height * height).max(0.0).sqrt();
    let scale = (wanted - out) / out;
    Point::new(from_centre.x * scale, from_centre.y * scale, 0.0)
}
