//! The features of the few-step model: both ends and every ball, in the canonical frame, as plain numbers.

use crate::models::canonical_frame::CanonicalFrame;
use crate::path::sine_basis::{SineBasis, UNKNOWNS};
use collision::{Ball, Scene};
use denoiser::FeatureFrame;
use pcc_model::{Backbone, Configuration, Nearest, Point, UnitRobot};

/// Numbers that describe the two ends of a path.
pub const END_FEATURES: usize = 36;
/// Numbers that describe one ball, seen from the straight segment between the ends.
pub const BALL_FEATURES: usize = 28;
/// Sine coefficients of a path's residual to the straight segment, term-major.
pub const COEFFICIENTS: usize = UNKNOWNS;

/// Balls whose features the model gets; of larger scenes and of solids these are the most relevant ones.
const MOST_BALLS: usize = 24;
/// Where along the straight segment the balls are seen from.
const VIEWS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Clearances beyond this say only "far", section lengths.
const FAR: f64 = 1.5;

/// Features of one pair of ends and its scene.
///
/// `ends` has [`END_FEATURES`] numbers, `balls` [`BALL_FEATURES`] for each ball in the scene's order.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// Description of the ends.
    pub ends: Vec<f32>,
    /// Descriptions of the balls, one after the other.
    pub balls: Vec<f32>,
}

/// Computes the features of a path from `start` to `end` around `balls`; all in the canonical frame already.
#[must_use]
pub fn features(
    robot: &UnitRobot,
    start: &Configuration,
    end: &Configuration,
    balls: &[Ball],
) -> Features {
    let views = VIEWS.map(|u| robot.backbone(&start.lerp(end, u)));
    let mut features = Features::default();
    describe_ends(start, end, &views, balls.len(), &mut features.ends);
    for ball in balls {
        describe_ball(robot, ball, &views, &mut features.balls);
    }
    features
}

fn describe_ends(
    start: &Configuration,
    end: &Configuration,
    views: &[Backbone; 5],
    balls: usize,
    out: &mut Vec<f32>,
) {
    let (first, last) = (views[0].tip(), views[4].tip());
    let mut values = [0.0_f64; END_FEATURES];
    values[..6].copy_from_slice(start.as_slice());
    values[6..12].copy_from_slice(end.as_slice());
    let bends = [1, 2, 3].map(|i| views[i].tip() - first.lerp(&last, VIEWS[i]));
    let elbows = [views[0].point(1, 1.0), views[4].point(1, 1.0)];
    let points = [first, last].into_iter().chain(bends).chain(elbows);
    for (slot, point) in values[12..33].chunks_exact_mut(3).zip(points) {
        slot.copy_from_slice(point.as_slice());
    }
    values[33..].copy_from_slice(&[
        (end - start).norm(),
        (last - first).norm(),
        balls as f64 / 8.0,
    ]);
    out.extend(values.map(|v| v as f32));
}

fn describe_ball(robot: &UnitRobot, ball: &Ball, views: &[Backbone; 5], out: &mut Vec<f32>) {
    let seen = [0, 1, 2, 3, 4].map(|i| sight(robot, ball, &views[i]));
    let mut values = [0.0_f64; BALL_FEATURES];
    values[..3].copy_from_slice(ball.centre.as_slice());
    values[3] = ball.radius;
    for (slot, sight) in values[4..9].iter_mut().zip(&seen) {
        *slot = sight.clearance.min(FAR);
    }
    for (slot, sight) in values[9..18].chunks_exact_mut(3).zip(&seen[1..4]) {
        slot.copy_from_slice(sight.normal.as_slice());
    }
    for (slot, sight) in values[18..21].iter_mut().zip(&seen[1..4]) {
        *slot = (sight.section as f64 + sight.fraction) / 3.0;
    }
    values[21] = (distance_to_segment(&ball.centre, &views[0].tip(), &views[4].tip())
        - ball.radius)
        .min(FAR);
    let middle = &seen[2];
    let gradient = views[2]
        .point_jacobian(middle.section, middle.fraction)
        .transpose()
        * middle.normal;
    values[22..28].copy_from_slice(gradient.as_slice());
    out.extend(values.map(|v| v as f32));
}

struct Sight {
    clearance: f64,
    normal: Point,
    section: usize,
    fraction: f64,
}

fn sight(robot: &UnitRobot, ball: &Ball, backbone: &Backbone) -> Sight {
    let distance =
        |(section, nearest): &(usize, Nearest)| nearest.distance - robot.tube_radii[*section];
    let candidates = [0, 1, 2].map(|section| (section, backbone.nearest(section, &ball.centre)));
    let (section, nearest) = candidates
        .into_iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .expect("a robot has three sections");
    let away = nearest.point - ball.centre;
    Sight {
        clearance: nearest.distance - ball.radius - robot.tube_radii[section],
        normal: away / nearest.distance.max(1e-9),
        section,
        fraction: nearest.fraction,
    }
}

fn distance_to_segment(p: &Point, a: &Point, b: &Point) -> f64 {
    let along = b - a;
    let u = ((p - a).dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    (p - a - along * u).norm()
}

/// A problem's ends and obstacles brought into the canonical frame.
pub(crate) struct CanonicalProblem<'a> {
    pub(crate) frame: CanonicalFrame,
    scene: &'a Scene,
    /// Clearance that paths are to have, section lengths: the balls are padded by it.
    room: f64,
}

