//! Why a request cannot be planned.

use codes::Outcome;
use thiserror::Error;

/// Why a planner cannot serve a request.
#[derive(Debug, Error, PartialEq)]
pub enum PlannerError {
    /// The problem itself has no solution.
    #[error(transparent)]
    Infeasible(#[from] Infeasible),
    /// A goal on the way cannot be passed.
    #[error("goal {} of the route: {infeasible}", index + 1)]
    InfeasibleVia {
        /// Its index among the goals.
        index: usize,
        /// Why.
        infeasible: Infeasible,
    },
    /// A learned sampler was asked for and its model is not loaded.
    #[error(
        "sampler not loaded: the request needs the {0} model, whose weights the configuration has to name; `straight` and `rrt-connect` need none"
    )]
    ModelNotLoaded(&'static str),
    /// The worker threads could not be started.
    #[error("the worker threads could not be started: {0}")]
    Threads(String),
}

/// Why a problem has no solution, found before any path is searched.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum Infeasible {
    /// A section of the start configuration is bent beyond the robot's limit.
    #[error(
        "start out of limits: a section is bent {excess_rad:.4} rad beyond the allowed {limit_rad:.4} rad"
    )]
    StartOutOfLimits {
        /// Bending angle above the limit, rad.
        excess_rad: f64,
        /// The bending limit, rad.
        limit_rad: f64,
    },
    /// The body touches an obstacle at the start.
    #[error("start in collision: clearance {clearance:.4} section lengths, at least 0 is needed")]
    StartInCollision {
        /// Signed clearance, section lengths.
        clearance: f64,
    },
    /// The robot moves faster, or changes its motion faster, than it may.
    #[error(
        "start cannot stop: it uses {share:.3} times a tendon limit until it rests, at most 1 is allowed"
    )]
    StartTooFast {
        /// Largest part of a limit that is used, until the robot rests.
        share: f64,
    },
    /// The robot cannot come to rest without contact or within its bending limits.
    #[error(
        "start cannot stop: braking is not certified free of contact and within the bending limits"
    )]
    StartCannotStop,
    /// No configuration within the limits puts the tip on the goal.
    #[error(
        "goal out of reach: the closest configuration found within the bending limit misses it by {miss:.4} section lengths (a tip) or rad (a configuration)"
    )]
    GoalOutOfReach {
        /// Distance of the closest tip found, section lengths; for a configuration the angle above the limit.
        miss: f64,
    },
    /// Every configuration found that reaches the goal touches an obstacle.
    #[error(
        "goal in collision: the clearest of {configurations} goal configurations has clearance {clearance:.4} section lengths, at least 0 is needed"
    )]
    GoalInCollision {
        /// Number of configurations found that reach the goal.
        configurations: usize,
        /// Largest clearance of the goal configurations found, section lengths.
        clearance: f64,
    },
}

impl Infeasible {
    /// The outcome of a request for which this is the reason.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        match self {
            Self::StartOutOfLimits { .. } => Outcome::StartOutOfLimits,
            Self::StartInCollision { .. } => Outcome::StartInCollision,
            Self::StartTooFast { .. } | Self::StartCannotStop => Outcome::StartCannotStop,
            Self::GoalOutOfReach { .. } => Outcome::GoalOutOfReach,
            Self::GoalInCollision { .. } => Outcome::GoalInCollision,
        }
    }
}
