//! The planner, resident: robot, models and workers.

use crate::error::PlannerError;
use crate::goals::goal_configurations::check_goal;
use crate::models::diffusion::Task;
use crate::path::waypoints::Waypoints;
use crate::pipeline::answer::{answer, answer_with_paths, answer_with_polylines};
use crate::pipeline::context::RequestContext;
use crate::pipeline::route::answer_route;
use crate::plan::Plan;
use crate::problem::{Problem, Via};
use crate::request::{Guidance, Interrupt, Request, Supervision};
use crate::resources::{Models, Resources};
use pcc_model::{Configuration, UnitRobot};

/// The planner, resident: the unit robot, the models, and worker threads.
pub struct Planner {
    resources: Resources,
    workers: rayon::ThreadPool,
}

impl Planner {
    /// Makes a planner for a robot with `threads` workers.
    ///
    /// # Errors
    /// [`PlannerError::Threads`].
    pub fn new(robot: UnitRobot, mut models: Models, threads: usize) -> Result<Self, PlannerError> {
        let workers = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|_| "planning".to_owned())
            .build()
            .map_err(|e| PlannerError::Threads(e.to_string()))?;
        if let Some(diffusion) = &mut models.diffusion {
            diffusion.prepare(workers.current_num_threads());
        }
        Ok(Self {
            resources: Resources::new(robot, models),
            workers,
        })
    }

    /// The robot in units of its section length.
    #[must_use]
    pub fn robot(&self) -> &UnitRobot {
        &self.resources.robot
    }

    /// Runs a task on one of the workers and returns at once; [`Planner::plan`] called in it begins on that worker.
    pub fn spawn(&self, task: impl FnOnce() + Send + 'static) {
        self.workers.spawn(task);
    }

    /// Runs a task whose parallel iterators use the workers, and waits for it.
    pub fn install<T: Send>(&self, task: impl FnOnce() -> T + Send) -> T {
        self.workers.install(task)
    }

    /// Runs a task on each of the workers, which is told the worker's number, from 0.
    pub fn on_every_worker(&self, task: impl Fn(usize) + Sync) {
        self.workers.broadcast(|worker| task(worker.index()));
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
        let supervision = Supervision::new(interrupt);
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
        self.plan_route(&[], problem, request, supervision)
    }

    /// Answers one request whose motions pass goals in turn on the way to the problem's own, without rest where that is certified, and tells
    /// of its candidates before that. The plan to go on from is not read where there are such goals.
    ///
    /// # Errors
    /// As [`Planner::plan`], and [`PlannerError::InfeasibleVia`].
    pub fn plan_route(
        &self,
        via: &[Via],
        problem: &Problem,
        request: &Request,
        supervision: Supervision,
    ) -> Result<Plan, PlannerError> {
        self.resources.models.check_loaded(request.sampler)?;
        problem.check_start(&self.resources.robot)?;
        let padded = self.padded(request);
        let resources = &self.resources;
        self.workers.install(|| {
            let context = RequestContext::new(resources, &padded, problem, request, supervision);
            match via {
                [] => answer(&context),
                via => answer_route(&context, via),
            }
        })
    }

    /// Answers a request with given paths (64 waypoints each, radians), as if a learned model of whole paths had drawn them: the
    /// ends are brought onto start and goal, then the paths are corrected, timed and certified. Reads no sampler of the request.
    ///
    /// # Errors
    /// [`PlannerError::Infeasible`].
    pub fn evaluate_paths(
        &self,
        problem: &Problem,
        request: &Request,
        paths: Vec<Waypoints>,
        interrupt: Interrupt,
    ) -> Result<Plan, PlannerError> {
        self.answer_given(problem, request, interrupt, |context| {
            answer_with_paths(context, paths)
        })
    }

    /// Answers a request with given polylines (radians) on certified edges from the start to configurations in the goal: each is shortened,
    /// and followed as the request's sampler, `rrt-connect` or `rrt-smooth`, follows those of its trees.
    ///
    /// # Errors
    /// [`PlannerError::Infeasible`].
    pub fn follow_polylines(
        &self,
        problem: &Problem,
        request: &Request,
        polylines: Vec<Vec<Configuration>>,
        interrupt: Interrupt,
    ) -> Result<Plan, PlannerError> {
        self.answer_given(problem, request, interrupt, |context| {
            answer_with_polylines(context, polylines)
        })
    }

    /// Answers a request on the workers with what is given in place of a sampler.
    fn answer_given(
        &self,
        problem: &Problem,
        request: &Request,
        interrupt: Interrupt,
        answer: impl FnOnce(&RequestContext) -> Plan + Send,
    ) -> Result<Plan, PlannerError> {
        problem.check_start(&self.resources.robot)?;
        let padded = self.padded(request);
        check_goal(&padded, problem, request.seed)?;
        let supervision = Supervision::new(interrupt);
        let resources = &self.resources;
        Ok(self.workers.install(|| {
            answer(&RequestContext::new(
                resources,
                &padded,
                problem,
                request,
                supervision,
            ))
        }))
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
        let diffusion = self.resources.models.diffusion.as_ref();
        let diffusion = diffusion.ok_or(PlannerError::ModelNotLoaded("diffusion"))?;
        problem.check_start(&self.resources.robot)?;
        check_goal(&self.resources.robot, problem, seed)?;
        let task = Task {
            robot: &self.resources.robot,
            problem,
            guidance,
            seed,
        };
        Ok(self.workers.install(|| diffusion.trace(&task)))
    }

    /// The robot whose tubes are padded as a request demands.
    fn padded(&self, request: &Request) -> UnitRobot {
        self.resources.robot.with_tube_padding(&request.padding)
    }
}
