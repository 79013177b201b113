//! Kinematics, arc distances and certificates measured against ways of computing them that share no formula.

use collision::{Ball, Scene, certify_edge, certify_trajectory};
use nalgebra::Vector3;
use pcc_model::{Backbone, Configuration, DOF, Point, Robot, SECTIONS};
use planning::random_configuration;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use trajectory::{Knot, Trajectory};

use crate::brute_force::{self, Body};

/// Step of the difference quotients, rad: their truncation and their rounding are both below 1e-12.
const STEP: f64 = 0.01;
/// Weights of the eighth-order central difference.
const EIGHTH_ORDER: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
/// Bisections that an edge may take.
const DEPTH: u32 = 10;

/// A generator for one measurement.
#[must_use]
pub fn seeded(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Random shapes, every fourth with straight or nearly straight sections, the first exactly straight.
fn shape(robot: &Robot, index: usize, rng: &mut Pcg64) -> Configuration {
    let mut shape = random_configuration(robot, rng);
    let scale = match index % 4 {
        _ if index == 0 => return Configuration::zeros(),
        0 => 0.0,
        1 => 1e-7,
        _ => return shape,
    };
    let section = index / 4 % SECTIONS;
    shape.fixed_rows_mut::<2>(2 * section).scale_mut(scale);
    shape
}

/// Largest difference between the analytic Jacobian of a random backbone point and an eighth-order difference, over
/// `count` configurations; section lengths a radian.
#[must_use]
pub fn jacobian_error(robot: &Robot, count: usize, seed: u64) -> f64 {
    let mut rng = seeded(seed);
    let errors = (0..count).map(|index| {
        let shape = shape(robot, index, &mut rng);
        let (section, fraction) = (index % SECTIONS, rng.random::<f64>());
        let fraction = if index % 7 == 0 { 1.0 } else { fraction };
        let analytic = robot.backbone(&shape).point_jacobian(section, fraction);
        let point = |shape: &Configuration| robot.backbone(shape).point(section, fraction);
        let column = |dof| (difference(&point, &shape, dof) - analytic.column(dof)).amax();
        (0..DOF).map(column).fold(0.0, f64::max)
    });
    errors.fold(0.0, f64::max)
}

fn difference(
    point: &impl Fn(&Configuration) -> Point,
    at: &Configuration,
    dof: usize,
) -> Vector3<f64> {
    let moved = |steps: f64| {
        let mut shape = *at;
        shape[dof] += steps * STEP;
        point(&shape)
    };
    let terms = EIGHTH_ORDER.iter().zip(1..).map(|(weight, steps)| {
        (moved(f64::from(steps)) - moved(-f64::from(steps))) * (*weight / STEP)
    });
    terms.sum()
}

/// Largest difference between the exact point–arc distance and a search along the arc, over `count` points.
#[must_use]
pub fn arc_error(robot: &Robot, count: usize, seed: u64) -> f64 {
    let mut rng = seeded(seed);
    let errors = (0..count).map(|index| {
        let backbone = robot.backbone(&shape(robot, index, &mut rng));
        let point = Point::from_fn(|axis, _| rng.random_range(-2.5..2.5) + [0.0, 0.0, 1.0][axis]);
        let section = index % SECTIONS;
        (backbone.distance(section, &point) - searched_distance(&backbone, section, &point)).abs()
    });
    errors.fold(0.0, f64::max)
}

/// The best of 256 points, then a golden-section search around it.
fn searched_distance(backbone: &Backbone, section: usize, point: &Point) -> f64 {
    let distance = |fraction: f64| (backbone.point(section, fraction) - point).norm();
    let fractions = (0..=256).map(|i| f64::from(i) / 256.0);
    let best = fractions
        .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
        .unwrap();
    let (mut low, mut high) = ((best - 1.0 / 256.0).max(0.0), (best + 1.0 / 256.0).min(1.0));
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..60 {
        let (left, right) = (high - ratio * (high - low), low + ratio * (high - low));
        if distance(left) < distance(right) {
            high = right;
        } else {
            low = left;
        }
    }
    [low, high, 0.0, 1.0]
        .into_iter()
        .map(distance)
        .fold(f64::INFINITY, f64::min)
}

/// Error of the tip of the published three-section example, m.
#[must_use]
pub fn golden_tip_error(robot: &Robot) -> f64 {
    let lengths = [0.04, 0.03, 0.04];
    let curvatures = [50.0, 20.0, 100.0 / 3.0];
    let planes = [
        std::f64::consts::FRAC_PI_6,
        std::f64::consts::PI,
        std::f64::consts::PI,
    ];
    let mut example = robot.clone();
    example.section_lengths = lengths;
    let mut shape = Configuration::zeros();
    for section in 0..SECTIONS {
        let angle = lengths[section] * curvatures[section];
        shape[2 * section] = -angle * planes[section].sin();
        shape[2 * section + 1] = angle * planes[section].cos();
    }
    (example.tip(&shape) - Point::new(0.058_250_97, 0.059_111_25, 0.036_566_94)).norm()
}

/// The authors' published tendon matrix, mm a radian.
const PUBLISHED: [[f64; 6]; 9] = [
    [0.0, -42.0, 0.0, 0.0, 0.0, 0.0],
    [36.3731, 21.0, 0.0, 0.0, 0.0, 0.0],
    [-36.3731, 21.0, 0.0, 0.0, 0.0, 0.0],
    [26.9971, -32.1739, 26.9971, -32.1739, 26.9971, -32.1739],
    [14.3648, 39.4671, 14.3648, 39.4671, 14.3648, 39.4671],
    [-41.3619, -7.2932, -41.3619, -7.2932, -41.3619, -7.2932],
    [41.3619, -7.2932, 41.3619, -7.2932, 0.0, 0.0],
    [-14.3648, 39.4671, -14.3648, 39.4671, 0.0, 0.0],
    [-26.9971, -32.1739, -26.9971, -32.1739, 0.0, 0.0],
];

/// Largest difference from the authors' published tendon matrix, mm a radian.
#[must_use]
pub fn tendon_matrix_error(authors_robot: &Robot) -> f64 {
    let matrix = authors_robot.tendons.matrix();
    let rows = PUBLISHED.iter().enumerate();
    let error = |(tendon, row): (usize, &[f64; 6])| {
        let errors = (0..DOF).map(|dof| (1e3 * matrix[(tendon, dof)] - row[dof]).abs());
        errors.fold(0.0, f64::max)
    };
    rows.map(error).fold(0.0, f64::max)
}

/// What the certificate said of random motions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Certified {
    /// Motions tried.
    pub tried: usize,
    /// Certified free.
    pub certified: usize,
    /// Found to touch a ball when sampled densely.
    pub colliding: usize,
    /// Both: there must be none.
    pub certified_and_colliding: usize,
}

