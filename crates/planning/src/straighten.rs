//! Straightening: the tip of a sampled path is drawn onto a smooth curve near it.
//!
//! A sampled path comes near the straight way of the tip, with small waves in it. Here the curve is the straight line at even
//! speed, bent at its ends where the robot cannot set out along it, or as much nearer to the straight segment's way as the
//! bending limits demand; else as few terms u (1 − u) P_k(2u − 1) beside it as the scene allows. Every waypoint moves onto it
//! by Newton steps. The tip of a nearly straight robot, which sets out sideways only, is drawn onto the line at the pace of
//! the sampled path: with a speed of zero at first it goes exactly straight. Where the body would come too near to an
//! obstacle on all such curves, the path stays as it was sampled.

use crate::inverse_kinematics::damped_step;
use crate::path::{WAYPOINTS, parameter};
use collision::Scene;
use nalgebra::{Matrix3, SymmetricEigen};
use pcc_model::{Backbone, Configuration, DOF, Point, Robot, SECTIONS, TendonLimits};

/// Terms at most.
const TERMS: usize = 4;
/// Shares of the straight segment's way in the curve that are tried, in this order.
const SHARES: [f64; 3] = [0.0, 0.5, 0.8];
/// How far such a curve may be from the sampled tip, section lengths.
const NEAR_THE_LINE: f64 = 0.5;
/// Numbers of terms that are tried then, and how far the curve may be from the sampled tip, section lengths.
const BENT: [(usize, f64); 2] = [(2, 0.1), (TERMS, 0.05)];
/// Every so many waypoints are tried first: most curves that do not serve show it there. Even, so that these are odd ones.
const STRIDE: usize = 8;
/// Newton steps at most: a count, so that answers do not depend on time.
const STEPS: usize = 4;
/// A tip this near to the curve is on it, section lengths.
const ON_THE_CURVE: f64 = 1e-6;
/// A waypoint that would have to move farther lies near a shape whose tip cannot follow the curve, rad.
const LARGEST_CHANGE_RAD: f64 = 0.8;
/// Where the tip moves less than this by a rad in some direction, it cannot set out in that direction.
const STIFF: f64 = 0.6;
/// From stiffer ends the tip follows the line at its own pace: that of a straight robot sets out sideways only.
const STIFFEST: f64 = 0.9;
/// Share of the straight segment's way of the tip in the curve where an end is as stiff as can be.
const SEGMENT_SHARE: f64 = 0.35;
/// Bending above this far below the limit is compressed, so that a path does not run into its limits with a kink, rad.
const SOFT_RAD: f64 = 0.15;
/// A section at its limit still takes this share of the part that a free one takes in a Newton step.
const LEAST_WEIGHT: f64 = 0.02;
/// A waypoint is moved away from the middle of its neighbours by this times its distance from there at most.
const SHARPEST: f64 = 4.0;