impl<'a> CanonicalProblem<'a> {
    pub(crate) fn new(frame: CanonicalFrame, scene: &'a Scene, room: f64) -> Self {
        Self { frame, scene, room }
    }

    /// The balls that matter most for the straight segment between two configurations, in the canonical frame.
    fn balls(&self, robot: &UnitRobot, start: &Configuration, end: &Configuration) -> Vec<Ball> {
        let views = VIEWS.map(|u| robot.backbone(&start.lerp(end, u)));
        let chosen = self
            .scene
            .most_relevant(&views, &robot.tube_radii, MOST_BALLS);
        let padded = |ball: &Ball| Ball {
            radius: ball.radius + self.room,
            ..self.frame.ball(ball)
        };
        chosen.iter().map(padded).collect()
    }

    pub(crate) fn features(
        &self,
        robot: &UnitRobot,
        start: &Configuration,
        end: &Configuration,
    ) -> Features {
        features(
            robot,
            &self.frame.configuration(start),
            &self.frame.configuration(end),
            &self.balls(robot, start, end),
        )
    }
}

/// Sine coefficients (term-major, radians) of a path's residual to the straight segment between its ends, in the base
/// frame or the canonical one of `goal_tip`; `mirrored` gives the mirror image. With the features of the same frame.
#[must_use]
pub fn residual_coefficients(
    robot: &UnitRobot,
    path: &[Configuration],
    goal_tip: &Point,
    scene: &Scene,
    frame: FeatureFrame,
    mirrored: bool,
) -> (Features, [f64; COEFFICIENTS]) {
    let (start, end) = (path[0], path[path.len() - 1]);
    let frame = CanonicalFrame::wanted(frame, robot, &start, goal_tip);
    let problem =
        CanonicalProblem::new(if mirrored { frame.mirrored() } else { frame }, scene, 0.0);
    let turned: Vec<Configuration> = path
        .iter()
        .map(|q| problem.frame.configuration(q))
        .collect();
    (
        problem.features(robot, &start, &end),
        SineBasis::default().analyse(&turned),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::path::waypoints::straight_path;

    fn close(a: &[f32], b: &[f32]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(x, y)| (x - y).abs() < 2e-5)
    }

    #[test]
    fn features_do_not_change_when_the_world_turns_about_the_base() {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.3, -0.2, 0.5, 0.1, -0.4, 0.6]);
        let end = Configuration::from_column_slice(&[-0.7, 0.4, 0.2, 0.9, 0.3, -0.2]);
        let ball = Ball {
            centre: Point::new(0.7, 0.4, 1.2),
            radius: 0.3,
        };
        let turn = CanonicalFrame::of(&robot, &start, &Point::new(0.4, -1.0, 2.0));
        let path = straight_path(&start, &end);
        let turned: Vec<Configuration> = path.iter().map(|q| turn.configuration(q)).collect();
        let here = residual_coefficients(
            &robot,
            &path,
            &robot.tip(&end),
            &Scene::new(vec![ball]).unwrap(),
            FeatureFrame::Canonical,
            false,
        )
        .0;
        let there_tip = robot.tip(&turned[63]);
        let there = residual_coefficients(
            &robot,
            &turned,
            &there_tip,
            &Scene::new(vec![turn.ball(&ball)]).unwrap(),
            FeatureFrame::Canonical,
            false,
        )
        .0;
        assert!(
            (robot.tip(&end) - there_tip).norm() > 0.1,
            "the world was turned"
        );
        assert!(close(&here.ends, &there.ends) && close(&here.balls, &there.balls));
    }

    #[test]
    fn the_mirror_is_a_symmetry_of_the_robot() {
        let robot = unit_robot();
        let configuration = Configuration::from_column_slice(&[0.3, -0.2, 0.5, 0.1, -0.4, 0.6]);
        let frame =
            CanonicalFrame::of(&robot, &configuration, &Point::new(1.0, 1.0, 2.0)).mirrored();
        let expected = frame.point(&robot.tip(&configuration));
        assert!((robot.tip(&frame.configuration(&configuration)) - expected).norm() < 1e-12);
        assert!(
            (frame.restore(&frame.configuration(&configuration)) - configuration).norm() < 1e-12
        );
    }

    #[test]
    fn balls_are_told_thicker_by_the_room_that_is_wanted() {
        let robot = unit_robot();
        let (start, end) = (Configuration::zeros(), Configuration::repeat(0.3));
        let ball = |radius| Ball {
            centre: Point::new(0.8, 0.2, 2.0),
            radius,
        };
        let told = |radius, room| {
            let scene = Scene::new(vec![ball(radius)]).unwrap();
            let frame = CanonicalFrame::of(&robot, &start, &robot.tip(&end));
            CanonicalProblem::new(frame, &scene, room)
                .features(&robot, &start, &end)
                .balls
        };
        assert_eq!(told(0.3, 0.07), told(0.37, 0.0));
        assert_ne!(told(0.3, 0.07), told(0.3, 0.0));
    }
}
