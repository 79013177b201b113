//! Stops in three parts of constant jerk, which last equally long for all tendons.
//!
//! Given how long they last, the acceleration at the end of the first part, the peak, determines the stop, and what a tendon allows of it is a slab:
//! an interval in that tendon's direction. A peak within all slabs is found by alternating projections onto convex sets. They begin in the plane of
//! velocity and acceleration: with the peak of the least jerk, moved to the middle of what the slowest tendon allows. The parts last as those of the
//! slowest tendon's own fastest stop, and where no stop of the whole robot is as fast, a pattern search changes their shares.

use crate::limits::tendon_rows::TendonRows;
use crate::{Knot, LimitUse, Trajectory};
use pcc_model::{Configuration, TendonLimits};

/// A limit that is exceeded by this part of itself or less is kept: that much is rounding.
const ROUNDING: f64 = 2e-7;
/// Part of a limit by which stops are planned beyond it, below [`ROUNDING`], so that the fastest stop of a tendon leaves its slab a width.
const ALLOWED: f64 = 1e-7;
/// Rounding of a position, rad.
const POSITION_ROUNDING_RAD: f64 = 1e-15;
/// Stops are at least so long, in times in which the acceleration rises to its limit: less is nothing to win, and knots keep apart.
const SHORTEST_STOP: f64 = 1e-3;
/// Share of its stop below which a part of the slowest tendon's is left out, in the first and in the second try.
const SHORT_PARTS: [f64; 2] = [0.02, SHORTEST_PART];
/// Share of a stop that each part has at least, so that knots keep apart.
const SHORTEST_PART: f64 = 0.001;
/// Durations that differ by this part of themselves or less count as equal.
const RESOLVED: f64 = 5e-7;
/// Longest duration tried ÷ that of the averaged stop.
const LONGEST_TRIED: f64 = 2.0;
/// Halvings of the interval in which the shortest duration lies.
const HALVINGS: usize = 14;
/// By how much the shares of the parts are changed at first, and at last.
const STEPS: [f64; 2] = [0.1, 0.001];
/// Changes of the shares at most.
const CHANGES: usize = 80;
/// Rounds of projections.
const ROUNDS: usize = 60;
/// Share of a slab's width by which a projection leads into it.
const INSET: f64 = 0.02;

/// A tendon that is to come to rest.
struct Tendon {
    row: Configuration,
    velocity_m_s: f64,
    acceleration_m_s2: f64,
    /// How long the parts of its own fastest stop last, s.
    fastest_s: [f64; 3],
}

/// What a tendon allows of the peak.
struct Slab<'a> {
    row: &'a Configuration,
    between_m_s2: [f64; 2],
}

/// The limits of a tendon, of the jerk in each part.
struct Limits {
    acceleration: f64,
    jerk: [f64; 3],
}

/// A robot that is to come to rest.
struct Stop<'a> {
    from: &'a Knot,
    rows: &'a TendonRows,
    /// The most that a length changes per rad, m.
    gain_m: f64,
    limits: &'a TendonLimits,
    /// Velocity ÷ its limit at most.
    velocity_use: f64,
    /// The slowest one first.
    tendons: Vec<Tendon>,
}

/// The shortest stop so far, or what it has to be shorter than.
struct Best {
    shares: [f64; 3],
    lasts_s: f64,
    motion: Option<Trajectory>,
}

/// The shortest stop in three parts that is found from where another stop begins, at time 0, if it is shorter than that one. The limits of
/// acceleration and jerk are kept, and that of velocity as far as the other stop keeps it.
pub(super) fn three_part_stop(
    other: &Trajectory,
    rows: &TendonRows,
    limits: &TendonLimits,
) -> Option<Trajectory> {
    let from = &other.knots()[0];
    let used = LimitUse::default().raised_by_motion(other, rows, limits);
    let stop = Stop {
        from,
        rows,
        gain_m: rows.gain(),
        limits,
        velocity_use: used.velocity.max(1.0) + ROUNDING,
        tendons: slowest_first(from, rows, limits),
    };
    // Shares that are good for a longer stop lead to those of the shortest one.
    let found = stop.shortest(LONGEST_TRIED * other.duration())?;
    (found.duration() < other.duration()).then_some(found)
}

