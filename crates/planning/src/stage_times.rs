//! The time that each stage of a request takes.

use codes::Stage;
use std::ops::{Index, IndexMut};
use std::time::Instant;

/// Time of each [`Stage`], seconds: wall time of a request, or time on its worker of one path. Waiting and writing are not planning's.
///
/// Paths go from sampling through correction, time parameterization and certification to their figures without waiting for each
/// other, several at once: the wall time of all is divided among these stages by the time that each took on the workers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes([f64; Stage::ALL.len()]);

impl Index<Stage> for StageTimes {
    type Output = f64;

    fn index(&self, stage: Stage) -> &f64 {
        &self.0[stage as usize]
    }
}

impl IndexMut<Stage> for StageTimes {
    fn index_mut(&mut self, stage: Stage) -> &mut f64 {
        &mut self.0[stage as usize]
    }
}

impl StageTimes {
    /// Does some work, and adds its wall time to a stage.
    pub(crate) fn measure<T>(&mut self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let clock = Instant::now();
        let made = work();
        self[stage] += clock.elapsed().as_secs_f64();
        made
    }

    /// Adds the times of another path, each multiplied by `scale`.
    pub(crate) fn add(&mut self, scale: f64, other: &Self) {
        for (time, more) in self.0.iter_mut().zip(other.0) {
            *time += scale * more;
        }
    }

    /// Adds `wall_s` seconds of wall time to the stages, in proportion to the worker time that `paths` spent in each.
    pub(crate) fn share(&mut self, wall_s: f64, paths: impl Iterator<Item = Self>) {
        let mut spent = Self::default();
        paths.for_each(|path| spent.add(1.0, &path));
        let total: f64 = spent.0.iter().sum();
        self.add(wall_s / total.max(f64::MIN_POSITIVE), &spent);
    }
}

/// A clock that tells the seconds since the lap before; the first lap begins with the clock.
pub(crate) struct Stopwatch(Instant);

impl Stopwatch {
    /// A clock that runs from now on.
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since the lap before, or since the start.
    pub(crate) fn lap(&mut self) -> f64 {
        let now = Instant::now();
        (now - std::mem::replace(&mut self.0, now)).as_secs_f64()
    }
}
