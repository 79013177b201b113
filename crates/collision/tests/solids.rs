//! Solids: distances against dense sampling, certificates, contacts, refusals.
#![allow(clippy::unwrap_used)]

mod motions;

use collision::{
    Ball, Contact, Scene, SceneError, Solid, SolidError, VoxelError, VoxelGrid,
    certified_clearance, certify_edge, certify_trajectory, minimum_clearance,
};
use motions::{ball, motion, random, sampled_clearance, shape, step, uneven_robot, unit_robot};
use nalgebra::{Isometry3, Vector3};
use pcc_model::{Backbone, Configuration, Point, Robot};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use trajectory::Trajectory;

const BOX_TRIANGLES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];

/// The corners of a box around the origin; x is the lowest bit of the index.
fn corners(sides: &Point) -> Vec<Point> {
    let sign = |i: u32, axis: u32| if i >> axis & 1 == 1 { 0.5 } else { -0.5 };
    let corner = |i: u32| Point::new(sign(i, 0), sign(i, 1), sign(i, 2)).component_mul(sides);
    (0..8).map(corner).collect()
}

fn pose(random: &mut Pcg64) -> Isometry3<f64> {
    let mut within = |low: f64, high: f64| random.random_range(low..high);
    let place = Vector3::new(within(-0.9, 0.9), within(-0.9, 0.9), within(0.0, 2.6));
    let turn = Vector3::new(within(-2.0, 2.0), within(-2.0, 2.0), within(-2.0, 2.0));
    Isometry3::new(place, turn)
}

fn cuboid(random: &mut Pcg64) -> Solid {
    let mut side = || random.random_range(0.1..0.8);
    let sides = Point::new(side(), side(), side());
    Solid::cuboid(&sides, &pose(random)).unwrap()
}

fn capsule(random: &mut Pcg64) -> Solid {
    let (a, b) = (ball(random, 0.05..0.3), ball(random, 0.1..0.2));
    Solid::capsule([a.centre, a.centre.lerp(&b.centre, 0.4)], a.radius).unwrap()
}

/// A mesh that is not convex: a prism over an L, six cells long in one direction and three in the other.
fn corner_mesh(random: &mut Pcg64) -> Solid {
    let outline = [
        [0.0, 0.0],
        [0.9, 0.0],
        [0.9, 0.3],
        [0.3, 0.3],
        [0.3, 0.6],
        [0.0, 0.6],
    ];
    let level = |z: f64| outline.map(|[x, y]| Point::new(x, y, z));
    let vertices = [level(0.0), level(0.25)].concat();
    let caps = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let mut triangles: Vec<[u32; 3]> = caps.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    triangles.extend(caps.map(|cap| cap.map(|v| v + 6)));
    for i in 0..6 {
        let j = (i + 1) % 6;
        triangles.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
    }
    Solid::mesh(&vertices, &triangles, &pose(random)).unwrap()
}

fn voxels(random: &mut Pcg64) -> Solid {
    let filled = (0..5 * 4 * 3)
        .map(|_| random.random_range(0..3) == 0)
        .collect();
    let grid = VoxelGrid {
        counts: [5, 4, 3],
        cell: 0.12,
        filled,
    };
    Solid::voxels(grid, &pose(random)).unwrap()
}

type Maker = fn(&mut Pcg64) -> Solid;
const KINDS: [(&str, Maker); 4] = [
    ("box", cuboid),
    ("capsule", capsule),
    ("mesh", corner_mesh),
    ("voxels", voxels),
];

fn scene_of(random: &mut Pcg64, make: Maker, count: usize) -> Scene {
    let solids = (0..count).map(|_| Arc::new(make(random))).collect();
    Scene::with_solids(Vec::new(), solids).unwrap()
}