fn slowest_first(from: &Knot, rows: &TendonRows, limits: &TendonLimits) -> Vec<Tendon> {
    let tendon = |row: Configuration| {
        let velocity_m_s = row.dot(&from.velocity);
        let acceleration_m_s2 = row.dot(&from.acceleration);
        let state = [velocity_m_s, acceleration_m_s2];
        Tendon {
            row,
            velocity_m_s,
            acceleration_m_s2,
            fastest_s: fastest_s(state, [limits.acceleration, limits.jerk]),
        }
    };
    let mut tendons: Vec<Tendon> = rows.rows().map(tendon).collect();
    tendons.sort_by(|a, b| b.least_s().total_cmp(&a.least_s()));
    tendons
}

impl Tendon {
    /// Duration of its fastest stop, s.
    fn least_s(&self) -> f64 {
        self.fastest_s.iter().sum()
    }
}

impl Stop<'_> {
    /// The stop with the shares of the slowest tendon's parts, or with those that a pattern search from there finds.
    fn shortest(&self, longest_s: f64) -> Option<Trajectory> {
        let slowest = self.tendons.first()?;
        let shortest_s = SHORTEST_STOP * self.limits.acceleration / self.limits.jerk;
        let least_s = slowest.least_s().max(shortest_s);
        let [long_parts, all_parts] = SHORT_PARTS.map(|short| shares(slowest.fastest_s, short));
        let mut best = Best {
            shares: long_parts?,
            lasts_s: longest_s,
            motion: None,
        };
        self.improve(&mut best, least_s, long_parts);
        self.improve(
            &mut best,
            least_s,
            all_parts.filter(|_| all_parts != long_parts),
        );
        let ([mut step, last_step], mut changes) = (STEPS, 0);
        while step > last_step
            && changes < CHANGES
            && best.lasts_s > least_s * (1.0 + 2.0 * RESOLVED)
        {
            let changed = neighbours(best.shares, step);
            if self.improve(&mut best, least_s, changed) {
                changes += 1;
            } else {
                step *= 0.5;
            }
        }
        best.motion
    }

    /// Replaces the best stop by that with the first of these shares with which it is shorter, if there is one.
    fn improve(
        &self,
        best: &mut Best,
        least_s: f64,
        tried: impl IntoIterator<Item = [f64; 3]>,
    ) -> bool {
        tried.into_iter().any(|shares| {
            let found = self.shortest_between(least_s, best.lasts_s, shares);
            let is_shorter = found.is_some();
            if let Some(motion) = found {
                *best = Best {
                    shares,
                    lasts_s: motion.duration(),
                    motion: Some(motion),
                };
            }
            is_shorter
        })
    }

    /// The shortest stop with these shares between two durations; none where neither the shorter one nor one just below the longer one has a
    /// stop.
    fn shortest_between(
        &self,
        least_s: f64,
        longest_s: f64,
        shares: [f64; 3],
    ) -> Option<Trajectory> {
        let longest_s = longest_s * (1.0 - RESOLVED);
        if least_s > longest_s {
            return None;
        }
        if let Some(soonest) = self.lasting(least_s, shares) {
            return Some(soonest);
        }
        let (mut too_short_s, mut found) = (least_s, self.lasting(longest_s, shares)?);
        for _ in 0..HALVINGS {
            let middle_s = 0.5 * (too_short_s + found.duration());
            match self.lasting(middle_s, shares) {
                Some(shorter) => found = shorter,
                None => too_short_s = middle_s,
            }
        }
        Some(found)
    }

    /// The stop of this duration with these shares, if one is found that keeps the limits.
    fn lasting(&self, duration_s: f64, shares: [f64; 3]) -> Option<Trajectory> {
        let parts_s = shares.map(|share| share * duration_s);
        let limits = Limits {
            acceleration: self.limits.acceleration * (1.0 + ALLOWED),
            jerk: parts_s.map(|lasts_s| {
                let rounding = self.gain_m * POSITION_ROUNDING_RAD * 60.0 / lasts_s.powi(3);
                self.limits.jerk * (1.0 + ALLOWED) - rounding
            }),
        };
        let slab = |tendon| {
            let between_m_s2 = allowed_peaks(tendon, &limits, parts_s)?;
            let row = &tendon.row;
            Some(Slab { row, between_m_s2 })
        };
        let slabs: Vec<Slab> = self.tendons.iter().map(slab).collect::<Option<_>>()?;
        let begin = least_jerk_peak(self.from, &self.tendons[0], slabs[0].between_m_s2, parts_s);
        let motion = in_knots(self.from, project_onto(&slabs, begin)?, parts_s)?;
        let most = LimitUse::default().raised_by_motion(&motion, self.rows, self.limits);
        let is_kept = most.acceleration.max(most.jerk) <= 1.0 + ROUNDING
            && most.velocity <= self.velocity_use;
        is_kept.then_some(motion)
    }
}

