//! The width of the moving average that keeps the jerk limit.
//!
//! The averaged motion's jerk is (q̈(t) − q̈(t − τ)) / τ, so 2a/j is always wide enough; a path that nowhere brakes
//! with all its strength within τ of having accelerated so needs less. The differences are evaluated where q̈ steps
//! (between, q̈ is taken as linear in time); the fit to the limits corrects what that misses.

use crate::limits::tendon_rows::{LANES, Lanes, combined, lanes, largest_lane};
use crate::parameterize::jerk::TimedPath;
use crate::parameterize::overlap::Overlap;
use crate::parameterize::topp::SpeedProfile;
use pcc_model::TendonLimits;

/// The most widths that are tried.
const ROUNDS: usize = 3;

/// Tendon accelerations ÷ their limit at the start and the end of each piece of a motion, block by block; the first and
/// the last piece are the rests before and after it.
#[derive(Clone, Debug, Default)]
pub(crate) struct WidthSearch {
    blocks: usize,
    force: Vec<[Lanes; 2]>,
}

impl WidthSearch {
    /// The width, s, from `narrowest` to `widest` with the shortest motion of those tried, once all its times are
    /// scaled by the cube root of the jerk's excess.
    pub(crate) fn find(
        &mut self,
        profile: &SpeedProfile,
        motion: &TimedPath,
        limits: &TendonLimits,
        [narrowest, widest]: [f64; 2],
    ) -> f64 {
        self.collect(profile, motion);
        let unit = limits.acceleration / limits.jerk;
        let mut best = [f64::INFINITY, widest];
        let mut width = widest;
        for _ in 0..ROUNDS {
            let needed = unit * self.largest_difference(motion.times(), width);
            let scale = (needed / width).max(1.0).cbrt();
            let duration = scale * (motion.duration() + width);
            if duration < best[0] {
                best = [duration, width];
            }
            let next = needed.clamp(narrowest, widest);
            if next == width {
                break;
            }
            // A narrower average sees other differences, which may be larger: then half-way back.
            width = if next < width {
                next
            } else {
                0.5 * (next + width)
            };
        }
        best[1]
    }

    /// The width, s, that the jerk limit needs where a braking is added to the motion, seen with an average of `width`.
    pub(crate) fn needed_beside(
        &mut self,
        profile: &SpeedProfile,
        motion: &TimedPath,
        braking: &Overlap,
        limits: &TendonLimits,
        width: f64,
    ) -> f64 {
        self.collect(profile, motion);
        let times = self.add(braking, motion.times());
        limits.acceleration / limits.jerk * self.largest_difference(&times, width)
    }

    /// Adds a braking to the collected accelerations of a motion whose pieces begin and end at `times`; the times of the sum's.
    fn add(&mut self, braking: &Overlap, times: &[f64]) -> Vec<f64> {
        let blocks = self.blocks;
        let path = std::mem::take(&mut self.force);
        let path = |piece: usize, block: usize| path[piece * blocks + block];
        let mut all = vec![0.0];
        self.force
            .extend((0..blocks).map(|block| [braking.force_before(block); 2]));
        let mut from = 0.0;
        // Piece 0 is the rest before the path, which lasts from the braking's begin to the path's.
        for (piece, &to) in times.iter().enumerate() {
            let begin = if piece == 0 { 0.0 } else { times[piece - 1] };
            while from < to {
                let until = if from < braking.duration() {
                    to.min(braking.duration())
                } else {
                    to
                };
                let parts = [from, until].map(|time| (time - begin) / (to - begin));
                for block in 0..blocks {
                    let [first, last] = path(piece, block);
                    let force = braking.force(block);
                    self.force.push(parts.map(|part| {
                        let here = combined(&first, 1.0 - part, &last, part);
                        let more = if from < braking.duration() { 1.0 } else { 0.0 };
                        combined(&here, 1.0, &force, more)
                    }));
                }
                all.push(until);
                from = until;
            }
        }
        self.force
            .extend(std::iter::repeat_n([[0.0; LANES]; 2], blocks));
        all
    }

