//! Motions to the goal shapes that are missing, from those there are.

use crate::known_ways::KnownWays;
use crate::path::Waypoints;
use crate::plan::{Draw, Failure, Source};
use crate::rrt_connect::{RrtSettings, Search};
use crate::run::{Run, unfinished};
use pcc_model::{Configuration, Robot};
use rand_pcg::Pcg64;
use rayon::Scope;
use std::sync::{Mutex, PoisonError};

/// Groups of missing goal shapes whose ways are sought at once, each with a tree of its own.
const GROUPS: usize = 2;
/// Samples for the goal shapes of a group together: most are reached within a few, and of some there is no way.
const SAMPLING: RrtSettings = RrtSettings {
    samples: 1500,
    shortcuts: 60,
};

/// From which ways which goal shapes are to be reached.
pub(crate) struct Reach<'a> {
    pub(crate) run: &'a Run<'a>,
    /// The robot that ways keep clear.
    pub(crate) grown: Robot,
    /// Those of the motions there are.
    pub(crate) ways: Vec<&'a Waypoints>,
    pub(crate) goals: &'a [Configuration],
}

/// What came of the goal shapes, by their places.
type Reached = Mutex<Vec<(usize, Draw)>>;

impl Reach<'_> {
    /// Seeks ways to the goal shapes in these places and makes motions of them. A way is followed as soon as it is found, while
    /// others are sought.
    pub(crate) fn all(&self, missing: &[usize]) -> Vec<(usize, Draw)> {
        let reached = Reached::default();
        rayon::scope(|scope| {
            for group in missing.chunks(missing.len().div_ceil(GROUPS).max(1)) {
                let reached = &reached;
                scope.spawn(move |scope| self.seek(group, scope, reached));
            }
        });
        reached.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn seek<'s>(&'s self, group: &[usize], scope: &Scope<'s>, reached: &'s Reached) {
        let mut known = KnownWays::from(&self.run.problem.start, self.search());
        for way in &self.ways {
            if (self.run.supervision.interrupt)() {
                break;
            }
            known.add(way);
        }
        for &place in group {
            let mut rng = self.run.tree_rng(place);
            let way = known.reach(&self.goals[place], &mut rng);
            scope.spawn(move |_| {
                let draw = self.draw(way, rng);
                self.run.report(place, &draw);
                let mut reached = reached.lock().unwrap_or_else(PoisonError::into_inner);
                reached.push((place, draw));
            });
        }
    }

    fn draw(&self, way: Option<Vec<Configuration>>, rng: Pcg64) -> Draw {
        let mut draw = unfinished(Source::Tree, Failure::NoPath);
        if let Some(way) = way {
            self.run
                .follow_ever_shorter(&self.search(), way, rng, &mut draw);
        }
        self.run.note_truncation(&mut draw);
        draw
    }

    fn search(&self) -> Search<'_> {
        let interrupt = self.run.supervision.interrupt;
        self.run.search(&self.grown, &SAMPLING, interrupt)
    }
}
