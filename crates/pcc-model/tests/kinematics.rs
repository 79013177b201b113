//! The backbone against an independent matrix exponential and differences of high order, and its symmetries.
#![allow(clippy::unwrap_used)] // tests

mod shapes;

use fearless_simd::{Level, dispatch};
use nalgebra::{Matrix3x6, Matrix4, Rotation3};
use pcc_model::{Configuration, Point, Robot, side_by_side};
use proptest::prelude::*;
use rand::RngExt;
use rand_pcg::Pcg64;
use shapes::{any_point, any_shape, random, shape_of, unit_robot};
use std::f64::consts::{FRAC_PI_2, TAU};

/// exp of a section's twist (the paper's ξ̂) by its Taylor series.
fn twist_exponential(x: f64, y: f64, length: f64) -> Matrix4<f64> {
    #[rustfmt::skip]
    let twist = Matrix4::new(
        0.0, 0.0, y, 0.0,
        0.0, 0.0, -x, 0.0,
        -y, x, 0.0, length,
        0.0, 0.0, 0.0, 0.0,
    );
    let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
    for n in 1..40 {
        term = term * twist / f64::from(n);
        sum += term;
    }
    sum
}

/// Sixth-order central difference of `f` in every component of the shape.
fn differences(
    shape: &Configuration,
    step: f64,
    f: impl Fn(&Configuration) -> Point,
) -> nalgebra::SMatrix<f64, 3, 6> {
    let mut result = nalgebra::SMatrix::<f64, 3, 6>::zeros();
    for k in 0..6 {
        let odd = |n: f64| {
            let (mut before, mut after) = (*shape, *shape);
            before[k] -= n * step;
            after[k] += n * step;
            f(&after) - f(&before)
        };
        let slope = (odd(1.0) * 45.0 - odd(2.0) * 9.0 + odd(3.0)) / (60.0 * step);
        result.set_column(k, &slope);
    }
    result
}

/// Unequal lengths, so that no two of them can be mixed up.
fn uneven_robot() -> Robot {
    Robot {
        section_lengths: [1.0, 0.7, 1.3],
        ..unit_robot()
    }
}

#[test]
fn frames_are_products_of_exponentials() {
    let (robot, mut random) = (uneven_robot(), random(1));
    for _ in 0..10_000 {
        let shape = any_shape(&mut random);
        let backbone = robot.backbone(&shape);
        let mut pose = Matrix4::<f64>::identity();
        for (i, length) in robot.section_lengths.into_iter().enumerate() {
            let fraction: f64 = random.random();
            let (x, y) = (shape[2 * i], shape[2 * i + 1]);
            let part = pose * twist_exponential(fraction * x, fraction * y, fraction * length);
            let point = part.fixed_view::<3, 1>(0, 3);
            assert!((backbone.point(i, fraction) - point).amax() < 1e-14);
            pose *= twist_exponential(x, y, length);
            let frame = &backbone.frames()[i + 1];
            assert!((frame.position - pose.fixed_view::<3, 1>(0, 3)).amax() < 1e-14);
            assert!((frame.rotation - pose.fixed_view::<3, 3>(0, 0)).amax() < 1e-14);
        }
        assert_eq!(robot.tip(&shape), backbone.frames()[3].position);
    }
}

#[test]
fn tips_together_are_those_one_by_one() {
    let (robot, mut random) = (uneven_robot(), random(3));
    for count in 0..200 {
        let mut shapes: Vec<_> = (0..count).map(|_| any_shape(&mut random)).collect();
        if let Some(first) = shapes.first_mut() {
            *first = Configuration::zeros();
        }
        let tips = robot.tips(&shapes);
        assert_eq!(tips.len(), shapes.len());
        for (tip, shape) in tips.iter().zip(&shapes) {
            assert!((tip - robot.tip(shape)).amax() < 1e-14);
        }
    }
}

/// The tips and the Jacobians of four configurations.
fn moving_tips(robot: &Robot, shapes: &[Configuration; 4]) -> [(Point, Matrix3x6<f64>); 4] {
    dispatch!(Level::new(), simd => {
        let moving = robot.moving_tips(&side_by_side(simd, shapes));
        std::array::from_fn(|lane| {
            let jacobian = Matrix3x6::from_fn(|row, column| moving.jacobians[column][row][lane]);
            (Point::from(moving.positions.map(|axis| axis[lane])), jacobian)
        })
    })
}

