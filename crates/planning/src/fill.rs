//! The default planner: learned candidates, beside which straight segments compete, and trees for what is missing.

use crate::finish::Demands;
use crate::first_success::first_success;
use crate::first_way::{FIRST_WAY, first_way};
use crate::path::{Waypoints, resample};
use crate::plan::{Draw, Failure, Plan, Source};
use crate::race::{Decided, Race};
use crate::reach::Reach;
use crate::request::{Interrupt, Sampler};
use crate::rrt_connect::{RrtSettings, Search};
use crate::run::{Aim, Run, count_learned, unfinished};
use pcc_model::{Configuration, Robot, SECTIONS};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::iter::once_with;
use std::time::Instant;

/// Tube growth of a tree's attempts: rounding its corners needs room, a narrow way may not have it.
const TREE_MARGINS: [f64; 3] = [0.04, 0.01, 0.0];
/// The same of ways that need only exist: beyond the accuracy with which a clearance is told.
const LEAST_MARGIN: f64 = 1e-3;
/// Times that a way that is found is shortened again because it is too angular for a motion.
const SHORTENINGS: usize = 3;

impl Run<'_> {
    /// Learned paths to every goal shape; where a straight segment is the fastest motion of all, it takes the place of the
    /// learned path to the same shape; what is missing then is filled.
    ///
    /// What is delivered does not depend on the selection rule.
    pub(crate) fn default(mut self, aim: &Aim) -> Plan {
        let clock = Instant::now();
        let race = Race::new(&self, &aim.ends);
        let (drawn, kept) = self.drawn_and_kept(aim, &race);
        let Decided { winner, segments } = race.decide(&drawn);
        let wall_s = clock.elapsed().as_secs_f64();
        let [mut draws, kept, mut segments] = self.share(wall_s, [drawn, kept, segments]);
        let learned = count_learned(&draws);
        if let Some((end, segment)) = winner {
            draws[end] = segments.swap_remove(segment);
        }
        self.keep(kept, &mut draws);
        self.fill(aim, &mut draws);
        self.answer(draws, learned)
    }

    /// Reaches the goal shapes that are still missing from the motions there are; without any, trees find the first.
    fn fill(&mut self, aim: &Aim, draws: &mut [Draw]) {
        let clock = Instant::now();
        if draws.iter().all(|draw| draw.outcome.is_err()) {
            if let Some((i, draw)) = self.first_motion(aim) {
                self.report(i, &draw);
                draws[i] = draw;
            }
            self.note_truncation(&mut draws[0]);
        }
        self.reach_missing(&aim.goals, draws);
        self.stages.select += clock.elapsed().as_secs_f64();
    }

    /// A first motion, and the place of the goal shape that it reaches. Falls back on the trees of [`Run::trees`], so that what they
    /// answer is not left without an answer.
    fn first_motion(&self, aim: &Aim) -> Option<(usize, Draw)> {
        self.motion_to_any(&aim.ends).or_else(|| {
            let interrupt = self.supervision.interrupt;
            first_success(aim.goals.len(), interrupt, |i, interrupt| {
                let draw = self.tree(i, &aim.goals[i], interrupt);
                draw.outcome.is_ok().then_some((i, draw))
            })
        })
    }

    /// A motion to some end shape, by trees that begin in all of them.
    fn motion_to_any(&self, ends: &[Configuration]) -> Option<(usize, Draw)> {
        let grown = self.grown_by(LEAST_MARGIN);
        let search = self.search(&grown, &FIRST_WAY, self.supervision.interrupt);
        let rng = |number| self.tree_rng(self.request.candidates + number);
        let (way, mut rng) = first_way(&search, &self.problem.start, ends, rng)?;
        let reached = ends.iter().position(|end| Some(end) == way.last())?;
        let way = search.shorten(way, &mut rng);
        let mut draw = unfinished(Source::Tree, Failure::NoPath);
        self.follow_ever_shorter(&search, way, rng, &mut draw)
            .then_some((reached, draw))
    }

    /// The robot that searches keep clear.
    fn grown_by(&self, margin: f64) -> Robot {
        self.demands.grown.with_tube_growth(&[margin; SECTIONS])
    }

    pub(crate) fn search<'b>(
        &'b self,
        robot: &'b Robot,
        settings: &'b RrtSettings,
        interrupt: Interrupt<'b>,
    ) -> Search<'b> {
        Search {
            robot,
            scene: &self.problem.scene,
            settings,
            interrupt,
        }
    }

    fn reach_missing(&self, goals: &[Configuration], draws: &mut [Draw]) {
        let (known, missing): (Vec<usize>, Vec<usize>) =
            (0..draws.len()).partition(|&i| draws[i].outcome.is_ok());
        let ways = known.iter().filter_map(|&i| draws[i].path.as_ref());
        let ways: Vec<&Waypoints> = ways.collect();
        if ways.is_empty() || missing.is_empty() {
            return;
        }
        let reach = Reach {
            run: self,
            grown: self.grown_by(LEAST_MARGIN),
            ways,
            goals,
        };
        for (i, draw) in reach.all(&missing) {
            replace(&mut draws[i], draw);
        }
    }

    /// One tree for each goal shape.
    pub(crate) fn trees(&mut self, goals: &[Configuration]) -> Vec<Draw> {
        let clock = Instant::now();
        let run = &*self;
        let draws = goals
            .par_iter()
            .with_max_len(1)
            .enumerate()
            .map(|(i, goal)| {
                let draw = run.tree(i, goal, run.supervision.interrupt);
                run.report(i, &draw);
                draw
            })
            .collect();
        self.stages.sample += clock.elapsed().as_secs_f64();
        draws
    }

    fn tree(&self, index: usize, goal: &Configuration, interrupt: Interrupt) -> Draw {
        let mut draw = unfinished(Source::Tree, Failure::NoPath);
        let mut rng = self.tree_rng(index);
        let settings = RrtSettings::default();
        for margin in TREE_MARGINS {
            if interrupt() {
                break;
            }
            let grown = self.grown_by(margin);
            let search = self.search(&grown, &settings, interrupt);
            if let Some(polyline) = search.connect(&self.problem.start, &[*goal], &mut rng)
                && self.follow(&search, &polyline, &mut draw)
            {
                return draw;
            }
        }
        self.note_truncation(&mut draw);
        draw
    }

    /// Where there was no time left, nobody knows whether there is a path.
    pub(crate) fn note_truncation(&self, draw: &mut Draw) {
        if draw.outcome.is_err() && (self.supervision.interrupt)() {
            draw.outcome = Err(Failure::Truncated);
        }
    }

    pub(crate) fn tree_rng(&self, index: usize) -> Pcg64 {
        Pcg64::new(u128::from(self.request.seed), index as u128 + 1)
    }

    /// Makes a motion of a polyline, which is shortened again where it has too many corners for that.
    pub(crate) fn follow_ever_shorter(
        &self,
        search: &Search,
        mut polyline: Vec<Configuration>,
        mut rng: Pcg64,
        draw: &mut Draw,
    ) -> bool {
        for _ in 0..=SHORTENINGS {
            if self.follow(search, &polyline, draw) {
                return true;
            }
            let shorter = search.shorten(polyline.clone(), &mut rng);
            if shorter == polyline || (search.interrupt)() {
                break;
            }
            polyline = shorter;
        }
        false
    }

    /// Makes a motion of a polyline that a search certified, if that can be timed and certified.
    ///
    /// The sampler `rrt-connect` keeps to the polyline and rounds its corners as is usual; `rrt-smooth` finishes this rounded path as
    /// a sampled one first, and others seek a smooth path beside the polyline. The search's interrupt holds for all of it.
    pub(crate) fn follow(
        &self,
        search: &Search,
        polyline: &[Configuration],
        draw: &mut Draw,
    ) -> bool {
        let demands = Demands {
            interrupt: search.interrupt,
            ..self.demands
        };
        let rounded = || resample(&search.round(polyline));
        let smooth = match self.request.sampler {
            Sampler::RrtConnect => None,
            Sampler::RrtSmooth => demands.smoothed(rounded()),
            _ => demands.beside(polyline),
        };
        let followed = smooth.or_else(|| {
            let ways = once_with(rounded).chain(once_with(|| resample(polyline)));
            demands.along(polyline, ways)
        });
        let Some((path, certified)) = followed else {
            return false;
        };
        draw.path = Some(path);
        draw.outcome = Ok(certified);
        true
    }
}

/// Takes a draw that is certified, or that says that there was no time left.
fn replace(draw: &mut Draw, by: Draw) {
    match by.outcome {
        Ok(_) => *draw = by,
        Err(Failure::Truncated) => draw.outcome = by.outcome,
        Err(_) => {}
    }
}
