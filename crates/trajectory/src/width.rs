//! How wide the moving average must be for the jerk limit.
//!
//! The averaged motion's jerk is (q̈(t) − q̈(t − τ)) / τ, so 2a/j is always wide enough; a path that nowhere brakes
//! with all its strength within τ of having accelerated so needs less. The differences are looked at where q̈ steps
//! (between, q̈ is taken as linear in time); what that misses the fit to the limits makes up for.

use crate::jerk::TimedPath;
use crate::tendon::{LANES, Lanes, combined, largest_lane, raise_to_magnitude};
use crate::topp::SpeedProfile;
use pcc_model::TendonLimits;

/// How many widths are tried.
const ROUNDS: usize = 3;

/// Tendon accelerations ÷ their limit at the start and the end of each piece of a motion, block by block.
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

    fn collect(&mut self, profile: &SpeedProfile, motion: &TimedPath) {
        self.blocks = profile.derivatives(0).len();
        self.force.clear();
        let squares = profile.square_speeds();
        for (i, pull) in motion.pulls().enumerate() {
            let (from, to) = (profile.derivatives(i), profile.derivatives(i + 1));
            for (from, to) in from.iter().zip(to) {
                self.force.push([
                    combined(&from.slope, pull, &from.bend, squares[i]),
                    combined(&to.slope, pull, &to.bend, squares[i + 1]),
                ]);
            }
        }
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
            for block in 0..self.blocks {
                let earlier = self.force_at(times, early, before, block);
                let later = self.force_at(times, late, after, block);
                let here = [
                    self.force_in(i.checked_sub(1), block).map(|ends| ends[1]),
                    self.force_in((i + 1 < times.len()).then_some(i), block)
                        .map(|ends| ends[0]),
                ];
                for force in here.map(Option::unwrap_or_default) {
                    raise_to_magnitude(&mut most, &combined(&force, 1.0, &earlier, -1.0));
                    raise_to_magnitude(&mut most, &combined(&force, 1.0, &later, -1.0));
                }
            }
        }
        largest_lane(&most)
    }

    fn force_in(&self, piece: Option<usize>, block: usize) -> Option<[Lanes; 2]> {
        piece.map(|piece| self.force[piece * self.blocks + block])
    }

    /// At `time` in `piece`; 0 before the first and after the last.
    fn force_at(&self, times: &[f64], piece: usize, time: f64, block: usize) -> Lanes {
        let (from, to) = (times[piece], times[piece + 1]);
        if time < from || time > to {
            return [0.0; LANES];
        }
        let part = (time - from) / (to - from);
        let [first, last] = self.force[piece * self.blocks + block];
        combined(&first, 1.0 - part, &last, part)
    }
}