#[test]
fn triangles_of_every_surface_face_outward() {
    let random = &mut random(31);
    for (kind, make) in KINDS {
        let solid = make(random);
        let (vertices, triangles) = solid.surface();
        assert!(!triangles.is_empty());
        for triangle in triangles {
            let [a, b, c] = triangle.map(|index| vertices[index as usize]);
            // More than what a capsule's triangles are inside its surface.
            let out = 0.004 * (b - a).cross(&(c - a)).normalize();
            let middle = (a + b + c) / 3.0;
            let [outside, inside] = [middle + out, middle - out];
            assert!(solid.nearest(&outside).distance > 0.0, "{kind}");
            assert!(solid.nearest(&inside).distance < 0.0, "{kind}");
        }
    }
}

/// Clearance of a section over many of its points, exact for each.
fn sampled(backbone: &Backbone, scene: &Scene, section: usize, tube_radius: f64) -> f64 {
    let distances = (0..=1000).flat_map(|i| {
        let point = backbone.point(section, f64::from(i) * 1e-3);
        scene
            .solids()
            .iter()
            .map(move |s| s.nearest(&point).distance)
    });
    distances.fold(f64::INFINITY, f64::min) - tube_radius
}

#[test]
fn clearances_are_never_above_the_true_ones_and_below_by_no_more_than_stated() {
    let (robot, mut random) = (uneven_robot(), random(1));
    for (name, make) in KINDS {
        let (mut touching, mut near) = (0, 0);
        for i in 0..150 {
            let scene = scene_of(&mut random, make, 1 + i % 3);
            let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
            let found = scene.section_clearances(&backbone, &robot.tube_radii);
            for (section, found) in found.into_iter().enumerate() {
                let sampled = sampled(&backbone, &scene, section, robot.tube_radii[section]);
                let length = robot.section_lengths[section];
                let allowed = 1e-3 * length + 0.05 * sampled.max(0.0) + 0.5e-3 * length;
                assert!(found <= sampled + 1e-12, "{name}: {found} {sampled}");
                assert!(found >= sampled - allowed, "{name}: {found} {sampled}");
                touching += usize::from(sampled < 0.0);
                near += usize::from((0.0..0.3).contains(&sampled));
            }
        }
        assert!(touching > 20 && near > 50, "{name}: {touching} {near}");
    }
}

#[test]
fn distances_to_the_kinds_are_those_of_their_points() {
    let mut random = random(2);
    for (name, make) in KINDS {
        let solid = make(&mut random);
        let (mut inside, mut outside) = (0, 0);
        for _ in 0..2_000 {
            let [p, q] = [ball(&mut random, 0.1..0.2), ball(&mut random, 0.1..0.2)];
            let near = solid.nearest(&p.centre).point + q.centre * 0.05;
            let [p, q] = [near, near + q.centre * 0.01];
            let (of_p, of_q) = (solid.nearest(&p), solid.nearest(&q));
            let change = (of_p.distance - of_q.distance).abs();
            assert!(change <= (p - q).norm() + 1e-12, "{name}: not a distance");
            assert!((of_p.away.norm() - 1.0).abs() < 1e-9);
            assert!(
                (of_p.point + of_p.away * of_p.distance - p).norm() < 1e-9,
                "{name}"
            );
            assert!(solid.nearest(&of_p.point).distance.abs() < 1e-9, "{name}");
            let beyond = of_p.point + of_p.away * 1e-6;
            assert!(solid.nearest(&beyond).distance > 0.0, "{name}");
            inside += usize::from(of_p.distance < 0.0);
            outside += usize::from(of_p.distance > 0.0);
        }
        assert!(inside > 100 && outside > 100, "{name}: {inside} {outside}");
    }
}

