//! Straightening: the tip of a sampled path is drawn onto a smooth curve near it.
//!
//! A sampled path comes near the straight way of the tip, with small hooks at both ends and waves between. Here the curve is
//! the straight line at even speed plus as few terms u (1 − u) P_k(2u − 1) as follow the sampled tip closely enough, and
//! every waypoint moves onto it by Newton steps of least norm. What is far from all such curves stays as it was sampled.

use crate::inverse_kinematics::newton_step;
use crate::path::{WAYPOINTS, parameter};
use pcc_model::{Configuration, Point, Robot};

/// Terms at most.
const TERMS: usize = 4;
/// Numbers of terms that are tried, in this order.
const TRIED: [usize; 3] = [0, 2, TERMS];
/// Distance between the sampled tip and the curve, section lengths.
const NEAR: f64 = 0.05;
/// Newton steps at most: a count, so that answers do not depend on time.
const STEPS: usize = 4;
/// A tip this near to the curve is on it, section lengths.
const ON_THE_CURVE: f64 = 1e-7;
/// A waypoint that would have to move farther lies near a shape whose tip cannot follow the curve, rad.
const LARGEST_CHANGE_RAD: f64 = 0.4;

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

    /// Draws the tip of a path (64 waypoints, radians) onto a smooth curve; both ends stay exactly where they are.
    pub(crate) fn straighten(&self, robot: &Robot, path: &mut [Configuration]) {
        let tips: [Point; WAYPOINTS] = std::array::from_fn(|h| robot.tip(&path[h]));
        let Some(curve) = self.near(&tips) else {
            eprintln!("ST none");return;
        };
        let mut drawn = path.to_vec();
        let ways = drawn.iter_mut().zip(&curve);
        for (waypoint, target) in ways.take(WAYPOINTS - 1).skip(1) {
            if !draw(robot, waypoint, target) {
 eprintln!("ST far");
                return;
            }
        }
        path.copy_from_slice(&drawn); eprintln!("ST ok");
    }

    /// The curve of fewest terms that is near these tips.
    fn near(&self, tips: &[Point; WAYPOINTS]) -> Option<[Point; WAYPOINTS]> {
        let (first, last) = (tips[0], tips[WAYPOINTS - 1]);
        let mut curve = std::array::from_fn(|h| first.lerp(&last, parameter(h)));
        let mut used = 0;
        for wanted in TRIED {
            for term in &self.terms[used..wanted] {
                let rest = tips.iter().zip(&curve).zip(term);
                let part: Point = rest.map(|((tip, on), value)| (tip - on) * *value).sum();
                for (on, value) in curve.iter_mut().zip(term) {
                    *on += part * *value;
                }
            }
            used = wanted;
            if tips
                .iter()
                .zip(&curve)
                .all(|(tip, on)| (tip - on).norm() <= NEAR)
            {
                eprintln!("ST K{wanted}");return Some(curve);
            }
        }
        None
    }
}

/// Moves a shape until its tip is at a point nearby; false if it would become another shape.
fn draw(robot: &Robot, shape: &mut Configuration, target: &Point) -> bool {
    let sampled = *shape;
    for _ in 0..STEPS {
        let backbone = robot.backbone(shape);
        let error = target - backbone.tip();
        if error.norm() < ON_THE_CURVE {
            break;
        }
        match newton_step(robot, shape, &backbone, &error) {
            Some(next) => *shape = next,
            None => return false,
        }
    }
    (*shape - sampled).norm() <= LARGEST_CHANGE_RAD
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
        let (first, last) = (robot.tip(&start), robot.tip(&end));
        let distance = |path: &[Configuration]| {
            let off = |(h, q): (usize, &Configuration)| {
                (robot.tip(q) - first.lerp(&last, parameter(h))).norm()
            };
            path.iter().enumerate().map(off).fold(0.0, f64::max)
        };
        let before = distance(&path);
        assert!(before > 1e-3 && before < NEAR, "it wanders by {before}");
        TipCurves::new().straighten(&robot, &mut path);
        assert!(distance(&path) < 1e-7, "{}", distance(&path));
        assert_eq!([path[0], path[63]], [start, end]);
    }

    #[test]
    fn a_wide_way_around_stays_as_it_is() {
        let robot = unit_robot();
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        for (h, waypoint) in path.iter_mut().enumerate() {
            waypoint[3] += 0.5 * (12.0 * parameter(h)).sin();
        }
        (path[0], path[63]) = (start, end);
        let sampled = path.clone();
        TipCurves::new().straighten(&robot, &mut path);
        assert_eq!(path, sampled);
    }
}
