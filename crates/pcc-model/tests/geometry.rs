//! Distances of points from sections against a search along the arc.
#![allow(clippy::unwrap_used)] // tests

mod shapes;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4};
use pcc_model::{Backbone, Configuration, Point, Robot};
use rand::RngExt;
use shapes::{any_point, any_shape, random, shape_of, unit_robot};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const SAMPLES: u32 = 400;

/// Distance to the nearest of many points of a section, refined by ternary search between its neighbours.
fn searched_distance(backbone: &Backbone, section: usize, p: &Point) -> f64 {
    let at = |fraction: f64| (backbone.point(section, fraction) - p).norm();
    let fraction = |i: u32| f64::from(i) / f64::from(SAMPLES);
    let best = (0..=SAMPLES).min_by(|a, b| at(fraction(*a)).total_cmp(&at(fraction(*b))));
    let best = best.unwrap();
    let (mut low, mut high) = (fraction(best.max(1) - 1), fraction((best + 1).min(SAMPLES)));
    for _ in 0..40 {
        let third = (high - low) / 3.0;
        if at(low + third) < at(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    at(0.5 * (low + high)).min(at(fraction(best)))
}

/// The distances of a point that is each of four in turn.
fn distances_among_others(backbone: &Backbone, section: usize, p: &Point) -> [f64; 4] {
    std::array::from_fn(|place| {
        let axis = |axis: usize| {
            let mut values = [0.0, -0.3, 1.0, 2.5];
            values[place] = p[axis];
            values
        };
        let distances: [f64; 4] = dispatch!(Level::new(), simd => {
            let points = [axis(0), axis(1), axis(2)].map(|values| f64x4::simd_from(simd, values));
            backbone.distances(section, &points).into()
        });
        distances[place]
    })
}

fn check(robot: &Robot, shape: &Configuration, section: usize, p: &Point) {
    let backbone = robot.backbone(shape);
    let (distance, nearest) = (backbone.distance(section, p), backbone.nearest(section, p));
    let searched = searched_distance(&backbone, section, p);
    let error = (distance - searched).abs();
    assert!(
        error < 1e-9,
        "{distance} {searched} for section {section} of {shape} and {p}"
    );
    assert_eq!(distances_among_others(&backbone, section, p), [distance; 4]);
    assert!((nearest.distance - distance).abs() < 1e-14);
    assert!((0.0..=1.0).contains(&nearest.fraction));
    assert!(
        ((nearest.point - p).norm() - distance).abs() < 1e-9,
        "{nearest:?} {distance}"
    );
    assert!((backbone.point(section, nearest.fraction) - nearest.point).amax() < 1e-15);
}

#[test]
fn points_all_around() {
    let robot = Robot {
        section_lengths: [1.0, 0.7, 1.3],
        ..unit_robot()
    };
    let (mut random, mut inside) = (random(11), 0);
    for _ in 0..6_000 {
        let (shape, section) = (any_shape(&mut random), random.random_range(0..3));
        let point = any_point(&mut random);
        check(&robot, &shape, section, &point);
        let fraction = robot.backbone(&shape).nearest(section, &point).fraction;
        inside += u32::from(fraction > 0.0 && fraction < 1.0);
    }
    assert!(
        (1_000..5_000).contains(&inside),
        "{inside} of 6000 had their foot inside the arc"
    );
}

#[test]
fn points_near_and_on_the_backbone() {
    let (robot, mut random) = (unit_robot(), random(12));
    for _ in 0..1_000 {
        let (shape, section) = (any_shape(&mut random), random.random_range(0..3));
        let on = robot.backbone(&shape).point(section, random.random());
        assert!(robot.backbone(&shape).distance(section, &on) < 1e-15);
        let near = on + any_point(&mut random) * 1e-3;
        check(&robot, &shape, section, &near);
    }
}

#[test]
fn points_on_the_axis_behind_the_base_and_beyond_the_tip() {
    let (robot, mut random) = (unit_robot(), random(13));
    for _ in 0..500 {
        let shape = any_shape(&mut random);
        for z in [-2.0, -1e-9, 0.0, 1e-9, 0.5, 1.0, 4.0] {
            check(&robot, &shape, 0, &Point::new(0.0, 0.0, z));
        }
        let frames = *robot.backbone(&shape).frames();
        for (section, frame) in frames[1..].iter().enumerate() {
            for beyond in [-1e-9, 0.0, 1e-9, 0.7] {
                let point = frame.position + frame.rotation.column(2) * beyond;
                check(&robot, &shape, section, &point);
            }
        }
    }
}

/// A motion may bend a robot whose limit is π a little beyond it, and its certificate must hold there too.
#[test]
fn sections_bent_beyond_half_a_turn() {
    let (robot, mut random) = (unit_robot(), random(14));
    let mut far = 0;
    for _ in 0..3_000 {
        let mut angle = || PI + random.random_range(0.0_f64..1.4).powi(3);
        let angles = [angle(), angle(), angle()];
        let shape = shape_of(angles, [0.3, 2.0, random.random_range(0.0..TAU)]);
        let (section, point) = (random.random_range(0..3), any_point(&mut random));
        check(&robot, &shape, section, &point);
        let fraction = robot.backbone(&shape).nearest(section, &point).fraction;
        far += u32::from(fraction * angles[section] > PI && fraction < 1.0);
    }
    assert!(far > 100, "{far} feet were beyond half a turn");
}

#[test]
fn straight_section_is_a_line_segment() {
    let backbone = unit_robot().backbone(&Configuration::zeros());
    let nearest = backbone.nearest(1, &Point::new(0.3, 0.4, 1.25));
    assert!((nearest.distance - 0.5).abs() < 1e-15 && (nearest.fraction - 0.25).abs() < 1e-15);
    assert_eq!(backbone.distance(1, &Point::new(0.0, 0.0, 2.5)), 0.5);
    assert_eq!(backbone.distance(1, &Point::new(0.0, 0.0, 0.5)), 0.5);
}

#[test]
fn centre_of_the_circle_is_one_radius_away() {
    for angle in [0.5, FRAC_PI_2, 3.0] {
        let backbone = unit_robot().backbone(&shape_of([angle, 0.0, 0.0], [FRAC_PI_2, 0.0, 0.0]));
        let centre = Point::new(1.0 / angle, 0.0, 0.0);
        assert!((backbone.distance(0, &centre) - 1.0 / angle).abs() < 1e-12);
    }
}

#[test]
fn arcs_beyond_a_quarter_circle() {
    let (robot, mut random) = (unit_robot(), random(14));
    for i in 0..2_000 {
        let angle = match i % 3 {
            0 => random.random_range(FRAC_PI_2..1.7),
            1 => random.random_range(1.7..PI),
            _ => random.random_range(PI - 1e-3..PI),
        };
        let directions = std::array::from_fn(|_| random.random_range(0.0..TAU));
        let shape = shape_of([angle, 0.3, angle], directions);
        let section = random.random_range(0..3);
        check(&robot, &shape, section, &any_point(&mut random));
        let frame = robot.backbone(&shape).frames()[section];
        let aside = frame.rotation * Point::new(random.random(), random.random(), 1e-6);
        check(&robot, &shape, section, &(frame.position + aside));
    }
}