#[test]
fn a_mesh_and_a_voxel_grid_of_a_box_agree_with_the_box() {
    let (robot, mut random) = (uneven_robot(), random(3));
    for _ in 0..50 {
        let (pose, sides) = (pose(&mut random), Point::new(0.6, 0.4, 0.8));
        let half = Isometry3::translation(-0.3, -0.2, -0.4);
        let grid = VoxelGrid {
            counts: [3, 2, 4],
            cell: 0.2,
            filled: vec![true; 24],
        };
        let twins = [
            Solid::cuboid(&sides, &pose).unwrap(),
            Solid::mesh(&corners(&sides), &BOX_TRIANGLES, &pose).unwrap(),
            Solid::voxels(grid, &(pose * half)).unwrap(),
        ];
        let place = Isometry3::from(pose.translation);
        for _ in 0..50 {
            let p = ball(&mut random, 0.1..0.2).centre * 0.3 + place.translation.vector;
            let of_box = twins[0].nearest(&p).distance;
            for twin in &twins[1..] {
                assert!((twin.nearest(&p).distance - of_box).abs() < 1e-9);
            }
        }
        let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
        let [of_box, of_mesh, of_grid] = twins.map(|solid| {
            let scene = Scene::with_solids(Vec::new(), vec![Arc::new(solid)]).unwrap();
            scene.clearance(&backbone, &robot.tube_radii)
        });
        assert!((of_box - of_mesh).abs() < 1e-9 && (of_box - of_grid).abs() < 1e-9);
    }
}

