//! Paths of the few-step model, each finished as soon as it is drawn.

use crate::canonical::CanonicalFrame;
use crate::features::{COEFFICIENTS, CanonicalProblem, Features};
use crate::path::{Waypoints, straight_path};
use crate::plan::{Draw, Failure, Source};
use crate::race::Race;
use crate::run::{Aim, Finishes, Proposal, Run, unfinished};
use crate::sampling::{sample_paths, share};
use crate::stage_times::{StageTimes, Stopwatch};
use denoiser::{CandidateInput, FastModel, WarmStart};
use pcc_model::Configuration;
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// Where in the flow a path that is known begins: half noise, so that the scene as it is now still shapes it.
const WARM_START_TIME: f32 = 0.5;
/// The flow's noise where paths to explore are drawn: wide enough to go around obstacles on other sides.
const WIDE: f32 = 4.0;
/// Rounds of exploring at most.
const ROUNDS: usize = 30;
/// Paths that a round draws.
const DRAWN: usize = PARTS * DRAWN_AT_ONCE;
/// Parts in which they are drawn: between them an interrupt is heeded.
const PARTS: usize = 8;
/// Paths of a part.
const DRAWN_AT_ONCE: usize = 8;
/// Paths of a round that are finished.
const FINISHED: usize = 8;
/// Every so many waypoints of a path are looked at to tell how far it is from clear.
const STRIDE: usize = 4;

impl Run<'_> {
    /// One path of the few-step model to each goal shape, the first ones begun from what is left of other paths.
    ///
    /// Parts are drawn and finished without waiting for each other; segments race beside them.
    pub(crate) fn learned(&self, aim: &Aim, race: &Race) -> Finishes {
        let Some(drawing) = Drawing::of(self) else {
            return Vec::new();
        };
        let share = share(drawing.model, aim.goals.len());
        race.wait_for(aim.goals.len());
        let parts = aim.goals.par_chunks(share).enumerate();
        let parts: Vec<_> = parts
            .map(|(part, goals)| drawing.part(aim, part * share, goals, race))
            .collect();
        parts.into_iter().flatten().collect()
    }

    /// Where no draw is certified: draws many more from wide noise, and finishes those that are nearest to clear, until one is
    /// certified or all rounds are over. These take the places of the draws to the same shapes.
    pub(crate) fn explore(&mut self, aim: &Aim, draws: &mut [Draw]) {
        if draws.iter().any(|draw| draw.outcome.is_ok()) {
            return;
        }
        let Some(drawing) = Drawing::of(self) else {
            return;
        };
        let clock = Instant::now();
        let Explored { drawn, finished } = drawing.explore(aim);
        let wall_s = clock.elapsed().as_secs_f64();
        self.explored += drawn;
        if (self.supervision.interrupt)() {
            draws[0].outcome = Err(Failure::Truncated);
        }
        let (places, finished): (Vec<usize>, Vec<(Draw, StageTimes)>) =
            finished.into_iter().unzip();
        let [finished] = self.share(wall_s, [finished]);
        // Those that were nearest to clear come first.
        for (place, draw) in places.into_iter().zip(finished) {
            if draw.outcome.is_ok() && draws[place].outcome.is_err() {
                self.report(place, &draw);
                draws[place] = draw;
            }
        }
    }
}

/// What came of exploring.
#[derive(Default)]
struct Explored {
    /// Paths that were drawn.
    drawn: usize,
    /// Those that were finished in the last round, and the places of the goal shapes to which they lead.
    finished: Vec<(usize, (Draw, StageTimes))>,
}

/// What the few-step model draws from.
struct Drawing<'a> {
    run: &'a Run<'a>,
    model: &'a FastModel,
    frame: CanonicalFrame,
    canonical: CanonicalProblem<'a>,
}

impl<'a> Drawing<'a> {
    /// None without the model.
    fn of(run: &'a Run<'a>) -> Option<Self> {
        let model = run.resources.models.fast.as_ref()?;
        let robot = &run.resources.robot;
        let goal_tip = run.problem.goal_tip(robot);
        let frame = CanonicalFrame::wanted(model.frame(), robot, &run.problem.start, &goal_tip);
        Some(Self {
            run,
            model,
            frame,
            canonical: CanonicalProblem::new(frame, &run.problem.scene, run.demands.room()),
        })
    }

    /// Draws and finishes the paths to some goal shapes, from the draw `first` on.
    fn part(&self, aim: &Aim, first: usize, goals: &[Configuration], race: &Race) -> Finishes {
        let mut clock = Stopwatch::start();
        let Some(features) = self.features(goals) else {
            let draw = unfinished(Source::Learned, Failure::Truncated);
            return vec![(draw, StageTimes::default()); goals.len()];
        };
        let mut laps = StageTimes {
            condition: clock.lap(),
            ..StageTimes::default()
        };
        let proposals = self.draw(aim, first, goals, &features);
        laps.sample = clock.lap();
        let proposals = proposals.into_par_iter().with_max_len(1);
        let finished = proposals.map(|proposal| race.finish(proposal));
        let mut finished: Finishes = finished.collect();
        finished[0].1.add(&laps);
        finished
    }

    /// None if interrupted.
    fn features(&self, goals: &[Configuration]) -> Option<Vec<Features>> {
        let (robot, start) = (&self.run.resources.robot, &self.run.problem.start);
        let interrupt = self.run.supervision.interrupt;
        let features = |goal| (!interrupt()).then(|| self.canonical.features(robot, start, goal));
        goals.par_iter().map(features).collect()
    }

