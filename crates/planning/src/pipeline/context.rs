//! One request with all that answering it needs, and how its paths become draws.

use crate::motion::constraints::MotionConstraints;
use crate::motion::incumbent::Incumbent;
use crate::path::waypoints::Waypoints;
use crate::plan::{Candidate, Draw, Failure, count_learned};
use crate::problem::Problem;
use crate::request::{Interrupt, Request, Supervision};
use crate::resources::Resources;
use crate::search::edges::{RrtSettings, Search};
use crate::stage_times::StageTimes;
use codes::Source;
use collision::Scene;
use pcc_model::{SECTIONS, UnitRobot};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::time::Instant;

/// One request: what it asks for, what the planner has for it, and what its motions must keep.
#[derive(Clone, Copy)]
pub(crate) struct RequestContext<'a> {
    pub(crate) resources: &'a Resources,
    pub(crate) problem: &'a Problem,
    pub(crate) request: &'a Request,
    pub(crate) supervision: Supervision<'a>,
    pub(super) constraints: MotionConstraints<'a>,
    /// The obstacles among which trees grow.
    pub(super) searched: &'a Scene,
}

/// A path that is to become a motion.
pub(super) struct Proposal {
    /// The path: 64 waypoints, radians.
    pub(crate) path: Waypoints,
    pub(crate) source: Source,
    /// Index of the draw that the path is, unless it only competes with one.
    pub(crate) draw: Option<usize>,
    /// Whether the path's tip is brought onto a smooth curve.
    pub(crate) smooths_tip: bool,
}

/// Draws, each with the time that its path took in every stage on its worker.
pub(super) type Deliveries = Vec<(Draw, StageTimes)>;

/// What a sampler delivers for a request.
pub(super) struct Drawn {
    pub(crate) draws: Vec<Draw>,
    /// Learned draws, and how many of them are certified, before anything took the place of one.
    pub(crate) learned: [usize; 2],
    /// Paths that exploring drew, since none of the draws asked for was certified.
    pub(crate) explored: usize,
}

impl Proposal {
    /// A path whose tip stays as it is, and which is none of the request's draws.
    pub(crate) fn of(path: Waypoints, source: Source) -> Self {
        Self {
            path,
            source,
            draw: None,
            smooths_tip: false,
        }
    }

    /// A path of the few-step model, whose tip is to be brought onto a smooth curve, and which is none of the request's draws.
    pub(crate) fn learned(path: Waypoints, source: Source) -> Self {
        Self {
            smooths_tip: true,
            ..Self::of(path, source)
        }
    }
}

impl From<Vec<Draw>> for Drawn {
    fn from(draws: Vec<Draw>) -> Self {
        Self {
            learned: count_learned(&draws),
            draws,
            explored: 0,
        }
    }
}

impl<'a> RequestContext<'a> {
    /// The context of a request for a robot whose tubes are `padded` by what it demands.
    pub(crate) fn new(
        resources: &'a Resources,
        padded: &'a UnitRobot,
        problem: &'a Problem,
        request: &'a Request,
        supervision: Supervision<'a>,
    ) -> Self {
        let limits = resources.robot.tendon_limits.scaled(request.limits_scale);
        let constraints = MotionConstraints {
            robot: &resources.robot,
            padded,
            scene: &problem.scene,
            moving: &problem.moving,
            kernel: &resources.kernel,
            tip_paths: &resources.tip_paths,
            limits,
            knots: request.knots,
            bending_slack_rad: 0.0,
            corrections: request.corrections,
            interrupt: supervision.interrupt,
        };
        let constraints = constraints.bending_no_more_than(&problem.start);
        Self {
            resources,
            problem,
            request,
            supervision,
            constraints,
            searched: &problem.scene,
        }
    }

