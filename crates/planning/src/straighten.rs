//! Straightening: the tip of a sampled path is drawn onto a smooth curve near it.
//!
//! A sampled path comes near the straight way of the tip, with small waves in it. Here the curve is the straight line at even
//! speed, bent at its ends where the robot cannot set out along it, plus as few terms u (1 − u) P_k(2u − 1) as the scene
//! allows; every waypoint moves onto it by Newton steps. Where the body would come too near to an obstacle on all such
//! curves, the path stays as it was sampled.

use crate::inverse_kinematics::damped_step;
use crate::path::{WAYPOINTS, parameter};
use collision::Scene;
use nalgebra::SymmetricEigen;
use pcc_model::{Backbone, Configuration, DOF, Point, Robot, SECTIONS};

/// Terms at most.
const TERMS: usize = 4;
/// Numbers of terms that are tried, in this order, and how far the curve may be from the sampled tip, section lengths.
const TRIED: [(usize, f64); 3] = [(0, 0.5), (2, 0.1), (TERMS, 0.05)];
/// Every so many waypoints are tried first: most curves that do not serve show it there.
const STRIDE: usize = 8;
/// Newton steps at most: a count, so that answers do not depend on time.
const STEPS: usize = 4;
/// A tip this near to the curve is on it, section lengths.
const ON_THE_CURVE: f64 = 1e-6;
/// A waypoint that would have to move farther lies near a shape whose tip cannot follow the curve, rad.
const LARGEST_CHANGE_RAD: f64 = 0.8;
/// Where the tip moves less than this by a rad in some direction, it cannot set out in that direction.
const STIFF: f64 = 0.6;
/// Stiffer ends keep the path as it was sampled: the tip of a straight robot sets out sideways only.
const STIFFEST: f64 = 0.9;
/// Share of the straight segment's way of the tip in the curve where an end is as stiff as can be.
const SEGMENT_SHARE: f64 = 0.35;
/// Bending above this far below the limit is compressed, so that a path does not run into its limits with a kink, rad.
const SOFT_RAD: f64 = 0.15;
/// A section at its limit still takes this share of the part that a free one takes in a Newton step.
const LEAST_WEIGHT: f64 = 0.02;

/// The terms at the waypoints, orthonormal.
pub(crate) struct TipCurves {
    terms: [[f64; WAYPOINTS]; TERMS],
}

impl TipCurves {
    pub(crate) fn new() -> Self {
        let mut terms = [[0.0; WAYPOINTS]; TERMS];
        for k in 0..TERMS {
            for (h, value) in terms[k].iter_mut().enumerate() {
                let u = parameter(h);
                *value = u * (1.0 - u) * (2.0 * u - 1.0).powi(k as i32);
            }
            let (before, rest) = terms.split_at_mut(k);
            let term = &mut rest[0];
            for other in before.iter() {
                let part: f64 = term.iter().zip(other).map(|(a, b)| a * b).sum();
                term.iter_mut().zip(other).for_each(|(a, b)| *a -= part * b);
            }
            let norm = term.iter().map(|v| v * v).sum::<f64>().sqrt();
            term.iter_mut().for_each(|v| *v /= norm);
        }
        Self { terms }
    }

    /// Draws the tip of a path (64 waypoints, radians) onto a smooth curve on which the body keeps a clearance of `margin`
    /// beyond the tube (section lengths); both ends stay exactly where they are.
    pub(crate) fn straighten(
        &self,
        robot: &Robot,
        scene: &Scene,
        margin: f64,
        path: &mut [Configuration],
    ) {
        let way = Way::new(robot, &path[0], &path[WAYPOINTS - 1]);
        if way.stiffness > STIFFEST {
            return;
        }
        let sampled = way.softened(path);
        let bodies: Vec<Backbone> = sampled.iter().map(|q| robot.backbone(q)).collect();
        let tips: [Point; WAYPOINTS] = std::array::from_fn(|h| bodies[h].tip());
        let mut curve = way.straightest();
        let mut used = 0;
        for (terms, near) in TRIED {
            self.terms[used..terms]
                .iter()
                .for_each(|term| follow(term, &tips, &mut curve));
            used = terms;
            let far = |(tip, on): (&Point, &Point)| (tip - on).norm() > near;
            if tips.iter().zip(&curve).any(far) {
                continue;
            }
            let drawn = Drawing {
                robot,
                scene,
                margin,
                curve: &curve,
                sampled: &sampled,
                bodies: &bodies,
            };
            if drawn.draw(path) {
                return;
            }
        }
    }
}