impl Certified {
    fn add(&mut self, is_certified: bool, collides: bool) {
        self.tried += 1;
        self.certified += usize::from(is_certified);
        self.colliding += usize::from(collides);
        self.certified_and_colliding += usize::from(is_certified && collides);
    }
}

fn random_scene(rng: &mut Pcg64) -> Scene {
    let count = rng.random_range(1..=6);
    let ball = |_| {
        let (radius, angle): (f64, f64) =
            (1.9 * rng.random::<f64>().sqrt(), rng.random_range(0.0..6.3));
        Ball {
            centre: Point::new(
                radius * angle.cos(),
                radius * angle.sin(),
                rng.random_range(0.3..2.8),
            ),
            radius: rng.random_range(0.15..0.5),
        }
    };
    Scene::new((0..count).map(ball).collect()).unwrap()
}

fn resting(scene: &Scene) -> Vec<brute_force::Ball> {
    let balls = scene.balls().iter();
    let resting = |ball: &Ball| brute_force::Ball::resting(ball.centre.into(), ball.radius);
    balls.map(resting).collect()
}

/// Whether a shape touches a ball for certain, by its chords.
fn touches(body: &Body, balls: &[brute_force::Ball], shape: &Configuration) -> bool {
    body.clearance(&(*shape).into(), balls, 0) < -body.chord_error_m()
}