/// The shares of a stop that its parts last: where one is short, the longest of the others is divided. None of a stop that takes no time.
fn shares(parts_s: [f64; 3], short: f64) -> Option<[f64; 3]> {
    let sum_s: f64 = parts_s.iter().sum();
    let shares = parts_s.map(|lasts_s| lasts_s / sum_s);
    let lasting = shares.into_iter().filter(|share| *share >= short);
    let mut lasting: Vec<f64> = lasting.collect();
    while lasting.len() < shares.len() {
        let places = 0..lasting.len();
        let longest = places.max_by(|a, b| lasting[*a].total_cmp(&lasting[*b]))?;
        lasting[longest] *= 0.5;
        lasting.insert(longest, lasting[longest]);
    }
    let sum: f64 = lasting.iter().sum();
    Some([0, 1, 2].map(|part| lasting[part] / sum))
}

/// Shares of which one has more by a step and another one less.
fn neighbours(shares: [f64; 3], step: f64) -> impl Iterator<Item = [f64; 3]> {
    let pairs = [[0, 1], [1, 0], [2, 1], [1, 2], [0, 2], [2, 0]];
    let moved = pairs.into_iter().map(move |[more, less]| {
        let mut moved = shares;
        moved[more] += step;
        moved[less] -= step;
        moved
    });
    moved.filter(|shares| shares.iter().all(|share| *share >= SHORTEST_PART))
}

/// The peaks with which a tendon keeps its limits.
fn allowed_peaks(tendon: &Tendon, limits: &Limits, parts_s: [f64; 3]) -> Option<[f64; 2]> {
    let [first_s, second_s, third_s] = parts_s;
    let most_a = limits.acceleration;
    let [of_first, of_second, of_third] = [0, 1, 2].map(|part| limits.jerk[part] * parts_s[part]);
    // The acceleration at the end of the second part is −(offset + slope × peak).
    let braked_s = second_s + third_s;
    let offset = (2.0 * tendon.velocity_m_s + tendon.acceleration_m_s2 * first_s) / braked_s;
    let slope = (first_s + second_s) / braked_s;
    let around =
        |centre: f64, half: f64, slope: f64| [(centre - half) / slope, (centre + half) / slope];
    let bounds = [
        around(0.0, most_a, 1.0),
        around(tendon.acceleration_m_s2, of_first, 1.0),
        around(-offset, most_a.min(of_third), slope),
        around(-offset, of_second, 1.0 + slope),
    ];
    let [lows, highs] = [0, 1].map(|end| bounds.map(|bound| bound[end]));
    let low = lows.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let high = highs.into_iter().fold(f64::INFINITY, f64::min);
    (low <= high).then_some([low, high])
}

