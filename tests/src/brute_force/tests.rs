use super::*;
use crate::programs::repository;
use std::fs;

fn unit() -> Body {
    let file = repository().join("config/robots/unit.toml");
    Body::from_robot_file(&fs::read_to_string(file).unwrap())
}

/// The last row of the published example: see `docs/robot.md`, golden numbers.
#[test]
fn the_published_example_is_reproduced() {
    let lengths: [f64; 3] = [0.04, 0.03, 0.04];
    let curvatures = [50.0, 20.0, 100.0 / 3.0];
    let planes = [
        std::f64::consts::FRAC_PI_6,
        std::f64::consts::PI,
        std::f64::consts::PI,
    ];
    let body = Body {
        section_lengths_m: lengths,
        ..unit()
    };
    let mut configuration = [0.0; 6];
    for section in 0..3 {
        let angle = lengths[section] * curvatures[section];
        configuration[2 * section] = -angle * f64::sin(planes[section]);
        configuration[2 * section + 1] = angle * f64::cos(planes[section]);
    }
    let tip = body.tip(&configuration);
    let published = [0.058_250_97, 0.059_111_25, 0.036_566_94];
    assert!(norm(subtract(tip, published)) < 1e-8, "{tip:?}");
}

#[test]
fn straight_and_nearly_straight_backbones_join() {
    let body = unit();
    assert_eq!(body.tip(&[0.0; 6]), [0.0, 0.0, 3.0]);
    for angle in [1e-9_f64, 0.999 * SMALL_ANGLE_RAD, 1.001 * SMALL_ANGLE_RAD] {
        let tip = body.tip(&[angle, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let half = f64::sin(0.5 * angle);
        let sideways = -2.0 * half * half / angle - 2.0 * f64::sin(angle);
        assert!((tip[1] - sideways).abs() < 1e-12, "{angle}: {tip:?}");
    }
}

#[test]
fn tendons_and_configurations_mean_each_other() {
    let body = unit();
    let configuration = [0.3, -1.2, 0.05, 0.7, -0.9, 0.4];
    let mut tendons = body.tendons(&configuration);
    let explained = body.explain(&tendons);
    let pairs = explained.configuration.iter().zip(&configuration);
    assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-12);
    assert!(explained.residual_m < 1e-15);
    tendons[4] += 1e-3;
    assert!(body.explain(&tendons).residual_m > 1e-4);
}

/// A straight robot and a ball beside it, and a quarter circle around a ball at its centre.
#[test]
fn distances_that_are_known_are_found() {
    let body = unit();
    let beside = Ball::resting([0.9, 0.0, 1.501], 0.3);
    let clearance = body.clearance(&[0.0; 6], &[beside], 0);
    assert!((clearance - 0.4).abs() < 1e-12, "{clearance}");
    let clearance = body
        .padded(&[0.0, 0.1, 0.0])
        .clearance(&[0.0; 6], &[beside], 0);
    assert!((clearance - 0.3).abs() < 1e-12, "{clearance}");
    let quarter = std::f64::consts::FRAC_PI_2;
    let bent = [0.0, quarter, 0.0, 0.0, 0.0, 0.0];
    let radius = 1.0 / quarter;
    let centre = Ball::resting([radius, 0.0, 0.0], 0.1);
    let clearance = body.clearance(&bent, &[centre], 0);
    let error = (clearance - (radius - 0.3)).abs();
    assert!(error > 0.0 && error < body.chord_error_m(), "{error}");
}

#[test]
fn a_ball_that_is_touched_only_between_two_samples_is_seen() {
    let body = unit();
    let (from, to) = (
        [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
    );
    let balls = [Ball::resting([0.0, 0.0, 3.15], 0.1)];
    let setpoints = [(0, body.tendons(&from)), (1_000_000_000, body.tendons(&to))];
    for end in [from, to] {
        assert!(body.clearance(&end, &balls, 0) > 0.3);
    }
    let least = body.least_clearance(&setpoints, |_| &balls);
    assert!((least.sampled_m + 0.15).abs() < least.error_m, "{least:?}");
    assert!(
        (least.stamp_ns - 500_000_000).abs() < 1_000_000,
        "{least:?}"
    );
}

#[test]
fn a_ball_that_passes_a_resting_body_is_seen() {
    let body = unit();
    let ball = Ball {
        velocity_m_s: [2.0, 0.0, 0.0],
        ..Ball::resting([-1.0, 0.0, 1.5], 0.1)
    };
    let straight = [0.0; 9];
    let setpoints = [(0, straight), (1_000_000_000, straight)];
    let least = body.least_clearance(&setpoints, |_| std::slice::from_ref(&ball));
    assert!((least.sampled_m + 0.3).abs() < least.error_m, "{least:?}");
}
