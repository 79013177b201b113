//! Placement of knots: at which instants of a smooth motion they are.
//!
//! A quarter of the knots is laid evenly. Then the worst segment is divided, again and again: the one that exceeds its
//! limits most or leaves the motion most. It is divided where the motion's jerk steps most inside it: a quintic
//! cannot follow a step of jerk within a segment without exceeding it, wherever the segment's ends are, but
//! follows the motion closely between steps.

use crate::limits::control::TendonKnot;
use crate::limits::limit_use::{exact_time_scale, time_scale_bounds};
use crate::limits::tendon_rows::TendonRows;
use crate::parameterize::jerk::TimedPath;
use crate::parameterize::topp::SpeedProfile;
use crate::{Knot, QuinticSegment};
use pcc_model::TendonLimits;

/// A segment that needs this part more time to keep its limits is as bad as one that is
/// [`POSITION_TOLERANCE`] off; better ones are left as they are.
const TIME_TOLERANCE: f64 = 0.002;
/// Distance between a segment's middle and the motion that counts as bad, rad.
const POSITION_TOLERANCE: f64 = 1e-3;
/// No segment becomes shorter than this part of the mean segment, but for one that ends at a jerk step.
const SHORTEST_PART: f64 = 0.2;
/// No segment becomes shorter than this part of the mean segment: two jerk steps may almost coincide, and the
/// segment that holds one of them exceeds the limit however short it is.
const SHORTEST_PART_AT_STEP: f64 = 0.01;
/// A jerk step is preferred to the middle of a segment from this acceleration step on, ÷ limit.
const NOTABLE_STEP: f64 = 0.05;

/// A motion that knots are to follow: what describes it, the limits, and how many knots there may be.
pub(crate) struct Target<'a> {
    pub(crate) profile: &'a SpeedProfile,
    pub(crate) motion: &'a TimedPath,
    pub(crate) rows: &'a TendonRows,
    pub(crate) limits: &'a TendonLimits,
    /// The states in which the motion begins and ends, exactly.
    pub(crate) ends: [Knot; 2],
    pub(crate) knots: usize,
}

/// A time at which the averaged motion's jerk steps, with the acceleration step behind it ÷ limit.
#[derive(Clone, Copy, Debug)]
struct JerkStep {
    time: f64,
    size: f64,
}

/// Two knots, by index, that follow each other.
#[derive(Clone, Copy, Debug)]
struct Segment {
    from: usize,
    to: usize,
    duration: f64,
    /// Bounds of the factor by which the segment's times must grow: see [`time_scale_bounds`].
    time_scale: [f64; 2],
    /// Upper bound of the distance of the segment's middle from the motion, rad.
    distance: f64,
    /// The larger of the segment's excess time and distance, each ÷ its tolerance.
    badness: f64,
}

/// The chosen knots, and the memory to choose them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Placement {
    /// The shortest segment, s, and the shortest that may end at a jerk step.
    shortest: f64,
    shortest_at_step: f64,
    steps: Vec<JerkStep>,
    knots: Vec<Knot>,
    /// The knots in tendon space, block by block.
    tendon_knots: Vec<TendonKnot>,
    segments: Vec<Segment>,
}

impl Placement {
    /// Chooses the knots of the target's averaged motion. The result is the factor by which all
    /// times must be multiplied for the limits to be kept and one of them to be used fully.
    pub(crate) fn place(&mut self, target: &Target) -> f64 {
        let mean = (target.motion.duration() + target.motion.width()) / target.knots as f64;
        let rounding = rounding_time(target);
        self.shortest = rounding.max(SHORTEST_PART * mean);
        self.shortest_at_step = rounding.max(SHORTEST_PART_AT_STEP * mean);
        self.find_steps(target);
        self.lay_evenly(target);
        while self.knots.len() < target.knots && self.divide_worst(target) {}
        self.time_scale(target)
    }

    fn time_scale(&self, target: &Target) -> f64 {
        let known = self.segments.iter().map(|segment| segment.time_scale[0]);
        let least = known.fold(0.0, f64::max);
        self.segments.iter().fold(least, |least, segment| {
            if least > 0.0 && segment.time_scale[1] <= least {
                return least;
            }
            let [from, to] = [segment.from, segment.to].map(|end| self.tendon_knot(target, end));
            exact_time_scale(from, to, segment.duration, target.limits, least)
        })
    }

    pub(crate) fn knots(&self) -> Vec<Knot> {
        let mut knots = self.knots.clone();
        knots.sort_unstable_by(|a, b| a.time.total_cmp(&b.time));
        knots
    }

    fn push_knot(&mut self, target: &Target, knot: Knot) {
        self.knots.push(knot);
        for block in target.rows.blocks() {
            self.tendon_knots.push(TendonKnot::of(block, &knot));
        }
    }

