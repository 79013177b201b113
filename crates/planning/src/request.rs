//! What a plan is asked for: sampler, selection, limits, the plan to go on from, and who follows the work.

use crate::path::waypoints::Waypoints;
use crate::plan::Candidate;
use pcc_model::{Configuration, SECTIONS};
use std::sync::Arc;

/// The sampler: where paths come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampler {
    /// The learned sampler, filled by straight segments and the tree where it did not deliver.
    Default,
    /// The learned few-step sampler alone.
    Fast,
    /// Straight segments in configuration space: the null arm.
    Straight,
    /// Straight segments with everything that a learned path gets after sampling: the tip brought onto a smooth curve, smoothing after
    /// correction, the corrected path where the smoothed one makes no motion.
    StraightDrawn,
    /// RRT-Connect on certified edges.
    RrtConnect,
    /// RRT-Connect, whose rounded paths get everything that a learned path gets after sampling.
    RrtSmooth,
    /// The paper's diffusion model alone; the network chooses the goal configuration.
    Diffusion(Guidance),
}

/// How differential kinematics refines the paths of the diffusion model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guidance {
    /// Not at all.
    Pure,
    /// Post correction: it moves the clean estimate.
    Post,
    /// Guided prediction: its energy's gradient goes through the network.
    Guided,
}

/// The rule by which one candidate is selected: what the best one has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Shortest duration.
    ShortestTime,
    /// Shortest tip path.
    ShortestTipPath,
    /// Largest clearance over the motion.
    LargestClearance,
    /// Smallest ∫‖p‴‖² of the tip path.
    Smoothest,
    /// Goal configuration nearest to the start.
    NearestGoalConfiguration,
    /// The candidate with this index.
    Index(usize),
}

/// A plan to go on from.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviousPlan {
    /// The motions, each as waypoints equally spaced in time, radians.
    pub paths: Vec<Waypoints>,
    /// Index of the one that is followed, if any.
    pub followed: Option<usize>,
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
    /// Padding of each section's tube for which motions are certified, section lengths: room for the tracking error.
    pub padding: [f64; SECTIONS],
    /// Knots of each motion (4 to 256).
    pub knots: usize,
    /// Corrections that a path gets before it is given up, 0 to `MOST_CORRECTIONS`; that many is usual, and larger numbers mean the same.
    pub corrections: usize,
    /// How the robot moves at the start, none where it rests. A moving robot first brakes straight ahead, then goes on from rest.
    pub start_motion: Option<StartMotion>,
    /// The plan to go on from; read by [`Sampler::Default`] and [`Sampler::Fast`].
    pub previous: Option<Arc<PreviousPlan>>,
}

/// Asked between the steps of planning a request; true truncates it.
pub(crate) type Interrupt<'a> = &'a (dyn Fn() -> bool + Sync);

/// Who follows a request while it is planned.
#[derive(Clone, Copy)]
pub struct Supervision<'a> {
    /// Asked between stages and while a tree grows; true truncates.
    pub interrupt: &'a (dyn Fn() -> bool + Sync),
    /// Called with each candidate as soon as it is certified, by any worker and in any order; the answer may have better ones in their
    /// place.
    pub certified: Option<&'a (dyn Fn(Candidate) + Sync)>,
}
