//! Which instants of a smooth motion become knots.
//!
//! Half of the knots are laid evenly. Then the worst segment is divided, again and again: the one that exceeds its
//! limits most or leaves the motion most. It is divided where the motion's jerk steps most inside it: a quintic
//! cannot follow a step of jerk within a segment without exceeding it, wherever the segment's ends are, but
//! follows the motion closely between steps.

use crate::jerk::Motion;
use crate::limit_use::segment_use;
use crate::tendon::TendonRows;
use crate::{Knot, LimitUse, QuinticSegment};
use pcc_model::TendonLimits;

/// A segment that needs this part more time to keep its limits is as bad as one that is
/// [`POSITION_TOLERANCE`] off; better ones are left as they are.
const TIME_TOLERANCE: f64 = 0.002;
/// Distance between a segment's middle and the motion it stands for, rad.
const POSITION_TOLERANCE: f64 = 1e-3;
/// No segment becomes shorter than this part of the mean segment.
const SHORTEST_PART: f64 = 0.2;
/// A jerk step is preferred to the middle of a segment from this acceleration step on, ÷ limit.
const NOTABLE_STEP: f64 = 0.05;

/// What is to be followed, within what, by how many knots.
pub(crate) struct Target<'a> {
    pub(crate) motion: Motion<'a>,
    pub(crate) rows: &'a TendonRows,
    pub(crate) limits: &'a TendonLimits,
    pub(crate) knots: usize,
}

/// A time at which the averaged motion's jerk steps, with the acceleration step behind it ÷ limit.
#[derive(Clone, Copy, Debug)]
struct JerkStep {
    time: f64,
    size: f64,
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    from: Knot,
    to: Knot,
    limit_use: LimitUse,
    /// What is worst about it ÷ its tolerance.
    badness: f64,
}

/// The chosen knots, and the memory to choose them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Placement {
    steps: Vec<JerkStep>,
    segments: Vec<Segment>,
}

impl Target<'_> {
    fn segment(&self, width: f64, from: Knot, to: Knot) -> Segment {
        let curve = QuinticSegment::between(&from, &to);
        let limit_use = segment_use(&curve, self.rows, self.limits);
        let middle = self
            .motion
            .mean_position_until(0.5 * (from.time + to.time), width);
        let distance = (curve.evaluate(0.5 * curve.duration).position - middle).norm();
        let excess = limit_use.time_scale() - 1.0;
        let badness = (excess / TIME_TOLERANCE).max(distance / POSITION_TOLERANCE);
        Segment {
            from,
            to,
            limit_use,
            badness,
        }
    }
}

impl Placement {
    /// Chooses the knots of the target's motion averaged over `width` seconds.
    pub(crate) fn place(&mut self, target: &Target, width: f64) {
        let total = target.motion.duration() + width;
        let shortest =
            (SHORTEST_PART * total / target.knots as f64).max(rounding_time(target, width));
        self.find_steps(target, width);
        self.lay_evenly(target, width, shortest);
        while self.segments.len() + 1 < target.knots && self.divide_worst(target, width, shortest) {
        }
    }

    /// The largest use of each limit, before any scaling.
    pub(crate) fn limit_use(&self) -> LimitUse {
        self.segments
            .iter()
            .fold(LimitUse::default(), |most, segment| {
                most.raised_by(&segment.limit_use)
            })
    }

    /// Duration once scaled to keep the limits, s.
    pub(crate) fn fitted_duration(&self) -> f64 {
        self.segments.last().map_or(0.0, |segment| segment.to.time) * self.limit_use().time_scale()
    }

    pub(crate) fn knots(&self) -> Vec<Knot> {
        let mut knots = Vec::with_capacity(self.segments.len() + 1);
        knots.extend(self.segments.first().map(|segment| segment.from));
        knots.extend(self.segments.iter().map(|segment| segment.to));
        knots
    }

    fn find_steps(&mut self, target: &Target, width: f64) {
        self.steps.clear();
        for (i, &time) in target.motion.times().iter().enumerate() {
            let change = target.motion.acceleration_step(i);
            let largest = target
                .rows
                .iter()
                .map(|row| row.dot(&change).abs())
                .fold(0.0, f64::max);
            let size = largest / target.limits.acceleration;
            if size > NOTABLE_STEP {
                self.steps.extend([
                    JerkStep { time, size },
                    JerkStep {
                        time: time + width,
                        size,
                    },
                ]);
            }
        }
        self.steps
            .sort_unstable_by(|a, b| a.time.total_cmp(&b.time));
    }

    fn lay_evenly(&mut self, target: &Target, width: f64, shortest: f64) {
        let total = target.motion.duration() + width;
        let count = (total / shortest).min((target.knots / 2) as f64).max(1.0) as usize;
        self.segments.clear();
        let mut from = target.motion.start();
        for i in 1..=count {
            let is_last = i == count;
            let time = total * (i as f64 / count as f64);
            let to = if is_last {
                target.motion.end(width)
            } else {
                target.motion.averaged(width, time)
            };
            self.segments.push(target.segment(width, from, to));
            from = to;
        }
    }

    /// Divides the worst segment; false if none is bad enough or all such are short.
    fn divide_worst(&mut self, target: &Target, width: f64, shortest: f64) -> bool {
        let mut worst = None;
        let mut most = 1.0;
        for (i, segment) in self.segments.iter().enumerate() {
            if segment.badness > most && segment.to.time - segment.from.time > 2.0 * shortest {
                (worst, most) = (Some(i), segment.badness);
            }
        }
        let Some(worst) = worst else { return false };
        let Segment { from, to, .. } = self.segments[worst];
        let middle = target
            .motion
            .averaged(width, self.divide_at(from.time, to.time, shortest));
        self.segments[worst] = target.segment(width, from, middle);
        self.segments
            .insert(worst + 1, target.segment(width, middle, to));
        true
    }

    /// The largest jerk step between two times, not nearer than `shortest` to either; else their middle.
    fn divide_at(&self, from: f64, to: f64, shortest: f64) -> f64 {
        let first = self
            .steps
            .partition_point(|step| step.time < from + shortest);
        let after = self
            .steps
            .partition_point(|step| step.time <= to - shortest);
        let inside = self.steps.get(first..after).unwrap_or_default();
        let largest = inside.iter().max_by(|a, b| a.size.total_cmp(&b.size));
        largest.map_or(0.5 * (from + to), |step| step.time)
    }
}

/// The segment duration below which the rounding of positions alone would make 1 % of the motion's jerk bound.
///
/// A quintic's jerk is up to 60 ÷ h³ times a displacement.
fn rounding_time(target: &Target, width: f64) -> f64 {
    let gain = target
        .rows
        .iter()
        .map(nalgebra::Matrix::norm)
        .fold(0.0, f64::max);
    let rounding = 4.0 * f64::EPSILON * target.motion.largest_position() * gain;
    let jerk_bound = 2.0 * target.limits.acceleration / width;
    (60.0 * rounding / (0.01 * jerk_bound)).cbrt()
}