    fn draw(
        &self,
        aim: &Aim,
        first: usize,
        goals: &[Configuration],
        features: &[Features],
    ) -> Vec<Proposal> {
        let rests = aim.remaining.iter().skip(first);
        let known: Vec<_> = rests.map(|rest| self.residual(&rest.path)).collect();
        let starts = known.iter().map(|known| Some(known.as_slice()));
        let inputs: Vec<CandidateInput> = features
            .iter()
            .zip(starts.chain(std::iter::repeat(None)))
            .map(|(features, known)| input(features, known))
            .collect();
        let residuals = sample_paths(self.model, &inputs, first, self.run.request.seed, 1.0);
        let paths = residuals.iter().zip(goals);
        let paths = paths.map(|(residual, goal)| self.bend(goal, residual));
        let proposal = |(draw, path)| Proposal {
            draw: Some(draw),
            ..rough(path, Source::Learned)
        };
        (first..).zip(paths).map(proposal).collect()
    }

    fn explore(&self, aim: &Aim) -> Explored {
        let mut clock = Stopwatch::start();
        let mut explored = Explored::default();
        let Some(features) = self.features(&aim.goals) else {
            return explored;
        };
        let mut laps = StageTimes {
            condition: clock.lap(),
            ..StageTimes::default()
        };
        for round in 0..ROUNDS {
            if (self.run.supervision.interrupt)() {
                break;
            }
            let (places, paths): (Vec<usize>, Vec<Waypoints>) =
                self.promising(aim, &features, round).into_iter().unzip();
            laps.sample += clock.lap();
            let proposals = paths.into_iter().map(|path| rough(path, Source::Explored));
            let finished = self.run.finish_each(proposals.collect());
            clock.lap();
            let is_found = finished.iter().any(|(draw, _)| draw.outcome.is_ok());
            explored.drawn += DRAWN;
            explored.finished = places.into_iter().zip(finished).collect();
            if is_found {
                break;
            }
        }
        if let Some((_, (_, first))) = explored.finished.first_mut() {
            first.add(&laps);
        }
        explored
    }

    /// Those paths of a round of wide draws that are nearest to clear, and the places of the goal shapes to which they lead.
    fn promising(&self, aim: &Aim, features: &[Features], round: usize) -> Vec<(usize, Waypoints)> {
        let parts = (0..PARTS).into_par_iter().with_max_len(1);
        let drawn = parts.flat_map_iter(|part| {
            // Their noise is not that of any path that the request draws otherwise.
            let first = aim.goals.len() + round * DRAWN + part * DRAWN_AT_ONCE;
            self.wide(aim, features, first..first + DRAWN_AT_ONCE)
        });
        let mut drawn: Vec<(f64, usize, Waypoints)> = drawn.collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        drawn.truncate(FINISHED);
        let path = |(_, place, path)| (place, path);
        drawn.into_iter().map(path).collect()
    }

    /// Wide draws of these numbers: what each lacks, the place of its goal shape, and its path; none if interrupted.
    fn wide(
        &self,
        aim: &Aim,
        features: &[Features],
        draws: Range<usize>,
    ) -> Vec<(f64, usize, Waypoints)> {
        if (self.run.supervision.interrupt)() {
            return Vec::new();
        }
        let places = draws.clone().map(|draw| draw % features.len());
        let inputs: Vec<CandidateInput> = places
            .clone()
            .map(|place| input(&features[place], None))
            .collect();
        let seed = self.run.request.seed;
        let residuals = sample_paths(self.model, &inputs, draws.start, seed, WIDE);
        let paths = places.zip(residuals).map(|(place, residual)| {
            let path = self.bend(&aim.goals[place], &residual);
            (self.missing(&path), place, path)
        });
        paths.collect()
    }

    /// Sum of what the clearance of a path lacks, section lengths.
    fn missing(&self, path: &[Configuration]) -> f64 {
        let (robot, scene) = (self.run.demands.grown, &self.run.problem.scene);
        let lacking = |waypoint: &Configuration| {
            let shape = robot.backbone(&robot.project_to_limits(waypoint));
            (-scene.clearance(&shape, &robot.tube_radii)).max(0.0)
        };
        path.iter().skip(STRIDE).step_by(STRIDE).map(lacking).sum()
    }

    /// The straight segment to a goal shape plus a sampled residual given in the canonical frame.
    fn bend(&self, goal: &Configuration, residual: &[f64]) -> Waypoints {
        let basis = &self.run.resources.basis;
        let line = straight_path(&self.run.problem.start, goal);
        line.iter()
            .enumerate()
            .map(|(h, q)| q + self.frame.restore(&basis.change(h, residual)))
            .collect()
    }

    /// What of a path is not the straight segment between its ends, in the canonical frame.
    fn residual(&self, path: &[Configuration]) -> [f32; COEFFICIENTS] {
        let turned: Vec<Configuration> = path.iter().map(|q| self.frame.shape(q)).collect();
        let basis = &self.run.resources.basis;
        basis.analyse(&turned).map(|c| c as f32)
    }
}

/// A path of the model, whose tip is to be drawn onto a smooth curve.
fn rough(path: Waypoints, source: Source) -> Proposal {
    Proposal {
        is_rough: true,
        ..Proposal::of(path, source)
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
