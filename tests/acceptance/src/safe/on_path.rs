//! How far set-points are from a path, whatever the path time at which they were sent.

use pcc_model::{Configuration, Robot};
use shared_types::message::Cycle;
use trajectory::{Knot, Trajectory};

/// How far the path time of a cycle may be from where the one before was found, s: a bracket that the nearest place is in.
const AROUND_S: f64 = 0.05;
/// Parts of the bracket of which the nearest one is searched.
const PARTS: usize = 32;
/// Steps of the search: 0.618 to this power is beyond the resolution of the numbers.
const STEPS: usize = 70;
/// Nearer than this is on the path, rad.
const ON_IT_RAD: f64 = 1e-12;

/// A path that set-points are held against one after the other.
pub(crate) struct Along<'a> {
    robot: &'a Robot,
    path: &'a Trajectory,
    /// Path time of the last set-point, s.
    time_s: f64,
    stamp_ns: Option<i64>,
}

/// Where a set-point is.
pub(crate) struct Nearest {
    /// Path time of the nearest place, s.
    pub(crate) time_s: f64,
    /// Distance from it, rad.
    pub(crate) distance_rad: f64,
}

impl<'a> Along<'a> {
    pub(crate) fn new(robot: &'a Robot, path: &'a Trajectory) -> Self {
        Self {
            robot,
            path,
            time_s: 0.0,
            stamp_ns: None,
        }
    }

    /// The nearest place of the path that is at most about as far on as time has passed.
    pub(crate) fn nearest(&mut self, cycle: &Cycle) -> Nearest {
        let stamp_ns = cycle.stamp_mono_ns;
        let passed_s = (stamp_ns - self.stamp_ns.unwrap_or(stamp_ns)) as f64 * 1e-9;
        self.stamp_ns = Some(stamp_ns);
        // Beyond its ends the path rests: a search there cannot tell which way to go.
        let within = |time_s: f64| time_s.clamp(0.0, self.path.duration());
        let around = [self.time_s - AROUND_S, self.time_s + passed_s + AROUND_S];
        let mut bracket = self.bracket(cycle, around.map(within));
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        for _ in 0..STEPS {
            let [from, to] = bracket;
            let inner = [to - golden * (to - from), from + golden * (to - from)];
            let [first, second] = inner.map(|time_s| self.distance_at(cycle, time_s));
            bracket = if first < second {
                [from, inner[1]]
            } else {
                [inner[0], to]
            };
            // The place itself, not the middle of what is left of the bracket.
            self.time_s = if first < second { inner[0] } else { inner[1] };
            if first.min(second) < ON_IT_RAD {
                break;
            }
        }
        Nearest {
            time_s: self.time_s,
            distance_rad: self.distance_at(cycle, self.time_s),
        }
    }

    /// The part around the nearest of some places between two path times: a path that turns back has more than one that is nearer than those
    /// beside it.
    fn bracket(&self, cycle: &Cycle, [from, to]: [f64; 2]) -> [f64; 2] {
        let step_s = (to - from) / PARTS as f64;
        let time = |part: usize| from + step_s * part as f64;
        let distance = |part: &usize| self.distance_at(cycle, time(*part));
        let nearest = (0..=PARTS).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let nearest = nearest.unwrap_or(0);
        [
            time(nearest.saturating_sub(1)),
            time((nearest + 1).min(PARTS)),
        ]
    }

    /// Of all tendons, each in the angle that turns it by as much.
    fn distance_at(&self, cycle: &Cycle, time_s: f64) -> f64 {
        let shape: Configuration = on_curve(self.path.knots(), time_s);
        let tendons = &self.robot.tendons;
        let angle = |tendon: usize| {
            let row = tendons.matrix().row(tendon);
            (cycle.setpoint_m[tendon] - row.dot(&shape.transpose())) / row.norm()
        };
        let squares = (0..tendons.count()).map(|tendon| angle(tendon).powi(2));
        squares.sum::<f64>().sqrt()
    }
}

/// The quintic through two knots by its power series (Hermite), at rest beyond the ends.
pub(super) fn on_curve(knots: &[Knot], time: f64) -> Configuration {
    let after = knots.partition_point(|knot| knot.time <= time);
    if after == 0 {
        return knots[0].position;
    }
    if after == knots.len() {
        return knots[after - 1].position;
    }
    let (from, to) = (&knots[after - 1], &knots[after]);
    let h = to.time - from.time;
    let u = (time - from.time) / h;
    let (v0, v1) = (from.velocity * h, to.velocity * h);
    let (a0, a1) = (from.acceleration * (h * h), to.acceleration * (h * h));
    let way = to.position - from.position;
    let cubic = way * 10.0 - v0 * 6.0 - v1 * 4.0 - a0 * 1.5 + a1 * 0.5;
    let quartic = way * -15.0 + v0 * 8.0 + v1 * 7.0 + a0 * 1.5 - a1;
    let quintic = way * 6.0 - (v0 + v1) * 3.0 - (a0 - a1) * 0.5;
    let high = cubic + (quartic + quintic * u) * u;
    from.position + (v0 + (a0 * 0.5 + high * u) * u) * u
}