/// Random straight moves in random scenes; `body`: the same robot's.
#[must_use]
pub fn certified_edges(robot: &Robot, body: &Body, count: usize, seed: u64) -> Certified {
    let (mut found, mut rng) = (Certified::default(), seeded(seed));
    for _ in 0..count {
        let scene = random_scene(&mut rng);
        let from = random_configuration(robot, &mut rng);
        let reach = rng.random_range(0.05..1.0);
        let to = from.lerp(&random_configuration(robot, &mut rng), reach);
        let is_certified = certify_edge(robot, &scene, &from, &to, DEPTH).is_free();
        let at = |i: i32| from.lerp(&to, f64::from(i) / 120.0);
        let balls = resting(&scene);
        let collides = (0..=120).any(|i| touches(body, &balls, &at(i)));
        found.add(is_certified, collides);
    }
    found
}

/// Random knot curves in random scenes; `body`: the same robot's.
#[must_use]
pub fn certified_curves(robot: &Robot, body: &Body, count: usize, seed: u64) -> Certified {
    let (mut found, mut rng) = (Certified::default(), seeded(seed));
    for _ in 0..count {
        let scene = random_scene(&mut rng);
        let motion = random_motion(robot, &mut rng);
        let is_certified = certify_trajectory(robot, &scene, &motion, 0.0).is_free();
        let balls = resting(&scene);
        let collides = motion
            .sample(600)
            .iter()
            .any(|shape| touches(body, &balls, shape));
        found.add(is_certified, collides);
    }
    found
}

fn random_motion(robot: &Robot, rng: &mut Pcg64) -> Trajectory {
    let (mut time, mut position) = (0.0, random_configuration(robot, rng));
    let vector =
        |rng: &mut Pcg64, size: f64| Configuration::from_fn(|_, _| rng.random_range(-size..size));
    let mut knot = |_| {
        let knot = Knot {
            time,
            position,
            velocity: vector(rng, 0.3),
            acceleration: vector(rng, 0.5),
        };
        time += rng.random_range(0.2..1.0);
        position = robot.project_to_limits(&(position + vector(rng, 0.3)));
        knot
    };
    let knots = (0..5).map(&mut knot).collect();
    Trajectory::new(knots).unwrap()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::programs::repository;

    fn unit() -> Robot {
        Robot::from_file(&repository().join("config/robots/unit.toml")).unwrap()
    }

    #[test]
    fn small_counts_agree() {
        let robot = unit();
        assert!(jacobian_error(&robot, 300, 1) < 1e-9);
        assert!(arc_error(&robot, 300, 1) < 1e-9);
        assert!(golden_tip_error(&robot) < 1e-8);
        let file = repository().join("config/robots/unit.toml");
        let body = Body::from_robot_file(&std::fs::read_to_string(file).unwrap());
        for found in [
            certified_edges(&robot, &body, 300, 1),
            certified_curves(&robot, &body, 100, 1),
        ] {
            assert_eq!(found.certified_and_colliding, 0, "{found:?}");
            let share = found.tried / 10;
            assert!(
                found.certified > share && found.colliding > share,
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_wrong_jacobian_would_be_seen() {
        let robot = unit();
        let mut longer = robot.clone();
        longer.section_lengths[1] += 1e-6;
        let shape = Configuration::repeat(0.3);
        let wrong = longer.backbone(&shape).point_jacobian(2, 1.0);
        let point = |shape: &Configuration| robot.backbone(shape).point(2, 1.0);
        assert!((difference(&point, &shape, 0) - wrong.column(0)).amax() > 1e-8);
    }
}
