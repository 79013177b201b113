//! Random and adversarial problems for time parameterization.

use super::*;
use crate::test_paths::{cornered_path, smooth_path, unit_limits, unit_tendons};
use crate::{evaluate, limit_use};
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn point(x: f64, y: f64) -> Configuration {
    Configuration::from_row_slice(&[x, y, 0.3 * x, -y, 0.1, 0.5 * y])
}

fn allocated(waypoints: &[Configuration], limits: &TendonLimits) -> Trajectory {
    let motion = TimeParameterizer::default()
        .parameterize(
            waypoints,
            &unit_tendons(),
            limits,
            &ParameterizationOptions::default(),
        )
        .unwrap();
    assert_contract(&motion, waypoints, limits);
    motion
}

/// What every result promises: ends, rest, limits (exactly and by samples), number of knots.
fn assert_contract(motion: &Trajectory, waypoints: &[Configuration], limits: &TendonLimits) {
    let tendons = unit_tendons();
    let knots = motion.knots();
    let last = knots[knots.len() - 1];
    assert_eq!(knots[0], Knot::resting(0.0, waypoints[0]));
    assert_eq!(
        last,
        Knot::resting(last.time, waypoints[waypoints.len() - 1])
    );
    assert!(last.time > 0.0 && knots.len() <= MAX_KNOTS);
    let most = limit_use(motion, &tendons, limits);
    assert!(most.largest() <= 1.0 + 1e-9, "{most:?}");
    let (mut hint, mut out) = (0, [0.0; 9]);
    for i in 0..=500 {
        let state = evaluate(knots, &mut hint, motion.duration() * f64::from(i) / 500.0);
        let derivatives = [
            (state.velocity, limits.velocity),
            (state.acceleration, limits.acceleration),
            (state.jerk, limits.jerk),
        ];
        for (derivative, limit) in derivatives {
            tendons.lengths(&derivative, &mut out);
            assert!(
                out.iter().all(|value| value.abs() <= limit * (1.0 + 1e-6)),
                "{out:?} over {limit}"
            );
        }
    }
}

#[test]
fn smooth_paths_are_fast_and_use_a_limit_fully() {
    let mut random = Pcg64::seed_from_u64(1);
    let (tendons, limits) = (unit_tendons(), unit_limits());
    let mut parameterizer = TimeParameterizer::default();
    for _ in 0..200 {
        let path = smooth_path(&mut random, 64);
        let motion = parameterizer
            .parameterize(
                &path,
                &tendons,
                &limits,
                &ParameterizationOptions::default(),
            )
            .unwrap();
        assert_contract(&motion, &path, &limits);
        let width = 2.0 * limits.acceleration / limits.jerk;
        let bound = parameterizer
            .fastest_duration(
                &path,
                &tendons,
                &limits,
                &ParameterizationOptions::default(),
            )
            .unwrap()
            + width;
        assert!(
            motion.duration() <= 1.03 * bound,
            "{} against {bound}",
            motion.duration()
        );
        assert!(limit_use(&motion, &tendons, &limits).largest() > 1.0 - 1e-6);
    }
}

#[test]
fn memory_does_not_change_the_result() {
    let mut random = Pcg64::seed_from_u64(2);
    let mut parameterizer = TimeParameterizer::default();
    let options = ParameterizationOptions::default();
    for count in [64, 2, 5, 200, 3] {
        let path = smooth_path(&mut random, count);
        let again = parameterizer
            .parameterize(&path, &unit_tendons(), &unit_limits(), &options)
            .unwrap();
        assert_eq!(again, allocated(&path, &unit_limits()));
    }
}