/// All waypoints of a path.
type Drawn = [Configuration; WAYPOINTS];

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
    /// beyond the tube (section lengths); both ends stay exactly where they are. Where there is none, the path stays as it
    /// is.
    ///
    /// `limits` are those of the motion.
    pub(crate) fn straighten(
        &self,
        robot: &Robot,
        scene: &Scene,
        margin: f64,
        limits: &TendonLimits,
        path: &mut [Configuration],
    ) -> bool {
        let way = Way::new(robot, &path[0], &path[WAYPOINTS - 1]);
        let pen = Pen {
            robot,
            scene,
            margin,
            ends: way.ends,
        };
        let drawn = if way.stiffness > STIFFEST {
            self.at_its_own_pace(&way, &pen, path)
        } else {
            straight(&way, &pen, path).or_else(|| self.bent(&way, &pen, path))
        };
        if let Some(drawn) = &drawn {
            path.copy_from_slice(&sharpened(robot, limits, drawn));
        }
        drawn.is_some()
    }

    /// On the line between the tip's two ends; how far the tip has come there is left to the path.
    fn at_its_own_pace(&self, way: &Way, pen: &Pen, path: &[Configuration]) -> Option<Drawn> {
        let line = way.line.try_normalize(0.0)?;
        let calm = self.calmed(way, path);
        let demand = Demand {
            directions: Matrix3::identity() - line * line.transpose(),
            near: NEAR_THE_LINE,
            keeps_limits: true,
        };
        let guess = |h: usize| way.softened(h, &calm[h]);
        pen.draw(&demand, guess, |h| way.on_the_line(h))
    }

    /// The path without the short waves in it.
    fn calmed(&self, way: &Way, path: &[Configuration]) -> Drawn {
        let segment: Drawn = std::array::from_fn(|h| way.segment(h));
        let mut calm = segment;
        for term in &self.terms {
            let part: Configuration = (0..WAYPOINTS)
                .map(|h| (path[h] - segment[h]) * term[h])
                .sum();
            for (waypoint, value) in calm.iter_mut().zip(term) {
                *waypoint += part * *value;
            }
        }
        calm
    }

    /// On a curve that goes with the sampled tip.
    fn bent(&self, way: &Way, pen: &Pen, path: &[Configuration]) -> Option<Drawn> {
        let sampled: Drawn = std::array::from_fn(|h| way.guess(h, &path[h], 0.0));
        let tips = sampled.map(|shape| pen.robot.tip(&shape));
        let mut curve: [Point; WAYPOINTS] = std::array::from_fn(|h| way.straightest(h, 0.0));
        let mut used = 0;
        BENT.iter().find_map(|&(terms, near)| {
            self.terms[used..terms]
                .iter()
                .for_each(|term| follow(term, &tips, &mut curve));
            used = terms;
            let demand = Demand {
                directions: Matrix3::identity(),
                near,
                keeps_limits: false,
            };
            pen.draw(&demand, |h| sampled[h], |h| curve[h])
        })
    }
}

/// On the straightest curve that keeps the bending limits.
fn straight(way: &Way, pen: &Pen, path: &[Configuration]) -> Option<Drawn> {
    let demand = Demand {
        directions: Matrix3::identity(),
        near: NEAR_THE_LINE,
        keeps_limits: true,
    };
    SHARES.iter().find_map(|&share| {
        pen.draw(
            &demand,
            |h| way.guess(h, &path[h], share),
            |h| way.straightest(h, share),
        )
    })
}

/// The two ends of a path, and how far the tip cannot set out there in every direction.
struct Way<'a> {
    robot: &'a Robot,
    ends: [Configuration; 2],
    /// What compressing would change at the ends.
    compressions: [Configuration; 2],
    first_tip: Point,
    /// From the first tip to the last.
    line: Point,
    /// Bend of the tip's line at its middle, times 4, that spares the directions in which the tip is stiff.
    bend: Point,
    /// How stiff the tip is at the stiffer end, 0 to 1.
    stiffness: f64,
}

impl<'a> Way<'a> {
    fn new(robot: &'a Robot, start: &Configuration, end: &Configuration) -> Self {
        let ends = [*start, *end];
        let [first, last] = ends.map(|shape| robot.backbone(&shape));
        let line = last.tip() - first.tip();
        let [at_start, at_end] = [&first, &last].map(stiffest);
        let part =
            |(direction, stiffness): (Point, f64)| direction * (direction.dot(&line) * stiffness);
        Self {
            robot,
            ends,
            compressions: ends.map(|end| end - compressed(robot, &end)),
            first_tip: first.tip(),
            line,
            bend: part(at_end) - part(at_start),
            stiffness: at_start.1.max(at_end.1),
        }
    }

    fn segment(&self, h: usize) -> Configuration {
        self.ends[0].lerp(&self.ends[1], parameter(h))
    }

    fn on_the_line(&self, h: usize) -> Point {
        self.first_tip + self.line * parameter(h)
    }

