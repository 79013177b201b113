//! Certificates against dense sampling: what is certified never collides, what is called colliding does.
#![allow(clippy::unwrap_used)]

mod motions;

use collision::{
    Ball, Scene, Verdict, certified_clearance, certify_edge, certify_polyline, certify_trajectory,
    minimum_clearance, tracking_padding,
};
use motions::{motion, random, sampled_clearance, scene, shape, step, uneven_robot, unit_robot};
use pcc_model::{Configuration, Point, Robot, SECTIONS};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::FRAC_PI_2;
use trajectory::{Knot, Trajectory};

/// How often each verdict was given.
#[derive(Debug, Default)]
struct Tally {
    free: usize,
    colliding: usize,
    undecided: usize,
}

impl Tally {
    fn count(&mut self, verdict: Verdict) {
        match verdict {
            Verdict::Free => self.free += 1,
            Verdict::Colliding { .. } => self.colliding += 1,
            Verdict::Undecided { .. } => self.undecided += 1,
        }
    }
}

fn clearance(robot: &Robot, scene: &Scene, shape: &Configuration) -> f64 {
    scene.clearance(&robot.backbone(shape), &robot.tube_radii)
}

fn ball(x: f64, y: f64, z: f64, radius: f64) -> Ball {
    Ball {
        centre: Point::new(x, y, z),
        radius,
    }
}

/// An eighth-turn of the whole robot towards +x or, for a negative angle, −x.
fn leaning(angle: f64) -> Configuration {
    Configuration::from_row_slice(&[0.0, angle, 0.0, angle, 0.0, angle])
}

#[test]
fn certified_edges_never_collide() {
    let (robot, mut random) = (uneven_robot(), random(2));
    let mut tally = Tally::default();
    let mut closest = f64::INFINITY;
    for i in 0..20_000 {
        let scene = scene(&mut random, [2, 4, 8, 16][i % 4], 0.05..0.5);
        let a = shape(&mut random, FRAC_PI_2);
        let b = a + step(&mut random, [0.1, 0.5, 2.0][i % 3]);
        let verdict = certify_edge(&robot, &scene, &a, &b, 10);
        tally.count(verdict);
        match verdict {
            Verdict::Free => {
                for k in 0..=60 {
                    let between = a.lerp(&b, f64::from(k) / 60.0);
                    let clearance = clearance(&robot, &scene, &between);
                    assert!(clearance > 0.0, "edge {i} collides: {clearance}");
                    closest = closest.min(clearance);
                }
            }
            Verdict::Colliding { at } => {
                assert!(
                    clearance(&robot, &scene, &a.lerp(&b, at)) < 1e-12,
                    "edge {i}"
                );
            }
            Verdict::Undecided { at } => {
                assert!(
                    clearance(&robot, &scene, &a.lerp(&b, at)).abs() < 0.01,
                    "edge {i}"
                );
            }
        }
    }
    assert!(tally.free > 5_000 && tally.colliding > 5_000, "{tally:?}");
    assert!(tally.undecided < 20, "{tally:?}");
    assert!(closest < 1e-3, "no edge came near: {closest}");
}

#[test]
fn a_deeper_search_never_takes_a_certificate_back() {
    let (robot, mut random) = (uneven_robot(), random(3));
    let mut gained = 0;
    for _ in 0..2_000 {
        let scene = scene(&mut random, 2, 0.05..0.5);
        let (a, b) = (shape(&mut random, 1.5), shape(&mut random, 1.5));
        let free = [0, 2, 4, 8].map(|depth| certify_edge(&robot, &scene, &a, &b, depth).is_free());
        assert!(free.windows(2).all(|pair| pair[0] <= pair[1]), "{free:?}");
        gained += usize::from(free[3] && !free[0]);
    }
    assert!(gained > 100, "{gained}");
}

#[test]
fn a_polyline_is_its_edges() {
    let (robot, mut random) = (uneven_robot(), random(4));
    let mut tally = Tally::default();
    for i in 0..500 {
        let scene = scene(&mut random, 8, 0.05..0.4);
        let mut points = vec![shape(&mut random, FRAC_PI_2)];
        for _ in 0..1 + i % 120 {
            let next = points[points.len() - 1] + step(&mut random, 0.04);
            points.push(next);
        }
        let verdict = certify_polyline(&robot, &scene, &points);
        tally.count(verdict);
        let edges_are_free = points
            .windows(2)
            .all(|edge| certify_edge(&robot, &scene, &edge[0], &edge[1], 10).is_free());
        assert_eq!(verdict.is_free(), edges_are_free);
        if let Verdict::Colliding { at } = verdict {
            let edge = (at as usize).min(points.len() - 2);
            let place = points[edge].lerp(&points[edge + 1], at - edge as f64);
            assert!(clearance(&robot, &scene, &place) < 1e-12);
        }
    }
    assert!(tally.free > 100 && tally.colliding > 100, "{tally:?}");
}

