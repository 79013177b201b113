//! One request on its way: condition, sample, finish every path, fill what is missing, select.
//!
//! Everything is budgeted in counts, so the same request and seed give the same bits whatever the number of
//! threads; an interrupt only truncates.

use crate::canonical::CanonicalFrame;
use crate::diffusion::{Guidance, Task};
use crate::end_shapes::{check_goal, end_shapes};
use crate::features::CanonicalProblem;
use crate::finish::{Demands, Finished};
use crate::path::{Waypoints, straight_path};
use crate::plan::{Candidate, Draw, Failure, Plan, Request, Sampler, Source, StageTimes};
use crate::planner::{Interrupt, Planner, PlannerError};
use crate::problem::Problem;
use crate::sampling::sample_paths;
use crate::select::select;
use crate::terminal::attach;
use pcc_model::{Configuration, TendonLimits};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::time::Instant;

/// One request on its way through the stages.
pub(crate) struct Run<'a> {
    pub(crate) planner: &'a Planner,
    pub(crate) problem: &'a Problem,
    pub(crate) request: &'a Request,
    pub(crate) interrupt: Interrupt<'a>,
    pub(crate) demands: Demands<'a>,
    pub(crate) stages: StageTimes,
}

impl<'a> Run<'a> {
    pub(crate) fn new(
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
            basis: &planner.basis,
            limits,
            knots: request.knots,
            growth: request.growth,
            corrections: request.corrections,
            interrupt,
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

    pub(crate) fn plan(mut self) -> Result<Plan, PlannerError> {
        if let Sampler::Diffusion(guidance) = self.request.sampler {
            return self.diffusion(guidance);
        }
        let clock = Instant::now();
        let mut rng = Pcg64::seed_from_u64(self.request.seed);
        let (robot, count) = (&self.planner.robot, self.request.candidates);
        let ends = end_shapes(robot, self.problem, count, self.request.growth, &mut rng)?.shapes;
        let goals: Vec<Configuration> = (0..count).map(|i| ends[i % ends.len()]).collect();
        self.stages.condition = clock.elapsed().as_secs_f64();
        let draws = match self.request.sampler {
            Sampler::Default => return Ok(self.default(&ends, &goals)),
            Sampler::Fast => {
                let paths = self.learned(&goals);
                self.finish(paths, Source::Learned)
            }
            Sampler::Straight => {
                let paths = self.straight_paths(&ends);
                self.finish(paths, Source::Straight)
            }
            Sampler::RrtConnect | Sampler::Diffusion(_) => self.trees(&goals),
        };
        let learned = count_learned(&draws);
        Ok(self.answer(draws, learned))
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
        Ok(self.answer(draws, learned))
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

    /// One path of the few-step model to each goal shape.
    pub(crate) fn learned(&mut self, goals: &[Configuration]) -> Vec<Waypoints> {
        let Some(model) = &self.planner.models.fast else {
            return Vec::new();
        };
        let clock = Instant::now();
        let robot = &self.planner.robot;
        let frame = CanonicalFrame::of(robot, &self.problem.start, &self.problem.goal_tip(robot));
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
        paths
    }

    /// The straight segment to a goal shape plus a sampled residual given in the canonical frame.
    fn bend(&self, frame: &CanonicalFrame, goal: &Configuration, residual: &[f64]) -> Waypoints {
        let line = straight_path(&self.problem.start, goal);
        line.iter()
            .enumerate()
            .map(|(h, q)| q + frame.restore(&self.planner.basis.change(h, residual)))
            .collect()
    }

    pub(crate) fn straight_paths(&self, ends: &[Configuration]) -> Vec<Waypoints> {
        let start = &self.problem.start;
        ends.iter().map(|end| straight_path(start, end)).collect()
    }

    /// Takes every path through correction, time allocation, certification and figures.
    pub(crate) fn finish(&mut self, paths: Vec<Waypoints>, source: Source) -> Vec<Draw> {
        let sourced = paths.into_iter().map(|path| (path, source)).collect();
        self.finish_each(sourced)
    }

    /// The same for paths of several sources.
    pub(crate) fn finish_each(&mut self, paths: Vec<(Waypoints, Source)>) -> Vec<Draw> {
        let clock = Instant::now();
        let demands = &self.demands;
        let finished: Vec<(Waypoints, Source, Finished)> = paths
            .into_par_iter()
            .with_max_len(1)
            .map(|(path, source)| (path.clone(), source, demands.finish(path)))
            .collect();
        let laps = finished.iter().map(|(_, _, finished)| finished.laps);
        self.stages.share(clock.elapsed().as_secs_f64(), laps);
        let draw = |(sampled, source, finished): (Waypoints, Source, Finished)| Draw {
            sampled: Some(sampled),
            path: Some(finished.path),
            source,
            outcome: finished.outcome,
        };
        finished.into_iter().map(draw).collect()
    }

    pub(crate) fn answer(mut self, draws: Vec<Draw>, learned: [usize; 2]) -> Plan {
        let clock = Instant::now();
        let certified = draws.iter().enumerate().filter_map(|(draw, d)| {
            let certified = d.outcome.as_ref().ok()?;
            Some(Candidate {
                trajectory: certified.trajectory.clone(),
                metrics: certified.metrics,
                source: d.source,
                draw,
            })
        });
        let candidates: Vec<Candidate> = certified.collect();
        let selected = select(&candidates, &self.problem.start, self.request.selection);
        self.stages.select += clock.elapsed().as_secs_f64();
        let truncated = draws
            .iter()
            .any(|d| d.outcome.as_ref().err() == Some(&Failure::Truncated));
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

/// Learned draws, and how many of them are certified.
pub(crate) fn count_learned(draws: &[Draw]) -> [usize; 2] {
    let learned = draws.iter().filter(|d| d.source == Source::Learned);
    let certified = learned.clone().filter(|d| d.outcome.is_ok());
    [learned.count(), certified.count()]
}