    /// The same for motions that may bend so far beyond the limit, rad.
    pub(super) fn with_bending_slack(self, bending_slack_rad: f64) -> Self {
        let constraints = MotionConstraints {
            bending_slack_rad,
            ..self.constraints
        };
        Self {
            constraints,
            ..self
        }
    }

    /// Makes motions of paths on all workers: correction, timing, the certificate, figures. The wall time that passes is divided
    /// among these stages.
    pub(super) fn deliver_timed(
        &self,
        proposals: Vec<Proposal>,
        times: &mut StageTimes,
    ) -> Vec<Draw> {
        let clock = Instant::now();
        let delivered = self.deliver_all(proposals);
        let [draws] = share(times, clock.elapsed().as_secs_f64(), [delivered]);
        draws
    }

    /// Makes motions of paths on all workers, in the order of the paths.
    pub(super) fn deliver_all(&self, proposals: Vec<Proposal>) -> Deliveries {
        let proposals = proposals.into_par_iter().with_max_len(1);
        proposals.map(|proposal| self.deliver(proposal)).collect()
    }

    /// Makes a motion of a path.
    pub(super) fn deliver(&self, proposal: Proposal) -> (Draw, StageTimes) {
        self.deliver_against(proposal, None)
    }

    /// Makes a motion of a path that counts only if it is faster than the incumbent.
    pub(super) fn deliver_against(
        &self,
        proposal: Proposal,
        incumbent: Option<&Incumbent>,
    ) -> (Draw, StageTimes) {
        let sampled = proposal.path.clone();
        let delivered =
            self.constraints
                .to_trajectory(proposal.path, proposal.smooths_tip, incumbent);
        let draw = Draw {
            sampled: Some(sampled),
            path: Some(delivered.path),
            source: proposal.source,
            outcome: delivered.outcome,
        };
        if let Some(index) = proposal.draw {
            self.report(index, &draw);
        }
        (draw, delivered.times)
    }

    /// Calls the request's supervisor with a draw, if that is certified.
    pub(super) fn report(&self, index: usize, draw: &Draw) {
        if let (Some(report), Ok(motion)) = (self.supervision.certified, &draw.outcome) {
            report(Candidate::of(index, draw.source, motion));
        }
    }

    /// Marks a draw without a motion as truncated if the request was: that it has none does not show then that there is no path.
    pub(super) fn note_truncation(&self, draw: &mut Draw) {
        if draw.outcome.is_err() && (self.supervision.interrupt)() {
            draw.outcome = Err(Failure::Truncated);
        }
    }

    /// The robot whose tubes have `margin` (section lengths) around them beside the request's padding.
    pub(super) fn padded_by(&self, margin: f64) -> UnitRobot {
        self.constraints
            .padded
            .with_tube_padding(&[margin; SECTIONS])
    }

    /// The same, with trees that grow among these obstacles.
    pub(super) fn among<'b>(&'b self, searched: &'b Scene) -> RequestContext<'b> {
        RequestContext { searched, ..*self }
    }

    /// A search in the request's scene that keeps `robot` clear.
    pub(crate) fn search<'b>(
        &'b self,
        robot: &'b UnitRobot,
        settings: &'b RrtSettings,
        interrupt: Interrupt<'b>,
    ) -> Search<'b> {
        Search {
            robot,
            scene: self.searched,
            settings,
            interrupt,
        }
    }

    /// The random numbers of the tree with this index.
    pub(super) fn tree_rng(&self, index: usize) -> Pcg64 {
        Pcg64::new(u128::from(self.request.seed), index as u128 + 1)
    }
}

/// Divides `wall_s` seconds among the stages that these paths went through meanwhile; their draws.
pub(crate) fn share<const N: usize>(
    times: &mut StageTimes,
    wall_s: f64,
    delivered: [Deliveries; N],
) -> [Vec<Draw>; N] {
    times.share(wall_s, delivered.iter().flatten().map(|(_, times)| *times));
    delivered.map(|delivered| delivered.into_iter().map(|(draw, _)| draw).collect())
}
