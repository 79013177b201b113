//! Corner precompensation: a path that bounding jerk turns into the wanted one.

use crate::path::waypoints::{WAYPOINTS, WaypointArray};
use pcc_model::{Configuration, TendonLimits, UnitRobot};

/// Most that a waypoint is moved away from the middle of its neighbours, times its distance from there.
const LARGEST_SHIFT: f64 = 4.0;

/// The path that a motion with bounded jerk has to be timed along so that it runs along `path` (64 waypoints, radians).
///
/// Bounding jerk averages a motion over about w = a/j, which moves a place of the path by q̈ w²/24 to the inner side of its
/// bends; here the waypoints move as much to the outer side. With x the travel of the fastest tendon, at the speed v that its
/// limits allow there, q̈ across the path is v² d²q/dx².
pub(super) fn precompensated(
    robot: &UnitRobot,
    limits: &TendonLimits,
    path: &WaypointArray,
) -> WaypointArray {
    let travels: [f64; WAYPOINTS - 1] =
        std::array::from_fn(|h| fastest_tendon(robot, &(path[h + 1] - path[h])));
    let whole: f64 = travels.iter().sum();
    let width_squared = (limits.acceleration / limits.jerk).powi(2);
    let mut shifted = *path;
    let mut passed = 0.0;
    for h in 1..WAYPOINTS - 1 {
        let [before, after] = [travels[h - 1], travels[h]];
        passed += before;
        if before.min(after) <= 0.0 {
            continue;
        }
        let reached = 2.0 * limits.acceleration * passed.min(whole - passed);
        let speed_squared = reached.min(limits.velocity.powi(2));
        let moved = width_squared * speed_squared / 24.0;
        let mean = 0.5 * (before + after);
        let bend = (path[h + 1] - path[h]) / after - (path[h] - path[h - 1]) / before;
        shifted[h] -= bend * (moved / mean).min(LARGEST_SHIFT * 0.5 * mean);
    }
    shifted
}

/// The most that a tendon moves, length.
fn fastest_tendon(robot: &UnitRobot, change: &Configuration) -> f64 {
    let rows = robot.tendons.matrix().row_iter();
    rows.map(|row| (row * change)[0].abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::path::waypoints::parameter;

    #[test]
    fn precompensation_moves_bends_outwards_and_leaves_segments() {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.9, -0.4, -0.6, 0.6, 0.4, 0.8]);
        let end = Configuration::from_column_slice(&[0.7, 0.1, -0.3, 0.9, 0.5, 0.6]);
        let segment: WaypointArray = std::array::from_fn(|h| start.lerp(&end, parameter(h)));
        let bow = Configuration::from_column_slice(&[0.0, 0.3, 0.0, -0.2, 0.0, 0.1]);
        let bent: WaypointArray =
            std::array::from_fn(|h| segment[h] + bow * parameter(h) * (1.0 - parameter(h)));
        let moved = |path: &WaypointArray| {
            let shifted = precompensated(&robot, &robot.tendon_limits, path);
            shifted
                .iter()
                .zip(path)
                .map(|(s, d)| (s - d).dot(&bow))
                .sum::<f64>()
        };
        assert!(moved(&segment).abs() < 1e-12);
        assert!(moved(&bent) > 1e-4, "{}", moved(&bent));
    }
}
