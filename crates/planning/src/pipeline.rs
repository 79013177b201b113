//! The planner: condition, sample, correct, time, certify, fill what is missing, select.
//!
//! Everything is budgeted in counts, so the same request and seed give the same bits whatever the number of
//! threads; an interrupt only truncates.

use crate::basis::SineBasis;
use crate::canonical::CanonicalFrame;
use crate::correction::correct;
use crate::diffusion::{DiffusionModel, Guidance, Task};
use crate::end_shapes::{check_goal, end_shapes};
use crate::features::CanonicalProblem;
use crate::finish::Demands;
use crate::metrics::path_metrics;
use crate::path::{Waypoints, straight_path};
use crate::plan::{Candidate, Draw, Failure, Plan, Request, Sampler, Source, StageTimes};
use crate::problem::{Infeasible, Problem};
use crate::rrt_connect::{RrtSettings, rrt_connect};
use crate::sampling::sample_paths;
use crate::select::select;
use crate::terminal::attach;
use denoiser::FastModel;
use pcc_model::{Configuration, Robot, TendonLimits};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::time::Instant;
use thiserror::Error;
use trajectory::Trajectory;

/// Clearance that corrections aim for beyond the tube, in the first and the second attempt, section lengths.
const CORRECTION_MARGINS: [f64; 2] = [0.03, 0.07];
/// Tube growth of the tree's attempts: rounding its corners needs room, a narrow way may not have it.
const TREE_MARGINS: [f64; 3] = [0.04, 0.01, 0.0];
/// Samples of the tree's last attempt with all goal shapes at once, when nothing else was found.
const LAST_ATTEMPT: RrtSettings = RrtSettings {
    samples: 20_000,
    step_rad: 0.4,
    shortcuts: 120,
};

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
    workers: rayon::ThreadPool,
}

type Interrupt<'a> = &'a (dyn Fn() -> bool + Sync);

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
            .build()
            .map_err(|e| PlannerError::Threads(e.to_string()))?;
        if let Some(diffusion) = &mut models.diffusion {
            diffusion.prepare(workers.current_num_threads());
        }
        Ok(Self {
            robot: robot.scaled(1.0 / length),
            models,
            basis: SineBasis::new(),
            workers,
        })
    }

    /// The robot in units of its section length.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Answers one request; `interrupt` is asked between candidates and while a tree grows, and returns true to truncate.
    ///
    /// # Errors
    /// [`PlannerError::Infeasible`] or [`PlannerError::ModelNotLoaded`].
    pub fn plan(
        &self,
        problem: &Problem,
        request: &Request,
        interrupt: Interrupt,
    ) -> Result<Plan, PlannerError> {
        self.check_loaded(request.sampler)?;
        problem.check_start(&self.robot)?;
        self.workers
            .install(|| Run::new(self, problem, request, interrupt).plan())
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
        check_goal(&self.robot, problem, request.growth, request.seed)?;
        let given = paths.into_iter().map(Some).collect();
        let run = || Run::new(self, problem, request, interrupt).judge(given);
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
        check_goal(&self.robot, problem, 0.0, seed)?;
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
            Sampler::Straight | Sampler::RrtConnect => return Ok(()),
        };
        loaded
            .then_some(())
            .ok_or(PlannerError::ModelNotLoaded(name))
    }
}

/// Learned draws, and how many of them are certified.
fn count_learned(draws: &[Draw]) -> [usize; 2] {
    let learned = draws.iter().filter(|d| d.source == Source::Learned);
    let certified = learned.clone().filter(|d| d.outcome.is_ok());
    [learned.count(), certified.count()]
}

/// One request on its way through the stages.
struct Run<'a> {
    planner: &'a Planner,
    problem: &'a Problem,
    request: &'a Request,
    interrupt: Interrupt<'a>,
    demands: Demands<'a>,
    stages: StageTimes,
}

