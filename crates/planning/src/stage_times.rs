//! The time that each stage of a request takes.

use std::time::Instant;

/// Time of each stage, seconds: wall time of a request, or time on its worker of one path.
///
/// Paths go from sampling through correction, time parameterization and certification to their figures without waiting for each
/// other, several at once: the wall time of all is divided among these stages by the time that each took on the workers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Goal configurations (for diffusion: whether there is one) and features.
    pub condition: f64,
    /// The learned sampler, or the tree.
    pub sample: f64,
    /// Smoothing the tip and correction; for paths by diffusion also attaching their ends.
    pub correct: f64,
    /// Time parameterization.
    pub time: f64,
    /// Certification.
    pub certify: f64,
    /// Filling, figures of merit and selection.
    pub select: f64,
}

impl StageTimes {
    /// Adds the times of another path.
    pub(crate) fn add(&mut self, other: &Self) {
        self.add_scaled(1.0, other);
    }

    fn add_scaled(&mut self, scale: f64, other: &Self) {
        self.condition += scale * other.condition;
        self.sample += scale * other.sample;
        self.correct += scale * other.correct;
        self.time += scale * other.time;
        self.certify += scale * other.certify;
        self.select += scale * other.select;
    }

    fn total(&self) -> f64 {
        let finishing = self.correct + self.time + self.certify + self.select;
        self.condition + self.sample + finishing
    }

    /// Divides `wall_s` seconds among the stages of paths that went through them meanwhile, each with its time on its worker.
    pub(crate) fn share(&mut self, wall_s: f64, paths: impl Iterator<Item = Self>) {
        let mut spent = Self::default();
        for path in paths {
            spent.add(&path);
        }
        self.add_scaled(wall_s / spent.total().max(f64::MIN_POSITIVE), &spent);
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
