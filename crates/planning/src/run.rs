//! One request on its way: condition, sample, finish every path, fill what is missing, select.
//!
//! Everything is budgeted in counts, so the same request and seed give the same bits whatever the number of
//! threads; an interrupt only truncates.

use crate::diffusion::Task;
use crate::end_shapes::{check_goal, end_shapes_until};
use crate::error::PlannerError;
use crate::finish::Demands;
use crate::incumbent::Rival;
use crate::path::{Waypoints, straight_path};
use crate::plan::{Candidate, Certified, Draw, Failure, Plan, Source};
use crate::previous::{RemainingPath, remaining_paths};
use crate::problem::Problem;
use crate::race::Race;
use crate::request::{Guidance, Request, Sampler, Supervision};
use crate::resources::Resources;
use crate::select::{is_worth_a_change, select};
use crate::stage_times::StageTimes;
use crate::terminal::attach;
use pcc_model::{Configuration, Robot, TendonLimits};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// One request on its way through the stages.
pub(crate) struct Run<'a> {
    pub(crate) resources: &'a Resources,
    pub(crate) problem: &'a Problem,
    pub(crate) request: &'a Request,
    pub(crate) supervision: Supervision<'a>,
    pub(crate) demands: Demands<'a>,
    pub(crate) stages: StageTimes,
    /// Paths drawn because no draw certified.
    pub(crate) explored: usize,
}

/// What the few-step model is to draw.
pub(crate) struct Aim {
    /// The end shape of each draw.
    pub(crate) goals: Vec<Configuration>,
    /// The different shapes among them.
    pub(crate) ends: Vec<Configuration>,
    /// What is left of a previous plan's paths to the first of these shapes.
    pub(crate) remaining: Vec<RemainingPath>,
}

/// A path to be finished.
pub(crate) struct Proposal {
    pub(crate) path: Waypoints,
    pub(crate) source: Source,
    /// The draw that it is, unless it only competes with one.
    pub(crate) draw: Option<usize>,
    /// Whether its tip is drawn onto a smooth curve.
    pub(crate) is_rough: bool,
}

impl Proposal {
    /// A path that is finished as it is.
    pub(crate) fn of(path: Waypoints, source: Source) -> Self {
        Self {
            path,
            source,
            draw: None,
            is_rough: false,
        }
    }
}

/// Finished paths, and the time that each took.
pub(crate) type Finishes = Vec<(Draw, StageTimes)>;

/// Paths as the draws 0, 1, 2, …
pub(crate) fn draws_of(paths: Vec<Waypoints>, source: Source) -> Vec<Proposal> {
    let proposal = |(draw, path)| Proposal {
        draw: Some(draw),
        ..Proposal::of(path, source)
    };
    paths.into_iter().enumerate().map(proposal).collect()
}

impl<'a> Run<'a> {
    /// For a robot whose tubes are `grown` by what the request demands.
    pub(crate) fn new(
        resources: &'a Resources,
        grown: &'a Robot,
        problem: &'a Problem,
        request: &'a Request,
        supervision: Supervision<'a>,
    ) -> Self {
        let full = &resources.robot.tendon_limits;
        let limits = TendonLimits {
            velocity: full.velocity * request.limits_scale,
            acceleration: full.acceleration * request.limits_scale,
            jerk: full.jerk * request.limits_scale,
        };
        let demands = Demands {
            robot: &resources.robot,
            grown,
            scene: &problem.scene,
            kernel: &resources.kernel,
            curves: &resources.tip_curves,
            limits,
            knots: request.knots,
            corrections: request.corrections,
            interrupt: supervision.interrupt,
        };
        Self {
            resources,
            problem,
            request,
            supervision,
            demands,
            stages: StageTimes::default(),
            explored: 0,
        }
    }

    pub(crate) fn plan(mut self) -> Result<Plan, PlannerError> {
        if let Sampler::Diffusion(guidance) = self.request.sampler {
            return self.diffusion(guidance);
        }
        let clock = Instant::now();
        let aim = self.aim()?;
        self.stages.condition = clock.elapsed().as_secs_f64();
        if aim.ends.is_empty() {
            return Ok(self.truncated());
        }
        let draws = match self.request.sampler {
            Sampler::Default => return Ok(self.default(&aim)),
            Sampler::Fast => return Ok(self.fast(&aim)),
            Sampler::Straight | Sampler::StraightDrawn => {
                let is_rough = self.request.sampler == Sampler::StraightDrawn;
                let paths = self.straight_paths(&aim.ends);
                let segments = draws_of(paths, Source::Straight).into_iter();
                let segments = segments.map(|path| Proposal { is_rough, ..path });
                self.finish(segments.collect())
            }
            Sampler::RrtConnect | Sampler::RrtSmooth | Sampler::Diffusion(_) => {
                self.trees(&aim.goals)
            }
        };
        let learned = count_learned(&draws);
        Ok(self.answer(draws, learned))
    }

