//! Drawing the tip of a path onto a curve by Newton steps, where the body has room.

use crate::inverse_kinematics::damped_step;
use crate::path::WAYPOINTS;
use collision::Scene;
use nalgebra::Matrix3;
use pcc_model::{Backbone, Configuration, DOF, Point, Robot};

/// Every so many waypoints are tried first: most curves that do not serve show it there. Even, so that these are odd ones.
const STRIDE: usize = 8;
/// Newton steps at most: a count, so that answers do not depend on time.
const STEPS: usize = 4;
/// A tip this near to the curve is on it, section lengths.
const ON_THE_CURVE: f64 = 1e-6;
/// How far the curve may be from the tip of a first guess, section lengths.
const NEAR: f64 = 0.5;
/// A waypoint that would have to move farther lies near a shape whose tip cannot follow the curve, rad.
const LARGEST_CHANGE_RAD: f64 = 0.8;
/// A section at its limit still takes this share of the part that a free one takes in a Newton step.
const LEAST_WEIGHT: f64 = 0.02;

/// All waypoints of a path.
pub(crate) type Drawn = [Configuration; WAYPOINTS];

/// What a curve is drawn for.
pub(crate) struct Demand {
    /// Projects on the directions in which the tip must be on the curve.
    pub(crate) directions: Matrix3<f64>,
    /// Whether steps that would bend beyond the limits fail; else they are cut there.
    pub(crate) keeps_limits: bool,
}

/// Draws curves where there is room for them.
pub(crate) struct Pen<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) scene: &'a Scene,
    /// Clearance to keep beyond the tube, section lengths.
    pub(crate) margin: f64,
    pub(crate) ends: [Configuration; 2],
}

impl Pen<'_> {
    /// The path between the ends whose tip is on the curve, near a first guess; none where that is too far away or too near
    /// to an obstacle.
    pub(crate) fn draw(
        &self,
        demand: &Demand,
        guess: impl Fn(usize) -> Configuration,
        curve: impl Fn(usize) -> Point,
    ) -> Option<Drawn> {
        let mut drawn = [None; WAYPOINTS];
        (drawn[0], drawn[WAYPOINTS - 1]) = (Some(self.ends[0]), Some(self.ends[1]));
        let some_first = (1..WAYPOINTS - 1).step_by(STRIDE);
        for h in some_first.chain((1..WAYPOINTS - 1).step_by(2)) {
            if drawn[h].is_none() {
                drawn[h] = Some(self.waypoint(demand, &guess(h), &curve(h))?);
            }
        }
        let mut drawn = drawn.map(Option::unwrap_or_default);
        for h in (2..WAYPOINTS - 1).step_by(2) {
            drawn[h] = self.between(demand, &interpolated(&drawn, h), &curve(h))?;
        }
        Some(drawn)
    }

    /// A shape that is all but on the curve, on it.
    fn between(
        &self,
        demand: &Demand,
        near: &Configuration,
        place: &Point,
    ) -> Option<Configuration> {
        let backbone = self.robot.backbone(near);
        let error = demand.directions * (place - backbone.tip());
        self.step(demand, near, &backbone, &error)
    }

    /// The shape near a guess whose tip is at `place`.
    fn waypoint(
        &self,
        demand: &Demand,
        guess: &Configuration,
        place: &Point,
    ) -> Option<Configuration> {
        let (mut shape, mut backbone) = (*guess, self.robot.backbone(guess));
        for taken in 0..STEPS {
            let error = demand.directions * (place - backbone.tip());
            let distance = error.norm();
            if taken == 0 && distance > NEAR {
                return None;
            }
            if distance < ON_THE_CURVE {
                break;
            }
            shape = self.step(demand, &shape, &backbone, &error)?;
            backbone = self.robot.backbone(&shape);
        }
        let clearance = self.scene.clearance(&backbone, &self.robot.tube_radii);
        let serves = (shape - guess).norm() <= LARGEST_CHANGE_RAD && clearance >= self.margin;
        serves.then_some(shape)
    }

    /// The shape within the limits after a Newton step that moves the tip by `error`, of least norm where sections near
    /// their limits weigh more (Chan and Dubey 1995).
    fn step(
        &self,
        demand: &Demand,
        shape: &Configuration,
        backbone: &Backbone,
        error: &Point,
    ) -> Option<Configuration> {
        let limit = self.robot.bending_limit;
        let angles = self.robot.bending_angles(shape);
        let free = angles.map(|angle| (1.0 - (angle / limit).powi(2)).max(LEAST_WEIGHT));
        let jacobian = demand.directions * backbone.tip_jacobian();
        let mut weighted = jacobian.transpose();
        for d in 0..DOF {
            weighted.row_mut(d).scale_mut(free[d / 2]);
        }
        let next = shape + damped_step(&jacobian, &weighted, error)?;
        if demand.keeps_limits && self.robot.limit_excess(&next) > 0.0 {
            return None;
        }
        Some(self.robot.project_to_limits(&next))
    }
}

/// The cubic through the nearest shapes with odd numbers, and the ends, at an even one.
fn interpolated(drawn: &Drawn, h: usize) -> Configuration {
    let nodes = match h {
        2 => [0, 1, 3, 5],
        _ if h == WAYPOINTS - 2 => [7, 5, 3, 1].map(|before| WAYPOINTS - before),
        _ => [h - 3, h - 1, h + 1, h + 3],
    };
    let weight = |node: usize| -> f64 {
        let others = nodes.iter().filter(|&&other| other != node);
        let parts = others.map(|&other| (h as f64 - other as f64) / (node as f64 - other as f64));
        parts.product()
    };
    nodes.iter().map(|&node| drawn[node] * weight(node)).sum()
}
