//! What a plan is asked for, and what it delivers.

use crate::diffusion::Guidance;
use crate::finish::Laps;
use crate::metrics::PathMetrics;
use crate::path::Waypoints;
use crate::previous::PreviousPlan;
use crate::select::Selection;
use pcc_model::{Configuration, SECTIONS};
use std::sync::Arc;
use thiserror::Error;
use trajectory::Trajectory;

/// Where paths come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampler {
    /// The learned sampler, filled by straight segments and the tree where it did not deliver.
    Default,
    /// The learned few-step sampler alone.
    Fast,
    /// Straight segments in configuration space: the null arm.
    Straight,
    /// Straight segments with everything that a learned path gets after sampling: the tip drawn onto a smooth curve, smoothing after
    /// correction, a second delivery where the smoothed path is refused.
    StraightDrawn,
    /// RRT-Connect on certified edges.
    RrtConnect,
    /// RRT-Connect, whose rounded paths get everything that a learned path gets after sampling.
    RrtSmooth,
    /// The paper's diffusion model alone; the goal's end shape is the network's choice.
    Diffusion(Guidance),
}

/// Who proposed a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The learned sampler, in one of the draws that were asked for.
    Learned,
    /// The learned sampler, from wider noise, where none of these draws was certified.
    Explored,
    /// A straight segment in configuration space.
    Straight,
    /// The tree, RRT-Connect.
    Tree,
    /// The rest of the previous plan's motion.
    Kept,
}

/// Why a draw did not become a certified motion.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Failure {
    /// No path was produced.
    #[error("no path was found")]
    NoPath,
    /// The sampled end is too far from any shape that reaches the goal.
    #[error("does not reach the goal")]
    Goal,
    /// The motion could not be certified free of collisions.
    #[error("not certified free of collisions")]
    Collision,
    /// A section bends beyond the limit.
    #[error("bends beyond the limit")]
    Bending,
    /// No time allocation within the limits, or not with the knots that a motion may have.
    #[error("no time allocation within the tendon limits and the knots of a motion")]
    Time,
    /// A motion that only counts if it is the fastest, and is not, or would not be were it certified.
    #[error("not the fastest")]
    Slower,
    /// The request was truncated before this draw was finished.
    #[error("truncated")]
    Truncated,
}

/// How the robot moves at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartMotion {
    /// dζ/dt, rad/s.
    pub velocity: Configuration,
    /// d²ζ/dt², rad/s².
    pub acceleration: Configuration,
}

/// What a plan must deliver, beside its problem.
#[derive(Clone, Debug)]
pub struct Request {
    /// Candidates to draw (1..=64).
    pub candidates: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Where paths come from.
    pub sampler: Sampler,
    /// Which candidate is selected.
    pub selection: Selection,
    /// Factor on the tendon velocity, acceleration and jerk limits, in (0, 1].
    pub limits_scale: f64,
    /// Growth of each section's tube that the certificate includes, section lengths (tracking error).
    pub growth: [f64; SECTIONS],
    /// Knots of each motion (4 to 256).
    pub knots: usize,
    /// Corrections that a path gets before it is given up: 0 to `MOST_CORRECTIONS`, which is the rule; more are as many.
    pub corrections: usize,
    /// How the robot moves at the start; none: it rests. It first brakes straight ahead, then goes on from rest.
    pub start_motion: Option<StartMotion>,
    /// The plan to go on from; read by [`Sampler::Default`] and [`Sampler::Fast`].
    pub previous: Option<Arc<PreviousPlan>>,
}

/// A certified motion.
#[derive(Clone, Debug)]
pub struct Certified {
    /// The curve that is executed.
    pub trajectory: Arc<Trajectory>,
    /// Its figures.
    pub metrics: PathMetrics,
}

/// One certified, timed motion of a plan.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The curve that is executed.
    pub trajectory: Arc<Trajectory>,
    /// Its figures.
    pub metrics: PathMetrics,
    /// Who proposed it.
    pub source: Source,
    /// The draw it came from.
    pub draw: usize,
}

impl Certified {
    /// The end shape, radians.
    #[must_use]
    pub fn end(&self) -> Configuration {
        end_of(&self.trajectory)
    }
}

impl Candidate {
    /// The end shape, radians.
    #[must_use]
    pub fn end(&self) -> Configuration {
        end_of(&self.trajectory)
    }
}

fn end_of(trajectory: &Trajectory) -> Configuration {
    let knots = trajectory.knots();
    knots[knots.len() - 1].position
}

/// One draw, certified or not.
#[derive(Clone, Debug)]
pub struct Draw {
    /// The path before correction, if a sampler or a straight segment proposed one.
    pub sampled: Option<Waypoints>,
    /// The path after correction (64 waypoints), if one was produced.
    pub path: Option<Waypoints>,
    /// Who proposed it.
    pub source: Source,
    /// The motion, or why there is none.
    pub outcome: Result<Certified, Failure>,
}

impl Draw {
    /// Duration of its motion, s; infinite if there is none.
    pub(crate) fn duration_s(&self) -> f64 {
        let motion = self.outcome.as_ref();
        motion.map_or(f64::INFINITY, |motion| motion.metrics.duration_s)
    }
}

/// Wall time of the stages, seconds.
///
/// Paths go from sampling through correction, time allocation and certification to their figures without waiting for each
/// other, several at once: the wall time of all is divided among these stages by the time that each took on the workers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// End shapes (for diffusion: whether there is one) and features.
    pub condition: f64,
    /// The learned sampler, or the tree.
    pub sample: f64,
    /// Straightening and analytic correction, the ends of paths by diffusion included.
    pub correct: f64,
    /// Time allocation.
    pub time: f64,
    /// Certification.
    pub certify: f64,
    /// Filling, figures of merit and selection.
    pub select: f64,
}

impl StageTimes {
    /// Divides `wall` seconds among the stages of paths that went through them meanwhile.
    pub(crate) fn share(&mut self, wall: f64, laps: impl Iterator<Item = Laps>) {
        let mut spent = Laps::default();
        for lap in laps {
            spent.add(&lap);
        }
        let scale = wall / spent.total().max(f64::MIN_POSITIVE);
        self.condition += scale * spent.condition;
        self.sample += scale * spent.sample;
        self.correct += scale * spent.correct;
        self.time += scale * spent.time;
        self.certify += scale * spent.certify;
        self.select += scale * spent.select;
    }
}

/// The answer to a request.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What was drawn, in order; for [`Sampler::Default`] what was delivered.
    pub draws: Vec<Draw>,
    /// The certified ones.
    pub candidates: Vec<Candidate>,
    /// Index into `candidates`.
    pub selected: Option<usize>,
    /// Learned draws that certified before anything was filled.
    pub learned_certified: usize,
    /// Learned draws made.
    pub learned_drawn: usize,
    /// Paths drawn beyond these because none of them certified.
    pub explored: usize,
    /// Whether the interrupt cut the work short.
    pub truncated: bool,
    /// Wall time of the stages.
    pub stages: StageTimes,
}