/// Clearance of a motion over many of its points, exact for each.
fn sampled_over(robot: &Robot, scene: &Scene, motion: &Trajectory) -> f64 {
    let at = |i: u32| motion.at(motion.duration() * f64::from(i) / 120.0).position;
    (0..=120)
        .map(|i| robot.backbone(&at(i)))
        .flat_map(|backbone| {
            let point = move |i: usize| (backbone.point(i / 31, (i % 31) as f64 / 30.0), i / 31);
            (0..93).map(point)
        })
        .flat_map(|(point, section)| {
            scene
                .solids()
                .iter()
                .map(move |s| s.nearest(&point).distance - robot.tube_radii[section])
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn certified_motions_never_meet_a_solid() {
    let (robot, mut random) = (uneven_robot(), random(4));
    let padded = robot.with_tube_padding(&[0.01, 0.03, 0.08]);
    for (name, make) in KINDS {
        let (mut free, mut not, mut closest) = (0, 0, f64::INFINITY);
        let mut certified = 0;
        for i in 0..120 {
            let scene = scene_of(&mut random, make, 1 + i % 3);
            let motion = motion(&mut random);
            let sampled = sampled_over(&robot, &scene, &motion);
            let minimum = minimum_clearance(&robot, &scene, &motion, 1e-3);
            assert!(minimum <= sampled + 1e-12, "{name}: {minimum} {sampled}");
            let dense = sampled_clearance(&robot, &scene, &motion, 0.0, 500);
            assert!(minimum >= dense - 0.02, "{name}: {minimum} {dense}");
            let clearance = certified_clearance(&robot, &padded, (&scene, &[]), &motion, 1e-3);
            if let Some(clearance) = clearance {
                assert!(
                    sampled_over(&padded, &scene, &motion) > 0.0,
                    "{name} {i} collides"
                );
                assert!(
                    clearance <= sampled + 1e-12,
                    "{name}: {clearance} {sampled}"
                );
                assert!(clearance >= dense - 0.03, "{name}: {clearance} {dense}");
            }
            certified += usize::from(clearance.is_some());
            let a = motion.at(0.0).position;
            let b = a + step(&mut random, 0.5);
            let is_edge_free = certify_edge(&robot, &scene, &a, &b, 10).is_free();
            for k in 0..=40 {
                let backbone = robot.backbone(&a.lerp(&b, f64::from(k) / 40.0));
                assert!(!is_edge_free || scene.clearance(&backbone, &robot.tube_radii) > 0.0);
            }
            if certify_trajectory(&robot, &scene, &motion, 0.0).is_free() {
                assert!(sampled > 0.0, "{name} {i} collides: {sampled}");
                closest = closest.min(sampled);
                free += 1;
            } else {
                assert!(sampled < 0.02, "{name} {i} is free: {sampled}");
                not += 1;
            }
        }
        assert!(free > 20 && not > 20, "{name}: {free} {not}");
        assert!((10..=free).contains(&certified), "{name}: {certified}");
        assert!(closest < 0.1, "{name}: no motion came near: {closest}");
    }
}

#[test]
fn contacts_lead_away_from_the_solid() {
    let (robot, mut random) = (unit_robot(), random(5));
    for (name, make) in KINDS {
        let mut pushed = 0;
        for _ in 0..100 {
            let scene = scene_of(&mut random, make, 2);
            let shape = shape(&mut random, 1.2);
            let backbone = robot.backbone(&shape);
            let mut contacts: Vec<Contact> = Vec::new();
            scene.contacts_within(&backbone, &robot.tube_radii, 0.1, &mut contacts);
            let clearance = scene.clearance(&backbone, &robot.tube_radii);
            assert_eq!(!contacts.is_empty(), clearance < 0.1, "{name}: {clearance}");
            for contact in contacts {
                let body = backbone.point(contact.section, contact.fraction);
                let solid = &scene.solids()[contact.obstacle];
                let (here, there) = (
                    solid.nearest(&body).distance,
                    solid.nearest(&(body + contact.normal * 1e-4)).distance,
                );
                assert!(there > here, "{name}: {here} {there}");
                assert!(
                    (here - robot.tube_radii[contact.section] - contact.clearance).abs() < 6e-3
                );
                pushed += usize::from(here < 0.0);
            }
        }
        assert!(pushed > 3, "{name}: {pushed} from inside");
    }
}

#[test]
fn a_thousand_balls_beside_a_solid_agree_with_brute_force() {
    let (robot, mut random) = (uneven_robot(), random(6));
    let balls: Vec<Ball> = (0..1000).map(|_| ball(&mut random, 0.0..0.05)).collect();
    let wall = Arc::new(cuboid(&mut random));
    let scene = Scene::with_solids(balls.clone(), vec![wall.clone()]).unwrap();
    let alone = Scene::with_solids(Vec::new(), vec![wall]).unwrap();
    for _ in 0..200 {
        let backbone = robot.backbone(&shape(&mut random, FRAC_PI_2));
        let of_balls = (0..3)
            .flat_map(|k| balls.iter().map(move |b| (k, b)))
            .map(|(k, b)| backbone.distance(k, &b.centre) - b.radius - robot.tube_radii[k])
            .fold(f64::INFINITY, f64::min);
        let expected = of_balls.min(alone.clearance(&backbone, &robot.tube_radii));
        let found = scene.clearance(&backbone, &robot.tube_radii);
        assert!((found - expected).abs() <= 0.05 * expected.max(0.0) + 1.3e-3);
        assert!(found <= of_balls);
    }
}

#[test]
fn the_most_relevant_balls_are_the_nearest_and_stand_for_solids_too() {
    let (robot, mut random) = (unit_robot(), random(7));
    let few: Vec<Ball> = (0..24).map(|_| ball(&mut random, 0.1..0.3)).collect();
    let views = [0.1, 0.4].map(|q| robot.backbone(&Configuration::repeat(q)));
    let scene = Scene::new(few.clone()).unwrap();
    assert_eq!(scene.most_relevant(&views, &[0.2; 3], 24), few);
    let many: Vec<Ball> = (0..1000).map(|_| ball(&mut random, 0.0..0.1)).collect();
    let chosen = Scene::new(many.clone())
        .unwrap()
        .most_relevant(&views, &[0.2; 3], 24);
    let cost = |ball: &Ball| {
        let nearest = |view: &Backbone| {
            (0..3)
                .map(|k| view.distance(k, &ball.centre))
                .fold(9.0, f64::min)
        };
        views.iter().map(nearest).fold(9.0, f64::min) - ball.radius
    };
    let mut sorted: Vec<f64> = many.iter().map(cost).collect();
    sorted.sort_by(f64::total_cmp);
    let farthest = chosen.iter().map(cost).fold(0.0, f64::max);
    assert_eq!(chosen.len(), 24);
    assert!(farthest < sorted[23] + 0.1, "{farthest} {}", sorted[23]);
    assert!(cost(&chosen[0]) < sorted[0] + 0.1, "the nearest first");
    let wall = Solid::cuboid(
        &Point::new(0.2, 9.0, 9.0),
        &Isometry3::translation(1.2, 0.0, 0.0),
    );
    let scene = Scene::with_solids(few[..2].to_vec(), vec![Arc::new(wall.unwrap())]).unwrap();
    let chosen = scene.most_relevant(&views, &[0.2; 3], 24);
    let touching = |b: &&Ball| (b.centre.x + (-1.1 - b.radius)).abs() < 1e-9 && b.radius == 0.2;
    assert!(chosen.iter().filter(touching).count() >= 3, "{chosen:?}");
    assert!(few[..2].iter().all(|b| chosen.contains(b)));
}

#[test]
fn solids_that_are_not_usable_are_refused_by_name() {
    let here = Isometry3::identity();
    let unit = Point::new(1.0, 1.0, 1.0);
    let refused = |result: Result<Solid, SolidError>, named: &str| {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    };
    refused(
        Solid::cuboid(&Point::new(1.0, 0.0, 1.0), &here),
        "a side is 0",
    );
    refused(
        Solid::cuboid(&Point::new(1.0, f64::NAN, 1.0), &here),
        "a side is NaN",
    );
    refused(
        Solid::cuboid(&unit, &Isometry3::translation(f64::NAN, 0.0, 0.0)),
        "the position is NaN",
    );
    refused(
        Solid::capsule([unit, unit * f64::INFINITY], 0.1),
        "an end is inf",
    );
    refused(Solid::capsule([unit, unit], -0.1), "the radius is -0.1");
    assert!(
        Solid::capsule([unit, unit], 0.1).is_ok(),
        "a ball is a capsule"
    );
    let corners = corners(&unit);
    let mesh = |triangles: &[[u32; 3]]| Solid::mesh(&corners, triangles, &here);
    assert!(mesh(&BOX_TRIANGLES).is_ok());
    refused(mesh(&[]), "0 triangles; 1 to");
    refused(mesh(&BOX_TRIANGLES[1..]), "the mesh is open");
    refused(
        mesh(&BOX_TRIANGLES.map(|[a, b, c]| [a, c, b])),
        "inside out",
    );
    let mut turned = BOX_TRIANGLES;
    turned[4].swap(0, 1);
    refused(mesh(&turned), "do not all face the same side");
    turned[4] = [0, 1, 8];
    refused(mesh(&turned), "triangle 4 has a vertex 8 of 8");
    let grid = |counts, given, fill| VoxelGrid {
        counts,
        cell: 0.1,
        filled: vec![fill; given],
    };
    let voxels = |grid| Solid::voxels(grid, &here);
    refused(voxels(grid([2, 2, 2], 7, true)), "with 7 values");
    refused(voxels(grid([2, 2, 2], 8, false)), "0 faces");
    refused(voxels(grid([usize::MAX, 2, 2], 8, true)), "with 8 values");
    let side = VoxelError::Side(0.0);
    let flat = VoxelGrid {
        cell: 0.0,
        ..grid([1, 1, 1], 1, true)
    };
    assert_eq!(voxels(flat).unwrap_err(), SolidError::Voxels(side));
    let wall = Arc::new(Solid::cuboid(&unit, &here).unwrap());
    let error = Scene::with_solids(Vec::new(), vec![wall; 257]).unwrap_err();
    assert_eq!(error, SceneError::Solids { count: 257 });
}
