//! A lower bound of the duration of any motion along a path, known before the path is timed.

use pcc_model::{Configuration, DOF, TendonLimits, UnitRobot};

/// No motion from rest to rest through these configurations (radians) is faster, s.
///
/// In every step the tendon that has the longest travel there needs at least its time. So no motion is faster than one of a
/// single tendon whose travel is the sum of the longest ones: it, too, is nowhere faster than the limits of velocity,
/// acceleration and jerk allow from a rest on and up to one, where acceleration is zero, too. Motions that pass by corners on the
/// inside may be faster by what they save of the travel.
pub(crate) fn least_duration_s(
    robot: &UnitRobot,
    limits: &TendonLimits,
    configurations: &[Configuration],
) -> f64 {
    let travel = |pair: &[Configuration]| longest_travel(robot, &(pair[1] - pair[0]));
    least_s(limits, configurations.windows(2).map(travel).sum())
}

/// The longest travel of a tendon for a change of the configuration (rad), section lengths.
pub(crate) fn longest_travel(robot: &UnitRobot, step: &Configuration) -> f64 {
    let matrix = robot.tendons.matrix();
    let travel = |row| matrix.fixed_view::<1, DOF>(row, 0).tr_dot(step).abs();
    (0..matrix.nrows()).map(travel).fold(0.0, f64::max)
}

/// Lower bound of a tendon's time from rest to rest, s, for a travel in one direction (length, not negative).
///
/// The velocity t after an end is at most the limit v, and at most what acceleration a and jerk j allow: j t²/2 until t = a/j and
/// then a t − a²/(2j). The area under the least of these is the travel that can be made in T: v T less
/// v²/(2a) + v a/(2j) − a³/(24 j²) at each end. That holds where v is reached after a, and from both ends within T; elsewhere
/// jerk is left out.
fn least_s(limits: &TendonLimits, travel: f64) -> f64 {
    let (speed, acceleration) = (limits.velocity, limits.acceleration);
    let build_up = acceleration / limits.jerk;
    let overlap = acceleration * build_up / (24.0 * speed);
    let least = travel / speed + speed / acceleration + build_up * (1.0 - 2.0 * overlap);
    let accelerating = 2.0 * speed / acceleration + build_up;
    let reaches_speed = least >= accelerating && speed >= 0.5 * acceleration * build_up;
    if reaches_speed {
        least
    } else {
        least_with_any_jerk_s(limits, travel)
    }
}

/// Lower bound of the time, s, in which a tendon moves by `travel`, a length, from rest to rest with any jerk: its velocity is a trapezoid.
fn least_with_any_jerk_s(limits: &TendonLimits, travel: f64) -> f64 {
    let (speed, acceleration) = (limits.velocity, limits.acceleration);
    if travel * acceleration <= speed * speed {
        2.0 * (travel / acceleration).sqrt()
    } else {
        travel / speed + speed / acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::motion::incumbent::SURELY_SLOWER;
    use crate::path::waypoints::{resample, straight_path};
    use crate::search::random_configuration::random_configuration;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;
    use trajectory::{ParameterizationOptions, TimeParameterizer};

    #[test]
    fn a_straight_motion_takes_hardly_longer() {
        let robot = unit_robot();
        let limits = &robot.tendon_limits;
        let mut random = Pcg64::seed_from_u64(1);
        for _ in 0..100 {
            let [a, b] = [(); 2].map(|()| random_configuration(&robot, &mut random));
            let path = straight_path(&a, &b);
            let options = ParameterizationOptions::default();
            let motion = TimeParameterizer::default()
                .parameterize(&path, &robot.tendons, limits, &options)
                .unwrap();
            let least_s = least_duration_s(&robot, limits, &[a, b]);
            let ratio = motion.duration() / least_s;
            assert!((1.0 - 1e-9..1.03).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn ways_of_different_tendons_add_up() {
        let robot = unit_robot();
        let limits = &robot.tendon_limits;
        let bent = |x: f64, y: f64| Configuration::from_row_slice(&[x, y, 0.0, 0.0, 0.0, 0.0]);
        let configurations = [bent(0.0, 0.0), bent(0.8, 0.0), bent(0.8, 0.8)];
        let [first, second] =
            [0, 1].map(|i| least_duration_s(&robot, limits, &configurations[i..i + 2]));
        let both = least_duration_s(&robot, limits, &configurations);
        let at_ends = limits.velocity / limits.acceleration + limits.acceleration / limits.jerk;
        assert!((first + second - both - at_ends).abs() < 0.1 * at_ends);
        let straight = least_duration_s(&robot, limits, &[configurations[0], configurations[2]]);
        assert!(straight < 0.95 * both);
        let halfway = [configurations[0], bent(0.4, 0.0), configurations[1]];
        assert!((least_duration_s(&robot, limits, &halfway) - first).abs() < 1e-12);
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
                let options = ParameterizationOptions::default();
                let motion = TimeParameterizer::default()
                    .parameterize(&path, &robot.tendons, limits, &options)
                    .unwrap();
                let ratio = least_duration_s(&robot, limits, &path) / motion.duration();
                assert!(ratio <= SURELY_SLOWER, "{turns} of {size}: {ratio}");
            }
        }
    }

    #[test]
    fn a_short_way_takes_no_less_than_without_a_limit_on_jerk() {
        let limits = &unit_robot().tendon_limits;
        for travel in [0.0, 1e-6, 1e-3, 0.01, 0.02, 0.03, 1.0] {
            let least = least_s(limits, travel);
            assert!(least >= least_with_any_jerk_s(limits, travel));
        }
    }
}
