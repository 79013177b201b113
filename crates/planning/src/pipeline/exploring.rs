//! Exploring: many more learned paths from wide noise, where none of the request's draws is certified.

use crate::models::features::Features;
use crate::models::few_step::sample_paths;
use crate::path::waypoints::Waypoints;
use crate::pipeline::context::{Deliveries, Proposal, RequestContext, share};
use crate::pipeline::goal_set::GoalSet;
use crate::pipeline::learned::{FewStepSampler, candidate_input};
use crate::plan::{Draw, Failure};
use crate::stage_times::{StageTimes, Stopwatch};
use codes::{Source, Stage};
use denoiser::CandidateInput;
use pcc_model::Configuration;
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// The flow's noise where paths to explore are drawn: wide enough to go around obstacles on other sides.
const WIDE: f32 = 4.0;
/// Rounds of exploring at most.
const ROUNDS: usize = 30;
/// Paths that a round draws.
const DRAWN: usize = PARTS * DRAWN_AT_ONCE;
/// Parts in which a round's paths are drawn: between parts an interrupt is heeded.
const PARTS: usize = 8;
/// Paths that are drawn in a part.
const DRAWN_AT_ONCE: usize = 8;
/// Paths of a round that motions are made of.
const TRIED: usize = 8;
/// Step between the waypoints by which a path's distance from being clear is measured.
const STRIDE: usize = 4;

/// Where no draw is certified: draws many more from wide noise, and makes motions of those that are nearest to clear, until one is
/// certified or all rounds are over. Certified ones take the places of the draws to the same goal configurations.
///
/// Returns how many paths were drawn.
pub(super) fn explore(
    context: &RequestContext,
    goals: &GoalSet,
    draws: &mut [Draw],
    times: &mut StageTimes,
) -> usize {
    if draws.iter().any(|draw| draw.outcome.is_ok()) {
        return 0;
    }
    let Some(sampler) = FewStepSampler::of(context) else {
        return 0;
    };
    let clock = Instant::now();
    let (drawn, places, delivered) = sampler.explore(&goals.of_each_draw);
    let wall_s = clock.elapsed().as_secs_f64();
    if (context.supervision.interrupt)() {
        draws[0].outcome = Err(Failure::Truncated);
    }
    let [delivered] = share(times, wall_s, [delivered]);
    // Those that were nearest to clear come first.
    for (place, draw) in places.into_iter().zip(delivered) {
        if draw.outcome.is_ok() && draws[place].outcome.is_err() {
            context.report(place, &draw);
            draws[place] = draw;
        }
    }
    drawn
}

impl FewStepSampler<'_> {
    /// How many paths were drawn; of the last round the places of the goal configurations to which its draws lead, and the draws.
    fn explore(&self, goals: &[Configuration]) -> (usize, Vec<usize>, Deliveries) {
        let mut clock = Stopwatch::start();
        let (mut drawn, mut places, mut delivered) = (0, Vec::new(), Deliveries::new());
        let Some(features) = self.features(goals) else {
            return (drawn, places, delivered);
        };
        let mut times = StageTimes::default();
        times[Stage::Condition] = clock.lap();
        for round in 0..ROUNDS {
            if (self.context.supervision.interrupt)() {
                break;
            }
            let promising = self.promising(goals, &features, round).into_iter();
            let (leads_to, paths): (Vec<usize>, Vec<Waypoints>) = promising.unzip();
            times[Stage::Sample] += clock.lap();
            let proposals = paths
                .into_iter()
                .map(|path| Proposal::learned(path, Source::Explored));
            (places, delivered) = (leads_to, self.context.deliver_all(proposals.collect()));
            clock.lap();
            drawn += DRAWN;
            if delivered.iter().any(|(draw, _)| draw.outcome.is_ok()) {
                break;
            }
        }
        if let Some((_, first)) = delivered.first_mut() {
            first.add(1.0, &times);
        }
        (drawn, places, delivered)
    }

    /// Those paths of a round of wide draws that are nearest to clear, and the places of the goal configurations to which they lead.
    fn promising(
        &self,
        goals: &[Configuration],
        features: &[Features],
        round: usize,
    ) -> Vec<(usize, Waypoints)> {
        let parts = (0..PARTS).into_par_iter().with_max_len(1);
        let drawn = parts.flat_map_iter(|part| {
            // Their noise is not that of any path that the request draws otherwise.
            let first = goals.len() + round * DRAWN + part * DRAWN_AT_ONCE;
            self.wide(goals, features, first..first + DRAWN_AT_ONCE)
        });
        let mut drawn: Vec<(f64, usize, Waypoints)> = drawn.collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        drawn.truncate(TRIED);
        let path = |(_, place, path)| (place, path);
        drawn.into_iter().map(path).collect()
    }

    /// Wide draws with these numbers: the penetration of each, the place of its goal configuration, and its path; none if interrupted.
    fn wide(
        &self,
        goals: &[Configuration],
        features: &[Features],
        draws: Range<usize>,
    ) -> Vec<(f64, usize, Waypoints)> {
        if (self.context.supervision.interrupt)() {
            return Vec::new();
        }
        let places = draws.clone().map(|draw| draw % features.len());
        let inputs: Vec<CandidateInput> = places
            .clone()
            .map(|place| candidate_input(&features[place], None))
            .collect();
        let seed = self.context.request.seed;
        let residuals = sample_paths(self.model, &inputs, draws.start, seed, WIDE);
        let paths = places.zip(residuals).map(|(place, residual)| {
            let path = self.bend(&goals[place], &residual);
            (self.missing(&path), place, path)
        });
        paths.collect()
    }

    /// Sum of the penetrations of a path's waypoints, section lengths; 0 for a clear path.
    fn missing(&self, path: &[Configuration]) -> f64 {
        let (robot, scene) = (self.context.constraints.padded, &self.context.problem.scene);
        let lacking = |waypoint: &Configuration| {
            let within = robot.project_to_limits(waypoint);
            (-scene.clearance_at(robot, &within)).max(0.0)
        };
        path.iter().skip(STRIDE).step_by(STRIDE).map(lacking).sum()
    }
}