#[test]
fn certified_curves_never_collide() {
    let (robot, mut random) = (uneven_robot(), random(5));
    let mut tally = Tally::default();
    for i in 0..2_000 {
        let count = [1, 2, 4, 30][i % 4];
        let scene = scene(&mut random, count, 0.02..0.6 / (count as f64).sqrt());
        let motion = motion(&mut random);
        let verdict = certify_trajectory(&robot, &scene, &motion, 0.0);
        tally.count(verdict);
        let sampled = sampled_clearance(&robot, &scene, &motion, 0.0, 300);
        match verdict {
            Verdict::Free => assert!(sampled > 0.0, "curve {i} collides: {sampled}"),
            Verdict::Colliding { at } => {
                let there = clearance(&robot, &scene, &motion.at(at).position);
                assert!(there < 1e-12, "curve {i} is free at {at} s: {there}");
            }
            Verdict::Undecided { .. } => assert!(sampled < 0.01, "curve {i}: {sampled}"),
        }
    }
    assert!(tally.free > 500 && tally.colliding > 500, "{tally:?}");
    assert!(tally.undecided < 10, "{tally:?}");
}

#[test]
fn what_lies_before_the_time_asked_for_does_not_count() {
    let (robot, mut random) = (uneven_robot(), random(6));
    let (mut escaped, mut caught) = (0, 0);
    for _ in 0..1_000 {
        let scene = scene(&mut random, 3, 0.05..0.4);
        let motion = motion(&mut random);
        let from_time = motion.duration() * random.random_range(0.0..1.0);
        let verdict = certify_trajectory(&robot, &scene, &motion, from_time);
        let sampled = sampled_clearance(&robot, &scene, &motion, from_time, 300);
        let whole = certify_trajectory(&robot, &scene, &motion, 0.0);
        match verdict {
            Verdict::Free => {
                assert!(sampled > 0.0);
                escaped += usize::from(!whole.is_free());
            }
            Verdict::Colliding { at } => {
                assert!(!whole.is_free() && at >= from_time);
                assert!(clearance(&robot, &scene, &motion.at(at).position) < 1e-9);
                caught += 1;
            }
            Verdict::Undecided { .. } => assert!(sampled < 0.01, "{sampled}"),
        }
    }
    assert!(escaped > 50 && caught > 100, "{escaped} {caught}");
}

/// A ball that a place of a section just does not touch at some time.
fn beside(random: &mut Pcg64, robot: &Robot, motion: &Trajectory, section: usize) -> Ball {
    let time = motion.duration() * random.random::<f64>();
    let backbone = robot.backbone(&motion.at(time).position);
    let body = backbone.point(section, random.random_range(0.5..1.0));
    let turn = random.random_range(0.0..std::f64::consts::TAU);
    let radius = 0.1;
    let away = robot.tube_radii[section] + radius + random.random_range(0.0..0.01);
    Ball {
        centre: body + Point::new(turn.cos(), turn.sin(), 0.0) * away,
        radius,
    }
}

#[test]
fn padding_covers_every_body_within_the_path_tolerance() {
    let (robot, mut random) = (uneven_robot(), random(7));
    let tolerance = 0.03;
    let padding = tracking_padding(&robot, tolerance);
    let padded = robot.with_tube_padding(&padding);
    let (mut certified, mut closest) = (0, [f64::INFINITY; SECTIONS]);
    for i in 0..2_000 {
        let motion = motion(&mut random);
        let mut balls = scene(&mut random, 2, 0.05..0.4).balls().to_vec();
        if i % 3 > 0 {
            balls.push(beside(&mut random, &padded, &motion, i % 3 - 1));
        }
        let scene = Scene::new(balls).unwrap();
        if !certify_trajectory(&padded, &scene, &motion, 0.0).is_free() {
            continue;
        }
        certified += 1;
        for _ in 0..200 {
            let mut measured = motion
                .at(motion.duration() * random.random::<f64>())
                .position;
            for i in 0..SECTIONS {
                let direction = random.random_range(0.0..std::f64::consts::TAU);
                measured[2 * i] += tolerance * direction.cos();
                measured[2 * i + 1] += tolerance * direction.sin();
            }
            let clearances =
                scene.section_clearances(&robot.backbone(&measured), &robot.tube_radii);
            assert!(clearances.iter().all(|c| *c > 0.0), "{clearances:?}");
            for (closest, clearance) in closest.iter_mut().zip(clearances) {
                *closest = clearance.min(*closest);
            }
        }
    }
    let is_needed = |k: usize| closest[k] < padding[k];
    assert!(
        certified > 150 && (0..SECTIONS).all(is_needed),
        "{certified} {closest:?}"
    );
}