impl<'a> Run<'a> {
    fn new(
        planner: &'a Planner,
        problem: &'a Problem,
        request: &'a Request,
        interrupt: Interrupt<'a>,
    ) -> Self {
        let full = &planner.robot.tendon_limits;
        let limits = TendonLimits {
            velocity: full.velocity * request.limits_scale,
            acceleration: full.acceleration * request.limits_scale,
            jerk: full.jerk * request.limits_scale,
        };
        let demands = Demands {
            robot: &planner.robot,
            scene: &problem.scene,
            limits,
            knots: request.knots,
            growth: request.growth,
        };
        Self {
            planner,
            problem,
            request,
            interrupt,
            demands,
            stages: StageTimes::default(),
        }
    }

    fn plan(mut self) -> Result<Plan, PlannerError> {
        if let Sampler::Diffusion(guidance) = self.request.sampler {
            return self.diffusion(guidance);
        }
        let clock = Instant::now();
        let mut rng = Pcg64::seed_from_u64(self.request.seed);
        let (robot, count) = (&self.planner.robot, self.request.candidates);
        let ends = end_shapes(robot, self.problem, count, self.request.growth, &mut rng)?.shapes;
        let goals: Vec<Configuration> = (0..count).map(|i| ends[i % ends.len()]).collect();
        self.stages.condition = clock.elapsed().as_secs_f64();
        let mut draws = match self.request.sampler {
            Sampler::Default | Sampler::Fast => self.learned(&goals),
            Sampler::Straight => self.straight(&ends),
            Sampler::RrtConnect | Sampler::Diffusion(_) => self.trees(&goals),
        };
        let learned = count_learned(&draws);
        let clock = Instant::now();
        if self.request.sampler == Sampler::Default {
            self.fill(&goals, &mut draws);
        }
        Ok(self.answer(draws, learned, clock))
    }

    /// The paper's sampler; the end shapes are the network's, and correction brings their tips to the goal.
    fn diffusion(mut self, guidance: Guidance) -> Result<Plan, PlannerError> {
        let clock = Instant::now();
        let (robot, problem, request) = (&self.planner.robot, self.problem, self.request);
        check_goal(robot, problem, request.growth, request.seed)?;
        self.stages.condition = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let task = Task {
            robot,
            problem,
            guidance,
            seed: request.seed,
        };
        let model = self.planner.models.diffusion.as_ref();
        let sampled = model.map_or_else(Vec::new, |model| {
            model.sample(&task, request.candidates, self.interrupt)
        });
        self.stages.sample = clock.elapsed().as_secs_f64();
        Ok(self.judge(sampled))
    }

    /// Makes motions of paths whose ends are not exact yet; where there is no path, its drawing was truncated.
    fn judge(mut self, sampled: Vec<Option<Waypoints>>) -> Plan {
        let mut paths: Vec<Waypoints> = sampled.iter().flatten().cloned().collect();
        let attached = self.attach(&mut paths);
        let mut finished = self
            .finish(paths, Source::Learned)
            .into_iter()
            .zip(attached);
        let draws = sampled.into_iter().map(|sampled| {
            let finished = sampled.as_ref().and_then(|_| finished.next());
            let (path, outcome) = match finished {
                Some((draw, attached)) => (draw.path, attached.and(draw.outcome)),
                None => (None, Err(Failure::Truncated)),
            };
            Draw {
                sampled,
                path,
                source: Source::Learned,
                outcome,
            }
        });
        let draws: Vec<Draw> = draws.collect();
        let learned = count_learned(&draws);
        self.answer(draws, learned, Instant::now())
    }