/// The peak of the stop with the least squares of jerk, moved in the plane of velocity and acceleration to the middle of what the slowest tendon
/// allows.
fn least_jerk_peak(
    from: &Knot,
    slowest: &Tendon,
    [low, high]: [f64; 2],
    [first_s, second_s, third_s]: [f64; 3],
) -> Configuration {
    let sum_s = first_s + second_s + third_s;
    // Of the least sum of jerk² × duration the jerk of each part is linear in the time from its middle to the end.
    let gain_per_s = first_s / (first_s * sum_s + second_s * third_s);
    let by_velocity = -2.0 * gain_per_s;
    let by_acceleration = 1.0 - first_s / sum_s - sum_s * gain_per_s;
    // An acceleration, so that both can be weighed against each other.
    let deceleration = slowest.velocity_m_s / sum_s;
    let acceleration = slowest.acceleration_m_s2;
    let peak = by_velocity * slowest.velocity_m_s + by_acceleration * acceleration;
    let squares = deceleration * deceleration + acceleration * acceleration;
    let lacks = (0.5 * (low + high) - peak) / squares;
    from.velocity * (by_velocity + lacks * deceleration / sum_s)
        + from.acceleration * (by_acceleration + lacks * acceleration)
}

/// A point within all slabs, if projections from a point lead to one.
fn project_onto(slabs: &[Slab], mut point: Configuration) -> Option<Configuration> {
    for _ in 0..ROUNDS {
        let mut is_within = true;
        for slab in slabs {
            let ([low, high], value) = (slab.between_m_s2, slab.row.dot(&point));
            if (low..=high).contains(&value) {
                continue;
            }
            is_within = false;
            let inset = INSET * (high - low);
            let nearest = value.max(low + inset).min(high - inset);
            point += *slab.row * ((nearest - value) / slab.row.norm_squared());
        }
        if is_within {
            return Some(point);
        }
    }
    None
}