    /// The straight line of the tip at even speed; at a stiff end it sets out as the tip can. It follows with `share`, and
    /// with more at a stiff end, the way that the straight segment takes.
    fn straightest(&self, h: usize, share: f64) -> Point {
        let u = parameter(h);
        let line = self.on_the_line(h) + self.bend * (u * (1.0 - u));
        let share = share.max(SEGMENT_SHARE * self.stiffness);
        if share == 0.0 {
            return line;
        }
        line.lerp(&self.robot.tip(&self.segment(h)), share)
    }

    /// A sampled shape with its bending compressed near the limit, as far as the ends allow.
    fn softened(&self, h: usize, sampled: &Configuration) -> Configuration {
        let [at_start, at_end] = self.compressions;
        compressed(self.robot, sampled) + at_start.lerp(&at_end, parameter(h))
    }

    /// Where the Newton steps begin: nearer to the straight segment where the curve is.
    fn guess(&self, h: usize, sampled: &Configuration, share: f64) -> Configuration {
        let share = share.max(self.stiffness);
        self.softened(h, sampled).lerp(&self.segment(h), share)
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

/// Adds to a curve what one term can do to bring it nearer to the tips.
fn follow(term: &[f64; WAYPOINTS], tips: &[Point; WAYPOINTS], curve: &mut [Point; WAYPOINTS]) {
    let rest = tips.iter().zip(curve.iter()).zip(term);
    let part: Point = rest.map(|((tip, on), value)| (tip - on) * *value).sum();
    for (on, value) in curve.iter_mut().zip(term) {
        *on += part * *value;
    }
}

/// The path that is executed along `drawn`.
///
/// Bounding jerk averages a motion over about w = a/j, which moves a place of the path by q̈ w²/24 to the inner side of its
/// bends; here the waypoints move as much to the outer side. With x the way of the fastest tendon, at the speed v that its
/// limits allow there, q̈ across the path is v² d²q/dx².
fn sharpened(robot: &Robot, limits: &TendonLimits, drawn: &Drawn) -> Drawn {
    let ways: [f64; WAYPOINTS - 1] =
        std::array::from_fn(|h| fastest_tendon(robot, &(drawn[h + 1] - drawn[h])));
    let whole: f64 = ways.iter().sum();
    let width_squared = (limits.acceleration / limits.jerk).powi(2);
    let mut sharp = *drawn;
    let mut passed = 0.0;
    for h in 1..WAYPOINTS - 1 {
        let [before, after] = [ways[h - 1], ways[h]];
        passed += before;
        if before.min(after) <= 0.0 {
            continue;
        }
        let reached = 2.0 * limits.acceleration * passed.min(whole - passed);
        let speed_squared = reached.min(limits.velocity.powi(2));
        let moved = width_squared * speed_squared / 24.0;
        let mean = 0.5 * (before + after);
        let bend = (drawn[h + 1] - drawn[h]) / after - (drawn[h] - drawn[h - 1]) / before;
        sharp[h] -= bend * (moved / mean).min(SHARPEST * 0.5 * mean);
    }
    sharp
}

/// The most that a tendon moves, length.
fn fastest_tendon(robot: &Robot, change: &Configuration) -> f64 {
    let rows = robot.tendons.matrix().row_iter();
    rows.map(|row| (row * change)[0].abs()).fold(0.0, f64::max)
}

/// The cubic through the nearest shapes with odd numbers, and the ends, at an even one.
fn interpolated(drawn: &Drawn, h: usize) -> Configuration {
    let nodes = match h {
        2 => [0, 1, 3, 5],
        62 => [57, 59, 61, 63],
        _ => [h - 3, h - 1, h + 1, h + 3],
    };
    let weight = |node: usize| -> f64 {
        let others = nodes.iter().filter(|&&other| other != node);
        let parts = others.map(|&other| (h as f64 - other as f64) / (node as f64 - other as f64));
        parts.product()
    };
    nodes.iter().map(|&node| drawn[node] * weight(node)).sum()
}

/// What a curve is drawn for.
struct Demand {
    /// Projects on the directions in which the tip must be on the curve.
    directions: Matrix3<f64>,
    /// How far the curve may be from the tip of the first guess, section lengths.
    near: f64,
    /// Whether steps that would bend beyond the limits fail; else they are cut there.
    keeps_limits: bool,
}

/// Draws curves where there is room for them.
struct Pen<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    margin: f64,
    ends: [Configuration; 2],
}

impl Pen<'_> {
    /// The path between the ends whose tip is on the curve, near a first guess; none where that is too far away or too near
    /// to an obstacle.
    fn draw(
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
            if taken == 0 && distance > demand.near {
                return None;
            }
            if distance < ON_THE_CURVE {
                break;
            }
            shape = self.step(demand, &shape, &backbone, &error)?;
            backbone = self.robot.backbone(&shape);
        }
        let clearance = self.scene.clearance(&backbone, self.robot.tube_radius);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::straight_path;
    use crate::scenes::unit_robot;
    use collision::Ball;

