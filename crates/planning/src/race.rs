//! Straight segments beside the drawn paths: the one that is the fastest motion of all takes the place of the path to its shape.
//!
//! Workers run segments once all paths are drawn and taken, in the order of the least time that each can take, and stop one as
//! soon as it is surely slower than what there is by then. A segment counts with its duration or, if that is longer, with the
//! longest bound that it met on its way; a motion of its own that was not certified is one. The one that counts least is never
//! stopped, since nothing that there is ever counts less, so who wins does not depend on which worker was when where.

use crate::finish::Demands;
use crate::incumbent::{Rival, Shortest};
use crate::least_duration::least_duration_s;
use crate::path::straight_path;
use crate::plan::{Draw, Source};
use crate::run::{Finishes, Proposal, Run};
use crate::stage_times::StageTimes;
use pcc_model::Configuration;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// A segment that has run.
struct Runner {
    /// In the order of least durations.
    place: usize,
    /// The shortest duration of a rival that does not stop it, s; infinite where it makes no motion.
    counted_s: f64,
    finish: (Draw, StageTimes),
}

/// The segments from the start to the ends of a request.
pub(crate) struct Race<'a> {
    run: &'a Run<'a>,
    ends: &'a [Configuration],
    /// Ends, and the least duration of the segment to each, s.
    order: Vec<(usize, f64)>,
    /// Paths that are to be drawn, or drawn, and not yet taken by a worker to finish.
    waiting: AtomicUsize,
    begun: AtomicUsize,
    shortest: Shortest,
    runners: Mutex<Vec<Runner>>,
}

/// What came of a race.
pub(crate) struct Decided {
    /// The end whose segment is faster than all else, and which of the segments that is.
    pub(crate) winner: Option<(usize, usize)>,
    /// The segments that ran.
    pub(crate) segments: Finishes,
}

impl<'a> Race<'a> {
    /// Segments to `ends`.
    pub(crate) fn new(run: &'a Run<'a>, ends: &'a [Configuration]) -> Self {
        let Demands { robot, limits, .. } = &run.demands;
        let least_s =
            |end: &Configuration| least_duration_s(robot, limits, &[run.problem.start, *end]);
        let mut order: Vec<(usize, f64)> = ends.iter().map(least_s).enumerate().collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1));
        Self {
            run,
            ends,
            order,
            waiting: AtomicUsize::new(0),
            begun: AtomicUsize::new(0),
            shortest: Shortest::none(),
            runners: Mutex::default(),
        }
    }

    /// Tells of so many paths that are to be drawn.
    pub(crate) fn wait_for(&self, paths: usize) {
        self.waiting.fetch_add(paths, Ordering::Relaxed);
    }

    /// Finishes a drawn path that was waited for, and runs segments after that if no other one is.
    pub(crate) fn finish(&self, proposal: Proposal) -> (Draw, StageTimes) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        let finished = self.run.finish_one(proposal);
        self.shortest.note(finished.0.duration_s());
        while self.waiting.load(Ordering::Relaxed) == 0 && self.run_next() {}
        finished
    }

    /// Runs the next segment that may be the fastest; whether there was one.
    fn run_next(&self) -> bool {
        let place = self.begun.fetch_add(1, Ordering::Relaxed);
        let Some(&(end, least_s)) = self.order.get(place) else {
            return false;
        };
        if least_s > self.shortest.duration_s() {
            return false;
        }
        let path = straight_path(&self.run.problem.start, &self.ends[end]);
        let rival = Rival::new(&self.shortest);
        let proposal = Proposal::of(path, Source::Straight);
        let finish = self.run.finish_against(proposal, Some(&rival));
        let counted_s = finish.0.duration_s().max(rival.stopped_by_s());
        self.shortest.note(counted_s);
        let runner = Runner {
            place,
            counted_s,
            finish,
        };
        let mut runners = self.runners.lock().unwrap_or_else(PoisonError::into_inner);
        runners.push(runner);
        true
    }

    /// Who is faster than all these motions and all other segments.
    pub(crate) fn decide(self, drawn: &[(Draw, StageTimes)]) -> Decided {
        let runners = self.runners.into_inner();
        let mut runners = runners.unwrap_or_else(PoisonError::into_inner);
        runners.sort_by_key(|runner| runner.place);
        let drawn_s = drawn.iter().map(|(draw, _)| draw.duration_s());
        let counted_s = runners.iter().map(|runner| runner.counted_s);
        let winner = fastest(drawn_s.fold(f64::INFINITY, f64::min), counted_s);
        let winner = winner.map(|index| (self.order[runners[index].place].0, index));
        Decided {
            winner,
            segments: runners.into_iter().map(|runner| runner.finish).collect(),
        }
    }
}

/// Which of these durations is the least, the first of equal ones; none where a drawn path is as fast, or nothing moves.
fn fastest(drawn_s: f64, counted_s: impl Iterator<Item = f64>) -> Option<usize> {
    let (mut least_s, mut fastest) = (drawn_s, None);
    for (index, counted_s) in counted_s.enumerate() {
        if counted_s < least_s {
            (least_s, fastest) = (counted_s, Some(index));
        }
    }
    fastest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_the_fastest_wins_where_no_drawn_path_is_as_fast() {
        let of = |drawn_s: f64, counted_s: &[f64]| fastest(drawn_s, counted_s.iter().copied());
        assert_eq!(of(9.0, &[9.5, 8.0, f64::INFINITY, 8.0]), Some(1));
        assert_eq!(of(8.0, &[9.5, 8.0]), None);
        assert_eq!(of(f64::INFINITY, &[f64::INFINITY, 7.0]), Some(1));
        assert_eq!(of(f64::INFINITY, &[f64::INFINITY]), None);
    }
}
