//! The way of a request with several goals: goal configurations, legs, one motion through all of them.
//!
//! Everything is budgeted in counts, as for a request with one goal.

use crate::error::PlannerError;
use crate::motion::through::{Leg, Through};
use crate::moving_obstacles::MovingObstacles;
use crate::path::waypoints::resample;
use crate::pipeline::answer::from_rest;
use crate::pipeline::braking::Braking;
use crate::pipeline::chain::{Chain, Chains, ForbiddenLeg};
use crate::pipeline::context::RequestContext;
use crate::plan::{Candidate, Draw, Failure, Passage, Plan};
use crate::problem::{BENDING_SLACK_RAD, Goal, Problem, Via};
use crate::request::{Request, Supervision};
use crate::stage_times::StageTimes;
use codes::{Source, Stage};
use pcc_model::Configuration;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::time::Instant;

/// Chains that are tried in the place of one whose legs have no path.
const CHAINS_OF_A_DRAW: usize = 4;
/// Knots that a leg may have at least.
const LEAST_KNOTS_OF_A_LEG: usize = 8;

/// Samples of a motion, equally spaced in time, by which its path is known.
const SAMPLES: usize = 256;

/// A leg that was planned, with what it took.
struct PlannedLeg {
    leg: Leg,
    source: Source,
    /// Learned draws, and how many of them were certified.
    learned: [usize; 2],
}

/// One draw of a route.
struct RouteDraw {
    draw: Draw,
    passages: Vec<Passage>,
    learned: [usize; 2],
    times: StageTimes,
}

/// A request with goals before the problem's own.
struct Route<'a> {
    context: &'a RequestContext<'a>,
    via: &'a [Via],
    braking: Option<&'a Braking<'a>>,
}

/// Answers a request whose motion passes `via` on the way to the problem's goal.
///
/// # Errors
/// [`PlannerError::Infeasible`] or [`PlannerError::InfeasibleVia`] where a goal cannot be reached or a robot in motion cannot stop.
pub(crate) fn answer_route(context: &RequestContext, via: &[Via]) -> Result<Plan, PlannerError> {
    let problem = context.problem;
    let motion = context.request.start_motion.as_ref();
    let state = motion.map(|motion| motion.state_in(&problem.start));
    let braking = state.map(|state| Braking::new(&context.constraints, &state));
    let braking = braking.transpose()?;
    let after = braking
        .as_ref()
        .map(|braking| braking.what_follows(problem, context.request));
    let (rest, shorter) = after.unwrap_or_else(|| (problem.clone(), context.request.clone()));
    let padded = context.constraints.padded;
    let supervision = context.supervision;
    let slack_rad = braking
        .as_ref()
        .map_or(BENDING_SLACK_RAD, Braking::bending_slack_rad);
    let context = RequestContext::new(context.resources, padded, &rest, &shorter, supervision)
        .with_bending_slack(slack_rad);
    let route = Route {
        context: &context,
        via,
        braking: braking.as_ref(),
    };
    route.plan()
}