/// The two ends of a path, and how far the tip cannot set out there in every direction.
struct Way<'a> {
    robot: &'a Robot,
    ends: [Configuration; 2],
    /// Bend of the tip's line at its middle, times 4, that spares the directions in which the tip is stiff.
    bend: Point,
    /// How stiff the tip is at the stiffer end, 0 to 1.
    stiffness: f64,
}

impl<'a> Way<'a> {
    fn new(robot: &'a Robot, start: &Configuration, end: &Configuration) -> Self {
        let [first, last] = [start, end].map(|shape| robot.backbone(shape));
        let way = last.tip() - first.tip();
        let [at_start, at_end] = [&first, &last].map(stiffest);
        let part =
            |(direction, stiffness): (Point, f64)| direction * (direction.dot(&way) * stiffness);
        Self {
            robot,
            ends: [*start, *end],
            bend: part(at_end) - part(at_start),
            stiffness: at_start.1.max(at_end.1),
        }
    }

    fn segment(&self, h: usize) -> Configuration {
        self.ends[0].lerp(&self.ends[1], parameter(h))
    }

    /// The straight line of the tip at even speed; at a stiff end it sets out as the tip can, and follows in part the way
    /// that the straight segment takes.
    fn straightest(&self) -> [Point; WAYPOINTS] {
        let [first, last] = self.ends.map(|shape| self.robot.tip(&shape));
        std::array::from_fn(|h| {
            let u = parameter(h);
            let line = first.lerp(&last, u) + self.bend * (u * (1.0 - u));
            line.lerp(
                &self.robot.tip(&self.segment(h)),
                SEGMENT_SHARE * self.stiffness,
            )
        })
    }

    /// The path with its bending compressed near the limit, nearer to the straight segment where an end is stiff; both ends
    /// stay where they are.
    fn softened(&self, path: &[Configuration]) -> Vec<Configuration> {
        let changes = self.ends.map(|end| end - compressed(self.robot, &end));
        let soft = |(h, shape): (usize, &Configuration)| {
            let u = parameter(h);
            let soft = compressed(self.robot, shape) + changes[0] * (1.0 - u) + changes[1] * u;
            soft.lerp(&self.segment(h), self.stiffness)
        };
        path.iter().enumerate().map(soft).collect()
    }
}

/// The direction in which the tip moves least, and how stiff it is there, 0 to 1.
fn stiffest(shape: &Backbone) -> (Point, f64) {
    let jacobian = shape.tip_jacobian();
    let modes = SymmetricEigen::new(jacobian * jacobian.transpose());
    let least = modes.eigenvalues.imin();
    let mobility = modes.eigenvalues[least].max(0.0).sqrt();
    let direction = modes.eigenvectors.column(least).into_owned();
    (direction, (1.0 - mobility / STIFF).max(0.0))
}

fn compressed(robot: &Robot, shape: &Configuration) -> Configuration {
    let angles = robot.bending_angles(shape);
    let begin = robot.bending_limit - SOFT_RAD;
    let mut soft = *shape;
    for section in (0..SECTIONS).filter(|&section| angles[section] > begin) {
        let excess = (angles[section] - begin) / SOFT_RAD;
        let angle = begin + SOFT_RAD * excess.tanh();
        let mut bend = soft.fixed_rows_mut::<2>(2 * section);
        bend *= angle / angles[section];
    }
    soft
}

/// The shape within the limits after a Newton step that moves the tip by `error`, of least norm where sections near their
/// limits weigh more (Chan and Dubey 1995).
fn step(
    robot: &Robot,
    shape: &Configuration,
    backbone: &Backbone,
    error: &Point,
) -> Option<Configuration> {
    let angles = robot.bending_angles(shape);
    let free = angles.map(|angle| (1.0 - (angle / robot.bending_limit).powi(2)).max(LEAST_WEIGHT));
    let jacobian = backbone.tip_jacobian();
    let mut weighted = jacobian.transpose();
    for d in 0..DOF {
        weighted.row_mut(d).scale_mut(free[d / 2]);
    }
    let change = damped_step(&jacobian, &weighted, error)?;
    Some(robot.project_to_limits(&(shape + change)))
}

