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

/// The flow's noise where paths to explore are drawn: wide enough to go around obstacles on other sides.
const WIDE: f32 = 4.0;
/// Paths that a round of exploring draws, and how many of them are finished.
const DRAWN: usize = 64;
const FINISHED: usize = 8;
/// Every so many waypoints of a path are looked at to tell how far it is from clear.
const STRIDE: usize = 4;

impl Run<'_> {
    /// One path of the few-step model to each goal shape, the first ones begun from what is left of other paths.
    ///
    /// Parts are drawn and finished without waiting for each other.
    pub(crate) fn learned(&self, aim: &Aim) -> Vec<(Draw, Laps)> {
        let Some(drawing) = Drawing::of(self) else {
            return Vec::new();
        };
        let share = share(drawing.model, aim.goals.len());
        let parts = aim.goals.par_chunks(share).enumerate();
        let parts: Vec<_> = parts
            .map(|(part, goals)| drawing.part(aim, part * share, goals))
            .collect();
        parts.into_iter().flatten().collect()
    }

    /// Where no draw is certified: draws many more from wide noise, and finishes those that are nearest to clear, until one is
    /// certified or all rounds are over. These take the places of the draws to the same shapes.
    pub(crate) fn explore(&mut self, aim: &Aim, draws: &mut [Draw], rounds: usize) {
        if draws.iter().any(|draw| draw.outcome.is_ok()) {
            return;
        }
        let Some(drawing) = Drawing::of(self) else {
            return;
        };
        let clock = Instant::now();
        let found = drawing.explore(aim, rounds);
        let wall_s = clock.elapsed().as_secs_f64();
        let (places, found): (Vec<usize>, Vec<(Draw, Laps)>) = found.into_iter().unzip();
        let [found] = self.share(wall_s, [found]);
        for (place, draw) in places.into_iter().zip(found) {
            if draw.outcome.is_ok() {
                self.report(place, &draw);
                draws[place] = draw;
            }
        }
    }
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
        let model = run.planner.models.fast.as_ref()?;
        let robot = &run.planner.robot;
        let goal_tip = run.problem.goal_tip(robot);
        let frame = CanonicalFrame::wanted(model.frame(), robot, &run.problem.start, &goal_tip);
        Some(Self {
            run,
            model,
            frame,
            canonical: CanonicalProblem::new(frame, &run.problem.scene),
        })
    }

    /// Draws and finishes the paths to some goal shapes, from the draw `first` on.
    fn part(&self, aim: &Aim, first: usize, goals: &[Configuration]) -> Vec<(Draw, Laps)> {
        if (self.run.supervision.interrupt)() {
            let draw = unfinished(Source::Learned, Failure::Truncated);
            return vec![(draw, Laps::default()); goals.len()];
        }
        let mut clock = Instant::now();
        let features = self.features(goals);
        let mut laps = Laps {
            condition: lap(&mut clock),
            ..Laps::default()
        };
        let proposals = self.draw(aim, first, goals, &features);
        laps.sample = lap(&mut clock);
        let mut finished = self.run.finish_each(proposals);
        finished[0].1.add(&laps);
        finished
    }

    fn features(&self, goals: &[Configuration]) -> Vec<Features> {
        let (robot, start) = (&self.run.planner.robot, &self.run.problem.start);
        goals
            .par_iter()
            .map(|goal| self.canonical.features(robot, start, goal))
            .collect()
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
        let residuals = sample_paths(self.model, &inputs, first, self.run.request.seed, 1.0);
        let paths = residuals.iter().zip(goals);
        let paths = paths.map(|(residual, goal)| self.bend(goal, residual));
        let proposal = |(draw, path)| Proposal {
            draw: Some(draw),
            ..rough(path)
        };
        (first..).zip(paths).map(proposal).collect()
    }

    /// What came of the last round, and for which goal shape each was drawn.
    fn explore(&self, aim: &Aim, rounds: usize) -> Vec<(usize, (Draw, Laps))> {
        let mut clock = Instant::now();
        let features = self.features(&aim.goals);
        let mut laps = Laps {
            condition: lap(&mut clock),
            ..Laps::default()
        };
        let mut last = Vec::new();
        for round in 0..rounds {
            if (self.run.supervision.interrupt)() {
                break;
            }
            let (places, paths): (Vec<usize>, Vec<Waypoints>) =
                self.promising(aim, &features, round).into_iter().unzip();
            laps.sample += lap(&mut clock);
            let finished = self.run.finish_each(paths.into_iter().map(rough).collect());
            let is_found = finished.iter().any(|(draw, _)| draw.outcome.is_ok());
            last = places.into_iter().zip(finished).collect();
            if is_found {
                break;
            }
        }
        if let Some((_, (_, first))) = last.first_mut() {
            first.add(&laps);
        }
        last
    }

    /// Those paths of a round of wide draws that are nearest to clear, and the places of the goal shapes to which they lead.
    fn promising(&self, aim: &Aim, features: &[Features], round: usize) -> Vec<(usize, Waypoints)> {
        let share = share(self.model, DRAWN);
        let firsts: Vec<usize> = (0..DRAWN).step_by(share).collect();
        let drawn = firsts.par_iter().flat_map_iter(|&first| {
            let places = (first..DRAWN.min(first + share)).map(|draw| draw % features.len());
            let inputs: Vec<CandidateInput> = places
                .clone()
                .map(|place| input(&features[place], None))
                .collect();
            // Their noise is not that of any path that the request draws otherwise.
            let index = aim.goals.len() + round * DRAWN + first;
            let seed = self.run.request.seed;
            let residuals = sample_paths(self.model, &inputs, index, seed, WIDE);
            let paths = places.zip(residuals).map(|(place, residual)| {
                let path = self.bend(&aim.goals[place], &residual);
                (self.missing(&path), place, path)
            });
            paths.collect::<Vec<_>>()
        });
        let mut drawn: Vec<(f64, usize, Waypoints)> = drawn.collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        drawn.truncate(FINISHED);
        let path = |(_, place, path)| (place, path);
        drawn.into_iter().map(path).collect()
    }

    /// Sum of what the clearance of a path lacks, section lengths.
    fn missing(&self, path: &[Configuration]) -> f64 {
        let robot = &self.run.planner.robot;
        let (scene, growth) = (&self.run.problem.scene, self.run.request.growth);
        let lacking = |waypoint: &Configuration| {
            let shape = robot.backbone(&robot.project_to_limits(waypoint));
            (growth - scene.clearance(&shape, robot.tube_radius)).max(0.0)
        };
        path.iter().skip(STRIDE).step_by(STRIDE).map(lacking).sum()
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

/// A path of the model, whose tip is to be drawn onto a smooth curve.
fn rough(path: Waypoints) -> Proposal {
    Proposal {
        is_rough: true,
        ..Proposal::of(path, Source::Learned)
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
