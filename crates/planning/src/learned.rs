//! Paths of the few-step model, each finished as soon as it is drawn.

use crate::canonical::CanonicalFrame;
use crate::features::{COEFFICIENTS, CanonicalProblem, Features};
use crate::finish::{Laps, lap};
use crate::path::{Waypoints, straight_path};
use crate::plan::{Draw, Failure, Source};
use crate::run::{Aim, Proposal, Run, unfinished};
use crate::sampling::{sample_paths, share};
use denoiser::{CandidateInput, FastModel, WarmStart};
use pcc_model::Configuration;
use rayon::prelude::*;
use std::time::Instant;

/// Where in the flow a path that is known begins: half noise, so that the scene as it is now still shapes it.
const WARM_START_TIME: f32 = 0.5;

impl Run<'_> {
    /// One path of the few-step model to each goal shape, the first ones begun from what is left of other paths.
    ///
    /// Parts are drawn and finished without waiting for each other.
    pub(crate) fn learned(&self, aim: &Aim) -> Vec<(Draw, Laps)> {
        let Some(model) = &self.planner.models.fast else {
            return Vec::new();
        };
        let robot = &self.planner.robot;
        let goal_tip = self.problem.goal_tip(robot);
        let frame = CanonicalFrame::wanted(model.frame(), robot, &self.problem.start, &goal_tip);
        let drawing = Drawing {
            run: self,
            model,
            frame,
            canonical: CanonicalProblem::new(frame, &self.problem.scene),
        };
        let share = share(model, aim.goals.len());
        let parts = aim.goals.par_chunks(share).enumerate();
        let parts: Vec<_> = parts
            .map(|(part, goals)| drawing.part(aim, part * share, goals))
            .collect();
        parts.into_iter().flatten().collect()
    }
}

/// What the few-step model draws from.
struct Drawing<'a> {
    run: &'a Run<'a>,
    model: &'a FastModel,
    frame: CanonicalFrame,
    canonical: CanonicalProblem<'a>,
}

impl Drawing<'_> {
    /// Draws and finishes the paths to some goal shapes, from the draw `first` on.
    fn part(&self, aim: &Aim, first: usize, goals: &[Configuration]) -> Vec<(Draw, Laps)> {
        if (self.run.supervision.interrupt)() {
            let draw = unfinished(Source::Learned, Failure::Truncated);
            return vec![(draw, Laps::default()); goals.len()];
        }
        let mut laps = Laps::default();
        let mut clock = Instant::now();
        let (robot, start) = (&self.run.planner.robot, &self.run.problem.start);
        let features: Vec<Features> = goals
            .par_iter()
            .map(|goal| self.canonical.features(robot, start, goal))
            .collect();
        laps.condition = lap(&mut clock);
        let proposals = self.draw(aim, first, goals, &features);
        laps.sample = lap(&mut clock);
        let mut finished = self.run.finish_each(proposals);
        finished[0].1.add(&laps);
        finished
    }

    fn draw(
        &self,
        aim: &Aim,
        first: usize,
        goals: &[Configuration],
        features: &[Features],
    ) -> Vec<Proposal> {
        let rests = aim.rests.iter().skip(first);
        let known: Vec<_> = rests.map(|rest| self.residual(&rest.path)).collect();
        let starts = known.iter().map(|known| Some(known.as_slice()));
        let inputs: Vec<CandidateInput> = features
            .iter()
            .zip(starts.chain(std::iter::repeat(None)))
            .map(|(features, known)| input(features, known))
            .collect();
        let residuals = sample_paths(self.model, &inputs, first, self.run.request.seed);
        let paths = residuals.iter().zip(goals);
        let paths = paths.map(|(residual, goal)| self.bend(goal, residual));
        let proposal = |(draw, path)| Proposal {
            draw: Some(draw),
            is_rough: true,
            ..Proposal::of(path, Source::Learned)
        };
        (first..).zip(paths).map(proposal).collect()
    }

    /// The straight segment to a goal shape plus a sampled residual given in the canonical frame.
    fn bend(&self, goal: &Configuration, residual: &[f64]) -> Waypoints {
        let basis = &self.run.planner.basis;
        let line = straight_path(&self.run.problem.start, goal);
        line.iter()
            .enumerate()
            .map(|(h, q)| q + self.frame.restore(&basis.change(h, residual)))
            .collect()
    }

    /// What of a path is not the straight segment between its ends, in the canonical frame.
    fn residual(&self, path: &[Configuration]) -> [f32; COEFFICIENTS] {
        let turned: Vec<Configuration> = path.iter().map(|q| self.frame.shape(q)).collect();
        let basis = &self.run.planner.basis;
        basis.analyse(&turned).map(|c| c as f32)
    }
}

/// What the model is told of a candidate, with the residual that it starts from if there is one.
fn input<'a>(features: &'a Features, known: Option<&'a [f32]>) -> CandidateInput<'a> {
    CandidateInput {
        ends: &features.ends,
        balls: &features.balls,
        warm_start: known.map(|coefficients| WarmStart {
            coefficients,
            time: WARM_START_TIME,
        }),
    }
}