    fn straighten(robot: &Robot, path: &mut [Configuration]) -> bool {
        TipCurves::new().straighten(robot, &Scene::default(), 0.0, &robot.tendon_limits, path)
    }

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
        assert!(straighten(&robot, &mut path));
        assert!(bend(&path) < 0.2 * before, "{} of {before}", bend(&path));
        assert_eq!([path[0], path[63]], [start, end]);
    }

    #[test]
    fn the_tip_of_a_straight_robot_goes_straight_along_an_s_bend() {
        let robot = unit_robot();
        let start = Configuration::zeros();
        let end = Configuration::from_column_slice(&[0.7, 0.2, -1.1, -0.1, 0.6, 0.1]);
        let way = robot.tip(&end) - robot.tip(&start);
        let beside = |path: &[Configuration]| {
            let off = |q| way.cross(&(robot.tip(q) - robot.tip(&start))).norm() / way.norm();
            path.iter().map(off).fold(0.0, f64::max)
        };
        let mut path = straight_path(&start, &end);
        assert!(beside(&path) > 0.02, "the segment's tip leaves the line");
        assert!(straighten(&robot, &mut path));
        assert!(beside(&path) < 5e-4, "{}", beside(&path));
        assert_eq!([path[0], path[63]], [start, end]);
    }

    #[test]
    fn sharpening_moves_bends_outwards_and_leaves_segments() {
        let robot = unit_robot();
        let [start, end] = ends();
        let segment: Drawn = std::array::from_fn(|h| start.lerp(&end, parameter(h)));
        let bow = Configuration::from_column_slice(&[0.0, 0.3, 0.0, -0.2, 0.0, 0.1]);
        let bent: Drawn =
            std::array::from_fn(|h| segment[h] + bow * parameter(h) * (1.0 - parameter(h)));
        let moved = |drawn: &Drawn| {
            let sharp = sharpened(&robot, &robot.tendon_limits, drawn);
            sharp
                .iter()
                .zip(drawn)
                .map(|(s, d)| (s - d).dot(&bow))
                .sum::<f64>()
        };
        assert!(moved(&segment).abs() < 1e-12);
        assert!(moved(&bent) > 1e-4, "{}", moved(&bent));
    }

    #[test]
    fn a_way_around_a_ball_on_the_line_stays_as_it_is() {
        let robot = unit_robot();
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        let ball = Ball {
            centre: robot.tip(&path[32]),
            radius: 0.1,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        for (h, waypoint) in path.iter_mut().enumerate() {
            waypoint[3] += 1.2 * (std::f64::consts::PI * parameter(h)).sin();
        }
        (path[0], path[63]) = (start, end);
        let sampled = path.clone();
        let limits = &robot.tendon_limits;
        assert!(!TipCurves::new().straighten(&robot, &scene, 0.0, limits, &mut path));
        assert_eq!(path, sampled);
    }
}