#[test]
fn tracking_padding_is_the_motion_of_the_straight_robots_section_ends() {
    let robot = unit_robot();
    let padding = tracking_padding(&robot, 0.01);
    for (padding, lever) in padding.into_iter().zip([0.5, 1.5 + 0.5, 2.5 + 1.5 + 0.5]) {
        assert!((padding - 0.01 * lever).abs() < 1e-15);
    }
    assert_eq!(tracking_padding(&robot, 0.0), [0.0; SECTIONS]);
}

#[test]
fn a_motion_at_rest_is_free_exactly_if_its_shape_is() {
    let robot = unit_robot();
    let straight = Configuration::zeros();
    let knots = [0.0, 1.0].map(|time| Knot {
        time,
        position: straight,
        velocity: Configuration::zeros(),
        acceleration: Configuration::zeros(),
    });
    let motion = Trajectory::new(knots.to_vec()).unwrap();
    for (x, free) in [(0.5 + 1e-9, true), (0.5, false), (0.5 - 1e-9, false)] {
        let scene = Scene::new(vec![ball(x, 0.0, 1.5, 0.3)]).unwrap();
        assert_eq!(
            certify_edge(&robot, &scene, &straight, &straight, 10).is_free(),
            free
        );
        assert_eq!(
            certify_polyline(&robot, &scene, &[straight]).is_free(),
            free
        );
        for from_time in [-1.0, 0.0, 0.3, 1.0, 7.0] {
            let verdict = certify_trajectory(&robot, &scene, &motion, from_time);
            assert_eq!(verdict.is_free(), free, "from {from_time} s");
        }
    }
}

#[test]
fn a_ball_between_two_free_shapes_is_found() {
    let robot = unit_robot();
    let scene = Scene::new(vec![ball(0.0, 0.0, 3.3, 0.12)]).unwrap();
    let (a, b) = (leaning(-0.4), leaning(0.4));
    assert!(clearance(&robot, &scene, &a) > 0.0 && clearance(&robot, &scene, &b) > 0.0);
    let verdict = certify_edge(&robot, &scene, &a, &b, 10);
    assert_eq!(verdict, Verdict::Colliding { at: 0.5 });
    let undecided = certify_edge(&robot, &scene, &a, &b, 0);
    assert_eq!(undecided, Verdict::Undecided { at: 0.5 });
    let points = [a, b, a];
    let verdict = certify_polyline(&robot, &scene, &points);
    assert_eq!(verdict, Verdict::Colliding { at: 0.5 });
}

#[test]
fn nothing_to_hit_is_free() {
    let (robot, empty) = (unit_robot(), Scene::default());
    let (a, b) = (leaning(-0.4), leaning(0.4));
    assert!(certify_edge(&robot, &empty, &a, &b, 0).is_free());
    assert!(certify_polyline(&robot, &empty, &[a, b]).is_free());
    let scene = Scene::new(vec![ball(0.0, 0.0, 9.0, 0.1)]).unwrap();
    assert!(certify_polyline(&robot, &scene, &[]).is_free());
}

#[test]
fn shapes_that_are_not_finite_are_never_certified() {
    let robot = unit_robot();
    let scene = Scene::new(vec![ball(5.0, 0.0, 0.0, 0.1)]).unwrap();
    let (good, mut bad) = (leaning(0.1), leaning(0.2));
    bad[3] = f64::NAN;
    for (a, b) in [(good, bad), (bad, good), (bad, bad)] {
        assert!(!certify_edge(&robot, &scene, &a, &b, 10).is_free());
        assert!(!certify_polyline(&robot, &scene, &[a, b, a]).is_free());
    }
}