#[test]
fn four_moving_tips_are_those_one_by_one() {
    let (robot, mut random) = (uneven_robot(), random(4));
    for case in 0..10_000 {
        // Also tiny bends, and far ones, for which the series are not made, beside usual ones.
        let scales = [1.0, 1e-5, [0.3, 1.5][case % 2], 0.0];
        let shapes = scales.map(|scale| any_shape(&mut random) * scale);
        for ((tip, jacobian), shape) in moving_tips(&robot, &shapes).into_iter().zip(&shapes) {
            let backbone = robot.backbone(shape);
            assert!((tip - backbone.tip()).amax() < 1e-14);
            assert!((jacobian - backbone.tip_jacobian()).amax() < 2e-14);
        }
    }
}

#[test]
fn straight_robot_stands_on_the_z_axis() {
    let backbone = uneven_robot().backbone(&Configuration::zeros());
    assert_eq!(backbone.tip(), Point::new(0.0, 0.0, 3.0));
    assert_eq!(backbone.point(1, 0.5), Point::new(0.0, 0.0, 1.35));
    assert_eq!(backbone.section_length(2), 1.3);
}

#[test]
fn jacobians_agree_with_sixth_order_differences() {
    let (robot, mut random) = (uneven_robot(), random(2));
    for _ in 0..10_000 {
        let shape = any_shape(&mut random);
        let backbone = robot.backbone(&shape);
        let (section, fraction) = (random.random_range(0..3), random.random::<f64>());
        let numeric = differences(&shape, 0.01, |q| robot.backbone(q).point(section, fraction));
        let error = (backbone.point_jacobian(section, fraction) - numeric).amax();
        assert!(error < 1e-11, "{error} at {shape}");
        let numeric = differences(&shape, 0.01, |q| robot.tip(q));
        let error = (backbone.tip_jacobian() - numeric).amax();
        assert!(error < 1e-11, "{error} at {shape}");
    }
}

/// Whether the nearest point stays inside the arc, or at the same end of it, for all shapes within `reach`.
fn foot_stays(robot: &Robot, shape: &Configuration, section: usize, p: &Point, reach: f64) -> bool {
    let place = |q: &Configuration| {
        let fraction = robot.backbone(q).nearest(section, p).fraction;
        (fraction == 0.0, fraction == 1.0)
    };
    (0..6).all(|k| {
        [-reach, reach].iter().all(|change| {
            let mut moved = *shape;
            moved[k] += change;
            place(&moved) == place(shape)
        })
    })
}

#[test]
fn distance_gradients_agree_with_sixth_order_differences() {
    let (robot, mut random) = (uneven_robot(), random(3));
    let (step, mut checked) = (5e-4, [0; 3]);
    for _ in 0..10_000 {
        let shape = any_shape(&mut random);
        let (section, point) = (random.random_range(0..3), any_point(&mut random));
        let nearest = robot.backbone(&shape).nearest(section, &point);
        if nearest.distance < 0.25 || !foot_stays(&robot, &shape, section, &point, 3.0 * step) {
            continue;
        }
        let distance = |q: &Configuration| robot.backbone(q).distance(section, &point);
        let numeric = differences(&shape, step, |q| Point::new(distance(q), 0.0, 0.0));
        let jacobian = robot
            .backbone(&shape)
            .point_jacobian(section, nearest.fraction);
        let gradient = jacobian.tr_mul(&(nearest.point - point).normalize());
        let error = (gradient - numeric.row(0).transpose()).amax();
        assert!(error < 1e-9, "{error} at {shape}");
        checked[1 + usize::from(nearest.fraction == 1.0) - usize::from(nearest.fraction == 0.0)] +=
            1;
    }
    assert!(
        checked.iter().all(|n| *n > 1_000),
        "base, inside, end: {checked:?}"
    );
}

#[test]
fn tendon_lengths_and_back() {
    let (robot, mut random) = (shapes::authors_robot(), random(5));
    for _ in 0..1_000 {
        let shape = any_shape(&mut random);
        let mut lengths = [0.0; 9];
        robot.tendons.lengths(&shape, &mut lengths);
        assert!((robot.tendons.configuration(&lengths) - shape).amax() < 1e-14);
        assert!(robot.tendons.slack_residual(&lengths) < 1e-15);
        lengths[random.random_range(0..9)] += 0.003;
        let residual = robot.tendons.slack_residual(&lengths);
        assert!(
            (0.001..=0.003).contains(&residual),
            "slack of 3 mm leaves {residual} m"
        );
    }
}