    fn tendon_knot(&self, target: &Target, index: usize) -> &[TendonKnot] {
        let blocks = target.rows.blocks().len();
        &self.tendon_knots[index * blocks..(index + 1) * blocks]
    }

    /// The segment between two knots, `distance` rad from the motion in its middle.
    fn segment(&self, target: &Target, [from, to]: [usize; 2], distance: f64) -> Segment {
        let duration = self.knots[to].time - self.knots[from].time;
        let time_scale = time_scale_bounds(
            self.tendon_knot(target, from),
            self.tendon_knot(target, to),
            duration,
            target.limits,
        );
        let excess = time_scale[0] - 1.0;
        Segment {
            from,
            to,
            duration,
            time_scale,
            distance,
            badness: (excess / TIME_TOLERANCE).max(distance / POSITION_TOLERANCE),
        }
    }

    /// How far the middle of the segment between two knots is from the motion, rad.
    fn distance(&self, target: &Target, [from, to]: [usize; 2]) -> f64 {
        let (first, last) = (&self.knots[from], &self.knots[to]);
        let time = 0.5 * (first.time + last.time);
        let middle = target.motion.mean_position(time);
        (QuinticSegment::between(first, last).middle() - middle).norm()
    }

    fn find_steps(&mut self, target: &Target) {
        self.steps.clear();
        let changes = target
            .motion
            .path_acceleration_steps()
            .zip(target.profile.steepness());
        for ((time, path_acceleration), steepness) in changes {
            let size = path_acceleration.abs() * steepness;
            if size > NOTABLE_STEP {
                self.steps.extend([
                    JerkStep { time, size },
                    JerkStep {
                        time: time + target.motion.width(),
                        size,
                    },
                ]);
            }
        }
        for time in target.motion.braking_times() {
            self.steps.push(JerkStep { time, size: 1.0 });
        }
        self.steps
            .sort_unstable_by(|a, b| a.time.total_cmp(&b.time));
    }

    fn lay_evenly(&mut self, target: &Target) {
        let total = target.motion.duration() + target.motion.width();
        let count = (total / self.shortest)
            .min((target.knots / 4) as f64)
            .max(1.0) as usize;
        self.knots.clear();
        self.tendon_knots.clear();
        let [start, end] = target.ends;
        self.push_knot(target, start);
        for i in 1..count {
            let time = total * (i as f64 / count as f64);
            self.push_knot(target, target.motion.averaged(time));
        }
        self.push_knot(target, end);
        self.segments.clear();
        for i in 0..count {
            let ends = [i, i + 1];
            let segment = self.segment(target, ends, self.distance(target, ends));
            self.segments.push(segment);
        }
    }

    /// Divides the worst segment; false if there is none that is bad enough and can be divided.
    fn divide_worst(&mut self, target: &Target) -> bool {
        let mut worst = None;
        let mut most = 1.0;
        for (i, segment) in self.segments.iter().enumerate() {
            if segment.badness > most {
                (worst, most) = (Some(i), segment.badness);
            }
        }
        let Some(worst) = worst else { return false };
        let Segment {
            from, to, distance, ..
        } = self.segments[worst];
        let Some(time) = self.divide_at(self.knots[from].time, self.knots[to].time) else {
            self.segments[worst].badness = 0.0;
            return true;
        };
        let middle = self.knots.len();
        self.push_knot(target, target.motion.averaged(time));
        let parts = [[from, middle], [middle, to]].map(|ends| {
            // A part is closer than the whole.
            let is_close = distance <= POSITION_TOLERANCE;
            let distance = if is_close {
                distance
            } else {
                self.distance(target, ends)
            };
            self.segment(target, ends, distance)
        });
        self.segments[worst] = parts[0];
        self.segments.push(parts[1]);
        true
    }

    /// Where to divide between two times, s: at the largest jerk step, else in the middle; nowhere if that is too near.
    fn divide_at(&self, from: f64, to: f64) -> Option<f64> {
        let (earliest, latest) = (from + self.shortest_at_step, to - self.shortest_at_step);
        let first = self.steps.partition_point(|step| step.time < earliest);
        let after = self.steps.partition_point(|step| step.time <= latest);
        let inside = self.steps.get(first..after).unwrap_or_default();
        let largest = inside.iter().max_by(|a, b| a.size.total_cmp(&b.size));
        let middle = (to - from > 2.0 * self.shortest).then_some(0.5 * (from + to));
        largest.map(|step| step.time).or(middle)
    }
}

/// The segment duration, s, below which the rounding of positions alone would cause 1 % of the motion's jerk bound.
///
/// A quintic's jerk is up to 60 ÷ h³ times a displacement.
fn rounding_time(target: &Target) -> f64 {
    let gain = target.rows.gain();
    let rounding = 4.0 * f64::EPSILON * target.motion.largest_position() * gain;
    let jerk_bound = 2.0 * target.limits.acceleration / target.motion.width();
    (60.0 * rounding / (0.01 * jerk_bound)).cbrt()
}
