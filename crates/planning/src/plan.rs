//! What a request is answered with: draws, certified candidates, and how they came about.

use crate::path::metrics::PathMetrics;
use crate::path::waypoints::Waypoints;
use crate::stage_times::StageTimes;
use codes::Source;
use pcc_model::Configuration;
use std::sync::Arc;
use thiserror::Error;
use trajectory::Trajectory;

/// Why a draw did not become a certified motion.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Failure {
    /// No path was produced.
    #[error("no path was found")]
    NoPath,
    /// The sampled end is too far from any configuration that reaches the goal.
    #[error("does not reach the goal")]
    Goal,
    /// The motion could not be certified free of collisions.
    #[error("not certified free of collisions")]
    Collision,
    /// A section bends beyond the limit.
    #[error("bends beyond the limit")]
    Bending,
    /// No time parameterization within the limits, or not with the knots that a motion may have.
    #[error("no time parameterization within the tendon limits and the knots of a motion")]
    Time,
    /// The motion counts only if it is the fastest, and it is slower than another one.
    #[error("not the fastest")]
    Slower,
    /// The request was truncated before this draw was finished.
    #[error("truncated")]
    Truncated,
}

/// A certified motion.
#[derive(Clone, Debug)]
pub struct Certified {
    /// The curve that is executed.
    pub trajectory: Arc<Trajectory>,
    /// The motion's figures.
    pub metrics: PathMetrics,
}

/// A configuration that a motion passes on the way to its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// The configuration, radians; the motion is within 1e-3 rad of it.
    pub configuration: Configuration,
    /// Time of the motion at which it is nearest to the configuration, s.
    pub time_s: f64,
}

impl Passage {
    /// The same of a motion that begins so many seconds later.
    pub(crate) fn later(&self, by_s: f64) -> Self {
        Self {
            time_s: self.time_s + by_s,
            ..*self
        }
    }
}

/// One certified, timed motion of a plan.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The curve that is executed.
    pub trajectory: Arc<Trajectory>,
    /// The motion's figures.
    pub metrics: PathMetrics,
    /// What proposed the path.
    pub source: Source,
    /// Index of the draw that the motion came from.
    pub draw: usize,
    /// Where it passes the goals before the last, in their order.
    pub passages: Vec<Passage>,
}

impl Candidate {
    /// The certified motion of a draw with this number.
    pub(crate) fn of(draw: usize, source: Source, motion: &Certified) -> Self {
        Self {
            trajectory: Arc::clone(&motion.trajectory),
            metrics: motion.metrics,
            source,
            draw,
            passages: Vec::new(),
        }
    }

    /// Its motion.
    pub(crate) fn certified(&self) -> Certified {
        Certified {
            trajectory: Arc::clone(&self.trajectory),
            metrics: self.metrics,
        }
    }

    /// The configuration that the motion ends in, radians.
    #[must_use]
    pub fn end(&self) -> Configuration {
        self.trajectory.end()
    }
}

/// One draw, certified or not.
#[derive(Clone, Debug)]
pub struct Draw {
    /// The path before correction, if a sampler or a straight segment proposed one.
    pub sampled: Option<Waypoints>,
    /// The path after correction (64 waypoints), if one was produced.
    pub path: Option<Waypoints>,
    /// What proposed the path.
    pub source: Source,
    /// The motion, or why there is none.
    pub outcome: Result<Certified, Failure>,
}

impl Draw {
    /// A draw without a path.
    pub(crate) fn unfinished(source: Source, failure: Failure) -> Self {
        Self {
            sampled: None,
            path: None,
            source,
            outcome: Err(failure),
        }
    }

    /// Duration of its motion, s; infinite if there is none.
    pub(crate) fn duration_s(&self) -> f64 {
        let motion = self.outcome.as_ref();
        motion.map_or(f64::INFINITY, |motion| motion.metrics.duration_s)
    }
}

/// Learned draws, and how many of them are certified.
pub(crate) fn count_learned(draws: &[Draw]) -> [usize; 2] {
    let learned = draws.iter().filter(|d| d.source == Source::Learned);
    let certified = learned.clone().filter(|d| d.outcome.is_ok());
    [learned.count(), certified.count()]
}

/// The answer to a request.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What was drawn, in order; for [`Sampler::Default`](crate::Sampler::Default) what was delivered.
    pub draws: Vec<Draw>,
    /// The certified motions.
    pub candidates: Vec<Candidate>,
    /// Learned draws that were certified before draws without a motion were filled.
    pub learned_certified: usize,
    /// Learned draws made.
    pub learned_drawn: usize,
    /// Paths that the learned sampler drew from wider noise, since none of the draws asked for was certified.
    pub explored: usize,
    /// Whether the interrupt cut the work short.
    pub truncated: bool,
    /// Wall time of the stages.
    pub stages: StageTimes,
}