#[test]
fn cornered_paths_keep_limits_and_stay_near_their_polyline() {
    let mut random = Pcg64::seed_from_u64(3);
    for (count, knots) in [(2, 96), (3, 96), (4, 96), (6, 96), (10, 96), (30, 256)] {
        let options = ParameterizationOptions {
            knots,
            ..ParameterizationOptions::default()
        };
        for _ in 0..15 {
            let path = cornered_path(&mut random, count);
            let motion = TimeParameterizer::default()
                .parameterize(&path, &unit_tendons(), &unit_limits(), &options)
                .unwrap();
            assert_contract(&motion, &path, &unit_limits());
            let deviation = motion
                .sample(2000)
                .iter()
                .map(|p| distance(&path, p))
                .fold(0.0, f64::max);
            assert!(
                deviation < 0.03,
                "{deviation} rad off a polyline of {count} points"
            );
        }
    }
}

fn distance(polyline: &[Configuration], point: &Configuration) -> f64 {
    let to_chord = |pair: &[Configuration]| {
        let chord = pair[1] - pair[0];
        let part = ((point - pair[0]).dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0);
        (pair[0] + chord * part - point).norm()
    };
    polyline
        .windows(2)
        .map(to_chord)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn a_straight_line_takes_the_time_of_its_trapezoid() {
    // One tendon rules: |Δl| at v and a takes Δl/v + v/a, and the average adds at most 2a/j.
    let (from, to) = (point(0.0, 0.0), point(1.2, -0.7));
    let limits = unit_limits();
    let mut lengths = [0.0; 9];
    unit_tendons().lengths(&(to - from), &mut lengths);
    let longest = lengths
        .iter()
        .fold(0.0, |most: f64, length| most.max(length.abs()));
    let fastest = longest / limits.velocity + limits.velocity / limits.acceleration;
    let duration = allocated(&[from, to], &limits).duration();
    assert!(
        duration > fastest && duration < 1.002 * (fastest + 0.2),
        "{duration} against {fastest}"
    );
}

#[test]
fn paths_that_go_nowhere_rest() {
    let here = point(0.4, -0.2);
    for waypoints in [vec![here], vec![here; 2], vec![here; 64]] {
        let motion = allocated(&waypoints, &unit_limits());
        assert_eq!(motion.knots().len(), 2);
        assert_eq!(motion.duration(), REST_DURATION);
    }
}

#[test]
fn repeated_points_and_a_return_to_the_start_are_motions() {
    let (a, b, c) = (point(0.0, 0.1), point(0.5, 0.4), point(0.9, -0.3));
    let plain = allocated(&[a, b, c], &unit_limits());
    assert_eq!(allocated(&[a, a, b, b, b, c, c], &unit_limits()), plain);
    let there_and_back = allocated(&[a, c, a], &unit_limits());
    assert!(there_and_back.duration() > allocated(&[a, c], &unit_limits()).duration());
    let middle = there_and_back.sample(3)[1];
    assert!((middle - c).norm() < 0.02, "{}", (middle - c).norm());
    allocated(&[a, b, c, b, a], &unit_limits());
    allocated(&[a, b, a, b, a, c, a], &unit_limits());
}

#[test]
fn nearly_repeated_points_cost_little_time() {
    let mut random = Pcg64::seed_from_u64(6);
    for size in [1e-12, 1e-7, 1e-5] {
        let path = smooth_path(&mut random, 32);
        let noise = Configuration::from_fn(|row, _| size * (row as f64 - 2.5));
        let doubled: Vec<_> = path
            .iter()
            .flat_map(|&point| [point, point + noise])
            .collect();
        let (plain, noisy) = (
            allocated(&path, &unit_limits()),
            allocated(&doubled, &unit_limits()),
        );
        assert!(
            noisy.duration() < 1.01 * plain.duration() + 0.05,
            "{size}: {} s",
            noisy.duration()
        );
    }
}

#[test]
fn extreme_limits_and_sizes_are_answered() {
    let mut random = Pcg64::seed_from_u64(4);
    let extremes = [1e-9, 1e-3, 1.0, 1e3, 1e9];
    for velocity in extremes {
        for acceleration in extremes {
            for jerk in extremes {
                let limits = TendonLimits {
                    velocity,
                    acceleration,
                    jerk,
                };
                allocated(&smooth_path(&mut random, 20), &limits);
            }
        }
    }
}

#[test]
fn tiny_motions_are_timed_by_their_size() {
    let mut random = Pcg64::seed_from_u64(5);
    let limits = unit_limits();
    for size in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-300] {
        let path = smooth_path(&mut random, 64);
        let origin = path[0];
        let small: Vec<_> = path.iter().map(|p| origin + (p - origin) * size).collect();
        allocated(&small, &limits);
        let at_zero: Vec<_> = path.iter().map(|p| (p - origin) * size).collect();
        if size > 1e-100 {
            let duration = allocated(&at_zero, &limits).duration();
            // Bounded by jerk alone, the time of a motion of size d grows with the cube root of d ÷ jerk.
            let unit = (size / limits.jerk).cbrt();
            assert!(
                size > 1e-5 || (duration > 0.5 * unit && duration < 8.0 * unit),
                "{duration} for {size}"
            );
        }
    }
}