#[test]
fn verdicts_do_not_depend_on_the_unit_of_length() {
    let (robot, mut random) = (unit_robot(), random(8));
    let small = robot.scaled(0.2567);
    for i in 0..300 {
        let scene = scene(&mut random, [3, 40][i % 2], 0.05..0.2);
        let scaled = scene.balls().iter().map(|b| Ball {
            centre: b.centre * 0.2567,
            radius: b.radius * 0.2567,
        });
        let scaled = Scene::new(scaled.collect()).unwrap();
        let motion = motion(&mut random);
        assert_eq!(
            certify_trajectory(&robot, &scene, &motion, 0.0),
            certify_trajectory(&small, &scaled, &motion, 0.0)
        );
    }
}

#[test]
fn minimum_clearance_is_below_dense_sampling_by_no_more_than_the_tolerance() {
    let (robot, mut random) = (uneven_robot(), random(9));
    for i in 0..300 {
        let scene = scene(&mut random, [1, 4, 40][i % 3], 0.05..0.4);
        let motion = motion(&mut random);
        let sampled = sampled_clearance(&robot, &scene, &motion, 0.0, 2_000);
        for tolerance in [0.1, 1e-3] {
            let minimum = minimum_clearance(&robot, &scene, &motion, tolerance);
            assert!(minimum <= sampled + 1e-12, "{minimum} {sampled}");
            assert!(minimum >= sampled - tolerance - 2e-3, "{minimum} {sampled}");
        }
        let minimum = minimum_clearance(&robot, &scene, &motion, 1e-4);
        let verdict = certify_trajectory(&robot, &scene, &motion, 0.0);
        if minimum > 0.01 {
            assert!(verdict.is_free(), "{minimum} {verdict:?}");
        } else if minimum < -1e-4 {
            assert!(!verdict.is_free(), "{minimum}");
        }
    }
}

#[test]
fn a_motion_is_certified_for_thicker_tubes_together_with_its_clearance() {
    let (robot, mut random) = (uneven_robot(), random(11));
    let padded = robot.with_tube_padding(&[0.01, 0.03, 0.08]);
    let (mut free, mut refused) = (0, 0);
    for i in 0..300 {
        let scene = scene(&mut random, [1, 4, 40][i % 3], 0.05..0.4);
        let motion = motion(&mut random);
        let clearance = certified_clearance(&robot, &padded, (&scene, &[]), &motion, 1e-3);
        // The two divide a motion otherwise, so they could differ where there is hardly any room.
        let is_free = certify_trajectory(&padded, &scene, &motion, 0.0).is_free();
        assert_eq!(clearance.is_some(), is_free);
        free += usize::from(is_free);
        refused += usize::from(!is_free);
        if let Some(clearance) = clearance {
            assert!(sampled_clearance(&padded, &scene, &motion, 0.0, 500) > 0.0);
            let alone = minimum_clearance(&robot, &scene, &motion, 1e-3);
            assert!((clearance - alone).abs() <= 1e-3, "{clearance} {alone}");
            assert!(clearance > 0.01, "the padded tubes are clear");
        }
    }
    assert!(free > 20 && refused > 20, "{free} {refused}");
    let motion = motion(&mut random);
    let empty = certified_clearance(&robot, &padded, (&Scene::default(), &[]), &motion, 1e-3);
    assert_eq!(empty, Some(f64::INFINITY));
}

#[test]
fn a_motion_that_grazes_is_not_certified_though_its_clearance_is_found() {
    let robot = unit_robot();
    let shape = Configuration::zeros();
    let ends = [0.0, 1.0].map(|time| Knot::resting(time, shape));
    let motion = Trajectory::new(ends.to_vec()).unwrap();
    let radius = 0.2;
    let touching = ball(robot.tube_radii[1] + radius, 0.0, 1.5, radius);
    let scene = Scene::new(vec![touching]).unwrap();
    let none = certified_clearance(&robot, &robot, (&scene, &[]), &motion, 1e-3);
    assert_eq!(none, None);
    let minimum = minimum_clearance(&robot, &scene, &motion, 1e-3);
    assert!(minimum.abs() <= 1e-3, "{minimum}");
}

#[test]
fn minimum_clearance_ends_at_any_tolerance() {
    let robot = unit_robot();
    let scene = Scene::new(vec![ball(1.0, 0.0, 1.0, 0.3)]).unwrap();
    let motion = motion(&mut random(10));
    let coarse = minimum_clearance(&robot, &scene, &motion, 1e-5);
    let finest = minimum_clearance(&robot, &scene, &motion, 0.0);
    assert!((coarse - finest).abs() <= 1e-5);
    assert_eq!(
        minimum_clearance(&robot, &Scene::default(), &motion, 1e-3),
        f64::INFINITY
    );
}
