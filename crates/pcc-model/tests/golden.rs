//! Numbers that others published: end poses of CRVisToolkit, the authors' tendon matrix and a row of their log.
#![allow(clippy::unwrap_used)] // tests

mod shapes;

use pcc_model::{Configuration, Robot};
use shapes::{authors_robot, unit_robot};
use std::f64::consts::{FRAC_PI_6, PI};

/// Columns ξ11 ξ12 ξ21 ξ22 ξ31 ξ32, mm/rad, rows in the order of the log: sections 1, 3, 2.
const AUTHORS_MATRIX_MM: [[f64; 6]; 9] = [
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

/// The last pose of an example of CRVisToolkit: 4 × 4, column-major.
fn last_pose(example: &str) -> Vec<f64> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/tdcr_curve_examples.json"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let examples: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rows: Vec<Vec<f64>> = serde_json::from_value(examples[example].clone()).unwrap();
    rows.last().unwrap().clone()
}

#[test]
fn end_pose_of_the_three_section_example() {
    let robot = Robot {
        section_lengths: [0.04, 0.03, 0.04],
        ..unit_robot()
    };
    let curvatures = [50.0, 20.0, 100.0 / 3.0];
    let shape = Configuration::from_fn(|row, _| {
        let (i, direction) = (row / 2, [FRAC_PI_6, PI, PI][row / 2]);
        robot.section_lengths[i] * curvatures[i] * [-direction.sin(), direction.cos()][row % 2]
    });
    let (tip, golden) = (
        robot.backbone(&shape).frames()[3],
        last_pose("threesegtdcr"),
    );
    assert!((golden[12] - 0.058_250_97).abs() < 1e-8, "the golden pose");
    for row in 0..3 {
        assert!((tip.position[row] - golden[12 + row]).abs() < 2e-11);
        for column in 0..3 {
            let difference = tip.rotation[(row, column)] - golden[4 * column + row];
            assert!(difference.abs() < 2e-9, "({row}, {column}): {difference}");
        }
    }
}

#[test]
fn tendon_matrix_of_the_authors_robot() {
    let tendons = authors_robot().tendons;
    assert_eq!(tendons.count(), 9);
    for (j, row) in AUTHORS_MATRIX_MM.iter().enumerate() {
        for (k, golden) in row.iter().enumerate() {
            let difference = 1e3 * tendons.matrix()[(j, k)] - golden;
            assert!(difference.abs() < 1e-4, "({j}, {k}): {difference} mm");
        }
    }
    assert_eq!(tendons.matrix().rank(1e-6), 6);
    let values = tendons.matrix().singular_values();
    assert!((values.max() / values.min() - 4.05).abs() < 0.005);
}

#[test]
fn tendons_of_a_section_sum_to_zero() {
    let tendons = authors_robot().tendons;
    let shape = Configuration::from([0.3, 0.7, -0.4, 0.2, 0.5, 0.9]);
    let mut lengths = [0.0; 9];
    tendons.lengths(&shape, &mut lengths);
    assert!(lengths.iter().all(|l| l.abs() > 1e-3), "all of them move");
    for section in lengths.chunks(3) {
        assert!(section.iter().sum::<f64>().abs() < 1e-16);
    }
}

#[test]
fn row_of_the_authors_log() {
    let mut shape = Configuration::zeros();
    shape[1] = -0.277_412;
    let mut lengths = [0.0; 9];
    authors_robot().tendons.lengths(&shape, &mut lengths);
    assert!((1e3 * lengths[0] - 11.6513).abs() < 5e-5);
}