fn random_in_disc(random: &mut Pcg64, limit: f64) -> Configuration {
    let angles = std::array::from_fn(|_| random.random_range(0.0..limit));
    shape_of(
        angles,
        std::array::from_fn(|_| random.random_range(0.0..TAU)),
    )
}

#[test]
fn projection_is_the_nearest_shape_within_the_limits() {
    let (robot, mut random) = (unit_robot(), random(6));
    let mut moved = 0;
    for _ in 0..1_000 {
        let shape = random_in_disc(&mut random, 3.0);
        let projected = robot.project_to_limits(&shape);
        assert!(robot.limit_excess(&projected) < 1e-15);
        assert!((robot.project_to_limits(&projected) - projected).amax() < 1e-15);
        if robot.limit_excess(&shape) <= 0.0 {
            assert_eq!(projected, shape);
            continue;
        }
        moved += 1;
        for _ in 0..20 {
            let other = random_in_disc(&mut random, FRAC_PI_2);
            assert!((shape - projected).norm() <= (shape - other).norm() + 1e-15);
        }
    }
    assert!((100..1_000).contains(&moved), "{moved} shapes were outside");
}

#[test]
fn limit_excess_is_of_the_section_that_bends_most() {
    let robot = unit_robot();
    let shape = shape_of([0.1, 2.0, 0.3], [0.4, 5.0, 3.0]);
    assert!((robot.limit_excess(&shape) - (2.0 - FRAC_PI_2)).abs() < 1e-15);
    assert!((robot.limit_excess(&Configuration::zeros()) + FRAC_PI_2).abs() < 1e-15);
    for (angle, expected) in robot.bending_angles(&shape).iter().zip([0.1, 2.0, 0.3]) {
        assert!((angle - expected).abs() < 1e-15);
    }
}

#[test]
fn shape_that_is_not_a_number_is_not_within_the_limits() {
    let mut shape = Configuration::zeros();
    shape[3] = f64::NAN;
    assert_eq!(unit_robot().limit_excess(&shape), f64::INFINITY);
}

#[test]
fn scaled_robot_has_the_same_shapes_and_tendon_angles() {
    let (robot, mut random) = (shapes::authors_robot(), random(7));
    let length = robot.equal_section_length().unwrap();
    let unit = robot.to_unit().unwrap();
    assert!((unit.equal_section_length().unwrap() - 1.0).abs() < 1e-15);
    assert_eq!(uneven_robot().to_unit(), None);
    let shape = any_shape(&mut random);
    assert!((unit.tip(&shape) * length - robot.tip(&shape)).amax() < 1e-15);
    let matrix = unit.tendons.matrix() * length - robot.tendons.matrix();
    assert!(matrix.amax() < 1e-16);
    assert!((unit.tendon_limits.jerk * length - robot.tendon_limits.jerk).abs() < 1e-15);
    assert!((unit.largest_tube_radius() - 0.2).abs() < 1e-12);
}

fn shapes_within_limits() -> impl Strategy<Value = Configuration> {
    let angles = proptest::array::uniform3(0.0..=FRAC_PI_2);
    (angles, proptest::array::uniform3(0.0..TAU)).prop_map(|(a, d)| shape_of(a, d))
}

fn map_pairs(shape: &Configuration, map: impl Fn(f64, f64) -> [f64; 2]) -> Configuration {
    Configuration::from_fn(|row, _| {
        let i = row / 2 * 2;
        map(shape[i], shape[i + 1])[row % 2]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rotating_about_z_rotates_everything(
        shape in shapes_within_limits(), turn in 0.0..TAU, section in 0..3_usize, fraction in 0.0..=1.0,
    ) {
        let (robot, (s, c)) = (uneven_robot(), turn.sin_cos());
        let turned = map_pairs(&shape, |x, y| [c * x - s * y, s * x + c * y]);
        let point = Rotation3::from_axis_angle(&Point::z_axis(), turn) * robot.backbone(&shape).point(section, fraction);
        prop_assert!((robot.backbone(&turned).point(section, fraction) - point).amax() < 1e-14);
    }

    #[test]
    fn mirroring_y_mirrors_everything(
        shape in shapes_within_limits(), section in 0..3_usize, fraction in 0.0..=1.0,
    ) {
        let robot = uneven_robot();
        let mirrored = map_pairs(&shape, |x, y| [-x, y]);
        let mut point = robot.backbone(&shape).point(section, fraction);
        point.y = -point.y;
        prop_assert!((robot.backbone(&mirrored).point(section, fraction) - point).amax() < 1e-15);
    }
}
