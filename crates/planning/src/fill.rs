//! The default planner: learned candidates, beside which straight segments compete, filled by both classical planners.

use crate::plan::{Draw, Failure, Plan, Source};
use crate::rrt_connect::{RrtSettings, rrt_connect};
use crate::run::{Aim, Proposal, Run, count_learned, rough_draws_of};
use pcc_model::{Configuration, Robot, TendonLimits};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::time::Instant;

/// Straight segments that are finished at once: those that may be the fastest.
const COMPETITORS: usize = 2;
/// Tube growth of the tree's attempts: rounding its corners needs room, a narrow way may not have it.
const TREE_MARGINS: [f64; 3] = [0.04, 0.01, 0.0];
/// Samples of a tree that fills one place among others: a way that is hard to find is left to those who need it.
const FILLING: RrtSettings = RrtSettings {
    samples: 400,
    step_rad: 0.6,
    shortcuts: 60,
};
/// Samples of the tree's last attempt with all goal shapes at once, when nothing else was found.
const LAST_ATTEMPT: RrtSettings = RrtSettings {
    samples: 20_000,
    step_rad: 0.4,
    shortcuts: 120,
};

impl Run<'_> {
    /// Learned paths to every goal shape; where a straight segment is the fastest motion of all, it takes the place of the
    /// learned path to the same shape; what is missing then is filled.
    ///
    /// Segments that cannot be faster than what there is are not tried. What is delivered does not depend on the selection rule.
    pub(crate) fn default(mut self, aim: &Aim) -> Plan {
        let (ends, limits) = (&aim.ends, &self.demands.limits);
        let mut race = Race::new(self.demands.robot, limits, &self.problem.start, ends);
        let heat = race.next_heat();
        let clock = Instant::now();
        let (sampled, raced) = rayon::join(
            || self.learned(aim),
            || self.finish_each(self.segments(ends, &heat)),
        );
        self.count(&sampled);
        let rest_s = (clock.elapsed().as_secs_f64() - sampled.seconds()).max(0.0);
        race.record(&heat, self.share(rest_s, raced));
        let mut proposals = rough_draws_of(sampled.paths);
        proposals.extend(aim.kept());
        let mut draws = self.finish(proposals);
        let kept = draws.split_off(aim.goals.len());
        let learned_s = draws.iter().map(duration_s).fold(f64::INFINITY, f64::min);
        race.best_s = race.best_s.min(learned_s);
        let learned = count_learned(&draws);
        self.finish_race(&mut race, ends);
        if let Some((end, straight)) = race.winner()
            && duration_s(straight) < learned_s
        {
            draws[end] = straight.clone();
        }
        self.keep(kept, &mut draws);
        self.fill(&aim.goals, &race, &mut draws);
        self.answer(draws, learned)
    }

    fn finish_race(&mut self, race: &mut Race, ends: &[Configuration]) {
        loop {
            let heat = race.next_heat();
            if heat.is_empty() {
                break;
            }
            let finished = self.finish(self.segments(ends, &heat));
            race.record(&heat, finished);
        }
    }

    /// Straight segments to the chosen end shapes.
    fn segments(&self, ends: &[Configuration], chosen: &[usize]) -> Vec<Proposal> {
        let chosen: Vec<Configuration> = chosen.iter().map(|&end| ends[end]).collect();
        let proposal = |path| Proposal {
            path,
            source: Source::Straight,
            draw: None,
            is_rough: false,
        };
        let paths = self.straight_paths(&chosen).into_iter();
        paths.map(proposal).collect()
    }

    /// Replaces what is still missing: by a straight segment that has been finished, else by a tree, to the same shape.
    fn fill(&mut self, goals: &[Configuration], race: &Race, draws: &mut [Draw]) {
        let clock = Instant::now();
        let run = &*self;
        draws.par_iter_mut().enumerate().for_each(|(i, draw)| {
            if draw.outcome.is_err()
                && let Some(straight) = race.of(i % race.entries.len())
            {
                replace(draw, straight.clone());
                run.report(i, draw);
            }
            if draw.outcome.is_err() {
                replace(draw, run.tree(i, &[goals[i]], &FILLING));
            }
        });
        if draws.iter().all(|d| d.outcome.is_err()) {
            draws[0] = self.tree(goals.len(), goals, &LAST_ATTEMPT);
        }
        self.stages.select += clock.elapsed().as_secs_f64();
    }

    /// One tree for each goal shape.
    pub(crate) fn trees(&mut self, goals: &[Configuration]) -> Vec<Draw> {
        let clock = Instant::now();
        let run = &*self;
        let draws = goals
            .par_iter()
            .with_max_len(1)
            .enumerate()
            .map(|(i, goal)| run.tree(i, &[*goal], &RrtSettings::default()))
            .collect();
        self.stages.sample += clock.elapsed().as_secs_f64();
        draws
    }

    fn tree(&self, index: usize, goals: &[Configuration], settings: &RrtSettings) -> Draw {
        let mut draw = Draw {
            sampled: None,
            path: None,
            source: Source::Tree,
            outcome: Err(Failure::NoPath),
        };
        let mut rng = Pcg64::new(u128::from(self.request.seed), index as u128 + 1);
        for margin in TREE_MARGINS {
            if (self.supervision.interrupt)() {
                break;
            }
            let growth = margin + self.request.growth;
            let grown = self.planner.robot.with_tube_growth(growth);
            let found = rrt_connect(
                &grown,
                &self.problem.scene,
                &self.problem.start,
                goals,
                settings,
                &mut rng,
                self.supervision.interrupt,
            );
            if let Some(polyline) = found
                && let Ok((path, trajectory)) = self.demands.follow(&polyline)
            {
                draw.path = Some(path);
                draw.outcome = Ok(self.demands.describe(trajectory));
                self.report(index, &draw);
                return draw;
            }
        }
        if (self.supervision.interrupt)() {
            draw.outcome = Err(Failure::Truncated);
        }
        draw
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

/// The straight segments in the order of the least time that each can take: the fastest one is found with few of them.
struct Race {
    entries: Vec<Entry>,
    /// Ends in the order of their bounds.
    order: Vec<usize>,
    begun: usize,
    /// Shortest duration of any motion so far.
    best_s: f64,
}

/// The straight segment to one end shape.
struct Entry {
    least_s: f64,
    finished: Option<Draw>,
}

impl Entry {
    fn duration_s(&self) -> f64 {
        self.finished.as_ref().map_or(f64::INFINITY, duration_s)
    }
}

/// Duration of a draw's motion; infinite if there is none.
pub(crate) fn duration_s(draw: &Draw) -> f64 {
    let motion = draw.outcome.as_ref();
    motion.map_or(f64::INFINITY, |motion| motion.metrics.duration_s)
}

impl Race {
    fn new(
        robot: &Robot,
        limits: &TendonLimits,
        start: &Configuration,
        ends: &[Configuration],
    ) -> Self {
        let entry = |end: &Configuration| Entry {
            least_s: least_duration_s(robot, limits, &(end - start)),
            finished: None,
        };
        let entries: Vec<Entry> = ends.iter().map(entry).collect();
        let mut order: Vec<usize> = (0..ends.len()).collect();
        order.sort_by(|&a, &b| entries[a].least_s.total_cmp(&entries[b].least_s));
        Self {
            entries,
            order,
            begun: 0,
            best_s: f64::INFINITY,
        }
    }

    /// The ends whose segments may still be the fastest, at most [`COMPETITORS`] of them.
    fn next_heat(&mut self) -> Vec<usize> {
        let open = self.order[self.begun..].iter().copied();
        let heat: Vec<usize> = open
            .take(COMPETITORS)
            .filter(|&end| self.entries[end].least_s < self.best_s)
            .collect();
        self.begun += heat.len();
        heat
    }

    fn record(&mut self, heat: &[usize], finished: Vec<Draw>) {
        for (&end, draw) in heat.iter().zip(finished) {
            self.best_s = self.best_s.min(duration_s(&draw));
            self.entries[end].finished = Some(draw);
        }
    }

    /// The end and the motion of the fastest certified segment.
    fn winner(&self) -> Option<(usize, &Draw)> {
        let entries = self.entries.iter().enumerate();
        let certified = entries.filter(|(_, entry)| entry.duration_s().is_finite());
        let fastest = certified.min_by(|a, b| a.1.duration_s().total_cmp(&b.1.duration_s()));
        fastest.and_then(|(end, entry)| entry.finished.as_ref().map(|draw| (end, draw)))
    }

    /// The segment to an end, if it was tried.
    fn of(&self, end: usize) -> Option<&Draw> {
        self.entries[end].finished.as_ref()
    }
}

/// No motion with this change of configuration is faster, from rest to rest: the tendon with the farthest way needs it.
fn least_duration_s(robot: &Robot, limits: &TendonLimits, change: &Configuration) -> f64 {
    let ways = robot.tendons.matrix() * change;
    let way = ways.amax();
    let (speed, acceleration) = (limits.velocity, limits.acceleration);
    if way * acceleration <= speed * speed {
        2.0 * (way / acceleration).sqrt()
    } else {
        way / speed + speed / acceleration
    }
}
