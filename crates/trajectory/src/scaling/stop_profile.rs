//! Stops in one dimension at the limits of acceleration and jerk: the acceleration falls, stays and rises at constant jerk.

/// How long the acceleration falls, stays and rises in the fastest stop of a velocity and an acceleration in one dimension, at an acceleration and a
/// jerk of at most these, s.
pub(super) fn fastest_s([v, a]: [f64; 2], [most_a, most_j]: [f64; 2]) -> [f64; 3] {
    // The sign by which velocity is left where the acceleration alone is brought to 0.
    let left = v + a * a.abs() / (2.0 * most_j);
    let (v, a) = if left < 0.0 { (-v, -a) } else { (v, a) };
    let turn = (most_j * v + 0.5 * a * a).max(0.0).sqrt();
    let least = turn.min(most_a.max(-a));
    let fallen = (a * a - 2.0 * least * least) / (2.0 * most_j);
    let held_s = if least < turn {
        (v + fallen) / least
    } else {
        0.0
    };
    [(a + least) / most_j, held_s, least / most_j].map(|lasts_s| lasts_s.max(0.0))
}