    /// The answer where there was no time for anything.
    fn truncated(self) -> Plan {
        let source = match self.request.sampler {
            Sampler::Straight | Sampler::StraightDrawn => Source::Straight,
            Sampler::RrtConnect | Sampler::RrtSmooth => Source::Tree,
            Sampler::Default | Sampler::Fast | Sampler::Diffusion(_) => Source::Learned,
        };
        let draws = vec![unfinished(source, Failure::Truncated); self.request.candidates];
        let learned = count_learned(&draws);
        self.answer(draws, learned)
    }

    /// End shapes: those of a previous plan that still serve, then others.
    fn aim(&self) -> Result<Aim, PlannerError> {
        let (robot, problem) = (self.demands.grown, self.problem);
        let count = self.request.candidates;
        let previous = self.request.previous.as_deref();
        let remaining =
            previous.map_or_else(Vec::new, |p| remaining_paths(p, robot, problem, count));
        let mut ends: Vec<Configuration> = remaining.iter().map(RemainingPath::end).collect();
        let mut rng = Pcg64::seed_from_u64(self.request.seed);
        let interrupt = self.supervision.interrupt;
        match end_shapes_until(robot, problem, count, &mut rng, interrupt) {
            Ok(found) => add_distinct(&mut ends, &found.shapes, count),
            Err(infeasible) if ends.is_empty() => return Err(infeasible.into()),
            Err(_) => {}
        }
        let goals = ends.iter().cycle().take(count).copied().collect();
        Ok(Aim {
            goals,
            ends,
            remaining,
        })
    }

    /// The learned sampler alone, beside what is left of the motion that is followed.
    fn fast(mut self, aim: &Aim) -> Plan {
        let clock = Instant::now();
        let without_segments = Race::new(&self, &[]);
        let (drawn, kept) = self.drawn_and_kept(aim, &without_segments);
        let [mut draws, kept] = self.share(clock.elapsed().as_secs_f64(), [drawn, kept]);
        let learned = count_learned(&draws);
        self.keep(kept, &mut draws);
        self.explore(aim, &mut draws);
        self.answer(draws, learned)
    }

    /// The learned paths, beside which segments race, and what is left of the motion that is followed.
    pub(crate) fn drawn_and_kept(&self, aim: &Aim, race: &Race) -> (Finishes, Finishes) {
        rayon::join(
            || self.learned(aim, race),
            || self.finish_each(aim.kept().into_iter().collect()),
        )
    }

    /// The paper's sampler; the end shapes are the network's, and correction brings their tips to the goal.
    fn diffusion(mut self, guidance: Guidance) -> Result<Plan, PlannerError> {
        let clock = Instant::now();
        let (robot, problem, request) = (&self.resources.robot, self.problem, self.request);
        check_goal(self.demands.grown, problem, request.seed)?;
        self.stages.condition = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let task = Task {
            robot,
            problem,
            guidance,
            seed: request.seed,
        };
        let model = self.resources.models.diffusion.as_ref();
        let sampled = model.map_or_else(Vec::new, |model| {
            model.sample(&task, request.candidates, self.supervision.interrupt)
        });
        self.stages.sample = clock.elapsed().as_secs_f64();
        Ok(self.judge(sampled))
    }

