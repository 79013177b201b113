//! Motions to the goal configurations that none reaches yet, found from the motions to the others.

use crate::path::waypoints::Waypoints;
use crate::pipeline::context::RequestContext;
use crate::pipeline::trees::{LEAST_MARGIN, follow_ever_shorter};
use crate::plan::{Draw, Failure};
use crate::search::edges::{RrtSettings, Search};
use crate::search::seeded_tree::SeededTree;
use codes::Source;
use pcc_model::{Configuration, UnitRobot};
use rand_pcg::Pcg64;
use rayon::Scope;
use std::sync::{Mutex, PoisonError};

/// Groups of missing goal configurations whose paths are sought at once, each with a tree of its own.
const GROUPS: usize = 2;
/// Samples for the goal configurations of a group together: most are reached within a few, and to some there is no path.
const SAMPLING: RrtSettings = RrtSettings {
    samples: 1500,
    shortcuts: 60,
};

/// Which goal configurations are to be reached, and from which paths.
struct MissingGoals<'a> {
    context: &'a RequestContext<'a>,
    /// The robot that new paths keep clear.
    padded: UnitRobot,
    /// Paths of the motions that are certified.
    paths: Vec<&'a Waypoints>,
    goals: &'a [Configuration],
}

/// Draws to goal configurations, with the places of these.
type Reached = Mutex<Vec<(usize, Draw)>>;

/// Seeks motions for the draws that have none, from the paths of those that have one.
pub(super) fn reach_missing(context: &RequestContext, goals: &[Configuration], draws: &mut [Draw]) {
    let (known, missing): (Vec<usize>, Vec<usize>) =
        (0..draws.len()).partition(|&i| draws[i].outcome.is_ok());
    let paths = known.iter().filter_map(|&i| draws[i].path.as_ref());
    let paths: Vec<&Waypoints> = paths.collect();
    if paths.is_empty() || missing.is_empty() {
        return;
    }
    let missing_goals = MissingGoals {
        context,
        padded: context.padded_by(LEAST_MARGIN),
        paths,
        goals,
    };
    for (i, draw) in missing_goals.reach(&missing) {
        replace(&mut draws[i], draw);
    }
}

/// Takes a draw that is certified, or notes that the request was truncated.
fn replace(draw: &mut Draw, by: Draw) {
    match by.outcome {
        Ok(_) => *draw = by,
        Err(Failure::Truncated) => draw.outcome = by.outcome,
        Err(_) => {}
    }
}

impl MissingGoals<'_> {
    /// Seeks paths to the goal configurations in these places and makes motions of them. A path becomes a motion as soon as it is
    /// found, while others are sought.
    fn reach(&self, missing: &[usize]) -> Vec<(usize, Draw)> {
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
        let mut tree = SeededTree::from(&self.context.problem.start, self.search());
        for path in &self.paths {
            if (self.context.supervision.interrupt)() {
                break;
            }
            tree.add(path);
        }
        for &place in group {
            let mut rng = self.context.tree_rng(place);
            let polyline = tree.reach(&self.goals[place], &mut rng);
            scope.spawn(move |_| {
                let draw = self.draw(polyline, rng);
                self.context.report(place, &draw);
                let mut reached = reached.lock().unwrap_or_else(PoisonError::into_inner);
                reached.push((place, draw));
            });
        }
    }

    fn draw(&self, polyline: Option<Vec<Configuration>>, rng: Pcg64) -> Draw {
        let mut draw = Draw::unfinished(Source::Classical, Failure::NoPath);
        if let Some(polyline) = polyline {
            follow_ever_shorter(self.context, &self.search(), polyline, rng, &mut draw);
        }
        self.context.note_truncation(&mut draw);
        draw
    }

    fn search(&self) -> Search<'_> {
        let interrupt = self.context.supervision.interrupt;
        self.context.search(&self.padded, &SAMPLING, interrupt)
    }
}
