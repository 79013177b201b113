//! The planner, resident: robot, models and workers.

use crate::basis::SineBasis;
use crate::braking::Braking;
use crate::diffusion::{DiffusionModel, Guidance, Task};
use crate::end_shapes::check_goal;
use crate::path::Waypoints;
use crate::plan::{Candidate, Plan, Request, Sampler, StartMotion};
use crate::problem::{Infeasible, Problem};
use crate::pushes::PushKernel;
use crate::run::Run;
use crate::straighten::TipCurves;
use denoiser::FastModel;
use pcc_model::Robot;
use thiserror::Error;

/// Knots that a motion has at least.
const LEAST_KNOTS: usize = 4;

/// Why a planner cannot serve a request.
#[derive(Debug, Error, PartialEq)]
pub enum PlannerError {
    /// The problem itself has no solution.
    #[error(transparent)]
    Infeasible(#[from] Infeasible),
    /// A learned sampler was asked for and its model is not loaded.
    #[error(
        "sampler not loaded: the request needs the {0} model, whose weights the configuration has to name; `straight` and `rrt-connect` need none"
    )]
    ModelNotLoaded(&'static str),
    /// The robot's sections differ in length, which the unit model cannot express.
    #[error("the planner needs three sections of one length, got {0:?}")]
    UnequalSections([f64; 3]),
    /// The worker threads could not be started.
    #[error("the worker threads could not be started: {0}")]
    Threads(String),
}

/// The learned models of a planner; what is not there cannot be asked for.
#[derive(Default)]
pub struct Models {
    /// The few-step model.
    pub fast: Option<FastModel>,
    /// The paper's.
    pub diffusion: Option<DiffusionModel>,
}

/// The planner, resident: the unit robot, the models, and worker threads.
pub struct Planner {
    pub(crate) robot: Robot,
    pub(crate) models: Models,
    pub(crate) basis: SineBasis,
    pub(crate) kernel: PushKernel,
    pub(crate) tip_curves: TipCurves,
    workers: rayon::ThreadPool,
}

/// Asked again and again while a request is planned; true truncates it.
pub(crate) type Interrupt<'a> = &'a (dyn Fn() -> bool + Sync);

/// Who follows a request while it is planned.
#[derive(Clone, Copy)]
pub struct Supervision<'a> {
    /// Asked between stages and while a tree grows; true truncates.
    pub interrupt: &'a (dyn Fn() -> bool + Sync),
    /// Told of candidates as they certify, by any worker and in any order; the answer may have better ones in their place.
    pub certified: Option<&'a (dyn Fn(Candidate) + Sync)>,
}

