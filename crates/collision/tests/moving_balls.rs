//! The certificate against moving balls, by dense sampling in time.
#![allow(clippy::unwrap_used)]

mod motions;

use collision::{
    Ball, MovingBall, Scene, TimeSpread, Verdict, certified_clearance, certify_moving,
    certify_trajectory,
};
use motions::{ball, motion, random, shape, uneven_robot};
use pcc_model::{Configuration, Point, Robot};
use rand::RngExt;
use rand_pcg::Pcg64;
use trajectory::{Knot, Trajectory};

fn moving_balls(random: &mut Pcg64, count: usize) -> Vec<MovingBall> {
    let mut moving = || MovingBall {
        ball: ball(random, 0.02..0.3),
        velocity: Point::from_fn(|_, _| random.random_range(-0.5..0.5)),
    };
    (0..count).map(|_| moving()).collect()
}

fn clearance_at(robot: &Robot, balls: &[MovingBall], motion: &Trajectory, time: f64) -> f64 {
    let backbone = robot.backbone(&motion.at(time).position);
    let scene = Scene::new(balls.iter().map(|b| b.at(time)).collect()).unwrap();
    scene.clearance(&backbone, &robot.tube_radii)
}

fn resting(duration: f64) -> Trajectory {
    let knots = [0.0, duration / 3.0, duration].map(|time| Knot {
        time,
        position: Configuration::zeros(),
        velocity: Configuration::zeros(),
        acceleration: Configuration::zeros(),
    });
    Trajectory::new(knots.to_vec()).unwrap()
}

#[test]
fn certified_motions_never_meet_a_moving_ball() {
    let (robot, mut random) = (uneven_robot(), random(1));
    let (mut free, mut colliding, mut undecided) = (0, 0, 0);
    for i in 0..2_000 {
        let balls = moving_balls(&mut random, [1, 2, 5, 20][i % 4]);
        let motion = motion(&mut random);
        let from_time = motion.duration() * random.random_range(-0.5..0.9_f64).max(0.0);
        let sample = |k: u32| {
            let time = from_time + (motion.duration() - from_time) * f64::from(k) / 200.0;
            clearance_at(&robot, &balls, &motion, time)
        };
        match certify_moving(&robot, &balls, &motion, [from_time, f64::INFINITY]) {
            Verdict::Free => {
                free += 1;
                let least = (0..=200).map(sample).fold(f64::INFINITY, f64::min);
                assert!(least > 0.0, "motion {i} collides: {least}");
            }
            Verdict::Colliding { at } => {
                colliding += 1;
                assert!(at >= from_time);
                let there = clearance_at(&robot, &balls, &motion, at);
                assert!(there < 1e-9, "motion {i} is free at {at} s: {there}");
            }
            Verdict::Undecided { .. } => undecided += 1,
        }
    }
    assert!(
        free > 300 && colliding > 500,
        "{free} {colliding} {undecided}"
    );
    assert!(undecided < 10, "{free} {colliding} {undecided}");
}

#[test]
fn a_ball_that_does_not_move_is_a_scene() {
    let (robot, mut random) = (uneven_robot(), random(2));
    let mut free = 0;
    for _ in 0..300 {
        let mut balls = moving_balls(&mut random, 4);
        balls.iter_mut().for_each(|b| b.velocity = Point::zeros());
        let scene = Scene::new(balls.iter().map(|b| b.ball).collect()).unwrap();
        let motion = motion(&mut random);
        let padding = std::array::from_fn(|_| random.random_range(0.0..0.1));
        let robot = robot.with_tube_padding(&padding);
        let verdict = certify_moving(&robot, &balls, &motion, [0.0, f64::INFINITY]);
        let at_rest = certify_trajectory(&robot, &scene, &motion, 0.0);
        assert_eq!(verdict.is_free(), at_rest.is_free());
        free += usize::from(verdict.is_free());
    }
    assert!((50..250).contains(&free), "{free}");
}

#[test]
fn a_ball_that_flies_through_the_resting_robot_is_found() {
    let robot = uneven_robot();
    let ball = Ball {
        centre: Point::new(3.0, 0.0, 1.5),
        radius: 0.2,
    };
    let through = MovingBall {
        ball,
        velocity: Point::new(-2.0, 0.0, 0.0),
    };
    let past = MovingBall {
        ball: Ball {
            centre: Point::new(3.0, 0.32, 1.5),
            radius: 0.2,
        },
        ..through
    };
    let motion = resting(3.0);
    assert!(certify_moving(&robot, &[past], &motion, [0.0, f64::INFINITY]).is_free());
    let padded = robot.with_tube_padding(&[0.0, 0.04, 0.0]);
    assert!(!certify_moving(&padded, &[past], &motion, [0.0, f64::INFINITY]).is_free());
    let verdict = certify_moving(&robot, &[past, through], &motion, [0.0, f64::INFINITY]);
    let Verdict::Colliding { at } = verdict else {
        panic!("{verdict:?}")
    };
    assert!(
        (1.35..=1.65).contains(&at),
        "contact lasts from 1.35 s to 1.65 s, not {at} s"
    );
    assert!(certify_moving(&robot, &[through], &motion, [1.66, f64::INFINITY]).is_free());
    assert!(!certify_moving(&robot, &[through], &motion, [1.64, f64::INFINITY]).is_free());
    let until = |time| certify_moving(&robot, &[through], &motion, [0.0, time]);
    assert!(!until(motion.duration()).is_free());
    assert!(until(1.0).is_free());
    assert!(!until(1.01).is_free());
}

