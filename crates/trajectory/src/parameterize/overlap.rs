//! A path that begins while the robot still brakes straight ahead: both share the tendons' limits.

use crate::limits::tendon_rows::{LANES, Lanes, TendonRows, lanes};
use crate::parameterize::interval::Interval;
use crate::scaling::stopping::Braking;

/// Halvings of a speed that the velocity limit does not allow.
const BISECTIONS: usize = 14;

/// A braking in tendon space, ÷ the acceleration limit.
#[derive(Clone, Debug)]
pub(crate) struct Overlap {
    braking: Braking,
    /// Tendon velocities at its begin, block by block, s.
    velocity: Vec<Lanes>,
    /// The acceleration of the tendons before it, block by block.
    before: Vec<Lanes>,
}

/// An interval of the path's grid that is passed while the robot brakes.
pub(super) struct Step<'a> {
    pub(super) interval: Interval<'a>,
    /// When it begins, s after the braking does.
    pub(super) time: f64,
    /// Its length in s, rad.
    pub(super) length: f64,
    /// ṡ² at its begin.
    pub(super) x: f64,
    /// The velocity limit ÷ the acceleration limit, s.
    pub(super) largest_speed: f64,
}

impl Step<'_> {
    /// How long it takes with this ṡ² at its end, s.
    pub(super) fn duration(&self, next: f64) -> f64 {
        2.0 * self.length / (self.x.sqrt() + next.sqrt())
    }
}

impl Overlap {
    pub(crate) fn of(braking: Braking, rows: &TendonRows, acceleration_limit: f64) -> Self {
        let of_blocks = |vector| {
            let blocks = rows.blocks().iter();
            blocks
                .map(|block| lanes(|lane| block.times(vector)[lane] / acceleration_limit))
                .collect()
        };
        Self {
            velocity: of_blocks(&braking.velocity),
            before: of_blocks(&braking.before),
            braking,
        }
    }

    /// Its duration before averaging, s.
    pub(crate) fn duration(&self) -> f64 {
        self.braking.duration
    }

    /// Tendon accelerations while it brakes, of a block.
    pub(crate) fn force(&self, block: usize) -> Lanes {
        lanes(|lane| -self.velocity[block][lane] / self.braking.duration)
    }

    /// Tendon accelerations before it brakes, of a block.
    pub(crate) fn force_before(&self, block: usize) -> Lanes {
        self.before[block]
    }

    /// The largest ṡ² up to `most` at the end of a step for which the sum of both keeps the limits; none where even the least does not.
    pub(super) fn largest_second(&self, step: &Step<'_>, most: f64) -> Option<f64> {
        let (mut least, mut largest) = (0.0, most);
        for (block, normals) in step.interval.normals().enumerate() {
            let force = self.force(block);
            for [first, second] in &normals {
                for lane in 0..LANES {
                    let rest = force[lane] + first[lane] * step.x;
                    let bounds = [-1.0 - rest, 1.0 - rest].map(|bound| bound / second[lane]);
                    if second[lane] != 0.0 {
                        least = f64::max(least, bounds[0].min(bounds[1]));
                        largest = f64::min(largest, bounds[0].max(bounds[1]));
                    } else if rest.abs() > 1.0 {
                        return None;
                    }
                }
            }
        }
        if largest < least {
            return None;
        }
        if self.keeps_velocity(step, largest) {
            return Some(largest);
        }
        if !self.keeps_velocity(step, least) {
            return None;
        }
        let (mut within, mut beyond) = (least, largest);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (within + beyond);
            if self.keeps_velocity(step, middle) {
                within = middle;
            } else {
                beyond = middle;
            }
        }
        Some(within)
    }

    /// Whether the sum of both keeps the velocity limit at the end of a step with this ṡ² there.
    fn keeps_velocity(&self, step: &Step<'_>, next: f64) -> bool {
        let time = step.time + step.duration(next);
        let (limit, speed) = (step.largest_speed, next.sqrt());
        step.interval.to.iter().enumerate().all(|(block, to)| {
            (0..LANES).all(|lane| {
                let own = to.slope[lane] * speed;
                let from = self.velocity[block][lane];
                let least = own + self.velocity_at(block, lane, time);
                // Before averaging, the braking of a state that still accelerates may exceed the limit, which its average keeps.
                let is_faster = from.abs() > limit && own * from > 0.0;
                let most = if is_faster {
                    own.abs() + self.largest_mean_after(block, lane, time)
                } else {
                    least.abs()
                };
                most <= limit
            })
        })
    }

    /// Velocity of a tendon while it brakes, before averaging, s.
    fn velocity_at(&self, block: usize, lane: usize, time: f64) -> f64 {
        self.velocity[block][lane] * (1.0 - time / self.braking.duration).max(0.0)
    }

    /// The largest magnitude of a tendon's averaged velocity from a time on, s.
    fn largest_mean_after(&self, block: usize, lane: usize, time: f64) -> f64 {
        let (width, duration) = (self.braking.width(), self.braking.duration);
        let from = self.velocity[block][lane];
        let before = self.before[block][lane] * from.signum();
        let braked = from.abs() / duration;
        let peak = width * before.max(0.0) / (before + braked);
        let time = time.max(peak).min(duration);
        if time < width {
            let at_begin = from.abs() - 0.5 * before * width;
            at_begin + time * (before - (before + braked) * 0.5 * time / width)
        } else {
            from.abs() - braked * (time - 0.5 * width)
        }
    }
}
