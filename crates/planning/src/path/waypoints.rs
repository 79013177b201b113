//! Paths of a fixed number of waypoints in configuration space.

use pcc_model::{Configuration, UnitRobot};

/// Waypoints of a path, as in the paper (H = 64).
pub const WAYPOINTS: usize = 64;

/// A path: `WAYPOINTS` configurations, radians, equally spaced in its own parameter u = h / 63.
pub type Waypoints = Vec<Configuration>;

/// The waypoints of a path as an array, which needs no allocation.
pub(crate) type WaypointArray = [Configuration; WAYPOINTS];

/// The straight segment between two configurations: the fastest motion, since tendons are linear in ζ (docs/robot.md "Tendons").
#[must_use]
pub fn straight_path(start: &Configuration, end: &Configuration) -> Waypoints {
    (0..WAYPOINTS)
        .map(|h| start.lerp(end, parameter(h)))
        .collect()
}

/// The parameter u = h / 63 of waypoint h, 0 to 1.
#[must_use]
pub fn parameter(h: usize) -> f64 {
    h as f64 / (WAYPOINTS - 1) as f64
}

/// Resamples a polyline (rad) to `WAYPOINTS` points at equal distances along it, both ends included.
///
/// # Panics
/// If the polyline has fewer than two points.
#[must_use]
pub fn resample(polyline: &[Configuration]) -> Waypoints {
    let lengths: Vec<f64> = polyline.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    let total: f64 = lengths.iter().sum();
    let (mut edge, mut passed) = (0, 0.0);
    (0..WAYPOINTS)
        .map(|h| {
            let wanted = total * parameter(h);
            while edge + 1 < lengths.len() && passed + lengths[edge] < wanted {
                passed += lengths[edge];
                edge += 1;
            }
            let fraction =
                ((wanted - passed) / lengths[edge].max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            polyline[edge].lerp(&polyline[edge + 1], fraction)
        })
        .collect()
}

/// The path moved to another start, less and less towards its end, which stays.
pub(crate) fn begun_in(start: &Configuration, mut path: Waypoints) -> Waypoints {
    let moved = start - path[0];
    for (h, waypoint) in path.iter_mut().enumerate() {
        *waypoint += moved * (1.0 - parameter(h));
    }
    path[0] = *start;
    path
}

/// Brings every waypoint between the ends inside the bending limit, section by section; the ends stay as they are.
pub fn project_to_limits(robot: &UnitRobot, path: &mut [Configuration]) {
    let last = path.len().saturating_sub(1);
    for waypoint in path.iter_mut().take(last).skip(1) {
        *waypoint = robot.project_to_limits(waypoint);
    }
}