/// How long the acceleration falls, stays and rises in the fastest stop of a velocity and an acceleration in one dimension, at an acceleration and a
/// jerk of at most these, s.
fn fastest_s([v, a]: [f64; 2], [most_a, most_j]: [f64; 2]) -> [f64; 3] {
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

/// The stop with this peak.
fn in_knots(from: &Knot, peak: Configuration, parts_s: [f64; 3]) -> Option<Trajectory> {
    let [first_s, second_s, third_s] = parts_s;
    let left = from.velocity * 2.0 + from.acceleration * first_s + peak * (first_s + second_s);
    let second = left / -(second_s + third_s);
    let mut knots = vec![*from];
    let mut now = *from;
    let accelerations = [peak, second, Configuration::zeros()];
    for (lasts_s, acceleration) in parts_s.into_iter().zip(accelerations) {
        now = Knot {
            time: now.time + lasts_s,
            position: now.position
                + now.velocity * lasts_s
                + (now.acceleration * 2.0 + acceleration) * (lasts_s * lasts_s / 6.0),
            velocity: now.velocity + (now.acceleration + acceleration) * (0.5 * lasts_s),
            acceleration,
        };
        knots.push(now);
    }
    let end = knots.last_mut()?;
    *end = Knot::resting(end.time, end.position);
    Trajectory::new(knots).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limit_use;
    use crate::scaling::stopping::Braking;
    use crate::test_paths::{unit_limits, unit_tendons};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// The stop from a state, and its duration ÷ that of the slowest tendon's stop.
    fn stop(from: &Knot) -> (Trajectory, f64) {
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let rows = TendonRows::of(&tendons);
        let averaged = Trajectory::new(Braking::from(from, &rows, &limits).knots(*from)).unwrap();
        let of_averaged = limit_use(&averaged, &tendons, &limits).velocity;
        let motion = three_part_stop(&averaged, &rows, &limits).unwrap_or(averaged);
        let most = limit_use(&motion, &tendons, &limits);
        assert!(most.acceleration.max(most.jerk) <= 1.0 + 1e-6, "{most:?}");
        assert!(most.velocity <= of_averaged.max(1.0) + 1e-6, "{most:?}");
        assert_eq!(motion.knots()[0], *from);
        let excess = motion.duration() / slowest_first(from, &rows, &limits)[0].least_s();
        (motion, excess)
    }

    /// A state along one direction: velocity and acceleration as shares of the limits.
    fn straight(velocity: f64, acceleration: f64) -> Knot {
        let limits = unit_limits();
        let along = Configuration::from([0.3, -0.5, 0.2, 0.4, -0.1, 0.6]);
        let unit = along / TendonRows::of(&unit_tendons()).largest(&along);
        Knot {
            time: 0.0,
            position: along,
            velocity: unit * (velocity * limits.velocity),
            acceleration: unit * (acceleration * limits.acceleration),
        }
    }

    #[test]
    fn the_fastest_stop_of_a_tendon_is_known_in_simple_cases() {
        // From a velocity alone, with and without a time at the limit of the acceleration.
        assert_eq!(fastest_s([4.0, 0.0], [1.0, 1.0]), [1.0, 3.0, 1.0]);
        assert_eq!(fastest_s([-1.0, 0.0], [10.0, 1.0]), [1.0, 0.0, 1.0]);
        // From an acceleration alone, and from one that is just braked away.
        let reversing_s: f64 = fastest_s([0.0, 1.0], [9.0, 1.0]).iter().sum();
        assert!((reversing_s - (1.0 + 2.0_f64.sqrt())).abs() < 1e-12);
        assert_eq!(fastest_s([-0.5, 1.0], [2.0, 1.0]), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn along_one_direction_it_stays_straight_and_is_as_fast_as_the_limits_allow() {
        let states = [
            [1.0, 0.0],
            [1.0, 0.7],
            [0.3, -0.4],
            [0.0, 0.7],
            [0.01, 1.0],
            [-0.2, 0.9],
            [0.5, -1.0],
        ];
        for [velocity, acceleration] in states {
            let from = straight(velocity, acceleration);
            let (motion, excess) = stop(&from);
            assert!(excess <= 1.0 + 1e-6, "{velocity}, {acceleration}: {excess}");
            let way = motion.end() - from.position;
            let along = from.position.normalize();
            let aside = (way - along * way.dot(&along)).norm();
            assert!(aside < 1e-7 * way.norm(), "{aside} aside of {way}");
        }
    }

    #[test]
    fn the_end_of_a_motion_that_brakes_at_the_jerk_limit_is_its_own_stop() {
        let limits = unit_limits();
        let share = 0.6;
        let ramp_s = share * limits.acceleration / limits.jerk;
        for more in [0.0, 1e-4, 1e-3, 1e-2, -1e-6, -1e-5] {
            let velocity = 0.5 * share * limits.acceleration * ramp_s * (1.0 + more);
            let (_, excess) = stop(&straight(velocity / limits.velocity, -share));
            assert!(excess < 1.0 + 3e-3, "{more}: {excess}");
        }
    }

    #[test]
    fn velocity_and_acceleration_apart_take_little_more_than_the_slowest_tendon() {
        let mut random = Pcg64::seed_from_u64(63);
        let (rows, limits) = (TendonRows::of(&unit_tendons()), unit_limits());
        let mut vector = |limit: f64| {
            let vector = Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
            vector * (limit * random.random_range(0.0..1.0) / rows.largest(&vector))
        };
        let mut excesses: Vec<f64> = (0..1000)
            .map(|_| {
                let from = Knot {
                    time: 0.0,
                    position: vector(1.0),
                    velocity: vector(limits.velocity),
                    acceleration: vector(limits.acceleration),
                };
                stop(&from).1
            })
            .collect();
        excesses.sort_by(f64::total_cmp);
        let [most, p99] = [excesses[999], excesses[990]];
        assert!(p99 < 1.05 && most < 1.4, "p99 {p99}, at most {most}");
        let at_once = excesses.iter().filter(|it| **it < 1.0 + 2e-6).count();
        assert!(at_once > 800, "{at_once} of 1000");
    }
}
