//! What a plan is asked for: sampler, limits, the plan to go on from, and who follows the work.

use crate::path::waypoints::Waypoints;
use crate::plan::Candidate;
use codes::Sampler;
use pcc_model::{Configuration, SECTIONS};
use std::sync::Arc;
use trajectory::{Knot, Trajectory};

/// How differential kinematics refines the paths of the diffusion model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guidance {
    /// No refinement.
    Pure,
    /// Post correction: it moves the clean estimate.
    Post,
    /// Guided prediction: its energy's gradient goes through the network.
    Guided,
}

impl Guidance {
    /// That of a sampler which draws from the diffusion model.
    #[must_use]
    pub fn of(sampler: Sampler) -> Option<Self> {
        match sampler {
            Sampler::Diffusion => Some(Self::Pure),
            Sampler::DiffusionPost => Some(Self::Post),
            Sampler::DiffusionGuided => Some(Self::Guided),
            _ => None,
        }
    }
}

/// A plan to go on from.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviousPlan {
    /// The motions, each as waypoints equally spaced in time, radians.
    pub paths: Vec<Waypoints>,
    /// Index of the motion that the robot follows, if any.
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

impl StartMotion {
    /// The state of a robot that moves so in a configuration.
    pub(crate) fn state_in(&self, position: &Configuration) -> Knot {
        Knot {
            time: 0.0,
            position: *position,
            velocity: self.velocity,
            acceleration: self.acceleration,
        }
    }
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
    /// Factor on the tendon velocity, acceleration and jerk limits, in (0, 1].
    pub limits_scale: f64,
    /// Padding of each section's tube for which motions are certified, section lengths: room for the tracking error.
    pub padding: [f64; SECTIONS],
    /// Knots of each motion (4 to 256).
    pub knots: usize,
    /// Corrections that a path gets before it is given up, 0 to `MOST_CORRECTIONS`; that many is usual, and larger numbers mean the same.
    pub corrections: usize,
    /// How the robot moves at the start, none where it rests. A moving robot first brakes to rest, then goes on from rest, but for
    /// `end_to_move`.
    pub start_motion: Option<StartMotion>,
    /// The plan to go on from; read by [`Sampler::Default`] and [`Sampler::Fast`].
    pub previous: Option<Arc<PreviousPlan>>,
    /// The motion that a robot in motion follows: where moving its end a little reaches the goal within the limits, that motion alone is the
    /// plan, and supervision is told of nothing before it.
    pub end_to_move: Option<EndToMove>,
}

/// A motion whose end may be moved.
#[derive(Clone, Debug)]
pub struct EndToMove {
    /// What remains of the motion, from the start of the request on.
    pub remaining: Arc<Trajectory>,
    /// Knots that the motion with its end moved may have, 256 at most.
    pub most_knots: usize,
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
    /// Has the fastest candidate of a request with one goal that begins in motion before the others, where no obstacle moves.
    pub early_selection: Option<EarlySelection<'a>>,
}

/// What is to be done until the fastest motion of a request is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToBeDone {
    /// Nothing, unless the motions begin in another state: the fastest one, a straight segment, is then joined again.
    SegmentAgain,
    /// The same where the fastest motion follows another path.
    PathAgain,
    /// The same, and it is expected that the fastest motion is planned anew once more.
    PathAgainAndPlanningAnew,
    /// The fastest motion is planned anew to its goal configuration, which is known.
    PlanningAnew,
    /// Paths are joined to the motion that is left.
    Joining,
    /// The same, and it is expected that the fastest motion is planned anew.
    JoiningAndPlanningAnew,
}

impl ToBeDone {
    /// Whether the fastest motion is known, unless the motions begin in another state.
    #[must_use]
    pub fn is_known(self) -> bool {
        matches!(
            self,
            Self::SegmentAgain | Self::PathAgain | Self::PathAgainAndPlanningAnew
        )
    }
}

/// Whether the motions of a request can begin in a state.
pub type CanBegin<'a> = dyn Fn(&Knot) -> bool + 'a;

/// Whether a motion that was told can begin where it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// It can, or cannot for another reason than time.
    InTime,
    /// The state in which it begins has passed.
    TooLate,
}

/// Has the fastest motion of a request that begins in motion before the others are joined to the motion that is left.
#[derive(Clone, Copy)]
pub struct EarlySelection<'a> {
    /// Called before the fastest motion is told, and before that when it is to be planned anew, or paths are planned but the fastest motion is not
    /// known, with what is to be done until it is: it may ask once whether the motions can begin in another state than before (its time is not read), and where they
    /// can, they do. Paths are moved by the way between the rests that the robot reaches from both, so that should be short.
    pub begin: &'a (dyn Fn(ToBeDone, &CanBegin) + Sync),
    /// Called with the fastest candidate by any worker, which should not be held for long: what remains of a motion that is
    /// followed, where no other one is faster by a tenth. Motions that are joined later are not faster in general, which no bound proves.
    /// Where it comes too late, `begin` is asked once more, and it is told again, joined to where the motions then begin.
    pub selected: &'a (dyn Fn(Candidate) -> Told + Sync),
}

impl<'a> Supervision<'a> {
    /// Asks whether to truncate, and tells nobody of candidates.
    #[must_use]
    pub fn new(interrupt: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self {
            interrupt,
            certified: None,
            early_selection: None,
        }
    }
}