    fn collect(&mut self, profile: &SpeedProfile, motion: &TimedPath) {
        self.blocks = profile.derivatives(0).len();
        self.force.clear();
        let rest = std::iter::repeat_n([[0.0; LANES]; 2], self.blocks);
        self.force.extend(rest.clone());
        let squares = profile.square_speeds();
        for (i, path_acceleration) in motion.path_accelerations().enumerate() {
            let (from, to) = (profile.derivatives(i), profile.derivatives(i + 1));
            for (from, to) in from.iter().zip(to) {
                self.force.push([
                    combined(&from.slope, path_acceleration, &from.bend, squares[i]),
                    combined(&to.slope, path_acceleration, &to.bend, squares[i + 1]),
                ]);
            }
        }
        self.force.extend(rest);
    }

    /// The largest change of a tendon's acceleration ÷ its limit within `width` seconds.
    pub(crate) fn largest_difference(&self, times: &[f64], width: f64) -> f64 {
        let mut most = [0.0; LANES];
        let (mut early, mut late) = (0, 0);
        for i in 0..times.len() {
            let (before, after) = (times[i] - width, times[i] + width);
            while early + 2 < times.len() && times[early + 1] < before {
                early += 1;
            }
            while late + 2 < times.len() && times[late + 1] < after {
                late += 1;
            }
            let earlier = self.at(times, early, before);
            let later = self.at(times, late, after);
            let (ended, begun) = (self.piece(i), self.piece(i + 1));
            for block in 0..self.blocks {
                let beside = range(&earlier.force(block), &later.force(block));
                let here = range(&ended[block][1], &begun[block][0]);
                raise(&mut most, |lane| here[1][lane] - beside[0][lane]);
                raise(&mut most, |lane| beside[1][lane] - here[0][lane]);
            }
        }
        largest_lane(&most)
    }

    /// Accelerations of a piece, counted from the rest before the motion, block by block.
    fn piece(&self, piece: usize) -> &[[Lanes; 2]] {
        &self.force[piece * self.blocks..(piece + 1) * self.blocks]
    }

    /// The place at `time` in the motion's piece `piece`; as before the motion before its first piece, and at rest after the last one.
    fn at(&self, times: &[f64], piece: usize, time: f64) -> Mixture<'_> {
        let (from, to) = (times[piece], times[piece + 1]);
        let part = (time - from) / (to - from);
        let (piece, parts) = if time < from {
            (0, [1.0, 0.0])
        } else if time > to {
            (piece + 1, [0.0; 2])
        } else {
            (piece + 1, [1.0 - part, part])
        };
        Mixture {
            ends: self.piece(piece),
            parts,
        }
    }
}

/// A place on a piece of a motion.
struct Mixture<'a> {
    ends: &'a [[Lanes; 2]],
    parts: [f64; 2],
}

impl Mixture<'_> {
    #[inline(always)]
    fn force(&self, block: usize) -> Lanes {
        let [first, last] = &self.ends[block];
        combined(first, self.parts[0], last, self.parts[1])
    }
}

/// The smaller and the larger of two values, lane by lane.
#[inline(always)]
fn range(a: &Lanes, b: &Lanes) -> [Lanes; 2] {
    [
        lanes(|i| if a[i] < b[i] { a[i] } else { b[i] }),
        lanes(|i| if a[i] < b[i] { b[i] } else { a[i] }),
    ]
}

/// Raises each lane of `most` to the lane's value, where that is larger.
#[inline(always)]
fn raise(most: &mut Lanes, value: impl Fn(usize) -> f64) {
    for (lane, most) in most.iter_mut().enumerate() {
        let value = value(lane);
        *most = if value > *most { value } else { *most };
    }
}
