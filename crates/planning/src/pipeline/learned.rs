//! Paths of the few-step model, each made a motion of as soon as it is drawn.

use crate::models::canonical_frame::CanonicalFrame;
use crate::models::features::{COEFFICIENTS, CanonicalProblem, Features};
use crate::models::few_step::{sample_paths, sampled_together};
use crate::path::waypoints::{Waypoints, straight_path};
use crate::pipeline::context::{Deliveries, Proposal, RequestContext};
use crate::pipeline::goal_set::GoalSet;
use crate::pipeline::previous_plan::kept_path;
use crate::pipeline::straight_line::StraightLineCandidates;
use crate::plan::{Draw, Failure};
use crate::stage_times::{StageTimes, Stopwatch};
use codes::{Source, Stage};
use denoiser::{CandidateInput, FastModel, WarmStart};
use pcc_model::Configuration;
use rayon::prelude::*;

/// Time in the flow at which a known path begins, 0 to 1: half noise, so that the present scene still shapes it.
const WARM_START_TIME: f32 = 0.5;
/// The learned paths of a request, beside which straight segments compete, and what remains of the motion that is followed.
pub(super) fn learned_and_kept(
    context: &RequestContext,
    goals: &GoalSet,
    segments: &StraightLineCandidates,
) -> (Deliveries, Deliveries) {
    rayon::join(
        || learned(context, goals, segments),
        || context.deliver_all(kept_path(&goals.remaining).into_iter().collect()),
    )
}

/// One path of the few-step model to each goal configuration, the first ones begun from what remains of other paths.
///
/// Parts are drawn and made motions of without waiting for each other; segments compete beside them.
fn learned(
    context: &RequestContext,
    goals: &GoalSet,
    segments: &StraightLineCandidates,
) -> Deliveries {
    let Some(sampler) = FewStepSampler::of(context) else {
        return Vec::new();
    };
    let count = goals.of_each_draw.len();
    let share = sampled_together(sampler.model, count);
    segments.wait_for(count);
    let parts = goals.of_each_draw.par_chunks(share).enumerate();
    let parts: Vec<_> = parts
        .map(|(part, ends)| sampler.part(goals, part * share, ends, segments))
        .collect();
    parts.into_iter().flatten().collect()
}

/// The few-step model with the problem as it sees it.
pub(super) struct FewStepSampler<'a> {
    pub(crate) context: &'a RequestContext<'a>,
    pub(super) model: &'a FastModel,
    frame: CanonicalFrame,
    canonical: CanonicalProblem<'a>,
}

impl<'a> FewStepSampler<'a> {
    /// None where the planner has no few-step model.
    pub(crate) fn of(context: &'a RequestContext<'a>) -> Option<Self> {
        let model = context.resources.models.fast.as_ref()?;
        let (robot, problem) = (&context.resources.robot, context.problem);
        let goal_tip = problem.goal_tip(robot);
        let frame = CanonicalFrame::wanted(model.frame(), robot, &problem.start, &goal_tip);
        let room = context.constraints.room();
        Some(Self {
            context,
            model,
            frame,
            canonical: CanonicalProblem::new(frame, &problem.scene, room),
        })
    }

    /// Draws paths to the goal configurations `ends`, the first of which is that of the draw `first`, and makes motions of them.
    fn part(
        &self,
        goals: &GoalSet,
        first: usize,
        ends: &[Configuration],
        segments: &StraightLineCandidates,
    ) -> Deliveries {
        let mut clock = Stopwatch::start();
        let Some(features) = self.features(ends) else {
            let draw = Draw::unfinished(Source::Learned, Failure::Truncated);
            return vec![(draw, StageTimes::default()); ends.len()];
        };
        let mut times = StageTimes::default();
        times[Stage::Condition] = clock.lap();
        let proposals = self.draw(goals, first, ends, &features);
        times[Stage::Sample] = clock.lap();
        let proposals = proposals.into_par_iter().with_max_len(1);
        let delivered = proposals.map(|proposal| segments.deliver(proposal));
        let mut delivered: Deliveries = delivered.collect();
        delivered[0].1.add(1.0, &times);
        delivered
    }

    /// The model's features of each goal configuration; none if interrupted.
    pub(crate) fn features(&self, ends: &[Configuration]) -> Option<Vec<Features>> {
        let (robot, start) = (&self.context.resources.robot, &self.context.problem.start);
        let interrupt = self.context.supervision.interrupt;
        let features = |end| (!interrupt()).then(|| self.canonical.features(robot, start, end));
        ends.par_iter().map(features).collect()
    }

    /// Draws a path to each of these goal configurations, begun from what remains of another path where there is one.
    fn draw(
        &self,
        goals: &GoalSet,
        first: usize,
        ends: &[Configuration],
        features: &[Features],
    ) -> Vec<Proposal> {
        let remaining = goals.remaining.iter().skip(first);
        let known: Vec<_> = remaining
            .map(|remaining| self.residual(&remaining.path))
            .collect();
        let starts = known.iter().map(|known| Some(known.as_slice()));
        let inputs: Vec<CandidateInput> = features
            .iter()
            .zip(starts.chain(std::iter::repeat(None)))
            .map(|(features, known)| candidate_input(features, known))
            .collect();
        let residuals = sample_paths(self.model, &inputs, first, self.context.request.seed, 1.0);
        let paths = residuals.iter().zip(ends);
        let paths = paths.map(|(residual, end)| self.bend(end, residual));
        let proposal = |(draw, path)| Proposal {
            draw: Some(draw),
            ..Proposal::learned(path, Source::Learned)
        };
        (first..).zip(paths).map(proposal).collect()
    }

    /// The straight segment to a goal configuration plus a sampled residual given in the canonical frame.
    pub(crate) fn bend(&self, end: &Configuration, residual: &[f64]) -> Waypoints {
        let basis = &self.context.resources.basis;
        let line = straight_path(&self.context.problem.start, end);
        line.iter()
            .enumerate()
            .map(|(h, q)| q + self.frame.restore(&basis.change(h, residual)))
            .collect()
    }

    /// The difference of a path to the straight segment between its ends, as coefficients in the canonical frame.
    fn residual(&self, path: &[Configuration]) -> [f32; COEFFICIENTS] {
        let turned: Vec<Configuration> = path.iter().map(|q| self.frame.configuration(q)).collect();
        let basis = &self.context.resources.basis;
        basis.analyse(&turned).map(|c| c as f32)
    }
}

/// The model's input for a candidate, with the residual that the flow begins from if there is one.
pub(super) fn candidate_input<'a>(
    features: &'a Features,
    known: Option<&'a [f32]>,
) -> CandidateInput<'a> {
    CandidateInput {
        ends: &features.ends,
        balls: &features.balls,
        warm_start: known.map(|coefficients| WarmStart {
            coefficients,
            time: WARM_START_TIME,
        }),
    }
}
