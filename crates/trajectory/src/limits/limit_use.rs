//! How much of the tendons' limits a motion uses: exact extremes of its polynomials, no sampling.
//!
//! Along a quintic segment a tendon's velocity is quartic, its acceleration cubic and its jerk quadratic in time.
//! Each extreme is at an end of the segment or at a root of the next derivative. All of them are kept as Bézier
//! (Bernstein) control values, whose largest magnitude bounds the polynomial: a segment that cannot raise the
//! result is skipped without looking for roots.

use crate::Trajectory;
use crate::limits::control::{ControlLanes, TendonKnot};
use crate::limits::extremes::{
    extreme_of_cubic, extreme_of_quadratic, extreme_of_quartic, largest_control,
};
use crate::limits::tendon_rows::{LANES, TendonRows};
use pcc_model::{TendonLimits, TendonMap};

/// Largest |value| ÷ limit over all tendons and the whole motion, one ratio for each derivative of tendon length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LimitUse {
    /// Tendon velocity ÷ its limit.
    pub velocity: f64,
    /// Tendon acceleration ÷ its limit.
    pub acceleration: f64,
    /// Tendon jerk ÷ its limit.
    pub jerk: f64,
}

impl LimitUse {
    /// The largest of the three ratios; the motion keeps its limits if it is at most 1.
    pub fn largest(&self) -> f64 {
        self.velocity.max(self.acceleration).max(self.jerk)
    }

    /// The factor by which all times must grow to bring every ratio to at most 1: a velocity falls with the
    /// factor, an acceleration with its square, a jerk with its cube. Below 1 there is room to go faster.
    pub fn time_scale(&self) -> f64 {
        let most = self.velocity.max(self.acceleration.sqrt());
        if self.jerk > most * most * most {
            self.jerk.cbrt()
        } else {
            most
        }
    }
}

/// The exact largest use of each limit by a motion.
///
/// A limit of 0 gives 0 where nothing moves and infinity otherwise.
pub fn limit_use(motion: &Trajectory, tendons: &TendonMap, limits: &TendonLimits) -> LimitUse {
    LimitUse::default().raised_by_motion(motion, &TendonRows::of(tendons), limits)
}

impl LimitUse {
    /// The limit use of a motion whose times must grow by the factor `scale` to use each limit in full.
    pub(crate) fn at_time_scale(scale: f64) -> Self {
        Self {
            velocity: scale,
            acceleration: scale * scale,
            jerk: scale * scale * scale,
        }
    }

    /// For each limit the larger of this use and the exact use of a motion. Segments that stay below this use cost little.
    pub(crate) fn raised_by_motion(
        mut self,
        motion: &Trajectory,
        rows: &TendonRows,
        limits: &TendonLimits,
    ) -> Self {
        for segment in motion.segments() {
            let velocity = segment.velocity_control();
            for block in rows.blocks() {
                let control = ControlLanes::of(block, &velocity, segment.duration);
                self.raise(&control, limits);
            }
        }
        self
    }

    fn raise(&mut self, control: &ControlLanes, limits: &TendonLimits) {
        let ratio = |value: f64, limit: f64| if value == 0.0 { 0.0 } else { value / limit };
        let [velocity, acceleration, jerk] = control.bounds();
        if ratio(velocity, limits.velocity) > self.velocity {
            for lane in 0..LANES {
                let (v, a, j) = control.lane(lane);
                if ratio(largest_control(&v), limits.velocity) > self.velocity {
                    let most = ratio(extreme_of_quartic(&v, &a, &j), limits.velocity);
                    self.velocity = self.velocity.max(most);
                }
            }
        }
        if ratio(acceleration, limits.acceleration) > self.acceleration {
            for lane in 0..LANES {
                let (_, a, j) = control.lane(lane);
                if ratio(largest_control(&a), limits.acceleration) > self.acceleration {
                    let most = ratio(extreme_of_cubic(&a, &j), limits.acceleration);
                    self.acceleration = self.acceleration.max(most);
                }
            }
        }
        if ratio(jerk, limits.jerk) > self.jerk {
            for lane in 0..LANES {
                let (_, _, j) = control.lane(lane);
                let most = ratio(extreme_of_quadratic(&j), limits.jerk);
                self.jerk = self.jerk.max(most);
            }
        }
    }
}

/// The factor by which all times of a segment must grow for it to keep the limits: a bound from below, by samples,
/// and one from above, by control values. Both are 0 where the segment is known to keep them.
#[inline(always)]
pub(crate) fn time_scale_bounds(
    from: &[TendonKnot],
    to: &[TendonKnot],
    duration: f64,
    limits: &TendonLimits,
) -> [f64; 2] {
    let mut least = [0.0; 3];
    let mut most = [0.0; 3];
    for (from, to) in from.iter().zip(to) {
        let control = ControlLanes::between(from, to, duration);
        let bounds = control.bounds();
        let exceeds = [
            bounds[0] > limits.velocity,
            bounds[1] > limits.acceleration,
            bounds[2] > limits.jerk,
        ];
        if exceeds.contains(&true) {
            raise_each(&mut most, bounds);
            raise_each(&mut least, control.sampled(exceeds));
        }
    }
    let scale = |values: [f64; 3]| {
        let used = LimitUse {
            velocity: values[0] / limits.velocity,
            acceleration: values[1] / limits.acceleration,
            jerk: values[2] / limits.jerk,
        };
        if used.largest() > 1.0 {
            used.time_scale()
        } else {
            0.0
        }
    };
    [scale(least), scale(most)]
}

/// The exact factor by which all times of a segment must grow for it to keep the limits, if it is larger than `least`; else `least`.
pub(crate) fn exact_time_scale(
    from: &[TendonKnot],
    to: &[TendonKnot],
    duration: f64,
    limits: &TendonLimits,
    least: f64,
) -> f64 {
    let mut used = LimitUse::at_time_scale(least);
    for (from, to) in from.iter().zip(to) {
        used.raise(&ControlLanes::between(from, to, duration), limits);
    }
    used.time_scale().max(least)
}

#[inline(always)]
fn raise_each(most: &mut [f64; 3], values: [f64; 3]) {
    for (most, value) in most.iter_mut().zip(values) {
        *most = most.max(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_scale_brings_every_ratio_to_one() {
        let most = LimitUse {
            velocity: 1.5,
            acceleration: 4.0,
            jerk: 1.0,
        };
        assert_eq!(most.time_scale(), 2.0);
        assert_eq!(most.largest(), 4.0);
    }
}