#[test]
fn no_balls_are_no_danger_and_unknown_ones_are() {
    let robot = uneven_robot();
    let motion = resting(1.0);
    assert!(certify_moving(&robot, &[], &motion, [0.0, f64::INFINITY]).is_free());
    let far = MovingBall {
        ball: Ball {
            centre: Point::new(9.0, 0.0, 0.0),
            radius: 0.1,
        },
        velocity: Point::zeros(),
    };
    assert!(certify_moving(&robot, &[far], &motion, [0.0, f64::INFINITY]).is_free());
    for bad in [f64::NAN, f64::INFINITY] {
        let mut lost = far;
        lost.velocity.x = bad;
        assert!(!certify_moving(&robot, &[lost], &motion, [0.0, f64::INFINITY]).is_free());
        let mut lost = far;
        lost.ball.centre.y = f64::NAN;
        assert!(!certify_moving(&robot, &[far, lost], &motion, [0.0, f64::INFINITY]).is_free());
    }
}

#[test]
fn the_smallest_clearance_is_that_of_dense_sampling_from_moving_balls_too() {
    let (robot, mut random) = (uneven_robot(), random(3));
    let mut free = 0;
    for i in 0..400 {
        let balls = moving_balls(&mut random, [1, 3, 20][i % 3]);
        let scene = Scene::new(vec![ball(&mut random, 0.02..0.1)]).unwrap();
        let motion = motion(&mut random);
        let padded = robot.with_tube_padding(&[0.01, 0.02, 0.03]);
        let found = certified_clearance(&robot, &padded, (&scene, &balls), &motion, 1e-3);
        let moved = certify_moving(&padded, &balls, &motion, [0.0, f64::INFINITY]);
        let at_rest = certify_trajectory(&padded, &scene, &motion, 0.0);
        assert_eq!(
            found.is_some(),
            moved.is_free() && at_rest.is_free(),
            "motion {i}"
        );
        let Some(found) = found else { continue };
        free += 1;
        let least = (0..=2_000).map(|k| {
            let time = motion.duration() * f64::from(k) / 2_000.0;
            let backbone = robot.backbone(&motion.at(time).position);
            let at_rest = scene.clearance(&backbone, &robot.tube_radii);
            at_rest.min(clearance_at(&robot, &balls, &motion, time))
        });
        let least = least.fold(f64::INFINITY, f64::min);
        assert!(found <= least + 1e-9, "motion {i}: {found} of {least}");
        assert!(found >= least - 2e-3, "motion {i}: {found} of {least}");
    }
    assert!(free > 50, "{free}");
}

#[test]
fn a_robot_stands_clear_where_no_ball_comes_within_a_minute() {
    let (robot, mut random) = (uneven_robot(), random(7));
    let (mut clear, mut touched) = (0, 0);
    for _ in 0..500 {
        let balls = moving_balls(&mut random, 5);
        let configuration = shape(&mut random, 1.5);
        let spread = TimeSpread {
            earliest: -random.random_range(0.0..1.5),
            latest: 0.8,
            seen: random.random_range(-3.0..0.0),
        };
        let from_s = random.random_range(0.0..4.0);
        let begin_s = (from_s + spread.earliest).max(spread.seen);
        let clearance = |time: f64| {
            let scene = Scene::new(balls.iter().map(|ball| ball.at(time)).collect());
            scene.unwrap().clearance_at(&robot, &configuration)
        };
        let times = (0..=6_000).map(|k| begin_s + f64::from(k) * 0.01);
        let least = times.map(clearance).fold(f64::INFINITY, f64::min);
        if spread.stands_clear(&balls, &robot, &configuration, from_s) {
            clear += 1;
            assert!(least > 0.0, "{least}");
        } else {
            touched += 1;
            // Between two samples the nearest place is at most 4.4 mm away on the ball's way, 0.11 beside it.
            assert!(least < 1e-4, "{least}");
        }
    }
    assert!(clear > 100 && touched > 50, "{clear} {touched}");
}

#[test]
fn a_ball_that_nobody_knows_the_way_of_comes_everywhere() {
    let robot = uneven_robot();
    let spread = TimeSpread {
        earliest: 0.0,
        latest: 0.0,
        seen: f64::NEG_INFINITY,
    };
    let stands = |centre: Point, velocity: Point| {
        let ball = Ball {
            centre,
            radius: 0.1,
        };
        let moving = MovingBall { ball, velocity };
        spread.stands_clear(&[moving], &robot, &Configuration::zeros(), 0.0)
    };
    let (far, still) = (Point::new(0.0, 9.0, 0.0), Point::zeros());
    assert!(stands(far, still));
    assert!(!stands(far, Point::new(0.0, -1.0, 0.0)));
    assert!(stands(far, Point::new(0.0, 1.0, 0.0)), "it goes away");
    assert!(stands(far, Point::new(0.0, -0.1, 0.0)), "it comes in 88 s");
    assert!(!stands(Point::repeat(f64::NAN), still));
    assert!(!stands(far, Point::repeat(f64::NAN)));
    assert!(!stands(Point::repeat(f64::INFINITY), still));
}
