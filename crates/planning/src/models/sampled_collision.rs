//! Collisions as the reference implementation samples them: nine points of the backbone at every waypoint (docs/evaluation.md).
//!
//! It is what the paper counts as success and what its repulsion pushes; nothing is certified with it.

use collision::{Ball, Scene};
use pcc_model::{Backbone, Configuration, Point, SECTIONS, UnitRobot};

/// Fractions of each section that are looked at.
pub const FRACTIONS: [f64; 3] = [1.0 / 3.0, 2.0 / 3.0, 1.0];
/// Margin of repulsion over the tube radius.
pub const REPULSION: f64 = 1.5;
/// Tip error that counts as reached, section lengths.
const TIP_TOLERANCE: f64 = 0.1;
/// Nearer to the axis of a ball than this, a point is pushed along it, section lengths.
const AXIS: f64 = 1e-9;

/// The quantities by which the paper's criterion judges one path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledVerdict {
    /// Distance of the last tip from the target, section lengths.
    pub tip_error: f64,
    /// Smallest distance of the nine points of any waypoint to a ball, less the tube radius; +∞ without balls, NaN where
    /// a waypoint is.
    pub clearance: f64,
}

impl SampledVerdict {
    /// Judges a path by its waypoints.
    #[must_use]
    pub fn of(robot: &UnitRobot, scene: &Scene, target: &Point, path: &[Configuration]) -> Self {
        let distance = |configuration| {
            let nearest = deepest(&robot.backbone(configuration), scene.balls());
            nearest.map_or(f64::INFINITY, |d| d.distance)
        };
        let tip_error = path.last().map(|end| (robot.tip(end) - target).norm());
        Self {
            tip_error: tip_error.unwrap_or(f64::INFINITY),
            clearance: path.iter().map(distance).fold(f64::INFINITY, smaller)
                - robot.largest_tube_radius(),
        }
    }

    /// The paper's success of one candidate.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.tip_error <= TIP_TOLERANCE && self.clearance >= 0.0
    }
}

/// The smaller of two numbers, or NaN where one is NaN, which `f64::min` would drop.
fn smaller(a: f64, b: f64) -> f64 {
    if b < a || b.is_nan() { b } else { a }
}

/// Of the nine body points of the paper's collision criterion (at 1/3, 2/3 and the end of each section), the one nearest to or deepest
/// in a ball.
pub(crate) struct Deepest<'a> {
    pub(crate) section: usize,
    pub(crate) fraction: f64,
    pub(crate) point: Point,
    pub(crate) ball: &'a Ball,
    /// Distance of the deepest point to the ball's surface, section lengths.
    pub(crate) distance: f64,
}

/// Finds the deepest of the nine points of a configuration; none without balls.
pub(crate) fn deepest<'a>(backbone: &Backbone, balls: &'a [Ball]) -> Option<Deepest<'a>> {
    let mut found: Option<Deepest> = None;
    for section in 0..SECTIONS {
        for fraction in FRACTIONS {
            let point = backbone.point(section, fraction);
            for ball in balls {
                let distance = (point - ball.centre).norm() - ball.radius;
                let is_deeper = |f: &Deepest| distance < f.distance || distance.is_nan();
                if found.as_ref().is_none_or(is_deeper) {
                    found = Some(Deepest {
                        section,
                        fraction,
                        point,
                        ball,
                        distance,
                    });
                }
            }
        }
    }
    found
}

/// The vector that moves a point out of a sphere around the origin: horizontally at its height, vertically only on the axis.
#[must_use]
pub fn way_out(from_centre: &Point, radius: f64) -> Point {
    let (out, height) = (from_centre.x.hypot(from_centre.y), from_centre.z);
    if out < AXIS {
        return Point::new(0.0, 0.0, (radius - height.abs()).copysign(height));
    }
    let wanted = (radius * radius - height * height).max(0.0).sqrt();
    let scale = (wanted - out) / out;
    Point::new(from_centre.x * scale, from_centre.y * scale, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use datasets::scenes::reference_layout;
    use nalgebra::Vector3;

    #[test]
    fn the_way_out_ends_on_the_sphere() {
        for from in [
            Vector3::new(0.2, -0.1, 0.3),
            Vector3::new(0.0, 0.0, -0.2),
            Vector3::new(0.4, 0.0, 0.0),
        ] {
            let moved = from + way_out(&from, 0.7);
            assert!((moved.norm() - 0.7).abs() < 1e-12, "{moved}");
        }
    }

    #[test]
    fn a_path_through_a_ball_is_no_success_though_its_tip_arrives() {
        let robot = unit_robot();
        let straight = Configuration::zeros();
        let target = robot.tip(&straight);
        let free = Scene::new(Vec::new()).unwrap();
        let blocked = Scene::new(reference_layout(1)).unwrap();
        let judge = |scene| SampledVerdict::of(&robot, scene, &target, &[straight; 2]);
        assert!(judge(&free).is_success());
        assert!((judge(&blocked).clearance - (1.0 / 6.0 - 0.6)).abs() < 1e-9);
        assert!(!judge(&blocked).is_success());
    }

    #[test]
    fn a_path_that_is_not_finite_somewhere_is_no_success() {
        let robot = unit_robot();
        let straight = Configuration::zeros();
        let target = robot.tip(&straight);
        let scene = Scene::new(reference_layout(4)).unwrap();
        let mut path = [straight; 5];
        assert!(SampledVerdict::of(&robot, &scene, &target, &path).is_success());
        for degree_of_freedom in [1, 5] {
            path[2][degree_of_freedom] = f64::NAN;
            let verdict = SampledVerdict::of(&robot, &scene, &target, &path);
            assert!(!verdict.is_success(), "{verdict:?}");
            path[2] = straight;
        }
    }
}
