//! The least time that a path can take, before anything is timed.

use pcc_model::{Configuration, DOF, Robot, TendonLimits};

/// No motion from rest to rest through these shapes (radians) is faster, s: some tendon needs it for its own way alone, with
/// its velocity, acceleration and jerk limited; wherever it turns back its velocity is zero.
pub(crate) fn least_duration_s(
    robot: &Robot,
    limits: &TendonLimits,
    shapes: &[Configuration],
) -> f64 {
    let matrix = robot.tendons.matrix();
    let tendon = |row: usize| {
        let row: Configuration = matrix.fixed_view::<1, DOF>(row, 0).transpose();
        let (mut way, mut total, mut begin) = (0.0_f64, 0.0, End::Resting);
        for pair in shapes.windows(2) {
            let step = row.dot(&(pair[1] - pair[0]));
            if step * way < 0.0 {
                total += least_s(limits, way.abs(), [begin, End::Turning]);
                (way, begin) = (0.0, End::Turning);
            }
            way += step;
        }
        total + least_s(limits, way.abs(), [begin, End::Resting])
    };
    (0..matrix.nrows()).map(tendon).fold(0.0, f64::max)
}

/// Where a tendon's velocity is zero.
#[derive(Clone, Copy)]
enum End {
    /// Its acceleration, too.
    Resting,
    /// Its acceleration may be any that is allowed.
    Turning,
}

/// Lower bound of a tendon's time, s, for a way in one direction (length, not negative).
///
/// The velocity t after an end is at most the limit v, and at most what acceleration a allows: a t, or from rest, as jerk j
/// allows, j t²/2 until t = a/j and then a t − a²/(2j). The area under the least of these is the way that can be made in T: v T
/// less v²/(2a) at an end or, from rest, v²/(2a) + v a/(2j) − a³/(24 j²). That holds where v is reached after a, and from both
/// ends within T; elsewhere jerk is left out.
fn least_s(limits: &TendonLimits, way: f64, ends: [End; 2]) -> f64 {
    let (speed, acceleration) = (limits.velocity, limits.acceleration);
    let build_up = acceleration / limits.jerk;
    let (mut lost, mut accelerating) = (0.0, 0.0);
    for end in ends {
        lost += 0.5 * speed / acceleration;
        accelerating += speed / acceleration;
        if matches!(end, End::Resting) {
            let overlap = acceleration * build_up / (24.0 * speed);
            lost += build_up * (0.5 - overlap);
            accelerating += 0.5 * build_up;
        }
    }
    let least = way / speed + lost;
    let reaches_speed = least >= accelerating && speed >= 0.5 * acceleration * build_up;
    if reaches_speed {
        least
    } else {
        least_with_any_jerk_s(limits, way)
    }
}

/// The same of a trapezoid of velocity, with any jerk.
fn least_with_any_jerk_s(limits: &TendonLimits, way: f64) -> f64 {
    let (speed, acceleration) = (limits.velocity, limits.acceleration);
    if way * acceleration <= speed * speed {
        2.0 * (way / acceleration).sqrt()
    } else {
        way / speed + speed / acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{resample, straight_path};
    use crate::race::SURELY_SLOWER;
    use crate::scenes::{random_configuration, unit_robot};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;
    use trajectory::{AllocationOptions, allocate};

    #[test]
    fn a_straight_motion_takes_hardly_longer() {
        let robot = unit_robot();
        let limits = &robot.tendon_limits;
        let mut random = Pcg64::seed_from_u64(1);
        for _ in 0..100 {
            let [a, b] = [(); 2].map(|()| random_configuration(&robot, &mut random));
            let path = straight_path(&a, &b);
            let options = AllocationOptions::default();
            let motion = allocate(&path, &robot.tendons, limits, &options).unwrap();
            let least_s = least_duration_s(&robot, limits, &[a, b]);
            let ratio = motion.duration() / least_s;
            assert!((1.0 - 1e-9..1.03).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn a_way_there_and_back_takes_twice_as_long_but_for_a_rest_at_the_turn() {
        let robot = unit_robot();
        let limits = &robot.tendon_limits;
        let rest = Configuration::zeros();
        let bent = Configuration::from_column_slice(&[0.0, 0.8, 0.0, 0.0, 0.0, 0.0]);
        let there = least_duration_s(&robot, limits, &[rest, bent]);
        let halfway = least_duration_s(&robot, limits, &[rest, bent * 0.5, bent]);
        let and_back = least_duration_s(&robot, limits, &[rest, bent, rest]);
        assert!(there > 0.5);
        assert!((halfway - there).abs() < 1e-12);
        let build_up = limits.acceleration / limits.jerk;
        let saved = 2.0 * there - and_back;
        assert!((0.9 * build_up..=build_up).contains(&saved), "{saved}");
    }

    #[test]
    fn no_motion_along_a_path_with_many_turns_is_surely_faster() {
        let robot = unit_robot();
        let limits = &robot.tendon_limits;
        let mut random = Pcg64::seed_from_u64(2);
        for turns in [2, 3, 5, 9, 21] {
            for size in [0.01, 0.1, 1.0] {
                let mut corner = || random_configuration(&robot, &mut random) * size;
                let corners: Vec<Configuration> = (0..turns).map(|_| corner()).collect();
                let path = resample(&corners);
                let options = AllocationOptions::default();
                let motion = allocate(&path, &robot.tendons, limits, &options).unwrap();
                let ratio = least_duration_s(&robot, limits, &path) / motion.duration();
                assert!(ratio <= SURELY_SLOWER, "{turns} of {size}: {ratio}");
            }
        }
    }

    #[test]
    fn a_short_way_takes_no_less_than_without_a_limit_on_jerk() {
        let limits = &unit_robot().tendon_limits;
        for way in [0.0, 1e-6, 1e-3, 0.01, 0.02, 0.03, 1.0] {
            let least = least_s(limits, way, [End::Resting; 2]);
            assert!(least >= least_with_any_jerk_s(limits, way));
        }
    }
}
