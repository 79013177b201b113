//! Clearances of one configuration against brute force over all balls and sections.
#![allow(clippy::unwrap_used)]

mod motions;

use collision::{Ball, Contact, MAX_BALLS, Scene, SceneError};
use motions::{ball, random, scene, shape, uneven_robot, unit_robot};
use pcc_model::{Backbone, Configuration, Point, Robot};
use rand::RngExt;
use std::f64::consts::FRAC_PI_2;

fn brute_force(backbone: &Backbone, scene: &Scene, tube_radii: &[f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|section| {
        scene
            .balls()
            .iter()
            .map(|b| backbone.distance(section, &b.centre) - b.radius - tube_radii[section])
            .fold(f64::INFINITY, f64::min)
    })
}

/// Clearance to one ball over many points of the body.
fn sampled(backbone: &Backbone, ball: &Ball, tube_radii: &[f64; 3]) -> f64 {
    let distance = |i: u32| {
        let section = (i / 500).min(2) as usize;
        let fraction = f64::from(i) / 500.0 - section as f64;
        (backbone.point(section, fraction) - ball.centre).norm() - tube_radii[section]
    };
    (0..=1500).map(distance).fold(f64::INFINITY, f64::min) - ball.radius
}

#[test]
fn clearances_are_those_of_brute_force_in_scenes_of_any_size() {
    let (robot, mut random) = (uneven_robot(), random(1));
    for count in [1, 2, 16, 17, 64, 300, 1000] {
        let scene = scene(&mut random, count, 0.0..0.6);
        for _ in 0..200 {
            let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
            let expected = brute_force(&backbone, &scene, &robot.tube_radii);
            assert_eq!(
                scene.section_clearances(&backbone, &robot.tube_radii),
                expected
            );
            let least = expected.into_iter().fold(f64::INFINITY, f64::min);
            assert_eq!(scene.clearance(&backbone, &robot.tube_radii), least);
        }
    }
}

#[test]
fn deep_penetrations_are_found_in_large_scenes() {
    let (robot, mut random) = (uneven_robot(), random(2));
    let mut balls: Vec<Ball> = (0..400).map(|_| ball(&mut random, 0.0..0.2)).collect();
    balls[42].radius = 2.5;
    let scene = Scene::new(balls).unwrap();
    for _ in 0..500 {
        let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
        let expected = brute_force(&backbone, &scene, &[0.1; 3]);
        assert_eq!(scene.section_clearances(&backbone, &[0.1; 3]), expected);
    }
}

#[test]
fn clearance_is_that_of_the_nearest_body_point() {
    let (robot, mut random) = (uneven_robot(), random(3));
    for _ in 0..300 {
        let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
        let ball = ball(&mut random, 0.1..0.5);
        let exact = Scene::new(vec![ball])
            .unwrap()
            .clearance(&backbone, &robot.tube_radii);
        let sampled = sampled(&backbone, &ball, &robot.tube_radii);
        assert!(exact <= sampled + 1e-13, "{exact} {sampled}");
        assert!(sampled - exact < 1.4e-3, "{exact} {sampled}");
    }
}

fn assert_contact(contact: &Contact, backbone: &Backbone, scene: &Scene, robot: &Robot) {
    let ball = scene.balls()[contact.obstacle];
    let body = backbone.point(contact.section, contact.fraction);
    assert!((contact.normal.norm() - 1.0).abs() < 1e-12);
    let reach = contact.clearance + ball.radius + robot.tube_radii[contact.section];
    assert!((ball.centre + contact.normal * reach - body).norm() < 1e-12);
}

#[test]
fn contacts_are_one_for_each_ball_within_the_margin() {
    let (robot, mut random) = (uneven_robot(), random(4));
    for count in [1, 16, 17, 1000] {
        let scene = scene(&mut random, count, 0.0..0.4);
        let mut found = 0;
        for _ in 0..100 {
            let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
            let margin = random.random_range(-0.1..0.5);
            let mut contacts = Vec::new();
            scene.contacts_within(&backbone, &robot.tube_radii, margin, &mut contacts);
            for (index, ball) in scene.balls().iter().enumerate() {
                let alone = Scene::new(vec![*ball]).unwrap();
                let clearance = alone.clearance(&backbone, &robot.tube_radii);
                let mut of_ball = contacts.iter().filter(|c| c.obstacle == index);
                let contact = of_ball.next();
                assert!(of_ball.next().is_none());
                assert_eq!(
                    contact.is_some(),
                    clearance < margin,
                    "{clearance} {margin}"
                );
                if let Some(contact) = contact {
                    assert!((contact.clearance - clearance).abs() < 1e-12);
                    assert_contact(contact, &backbone, &scene, &robot);
                }
            }
            found += contacts.len();
        }
        assert!(count == 1 || found > 50, "{found} of {count} balls");
    }
}