impl Planner {
    /// Makes a planner for a robot (any unit of length) with `threads` workers.
    ///
    /// # Errors
    /// [`PlannerError::UnequalSections`] or [`PlannerError::Threads`].
    pub fn new(robot: &Robot, mut models: Models, threads: usize) -> Result<Self, PlannerError> {
        let length = robot
            .equal_section_length()
            .ok_or(PlannerError::UnequalSections(robot.section_lengths))?;
        let workers = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|_| "planning".to_owned())
            .build()
            .map_err(|e| PlannerError::Threads(e.to_string()))?;
        if let Some(diffusion) = &mut models.diffusion {
            diffusion.prepare(workers.current_num_threads());
        }
        let basis = SineBasis::new();
        Ok(Self {
            robot: robot.scaled(1.0 / length),
            models,
            kernel: PushKernel::new(&basis),
            tip_curves: TipCurves::new(),
            basis,
            workers,
        })
    }

    /// The robot in units of its section length.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Runs a task on one of the workers and returns at once; [`Planner::plan`] called in it needs no other thread's help to
    /// begin.
    pub fn spawn(&self, task: impl FnOnce() + Send + 'static) {
        self.workers.spawn(task);
    }

    /// Runs a task on each of the workers.
    pub fn on_every_worker(&self, task: impl Fn() + Sync) {
        self.workers.broadcast(|_| task());
    }

    /// Answers one request; `interrupt` is asked between stages and while a tree grows, and returns true to truncate.
    ///
    /// # Errors
    /// [`PlannerError::Infeasible`] or [`PlannerError::ModelNotLoaded`].
    pub fn plan(
        &self,
        problem: &Problem,
        request: &Request,
        interrupt: Interrupt,
    ) -> Result<Plan, PlannerError> {
        let supervision = Supervision {
            interrupt,
            certified: None,
        };
        self.plan_supervised(problem, request, supervision)
    }

    /// Answers one request, and tells of its candidates before that.
    ///
    /// # Errors
    /// As [`Planner::plan`].
    pub fn plan_supervised(
        &self,
        problem: &Problem,
        request: &Request,
        supervision: Supervision,
    ) -> Result<Plan, PlannerError> {
        self.check_loaded(request.sampler)?;
        problem.check_start(&self.robot)?;
        let grown = self.robot.with_tube_growth(&request.growth);
        let run = || match &request.start_motion {
            Some(motion) => self.plan_in_motion(&grown, problem, request, supervision, motion),
            None => Run::new(self, &grown, problem, request, supervision).plan(),
        };
        self.workers.install(run)
    }

    /// Plans from where the robot can rest soonest, and lets every motion begin with coming there.
    fn plan_in_motion(
        &self,
        grown: &Robot,
        problem: &Problem,
        request: &Request,
        supervision: Supervision,
        motion: &StartMotion,
    ) -> Result<Plan, PlannerError> {
        let demands = Run::new(self, grown, problem, request, supervision).demands;
        let braking = Braking::new(&demands, &problem.start, motion)?;
        let after = Problem {
            start: braking.end(),
            ..problem.clone()
        };
        let shorter = Request {
            knots: request
                .knots
                .saturating_sub(braking.knots())
                .max(LEAST_KNOTS),
            ..request.clone()
        };
        let tell = |candidate: Candidate| {
            if let Some(tell) = supervision.certified {
                tell(braking.candidate(&candidate));
            }
        };
        let told = Supervision {
            certified: supervision.certified.is_some().then_some(&tell),
            ..supervision
        };
        let plan = Run::new(self, grown, &after, &shorter, told).plan()?;
        Ok(braking.plan(plan, request.selection))
    }

    /// Answers a request with given paths (64 waypoints each, radians), as if a learned model of whole paths had drawn them: the
    /// ends are brought onto start and goal, then the paths are corrected, timed and certified. Reads no sampler of the request.
    ///
    /// # Errors
    /// [`PlannerError::Infeasible`].
    pub fn judge(
        &self,
        problem: &Problem,
        request: &Request,
        paths: Vec<Waypoints>,
        interrupt: Interrupt,
    ) -> Result<Plan, PlannerError> {
        problem.check_start(&self.robot)?;
        let grown = self.robot.with_tube_growth(&request.growth);
        check_goal(&grown, problem, request.seed)?;
        let given = paths.into_iter().map(Some).collect();
        let supervision = Supervision {
            interrupt,
            certified: None,
        };
        let run = || Run::new(self, &grown, problem, request, supervision).judge(given);
        Ok(self.workers.install(run))
    }

    /// Draws one path by diffusion and returns it before every evaluation of the network and at the end, 64 waypoints each.
    ///
    /// # Errors
    /// [`PlannerError::ModelNotLoaded`] or [`PlannerError::Infeasible`].
    pub fn trace(
        &self,
        problem: &Problem,
        guidance: Guidance,
        seed: u64,
    ) -> Result<Vec<Waypoints>, PlannerError> {
        let diffusion = self.models.diffusion.as_ref();
        let diffusion = diffusion.ok_or(PlannerError::ModelNotLoaded("diffusion"))?;
        problem.check_start(&self.robot)?;
        check_goal(&self.robot, problem, seed)?;
        let task = Task {
            robot: &self.robot,
            problem,
            guidance,
            seed,
        };
        Ok(self.workers.install(|| diffusion.trace(&task)))
    }

    fn check_loaded(&self, sampler: Sampler) -> Result<(), PlannerError> {
        let (name, loaded) = match sampler {
            Sampler::Default | Sampler::Fast => ("fast", self.models.fast.is_some()),
            Sampler::Diffusion(_) => ("diffusion", self.models.diffusion.is_some()),
            Sampler::Straight
            | Sampler::StraightDrawn
            | Sampler::RrtConnect
            | Sampler::RrtSmooth => return Ok(()),
        };
        loaded
            .then_some(())
            .ok_or(PlannerError::ModelNotLoaded(name))
    }
}