    /// Brings the ends of paths onto start and goal; where that fails, the path is none to deliver.
    fn attach(&mut self, paths: &mut [Waypoints]) -> Vec<Result<(), Failure>> {
        let (robot, problem, interrupt) = (&self.planner.robot, self.problem, self.interrupt);
        let clock = Instant::now();
        let bring = |path: &mut Waypoints| match interrupt() {
            true => Err(Failure::Truncated),
            false => attach(robot, problem, path)
                .then_some(())
                .ok_or(Failure::Goal),
        };
        let attached = paths.par_iter_mut().map(bring).collect();
        self.stages.correct += clock.elapsed().as_secs_f64();
        attached
    }

    fn learned(&mut self, goals: &[Configuration]) -> Vec<Draw> {
        let Some(model) = &self.planner.models.fast else {
            return Vec::new();
        };
        let clock = Instant::now();
        let robot = &self.planner.robot;
        let (start, goal_tip) = (&self.problem.start, self.problem.goal_tip(robot));
        let frame = CanonicalFrame::wanted(model.frame(), robot, start, &goal_tip);
        let canonical = CanonicalProblem::new(frame, &self.problem.scene);
        let features: Vec<_> = goals
            .par_iter()
            .map(|g| canonical.features(robot, &self.problem.start, g))
            .collect();
        self.stages.condition += clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let residuals = sample_paths(model, &features, self.request.seed);
        let paths = residuals
            .iter()
            .zip(goals)
            .map(|(residual, goal)| self.bend(&frame, goal, residual))
            .collect();
        self.stages.sample = clock.elapsed().as_secs_f64();
        self.finish(paths, Source::Learned)
    }

    /// The straight segment to a goal shape plus a sampled residual given in the canonical frame.
    fn bend(&self, frame: &CanonicalFrame, goal: &Configuration, residual: &[f64]) -> Waypoints {
        let line = straight_path(&self.problem.start, goal);
        line.iter()
            .enumerate()
            .map(|(h, q)| q + frame.restore(&self.planner.basis.change(h, residual)))
            .collect()
    }

    fn straight(&mut self, ends: &[Configuration]) -> Vec<Draw> {
        let paths = ends
            .iter()
            .map(|end| straight_path(&self.problem.start, end))
            .collect();
        self.finish(paths, Source::Straight)
    }

    /// Corrects, times and certifies; what does not certify is corrected once more with a larger margin.
    fn finish(&mut self, mut paths: Vec<Waypoints>, source: Source) -> Vec<Draw> {
        let sampled = paths.clone();
        let mut outcomes: Vec<Result<Trajectory, Failure>> =
            vec![Err(Failure::Truncated); paths.len()];
        for margin in CORRECTION_MARGINS {
            self.attempt(margin + self.request.growth, &mut paths, &mut outcomes);
        }
        let draw = |((sampled, path), outcome)| Draw {
            sampled: Some(sampled),
            path: Some(path),
            source,
            outcome,
        };
        let paths = sampled.into_iter().zip(paths);
        paths.zip(outcomes).map(draw).collect()
    }

    fn attempt(
        &mut self,
        margin: f64,
        paths: &mut [Waypoints],
        outcomes: &mut [Result<Trajectory, Failure>],
    ) {
        let (planner, demands, interrupt) = (self.planner, &self.demands, self.interrupt);
        let clock = Instant::now();
        let mut open: Vec<_> = paths
            .iter_mut()
            .zip(outcomes)
            .filter(|(_, outcome)| outcome.is_err())
            .collect();
        open.par_iter_mut().for_each(|(path, _)| {
            if !interrupt() {
                correct(&planner.robot, demands.scene, &planner.basis, margin, path);
            }
        });
        let corrected = clock.elapsed().as_secs_f64();
        open.par_iter_mut().for_each(|(path, outcome)| {
            **outcome = if interrupt() {
                Err(Failure::Truncated)
            } else {
                demands.time(path)
            };
        });
        let timed = clock.elapsed().as_secs_f64();
        open.par_iter_mut().for_each(|(_, outcome)| {
            if let Ok(trajectory) = &**outcome {
                let verdict = if interrupt() {
                    Err(Failure::Truncated)
                } else {
                    demands.certify(trajectory)
                };
                if let Err(failure) = verdict {
                    **outcome = Err(failure);
                }
            }
        });
        self.stages.correct += corrected;
        self.stages.time += timed - corrected;
        self.stages.certify += clock.elapsed().as_secs_f64() - timed;
    }