#[test]
fn contacts_are_appended() {
    let (robot, mut random) = (unit_robot(), random(5));
    let scene = scene(&mut random, 40, 0.2..0.4);
    let backbone = robot.backbone(&shape(&mut random, 1.0));
    let mut contacts = Vec::new();
    scene.contacts_within(&backbone, &[0.2; 3], 1.0, &mut contacts);
    let once = contacts.clone();
    assert!(once.len() > 3);
    scene.contacts_within(&backbone, &[0.2; 3], 1.0, &mut contacts);
    assert_eq!(contacts, [once.clone(), once].concat());
}

#[test]
fn every_ball_is_within_an_infinite_margin() {
    let (robot, mut random) = (unit_robot(), random(6));
    let backbone = robot.backbone(&shape(&mut random, 1.0));
    for count in [1, 4, 5, 300] {
        let scene = scene(&mut random, count, 0.2..0.4);
        let mut contacts = Vec::new();
        scene.contacts_within(&backbone, &[0.2; 3], f64::INFINITY, &mut contacts);
        let mut found: Vec<usize> = contacts.iter().map(|contact| contact.obstacle).collect();
        found.sort_unstable();
        assert_eq!(found, (0..count).collect::<Vec<_>>());
    }
}

#[test]
fn an_empty_scene_is_infinitely_clear() {
    let (robot, scene) = (unit_robot(), Scene::default());
    let backbone = robot.backbone(&Configuration::zeros());
    assert!(scene.is_empty());
    assert_eq!(scene.clearance(&backbone, &[0.2; 3]), f64::INFINITY);
    assert_eq!(
        scene.section_clearances(&backbone, &[0.2; 3]),
        [f64::INFINITY; 3]
    );
    let mut contacts = Vec::new();
    scene.contacts_within(&backbone, &[0.2; 3], f64::INFINITY, &mut contacts);
    assert!(contacts.is_empty());
}

#[test]
fn a_ball_around_the_backbone_is_as_deep_as_it_is_thick() {
    let (robot, straight) = (unit_robot(), Configuration::zeros());
    let backbone = robot.backbone(&straight);
    let centre = Point::new(0.0, 0.0, 1.5);
    let scene = Scene::new(vec![Ball {
        centre,
        radius: 0.4,
    }])
    .unwrap();
    let mut contacts = Vec::new();
    scene.contacts_within(&backbone, &[0.2; 3], 0.0, &mut contacts);
    let [contact] = contacts.as_slice() else {
        panic!("{contacts:?}");
    };
    assert!((contact.clearance + 0.6).abs() < 1e-15);
    assert_eq!((contact.section, contact.obstacle), (1, 0));
    assert!((contact.normal.norm() - 1.0).abs() < 1e-15);
    let point = Scene::new(vec![Ball {
        centre: Point::new(0.5, 0.0, 1.0),
        radius: 0.0,
    }])
    .unwrap();
    assert!((point.clearance(&backbone, &[0.2; 3]) - 0.3).abs() < 1e-15);
}

#[test]
fn a_shape_that_is_not_finite_is_never_clear() {
    let (robot, mut random) = (unit_robot(), random(6));
    for count in [1, 100] {
        let scene = scene(&mut random, count, 0.1..0.2);
        for (component, value) in [(0, f64::NAN), (3, f64::INFINITY), (5, f64::NAN)] {
            let mut shape = Configuration::zeros();
            shape[component] = value;
            let clearance = scene.clearance(&robot.backbone(&shape), &[0.2; 3]);
            assert_eq!(clearance, f64::NEG_INFINITY);
        }
    }
}

#[test]
fn scenes_that_are_not_usable_are_refused_by_name() {
    let good = Ball {
        centre: Point::new(1.0, 0.0, 0.0),
        radius: 0.1,
    };
    assert_eq!(
        Scene::new(vec![good; MAX_BALLS]).unwrap().balls().len(),
        MAX_BALLS
    );
    let error = Scene::new(vec![good; MAX_BALLS + 1]).unwrap_err();
    assert_eq!(
        error,
        SceneError::Count {
            count: MAX_BALLS + 1
        }
    );
    assert_eq!(error.to_string(), "8193 balls; at most 8192 are allowed");
    for (bad, x) in [
        (-0.1, 1.0),
        (f64::NAN, 1.0),
        (f64::INFINITY, 1.0),
        (0.1, f64::NAN),
        (0.1, f64::INFINITY),
        (1e200, 1.0),
        (0.1, -1e200),
    ] {
        let ball = Ball {
            centre: Point::new(x, 0.0, 0.0),
            radius: bad,
        };
        let error = Scene::new(vec![good, good, ball]).unwrap_err();
        assert!(matches!(error, SceneError::Ball { index: 2, .. }));
        assert!(
            error
                .to_string()
                .contains("coordinates within ±1e7 and a radius of 0 to 1e7")
        );
    }
}

#[test]
fn many_balls_at_one_place_are_a_scene_too() {
    let robot = unit_robot();
    let ball = Ball {
        centre: Point::new(1.0, 0.0, 1.0),
        radius: 0.25,
    };
    let scene = Scene::new(vec![ball; 1000]).unwrap();
    let clearance = scene.clearance(&robot.backbone(&Configuration::zeros()), &[0.2; 3]);
    assert!((clearance - 0.55).abs() < 1e-15);
}
