//! Random and adversarial states at the ends.

use super::*;
use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
use crate::{Knot, limit_use, parameterize};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn between(
    waypoints: &[Configuration],
    ends: &EndMotions,
) -> Result<Trajectory, ParameterizationError> {
    let options = ParameterizationOptions::default();
    TimeParameterizer::default().parameterize_between(
        waypoints,
        ends,
        &unit_tendons(),
        &unit_limits(),
        &options,
    )
}

fn assert_begins_and_keeps(motion: &Trajectory, first: &Knot, last: &Knot) {
    let knots = motion.knots();
    let time = motion.duration();
    assert_eq!(
        knots[0],
        Knot {
            time: 0.0,
            ..*first
        }
    );
    assert_eq!(knots[knots.len() - 1], Knot { time, ..*last });
    let most = limit_use(motion, &unit_tendons(), &unit_limits());
    assert!(most.largest() <= 1.0 + 1e-9, "{most:?}");
}

/// The rest of a motion from `time` on: its state there, and waypoints of what is left.
fn rest_of(motion: &Trajectory, time: f64) -> (Knot, Vec<Configuration>) {
    let state = motion.at(time);
    let knot = Knot {
        time: 0.0,
        position: state.position,
        velocity: state.velocity,
        acceleration: state.acceleration,
    };
    let left = motion.duration() - time;
    let points = (0..64).map(|i| motion.at(time + left * f64::from(i) / 63.0).position);
    (knot, points.collect())
}

#[test]
fn a_motion_is_continued_from_any_state_on_it() {
    let mut random = Pcg64::seed_from_u64(71);
    let (mut continued, mut added) = (0, 0.0);
    for _ in 0..200 {
        let path = smooth_path(&mut random, 64);
        let options = ParameterizationOptions::default();
        let motion = parameterize(&path, &unit_tendons(), &unit_limits(), &options).unwrap();
        let time = motion.duration() * random.random_range(0.02..0.7);
        let (knot, waypoints) = rest_of(&motion, time);
        let start = EndMotion {
            velocity: knot.velocity,
            acceleration: knot.acceleration,
        };
        let ends = EndMotions {
            start,
            ..EndMotions::default()
        };
        match between(&waypoints, &ends) {
            Ok(rest) => {
                let last = Knot::resting(0.0, waypoints[63]);
                assert_begins_and_keeps(&rest, &knot, &last);
                continued += 1;
                added += (time + rest.duration()) / motion.duration() - 1.0;
            }
            Err(ParameterizationError::NotControllable { end, .. }) => assert_eq!(end, End::Start),
            Err(ParameterizationError::NoRoom(most)) => assert!(most > 1.0),
            Err(error) => panic!("{error}"),
        }
    }
    println!(
        "{continued} of 200, {} longer",
        added / f64::from(continued)
    );
    assert!(continued >= 120, "only {continued} of 200 were continued");
    assert!(added / f64::from(continued) < 0.03);
}

#[test]
fn slow_states_along_the_path_begin_and_end_motions() {
    let mut random = Pcg64::seed_from_u64(72);
    let mut done = 0;
    for _ in 0..100 {
        let path = smooth_path(&mut random, 64);
        let mut speed = || random.random_range(0.0..0.1);
        let along = |from: usize, speed: f64| EndMotion {
            velocity: (path[from + 1] - path[from]).normalize() * speed,
            acceleration: Configuration::zeros(),
        };
        let ends = EndMotions {
            start: along(0, speed()),
            finish: along(62, speed()),
        };
        if let Ok(motion) = between(&path, &ends) {
            assert_begins_and_keeps(
                &motion,
                &ends.start.knot(path[0]),
                &ends.finish.knot(path[63]),
            );
            done += 1;
        }
    }
    assert!(done >= 90, "only {done} of 100");
}

#[test]
fn random_states_are_answered_within_limits_or_by_name() {
    let mut random = Pcg64::seed_from_u64(73);
    let rows = crate::limits::tendon_rows::TendonRows::of(&unit_tendons());
    let limits = unit_limits();
    let (mut answered, mut refused) = (0, 0);
    for _ in 0..300 {
        let path = smooth_path(&mut random, 64);
        let mut vector = |limit: f64| {
            let vector = Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
            vector * (limit * random.random_range(0.0..1.0) / rows.largest(&vector))
        };
        let mut end = || EndMotion {
            velocity: vector(0.5 * limits.velocity),
            acceleration: vector(0.5 * limits.acceleration),
        };
        let ends = EndMotions {
            start: end(),
            finish: end(),
        };
        match between(&path, &ends) {
            Ok(motion) => {
                let knots = (ends.start.knot(path[0]), ends.finish.knot(path[63]));
                assert_begins_and_keeps(&motion, &knots.0, &knots.1);
                answered += 1;
            }
            Err(
                ParameterizationError::NotControllable { .. } | ParameterizationError::NoRoom(_),
            ) => {
                refused += 1;
            }
            Err(error) => panic!("{error}"),
        }
    }
    assert!(answered > 0 && refused > 0);
}

#[test]
fn resting_ends_are_the_plain_motion() {
    let path = smooth_path(&mut Pcg64::seed_from_u64(74), 64);
    let options = ParameterizationOptions::default();
    let plain = parameterize(&path, &unit_tendons(), &unit_limits(), &options);
    assert_eq!(between(&path, &EndMotions::default()), plain);
}

#[test]
fn bad_ends_are_named() {
    let path = smooth_path(&mut Pcg64::seed_from_u64(75), 64);
    let with = |velocity: f64, acceleration: f64| EndMotion {
        velocity: (path[1] - path[0]).normalize() * velocity,
        acceleration: Configuration::repeat(acceleration),
    };
    let start = |start| {
        between(
            &path,
            &EndMotions {
                start,
                ..EndMotions::default()
            },
        )
        .unwrap_err()
    };
    let finish = |finish| {
        between(
            &path,
            &EndMotions {
                finish,
                ..EndMotions::default()
            },
        )
        .unwrap_err()
    };
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        assert_eq!(
            start(with(bad, 0.0)),
            ParameterizationError::EndNotFinite(End::Start)
        );
        assert_eq!(
            finish(with(0.0, bad)),
            ParameterizationError::EndNotFinite(End::Finish)
        );
    }
    let named = |error, named| matches!(error, ParameterizationError::EndExceeds { end, use_of_limit } if end == named && use_of_limit > 1.0);
    assert!(named(start(with(100.0, 0.0)), End::Start));
    assert!(named(finish(with(0.0, 100.0)), End::Finish));
    // A path too short to brake on, and none at all.
    let short: Vec<_> = path
        .iter()
        .map(|point| path[0] + (point - path[0]) * 1e-3)
        .collect();
    let moving = EndMotions {
        start: with(0.2, 0.0),
        ..EndMotions::default()
    };
    assert!(matches!(
        between(&short, &moving),
        Err(ParameterizationError::NotControllable { .. })
    ));
    let one = between(&path[..1], &moving);
    assert!(
        matches!(one, Err(ParameterizationError::NotControllable { .. })),
        "{one:?}"
    );
}
