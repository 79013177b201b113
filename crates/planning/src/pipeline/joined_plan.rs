//! A plan from rest whose motions are joined to the braking of a robot in motion: the fastest first, which is told before the others are joined.

use crate::pipeline::braking::Braking;
use crate::pipeline::joining::{AT_ONCE, JoinedDraw, Joining, USUAL_GAIN};
use crate::pipeline::segments::JoinedSegments;
use crate::pipeline::selection::select;
use crate::plan::{Candidate, Failure, Plan};
use crate::request::Told;
use codes::{Selection, Source, Stage};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::mem;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

/// Where the fastest motion is told once it is known, before the others are joined.
#[derive(Clone, Copy)]
pub(super) struct Late<'a> {
    /// The braking that motions are then joined to; none where the one before is still in time.
    pub(super) braking: &'a (dyn Fn() -> Option<Braking<'a>> + Sync),
    pub(super) selected: &'a (dyn Fn(Candidate) -> Told + Sync),
}

/// The draw of a motion, and the motion joined to the braking.
type Joined = (usize, Result<Candidate, Failure>);

impl Joining<'_> {
    /// A plan from rest with every motion joined to the braking, and the figures of the whole motions; `segments` take the place of the
    /// paths to their goal configurations. Where these do not tell which motion is the fastest, that is told as `late` says.
    pub(super) fn plan(
        &self,
        mut plan: Plan,
        segments: JoinedSegments,
        late: Option<Late<'_>>,
    ) -> Plan {
        let mut stages = plan.stages;
        stages.measure(Stage::Select, || self.join(&mut plan, segments, late));
        plan.stages = stages;
        plan
    }

    fn join(&self, plan: &mut Plan, segments: JoinedSegments, late: Option<Late<'_>>) {
        let mut others = mem::take(&mut plan.candidates);
        others.sort_by(in_order_of_selection);
        let (mut joined, mut from_rest) = (Vec::<Joined>::new(), Vec::new());
        for segment in segments.segments {
            let index = segment.joined.draw;
            others.retain(|it| it.draw != index);
            plan.draws[index] = segment.draw;
            joined.push((index, Ok(segment.joined)));
            from_rest.push(segment.from_rest);
        }
        if segments.is_settled {
            let workers = rayon::current_num_threads();
            joined.extend(self.join_all(&others, workers, &AtomicBool::new(false)));
        } else {
            from_rest.extend(others);
            joined = self.join_late(plan, joined, from_rest, late);
        }
        joined.sort_by_key(|(draw, _)| *draw);
        for (draw, joined) in &joined {
            let outcome = joined.as_ref().map(Candidate::certified);
            plan.draws[*draw].outcome = outcome.map_err(|failure| *failure);
            plan.truncated |= joined.as_ref().err() == Some(&Failure::Truncated);
        }
        plan.candidates = joined.into_iter().filter_map(|it| it.1.ok()).collect();
    }

    /// Joins motions, of which the first ones are joined already, until the fastest is known, tells it, and joins the others.
    fn join_late(
        &self,
        plan: &mut Plan,
        mut joined: Vec<Joined>,
        mut from_rest: Vec<Candidate>,
        late: Option<Late<'_>>,
    ) -> Vec<Joined> {
        self.join_fastest(&from_rest, &mut joined);
        self.put_fastest_anew(plan, &mut joined, &mut from_rest);
        plan.truncated |= self.is_interrupted();
        match late.and_then(|late| Some((late, (late.braking)()?))) {
            Some((late, braking)) => self.join_later(&braking, plan, &joined, from_rest, late),
            None => self.join_others(plan, joined, from_rest, late),
        }
    }

    /// Joins the fastest of what is joined to a later braking, tells it, and joins the others to that braking.
    fn join_later(
        &self,
        braking: &Braking,
        plan: &mut Plan,
        joined: &[Joined],
        mut from_rest: Vec<Candidate>,
        late: Late<'_>,
    ) -> Vec<Joined> {
        let later = self.to_braking(braking);
        let fastest = select_of(joined).map(|fastest| fastest.draw);
        from_rest.sort_by_key(|it| Some(it.draw) != fastest);
        let mut first: Vec<Joined> = from_rest
            .iter()
            .take(1)
            .map(|it| later.outcome(it))
            .collect();
        later.put_fastest_anew(plan, &mut first, &mut from_rest);
        later.join_others(plan, first, from_rest, Some(late))
    }

    /// Puts the fastest motion planned anew, where that is faster, in the place of the one that is joined.
    fn put_fastest_anew(
        &self,
        plan: &mut Plan,
        joined: &mut [Joined],
        from_rest: &mut [Candidate],
    ) {
        let Some(anew) = self.plan_fastest_anew(joined) else {
            return;
        };
        let index = anew.joined.draw;
        plan.draws[index] = anew.draw;
        let replaced = from_rest.iter_mut().filter(|it| it.draw == index);
        replaced.for_each(|it| it.clone_from(&anew.from_rest));
    }

    /// Tells the fastest of what is joined, the first ones of all motions, and joins the others to the braking meanwhile; all of them. Where
    /// it comes too late, all are joined to a later one.
    fn join_others(
        &self,
        plan: &mut Plan,
        mut joined: Vec<Joined>,
        from_rest: Vec<Candidate>,
        late: Option<Late<'_>>,
    ) -> Vec<Joined> {
        let is_too_late = AtomicBool::new(false);
        let tell = || {
            let (late, fastest) = late.zip(select_of(&joined))?;
            let is_late = (late.selected)(fastest) == Told::TooLate;
            is_too_late.store(is_late, Relaxed);
            is_late.then_some(late)
        };
        // The selected motion is published meanwhile, and its way to the loop needs a processor.
        let workers = rayon::current_num_threads() - 1;
        let others = || self.join_all(&from_rest[joined.len()..], workers, &is_too_late);
        let (too_late, others) = rayon::join(tell, others);
        if let Some(late) = too_late
            && let Some(braking) = (late.braking)()
        {
            return self.join_later(&braking, plan, &joined, from_rest, late);
        }
        joined.extend(others);
        joined
    }

    /// Joins motions in their order, of which the first ones are joined already, until no other one is expected to become faster than the fastest.
    fn join_fastest(&self, from_rest: &[Candidate], joined: &mut Vec<Joined>) {
        for round in from_rest[joined.len()..].chunks(AT_ONCE) {
            let fastest_s = joined.iter().map(duration_s).fold(f64::INFINITY, f64::min);
            if round[0].metrics.duration_s > fastest_s + self.largest_gain_s() {
                break;
            }
            let motions = round.par_iter().map(|from_rest| self.outcome(from_rest));
            joined.par_extend(motions);
        }
    }

    /// Joins motions that are not selected, on so many workers, until the request is interrupted or they are not needed any more.
    fn join_all(
        &self,
        from_rest: &[Candidate],
        workers: usize,
        are_needless: &AtomicBool,
    ) -> Vec<Joined> {
        let joined = |from_rest: &Candidate| {
            if self.is_interrupted() || are_needless.load(Relaxed) {
                return (from_rest.draw, Err(Failure::Truncated));
            }
            self.outcome(from_rest)
        };
        let of_a_worker = from_rest.len().div_ceil(workers.max(1)).max(1);
        let from_rest = from_rest.par_iter().with_min_len(of_a_worker);
        from_rest.map(joined).collect()
    }

    fn outcome(&self, from_rest: &Candidate) -> Joined {
        (from_rest.draw, self.braking.candidate(from_rest))
    }

    /// Plans the fastest motion anew, and puts the motion of that plan in its place where it is faster. Returns the motion.
    fn plan_fastest_anew(&self, joined: &mut [Joined]) -> Option<JoinedDraw> {
        if !self.plans_anew() {
            return None;
        }
        let fastest = joined
            .iter_mut()
            .min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))?;
        let known = fastest.1.as_ref().ok()?;
        let straight_s = self.straight_s(&known.end())?;
        let it = self.planned_anew(known, straight_s)?;
        fastest.1 = Ok(it.joined.clone());
        Some(it)
    }

    /// Whether the fastest motion of a plan from rest, joined, is expected to be planned anew: it takes longer than a straight segment by more
    /// than joining mostly wins.
    pub(super) fn expects_planning_paths_anew(&self, plan: &Plan) -> bool {
        let by_duration =
            |a: &&Candidate, b: &&Candidate| a.metrics.duration_s.total_cmp(&b.metrics.duration_s);
        let fastest = plan.candidates.iter().min_by(by_duration);
        let fastest = fastest.filter(|_| self.plans_anew());
        let detour_s =
            fastest.and_then(|it| Some(it.metrics.duration_s - self.straight_s(&it.end())?));
        detour_s.is_some_and(|detour_s| detour_s > USUAL_GAIN * self.braking.motion.duration())
    }
}

/// Duration of a joined motion, s; infinite where there is none.
fn duration_s(joined: &Joined) -> f64 {
    let motion = joined.1.as_ref();
    motion.map_or(f64::INFINITY, |motion| motion.metrics.duration_s)
}

/// The order in which candidates are joined: what remains of a motion that is followed, then the fastest from rest first.
fn in_order_of_selection(a: &Candidate, b: &Candidate) -> Ordering {
    let is_other = |candidate: &Candidate| candidate.source != Source::Kept;
    let by_duration = || a.metrics.duration_s.total_cmp(&b.metrics.duration_s);
    is_other(a).cmp(&is_other(b)).then_with(by_duration)
}

/// The joined candidate that is selected as the fastest.
fn select_of(joined: &[Joined]) -> Option<Candidate> {
    let motions = joined.iter().filter_map(|(_, it)| it.as_ref().ok());
    let mut candidates: Vec<Candidate> = motions.cloned().collect();
    let start = candidates.first()?.trajectory.knots()[0].position;
    let selected = select(&candidates, &start, Selection::ShortestTime)?;
    Some(candidates.swap_remove(selected))
}