#[test]
fn bad_problems_are_named() {
    let (a, b) = (point(0.0, 0.0), point(1.0, 0.0));
    let options = ParameterizationOptions::default();
    let answer = |waypoints: &[Configuration], limits: TendonLimits, options| {
        TimeParameterizer::default()
            .parameterize(waypoints, &unit_tendons(), &limits, &options)
            .unwrap_err()
    };
    assert_eq!(
        answer(&[], unit_limits(), options),
        ParameterizationError::NoWaypoints
    );
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        let error = answer(&[a, b, b * bad], unit_limits(), options);
        assert_eq!(error, ParameterizationError::WaypointNotFinite(2));
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let fields = [
            TendonLimits {
                velocity: bad,
                ..unit_limits()
            },
            TendonLimits {
                acceleration: bad,
                ..unit_limits()
            },
            TendonLimits {
                jerk: bad,
                ..unit_limits()
            },
        ];
        for limits in fields {
            assert!(matches!(
                answer(&[a, b], limits, options),
                ParameterizationError::Limits(_)
            ));
        }
    }
    let wrong = [
        ParameterizationOptions {
            knots: 3,
            ..options
        },
        ParameterizationOptions {
            knots: 257,
            ..options
        },
        ParameterizationOptions {
            grid_intervals: 0,
            ..options
        },
        ParameterizationOptions {
            spacing: f64::NAN,
            ..options
        },
    ];
    for options in wrong {
        assert!(matches!(
            answer(&[a, b], unit_limits(), options),
            ParameterizationError::Options(_)
        ));
    }
}

proptest::proptest! {
    #[test]
    fn any_waypoints_give_a_motion_within_limits(
        values in proptest::collection::vec(-1.5..1.5f64, 6..120),
        (velocity, acceleration, jerk) in (0.01..10.0f64, 0.01..10.0f64, 0.01..1000.0f64),
    ) {
        let waypoints: Vec<_> = values.chunks_exact(6).map(Configuration::from_row_slice).collect();
        allocated(&waypoints, &TendonLimits { velocity, acceleration, jerk });
    }

    #[test]
    fn knots_join_with_continuous_acceleration(seed in 0..u64::MAX, count in 2..80usize) {
        let motion = allocated(&smooth_path(&mut Pcg64::seed_from_u64(seed), count), &unit_limits());
        let segments: Vec<_> = motion.segments().collect();
        for pair in segments.windows(2) {
            let (left, right) = (pair[0].evaluate(pair[0].duration), pair[1].evaluate(0.0));
            proptest::prop_assert!((left.position - right.position).amax() == 0.0);
            proptest::prop_assert!((left.velocity - right.velocity).amax() < 1e-10);
            proptest::prop_assert!((left.acceleration - right.acceleration).amax() < 1e-7);
        }
    }
}