/// Adds to a curve what one term can do to bring it nearer to the tips.
fn follow(term: &[f64; WAYPOINTS], tips: &[Point; WAYPOINTS], curve: &mut [Point; WAYPOINTS]) {
    let rest = tips.iter().zip(curve.iter()).zip(term);
    let part: Point = rest.map(|((tip, on), value)| (tip - on) * *value).sum();
    for (on, value) in curve.iter_mut().zip(term) {
        *on += part * *value;
    }
}

/// A curve that the tip is drawn onto.
struct Drawing<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    margin: f64,
    curve: &'a [Point; WAYPOINTS],
    sampled: &'a [Configuration],
    /// The sampled shapes' bodies.
    bodies: &'a [Backbone],
}

impl Drawing<'_> {
    /// Moves what is between the ends of `path` so that the tip is on the curve; false, and nothing moved, where that is too
    /// far away or too near to an obstacle.
    fn draw(&self, path: &mut [Configuration]) -> bool {
        let mut drawn = [None; WAYPOINTS];
        let some_first = (1..WAYPOINTS - 1).step_by(STRIDE);
        for h in some_first.chain(1..WAYPOINTS - 1) {
            if drawn[h].is_none() {
                drawn[h] = self.waypoint(h);
            }
            if drawn[h].is_none() {
                return false;
            }
        }
        for (waypoint, drawn) in path.iter_mut().zip(drawn) {
            *waypoint = drawn.unwrap_or(*waypoint);
        }
        true
    }

    /// The shape near the sampled one whose tip is on the curve.
    fn waypoint(&self, h: usize) -> Option<Configuration> {
        let sampled = &self.sampled[h];
        let (mut shape, mut backbone) = (*sampled, self.bodies[h]);
        for _ in 0..STEPS {
            let error = self.curve[h] - backbone.tip();
            if error.norm() < ON_THE_CURVE {
                break;
            }
            shape = step(self.robot, &shape, &backbone, &error)?;
            backbone = self.robot.backbone(&shape);
        }
        let clearance = self.scene.clearance(&backbone, self.robot.tube_radius);
        let serves = (shape - sampled).norm() <= LARGEST_CHANGE_RAD && clearance >= self.margin;
        serves.then_some(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::straight_path;
    use crate::scenes::unit_robot;

    fn ends() -> [Configuration; 2] {
        [
            Configuration::from_column_slice(&[0.9, -0.4, -0.6, 0.6, 0.4, 0.8]),
            Configuration::from_column_slice(&[0.7, 0.1, -0.3, 0.9, 0.5, 0.6]),
        ]
    }

    #[test]
    fn a_tip_that_wanders_a_little_goes_straight() {
        let robot = unit_robot();
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        for (h, waypoint) in path.iter_mut().enumerate() {
            let wave = (20.0 * parameter(h)).sin() * parameter(h) * (1.0 - parameter(h));
            waypoint[1] += 0.02 * wave;
        }
        let bend = |path: &[Configuration]| {
            let tips: Vec<Point> = path.iter().map(|q| robot.tip(q)).collect();
            let third = |w: &[Point]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).norm_squared();
            tips.windows(4).map(third).sum::<f64>()
        };
        let before = bend(&path);
        TipCurves::new().straighten(&robot, &Scene::default(), 0.0, &mut path);
        assert!(bend(&path) < 1e-3 * before, "{} of {before}", bend(&path));
        assert_eq!([path[0], path[63]], [start, end]);
    }

    #[test]
    fn the_tip_of_a_straight_robot_is_left_as_it_is() {
        let robot = unit_robot();
        let sampled = straight_path(&Configuration::zeros(), &ends()[1]);
        let mut path = sampled.clone();
        TipCurves::new().straighten(&robot, &Scene::default(), 0.0, &mut path);
        assert_eq!(path, sampled);
    }

    #[test]
    fn a_wide_way_around_stays_as_it_is() {
        let robot = unit_robot();
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        for (h, waypoint) in path.iter_mut().enumerate() {
            waypoint[3] += 1.2 * (12.0 * parameter(h)).sin();
        }
        (path[0], path[63]) = (start, end);
        let sampled = path.clone();
        TipCurves::new().straighten(&robot, &Scene::default(), 0.0, &mut path);
        assert_eq!(path, sampled);
    }
}