    /// Makes motions of paths whose ends are not exact yet; where there is no path, its drawing was truncated.
    pub(crate) fn judge(mut self, sampled: Vec<Option<Waypoints>>) -> Plan {
        let attached = self.attach(&sampled);
        let mut proposals = Vec::new();
        for (draw, path) in attached.iter().enumerate() {
            proposals.extend(path.as_ref().ok().map(|path| Proposal {
                draw: Some(draw),
                ..Proposal::of(path.clone(), Source::Learned)
            }));
        }
        let mut finished = self.finish(proposals).into_iter();
        let draws = sampled
            .into_iter()
            .zip(attached)
            .map(|(sampled, attached)| {
                let finished = attached.and_then(|_| finished.next().ok_or(Failure::Truncated));
                let (path, outcome) = match finished {
                    Ok(draw) => (draw.path, draw.outcome),
                    Err(failure) => (sampled.clone(), Err(failure)),
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
        self.answer(draws, learned)
    }

    /// Brings the ends of paths onto start and goal; where that fails, the path is none to deliver.
    fn attach(&mut self, sampled: &[Option<Waypoints>]) -> Vec<Result<Waypoints, Failure>> {
        let (robot, problem) = (&self.resources.robot, self.problem);
        let interrupt = self.supervision.interrupt;
        let clock = Instant::now();
        let bring = |sampled: &Option<Waypoints>| match sampled {
            Some(path) if !interrupt() => {
                let mut path = path.clone();
                let reached = attach(robot, problem, &mut path);
                reached.then_some(path).ok_or(Failure::Goal)
            }
            _ => Err(Failure::Truncated),
        };
        let attached = sampled.par_iter().map(bring).collect();
        self.stages.correct += clock.elapsed().as_secs_f64();
        attached
    }

    pub(crate) fn straight_paths(&self, ends: &[Configuration]) -> Vec<Waypoints> {
        let start = &self.problem.start;
        ends.iter().map(|end| straight_path(start, end)).collect()
    }

    /// Takes every path through correction, time allocation, certification and figures.
    pub(crate) fn finish(&mut self, proposals: Vec<Proposal>) -> Vec<Draw> {
        let clock = Instant::now();
        let finished = self.finish_each(proposals);
        let [draws] = self.share(clock.elapsed().as_secs_f64(), [finished]);
        draws
    }

    /// Divides `wall_s` among the stages that these paths went through.
    pub(crate) fn share<const N: usize>(
        &mut self,
        wall_s: f64,
        finished: [Finishes; N],
    ) -> [Vec<Draw>; N] {
        let laps = finished.iter().flatten().map(|(_, laps)| *laps);
        self.stages.share(wall_s, laps);
        finished.map(|finished| finished.into_iter().map(|(draw, _)| draw).collect())
    }

    /// The same, without counting the time.
    pub(crate) fn finish_each(&self, proposals: Vec<Proposal>) -> Finishes {
        let proposals = proposals.into_par_iter().with_max_len(1);
        proposals
            .map(|proposal| self.finish_one(proposal))
            .collect()
    }

    pub(crate) fn finish_one(&self, proposal: Proposal) -> (Draw, StageTimes) {
        self.finish_against(proposal, None)
    }

    /// Finishes a path that counts only if it beats its rival.
    pub(crate) fn finish_against(
        &self,
        proposal: Proposal,
        rival: Option<&Rival>,
    ) -> (Draw, StageTimes) {
        let sampled = proposal.path.clone();
        let finished = self.demands.finish(proposal.path, proposal.is_rough, rival);
        let draw = Draw {
            sampled: Some(sampled),
            path: Some(finished.path),
            source: proposal.source,
            outcome: finished.outcome,
        };
        if let Some(index) = proposal.draw {
            self.report(index, &draw);
        }
        (draw, finished.laps)
    }

    /// Puts what is left of the followed motion in the place of the draw to the same shape, unless that is so much shorter
    /// that it is worth a change.
    pub(crate) fn keep(&self, kept: Vec<Draw>, draws: &mut [Draw]) {
        for kept in kept.into_iter().filter(|draw| draw.outcome.is_ok()) {
            if !is_worth_a_change(kept.duration_s(), draws[0].duration_s()) {
                draws[0] = kept;
            }
        }
    }

    /// Tells who watches of a draw that is certified.
    pub(crate) fn report(&self, index: usize, draw: &Draw) {
        if let (Some(watch), Ok(motion)) = (self.supervision.certified, &draw.outcome) {
            watch(candidate(index, draw.source, motion));
        }
    }

    pub(crate) fn answer(mut self, draws: Vec<Draw>, learned: [usize; 2]) -> Plan {
        let clock = Instant::now();
        let certified = draws.iter().enumerate().filter_map(|(index, draw)| {
            let motion = draw.outcome.as_ref().ok()?;
            Some(candidate(index, draw.source, motion))
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
            explored: self.explored,
            truncated,
            stages: self.stages,
        }
    }
}

/// A draw of which there is no path.
pub(crate) fn unfinished(source: Source, failure: Failure) -> Draw {
    Draw {
        sampled: None,
        path: None,
        source,
        outcome: Err(failure),
    }
}

/// Learned draws, and how many of them are certified.
pub(crate) fn count_learned(draws: &[Draw]) -> [usize; 2] {
    let learned = draws.iter().filter(|d| d.source == Source::Learned);
    let certified = learned.clone().filter(|d| d.outcome.is_ok());
    [learned.count(), certified.count()]
}

fn candidate(draw: usize, source: Source, motion: &Certified) -> Candidate {
    Candidate {
        trajectory: Arc::clone(&motion.trajectory),
        metrics: motion.metrics,
        source,
        draw,
    }
}

/// Adds shapes to `ends` until they are `count`: first those that are far from all there are, then nearer ones.
fn add_distinct(ends: &mut Vec<Configuration>, shapes: &[Configuration], count: usize) {
    for separation_rad in [0.5, 0.1, 0.01] {
        for shape in shapes {
            let is_new = ends
                .iter()
                .all(|end| (end - shape).norm() >= separation_rad);
            if is_new && ends.len() < count {
                ends.push(*shape);
            }
        }
    }
}

impl Aim {
    /// What is left of the motion that is followed, as it is.
    pub(crate) fn kept(&self) -> Option<Proposal> {
        let followed = self.remaining.first().filter(|rest| rest.followed)?;
        Some(Proposal::of(followed.path.clone(), Source::Kept))
    }
}