    fn trees(&mut self, goals: &[Configuration]) -> Vec<Draw> {
        let clock = Instant::now();
        let draws = goals
            .par_iter()
            .enumerate()
            .map(|(i, goal)| self.tree(i as u64, &[*goal], &RrtSettings::default()))
            .collect();
        self.stages.sample += clock.elapsed().as_secs_f64();
        draws
    }

    fn tree(&self, stream: u64, goals: &[Configuration], settings: &RrtSettings) -> Draw {
        let mut draw = Draw {
            sampled: None,
            path: None,
            source: Source::Tree,
            outcome: Err(Failure::NoPath),
        };
        let mut rng = Pcg64::new(u128::from(self.request.seed), u128::from(stream) + 1);
        for margin in TREE_MARGINS {
            if (self.interrupt)() {
                break;
            }
            let grown = self
                .planner
                .robot
                .with_tube_growth(margin + self.request.growth);
            let found = rrt_connect(
                &grown,
                &self.problem.scene,
                &self.problem.start,
                goals,
                settings,
                &mut rng,
                self.interrupt,
            );
            if let Some(polyline) = found
                && let Ok((path, trajectory)) = self.demands.follow(&polyline)
            {
                draw.path = Some(path);
                draw.outcome = Ok(trajectory);
                return draw;
            }
        }
        if (self.interrupt)() {
            draw.outcome = Err(Failure::Truncated);
        }
        draw
    }

    /// Replaces what the learned sampler did not deliver: a straight segment, else the tree, to the same shape.
    fn fill(&mut self, goals: &[Configuration], draws: &mut [Draw]) {
        let missing: Vec<usize> = (0..draws.len())
            .filter(|&i| draws[i].outcome.is_err())
            .collect();
        let ends: Vec<Configuration> = missing.iter().map(|&i| goals[i]).collect();
        let straight = self.straight(&ends);
        let filled: Vec<Draw> = straight
            .into_par_iter()
            .zip(&missing)
            .map(|(draw, &i)| {
                if draw.outcome.is_ok() {
                    draw
                } else {
                    self.tree(i as u64, &[goals[i]], &RrtSettings::default())
                }
            })
            .collect();
        for (i, draw) in missing.into_iter().zip(filled) {
            match draw.outcome {
                Ok(_) => draws[i] = draw,
                Err(Failure::Truncated) => draws[i].outcome = draw.outcome,
                Err(_) => {}
            }
        }
        if draws.iter().all(|d| d.outcome.is_err()) {
            draws[0] = self.tree(goals.len() as u64, goals, &LAST_ATTEMPT);
        }
    }

    fn answer(mut self, draws: Vec<Draw>, learned: [usize; 2], clock: Instant) -> Plan {
        let (robot, scene) = (&self.planner.robot, &self.problem.scene);
        let candidates: Vec<Candidate> = draws
            .par_iter()
            .enumerate()
            .filter_map(|(draw, d)| d.outcome.as_ref().ok().map(|t| (draw, d.source, t)))
            .map(|(draw, source, t)| Candidate {
                trajectory: t.clone(),
                metrics: path_metrics(robot, scene, t),
                source,
                draw,
            })
            .collect();
        let selected = select(&candidates, &self.problem.start, self.request.selection);
        self.stages.select = clock.elapsed().as_secs_f64();
        let truncated = draws.iter().any(|d| d.outcome == Err(Failure::Truncated));
        let [learned_drawn, learned_certified] = learned;
        Plan {
            draws,
            candidates,
            selected,
            learned_certified,
            learned_drawn,
            truncated,
            stages: self.stages,
        }
    }
}