impl Route<'_> {
    fn plan(&self) -> Result<Plan, PlannerError> {
        let mut times = StageTimes::default();
        let goals = self.goals();
        let found = times.measure(Stage::Condition, || Chains::find(self.context, &goals))?;
        let wanted = self.context.request.candidates;
        let best = found
            .as_ref()
            .map_or_else(Vec::new, |chains| chains.best(wanted));
        let clock = Instant::now();
        let chains = best.into_par_iter().enumerate().with_max_len(1);
        let draws = chains.filter_map(|(index, chain)| {
            let draw = self.draw(index, found.as_ref()?, chain);
            self.report(index, &draw);
            Some(draw)
        });
        let draws: Vec<RouteDraw> = draws.collect();
        times.share(
            clock.elapsed().as_secs_f64(),
            draws.iter().map(|draw| draw.times),
        );
        Ok(self.plan_of(draws, times))
    }

    fn goals(&self) -> Vec<Goal> {
        let via = self.via.iter().map(|via| via.goal);
        via.chain([self.context.problem.goal]).collect()
    }

    fn report(&self, index: usize, draw: &RouteDraw) {
        if let (Some(report), Some(candidate)) =
            (self.context.supervision.certified, draw.candidate(index))
        {
            report(candidate);
        }
    }

    fn plan_of(&self, draws: Vec<RouteDraw>, stages: StageTimes) -> Plan {
        let candidates = draws.iter().enumerate();
        let candidates = candidates.filter_map(|(index, draw)| draw.candidate(index));
        let count = |which: usize| draws.iter().map(|draw| draw.learned[which]).sum();
        let is_truncated =
            |draw: &RouteDraw| draw.draw.outcome.as_ref().err() == Some(&Failure::Truncated);
        Plan {
            candidates: candidates.collect(),
            learned_drawn: count(0),
            learned_certified: count(1),
            explored: 0,
            truncated: draws.is_empty() || draws.iter().any(is_truncated),
            stages,
            draws: draws.into_iter().map(|draw| draw.draw).collect(),
        }
    }

    /// A motion along a chain, or along others where a leg of it has no path.
    fn draw(&self, index: usize, chains: &Chains, mut chain: Chain) -> RouteDraw {
        let mut drawn = RouteDraw::default();
        let mut without: Vec<ForbiddenLeg> = Vec::new();
        for _ in 0..CHAINS_OF_A_DRAW {
            let found = chain.clone();
            let mut rng = Pcg64::new(u128::from(self.context.request.seed), index as u128);
            let shorten = || chains.shorten(&mut chain, index > 0, &mut rng);
            drawn.times.measure(Stage::Condition, shorten);
            let failed = match self.legs(&chain, &mut drawn) {
                Ok(legs) => return self.finish(&legs, drawn),
                Err(failed) => failed,
            };
            if (self.context.supervision.interrupt)() {
                drawn.draw.outcome = Err(Failure::Truncated);
                return drawn;
            }
            let from = failed
                .checked_sub(1)
                .map_or(0, |before| found.places[before]);
            without.push([failed, from, found.places[failed]]);
            match chains.instead_of(&found, &without) {
                Some(other) => chain = other,
                None => break,
            }
        }
        drawn
    }

    /// The legs of a chain, or the index of the first one that has no path.
    fn legs(&self, chain: &Chain, drawn: &mut RouteDraw) -> Result<Vec<PlannedLeg>, usize> {
        let mut from = self.context.problem.start;
        let mut legs = Vec::with_capacity(chain.configurations.len());
        for (index, to) in chain.configurations.iter().enumerate() {
            let leg = self.leg(index, from, *to, drawn).ok_or(index)?;
            drawn.learned[0] += leg.learned[0];
            drawn.learned[1] += leg.learned[1];
            legs.push(leg);
            from = *to;
        }
        Ok(legs)
    }

    /// The fastest motion between two configurations that a request of its own finds, among the obstacles at rest: when the leg begins, and so
    /// where the others are then, is known only of the whole route.
    fn leg(
        &self,
        index: usize,
        start: Configuration,
        end: Configuration,
        drawn: &mut RouteDraw,
    ) -> Option<PlannedLeg> {
        let RequestContext {
            resources,
            problem,
            request,
            supervision,
            ..
        } = *self.context;
        let problem = Problem {
            start,
            goal: Goal::Configuration(end),
            moving: MovingObstacles::default(),
            ..problem.clone()
        };
        let request = Request {
            candidates: 1,
            knots: (request.knots / (self.via.len() + 1)).max(LEAST_KNOTS_OF_A_LEG),
            start_motion: None,
            previous: None,
            ..request.clone()
        };
        let supervision = Supervision {
            certified: None,
            early_selection: None,
            ..supervision
        };
        let padded = self.context.constraints.padded;
        let context = RequestContext::new(resources, padded, &problem, &request, supervision)
            .with_bending_slack(self.context.constraints.bending_slack_rad);
        let plan = from_rest(&context).ok()?;
        drawn.times.add(1.0, &plan.stages);
        let candidate = plan.candidates.first()?;
        let mut path = resample(&candidate.trajectory.sample(SAMPLES));
        let last = path.len() - 1;
        (path[0], path[last]) = (start, end);
        let motion = plan.draws[candidate.draw].outcome.clone().ok()?;
        let tip_tolerance = self
            .via
            .get(index)
            .map_or(f64::INFINITY, |via| via.tip_tolerance);
        Some(PlannedLeg {
            leg: Leg {
                path,
                motion,
                tip_tolerance,
            },
            source: candidate.source,
            learned: [plan.learned_drawn, plan.learned_certified],
        })
    }

    /// One motion along all legs.
    fn finish(&self, planned: &[PlannedLeg], mut drawn: RouteDraw) -> RouteDraw {
        drawn.draw.source = source(planned.iter().map(|leg| leg.source));
        let legs = planned.iter().map(|planned| planned.leg.clone());
        let legs: Vec<Leg> = legs.collect();
        let through = drawn.times.measure(Stage::Time, || self.through(&legs));
        drawn.draw.outcome = through.map(|Through { motion, passages }| {
            drawn.draw.path = Some(resample(&motion.trajectory.sample(SAMPLES)));
            drawn.passages = passages;
            motion
        });
        drawn
    }

    /// One motion along all legs: joined to the braking of a robot in motion where that is certified, else after it.
    fn through(&self, legs: &[Leg]) -> Result<Through, Failure> {
        let constraints = &self.context.constraints;
        let Some(braking) = self.braking else {
            return constraints.through(legs, None);
        };
        let joined = constraints.through(legs, Some(braking.state()));
        joined.or_else(|_| braking.before_route(&constraints.through(legs, None)?))
    }
}

impl Default for RouteDraw {
    fn default() -> Self {
        Self {
            draw: Draw::unfinished(Source::Classical, Failure::NoPath),
            passages: Vec::new(),
            learned: [0; 2],
            times: StageTimes::default(),
        }
    }
}

impl RouteDraw {
    fn candidate(&self, index: usize) -> Option<Candidate> {
        let motion = self.draw.outcome.as_ref().ok()?;
        Some(Candidate {
            passages: self.passages.clone(),
            ..Candidate::of(index, self.draw.source, motion)
        })
    }
}

/// What proposed the path of a route: straight segments where all legs are straight, else a learned sampler where that proposed a leg.
fn source(of_legs: impl Iterator<Item = Source>) -> Source {
    let rank = |source: &Source| match source {
        Source::StraightLine => 0,
        Source::Classical => 1,
        _ => 2,
    };
    of_legs.max_by_key(rank).unwrap_or(Source::StraightLine)
}
