//! Stops in one dimension at the limits of acceleration and jerk: the acceleration falls, stays and rises at constant jerk.

/// Rounding of a position, rad.
const POSITION_ROUNDING_RAD: f64 = 1e-15;
/// Above this share of it a jerk is nearly the largest one.
const NEARLY: f64 = 0.9;
/// A part below this share of its stop is not passed at the limit of the jerk: between knots so near, rounding is more than is kept.
const SHORT_PART: f64 = 0.01;
/// A short part is made longer by this factor, at less jerk.
const LONGER: f64 = 1.5;
/// Share of its stop that a part has at least.
const SHORTEST_PART: f64 = 0.003;

/// Part of a stop in one dimension, with constant jerk.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) lasts_s: f64,
    pub(super) jerk: f64,
}

/// The fastest stop in one dimension, or one nearly as fast none of whose parts is short.
pub(super) fn fastest_with_long_parts(state: [f64; 2], limits: [f64; 2]) -> Option<[Part; 3]> {
    let parts = fastest(state, limits)?;
    let short_s = shortest_s(&parts);
    if short_s >= SHORT_PART * sum_s(&parts) {
        return Some(parts);
    }
    let longer_s = (LONGER * short_s).max(SHORTEST_PART * sum_s(&parts));
    let parts = without_short_parts(state, limits, parts, longer_s)?;
    let is_apart = |part: &Part| part.lasts_s == 0.0 || part.lasts_s >= 0.99 * longer_s;
    parts.iter().all(is_apart).then_some(parts)
}

pub(super) fn sum_s(parts: &[Part]) -> f64 {
    parts.iter().map(|part| part.lasts_s).sum()
}

/// The time of the shortest part, s.
fn shortest_s(parts: &[Part]) -> f64 {
    let lasting = parts.iter().map(|part| part.lasts_s).filter(|it| *it > 0.0);
    lasting.fold(f64::INFINITY, f64::min)
}

/// Jerk that the rounding of positions adds in the shortest part in which there is most of it, rad/s³.
pub(super) fn jerk_rounding(parts: &[Part; 3]) -> f64 {
    let most = parts
        .iter()
        .fold(0.0_f64, |most, it| most.max(it.jerk.abs()));
    let at_most = parts.map(|part| Part {
        lasts_s: if part.jerk.abs() > NEARLY * most {
            part.lasts_s
        } else {
            0.0
        },
        ..part
    });
    POSITION_ROUNDING_RAD * 60.0 / shortest_s(&at_most).powi(3)
}

/// A stop that is nearly as fast as the fastest one, whose parts are not all at least so long.
fn without_short_parts(
    state: [f64; 2],
    [most_a, most_j]: [f64; 2],
    [_, held, _]: [Part; 3],
    short_s: f64,
) -> Option<[Part; 3]> {
    let (sign, [v, a]) = mirrored(state, most_j);
    let part = |lasts_s: f64, jerk: f64| Part {
        lasts_s,
        jerk: sign * jerk,
    };
    let none = part(0.0, 0.0);
    if held.lasts_s > short_s {
        // The acceleration stays where it is, in place of falling a little.
        let held_s = (v - a * a / (2.0 * most_j)) / -a;
        return Some([none, part(held_s, 0.0), part(-a / most_j, most_j)]);
    }
    if held.lasts_s > 0.0 {
        // It turns at its limit, at a little less jerk.
        let jerk = (most_a * most_a - 0.5 * a * a) / v;
        return Some([
            part((a + most_a) / jerk, -jerk),
            none,
            part(most_a / jerk, jerk),
        ]);
    }
    if a > 0.0 {
        // It rises at less jerk after it has fallen.
        let over = a - 0.5 * most_j * short_s;
        let left = v + 0.5 * a * short_s;
        let falls_s = (over + (over * over + 2.0 * most_j * left).max(0.0).sqrt()) / most_j;
        let jerk = (most_j * falls_s - a) / short_s;
        let rises = falls_s > 0.0 && (0.0..=most_j).contains(&jerk);
        return rises.then_some([part(falls_s, -most_j), none, part(short_s, jerk)]);
    }
    // It falls at less jerk before it rises.
    let left = v + 0.5 * a * short_s;
    let depth = (0.25 * short_s * short_s + 2.0 * left / most_j).sqrt() - 0.5 * short_s;
    let deepest = -most_j * depth;
    let jerk = (deepest - a) / short_s;
    Some([part(short_s, jerk), none, part(depth, most_j)])
}

/// A velocity and an acceleration with the sign by which velocity is left where the acceleration alone is brought to 0, and that sign.
fn mirrored([v, a]: [f64; 2], most_j: f64) -> (f64, [f64; 2]) {
    let left = v + a * a.abs() / (2.0 * most_j);
    let sign = if left < 0.0 { -1.0 } else { 1.0 };
    (sign, [sign * v, sign * a])
}

/// The fastest stop of a velocity and an acceleration in one dimension, at an acceleration and a jerk of at most these.
pub(super) fn fastest(state: [f64; 2], [most_a, most_j]: [f64; 2]) -> Option<[Part; 3]> {
    if most_j <= 0.0 || most_a <= 0.0 {
        return None;
    }
    let (sign, [v, a]) = mirrored(state, most_j);
    let turn = (most_j * v + 0.5 * a * a).max(0.0).sqrt();
    let least = turn.min(most_a.max(-a));
    let fallen = (a * a - 2.0 * least * least) / (2.0 * most_j);
    let part = |lasts_s: f64, jerk: f64| Part {
        lasts_s: lasts_s.max(0.0),
        jerk: sign * jerk,
    };
    let held_s = if least < turn {
        (v + fallen) / least
    } else {
        0.0
    };
    Some([
        part((a + least) / most_j, -most_j),
        part(held_s, 0.0),
        part(least / most_j, most_j),
    ])
}
