//! Straight segments beside the drawn paths: the one that is the fastest motion of all takes the place of the path to its shape.
//!
//! Workers run segments while no drawn path waits for them, in the order of the least time that each can take, and give one up
//! as soon as it is surely slower than what there is by then. Which one wins is decided afterwards, as if they had run one after
//! the other behind all drawn paths; so it does not depend on which worker was when where.

use crate::fill::duration_s;
use crate::finish::{Demands, Laps};
use crate::least_duration::least_duration_s;
use crate::path::straight_path;
use crate::plan::{Draw, Source};
use crate::run::{Finishes, Proposal, Run};
use pcc_model::Configuration;
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// A corrected path whose least duration is this much above what it must beat is not timed: the curve that is executed, which
/// bounding jerk rounds at turns, and another correction may be a little faster.
pub(crate) const SURELY_SLOWER: f64 = 1.02;
/// So much above it, a path is given up between two pushes: the next ones may make it a little faster again.
const GIVEN_UP: f64 = 1.2;

/// The shortest duration of any motion so far.
struct Shortest(AtomicU64);

impl Shortest {
    fn none() -> Self {
        Self(AtomicU64::new(f64::INFINITY.to_bits()))
    }

    /// Infinite where there is no motion, s.
    fn duration_s(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }

    /// Takes note of a duration, not negative: such numbers are ordered as their bits are.
    fn note(&self, duration_s: f64) {
        self.0.fetch_min(duration_s.to_bits(), Ordering::Relaxed);
    }
}

/// What a segment must beat, and from where on it would have lost on its way.
pub(crate) struct Rival<'a> {
    shortest: &'a Shortest,
    /// Largest duration, s, of a rival that would have beaten it before its end.
    would_lose_to_s: Cell<f64>,
}

impl<'a> Rival<'a> {
    fn new(shortest: &'a Shortest) -> Self {
        Self {
            shortest,
            would_lose_to_s: Cell::new(0.0),
        }
    }

    /// Whether who takes at least `least_s` and is still pushed is given up.
    pub(crate) fn is_far_ahead_of(&self, least_s: f64) -> bool {
        self.beats_all_from(least_s / GIVEN_UP)
    }

    /// Whether who takes at least `least_s` surely loses.
    pub(crate) fn surely_beats(&self, least_s: f64) -> bool {
        self.beats_all_from(least_s / SURELY_SLOWER)
    }

    fn beats_all_from(&self, duration_s: f64) -> bool {
        let before_s = self.would_lose_to_s.get();
        self.would_lose_to_s.set(before_s.max(duration_s));
        duration_s > self.shortest.duration_s()
    }

    /// Whether who takes that long loses.
    pub(crate) fn beats(&self, duration_s: f64) -> bool {
        duration_s >= self.shortest.duration_s()
    }
}

/// A segment that has run.
struct Runner {
    /// In the order of least durations.
    place: usize,
    would_lose_to_s: f64,
    finish: (Draw, Laps),
}

/// The segments from the start to the ends of a request.
pub(crate) struct Race<'a> {
    run: &'a Run<'a>,
    ends: &'a [Configuration],
    /// Ends, and the least duration of the segment to each, s.
    order: Vec<(usize, f64)>,
    /// Drawn paths that no worker has taken yet.
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

    /// Tells of so many paths that were drawn.
    pub(crate) fn wait_for(&self, drawn: usize) {
        self.waiting.fetch_add(drawn, Ordering::Relaxed);
    }

    /// Runs segments while no drawn path waits.
    pub(crate) fn run_meanwhile(&self) {
        while self.waiting.load(Ordering::Relaxed) == 0 && self.run_next() {}
    }

    /// Finishes a drawn path, and runs segments after that while no other one waits.
    pub(crate) fn finish(&self, proposal: Proposal) -> (Draw, Laps) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        let finished = self.run.finish_one(proposal);
        self.shortest.note(duration_s(&finished.0));
        self.run_meanwhile();
        finished
    }

    /// Runs the next segment that may be the fastest; whether there was one.
    fn run_next(&self) -> bool {
        let place = self.begun.fetch_add(1, Ordering::Relaxed);
        let Some(&(end, least_s)) = self.order.get(place) else {
            return false;
        };
        if least_s >= self.shortest.duration_s() {
            return false;
        }
        let path = straight_path(&self.run.problem.start, &self.ends[end]);
        let rival = Rival::new(&self.shortest);
        let proposal = Proposal::of(path, Source::Straight);
        let finish = self.run.finish_against(proposal, Some(&rival));
        self.shortest.note(duration_s(&finish.0));
        let runner = Runner {
            place,
            would_lose_to_s: rival.would_lose_to_s.get(),
            finish,
        };
        let mut runners = self.runners.lock().unwrap_or_else(PoisonError::into_inner);
        runners.push(runner);
        true
    }

    /// Who is faster than all these motions and all other segments.
    pub(crate) fn decide(self, drawn: &[(Draw, Laps)]) -> Decided {
        let runners = self.runners.into_inner();
        let mut runners = runners.unwrap_or_else(PoisonError::into_inner);
        runners.sort_by_key(|runner| runner.place);
        let drawn_s = drawn.iter().map(|(draw, _)| duration_s(draw));
        let (mut shortest_s, mut winner) = (drawn_s.fold(f64::INFINITY, f64::min), None);
        for (index, runner) in runners.iter().enumerate() {
            let duration_s = duration_s(&runner.finish.0);
            if duration_s < shortest_s && runner.would_lose_to_s <= shortest_s {
                shortest_s = duration_s;
                winner = Some((self.order[runner.place].0, index));
            }
        }
        Decided {
            winner,
            segments: runners.into_iter().map(|runner| runner.finish).collect(),
        }
    }
}
