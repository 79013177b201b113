//! Motions from rest are joined to the braking of a robot in motion: the fastest first, which is told before the others are joined.

use crate::path::waypoints::straight_path;
use crate::pipeline::braking::Braking;
use crate::pipeline::selection::select;
use crate::plan::{Candidate, Draw, Failure, Plan};
use codes::{Selection, Source, Stage};
use pcc_model::Configuration;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::mem;

/// Candidates that are joined at once, as long as one of them may be selected.
const AT_ONCE: usize = 2;
/// Share of the braking by which a joined motion is expected to be faster than the motion from rest at most: in 300 replans no candidate that
/// was left out by this, or by none of it, became the fastest.
const LARGEST_GAIN: f64 = 0.25;

/// Share of the braking by which a joined motion is mostly faster than after a stop, at least.
const USUAL_GAIN: f64 = 0.5;

/// Share of the braking that a joined motion wins at least, in 97 of 100 replans.
const LITTLE_GAIN: f64 = 0.15;

/// Joins motions to a braking.
#[derive(Clone, Copy)]
pub(super) struct Joining<'a> {
    pub(super) braking: &'a Braking<'a>,
    /// Plans from where the robot rests after a braking to one configuration alone; its fastest draw. None where the fastest motion is taken
    /// as it is.
    pub(super) anew: Option<&'a PlanAnew<'a>>,
}

/// The fastest draw of a plan from where a robot rests after a braking to a configuration.
type PlanAnew<'a> = dyn Fn(&Braking, &Configuration) -> Option<Draw> + Sync + 'a;

/// Straight segments to goal configurations, joined to a braking before other paths are planned.
#[derive(Default)]
pub(super) struct JoinedSegments {
    segments: Vec<JoinedDraw>,
    /// Whether no motion to any other goal configuration is expected to be faster than the fastest of these.
    is_settled: bool,
}

/// A draw whose motion is joined to a braking, that motion from rest, and joined.
struct JoinedDraw {
    draw: Draw,
    from_rest: Candidate,
    joined: Candidate,
}

/// Where the fastest motion is told once it is known, before the others are joined.
#[derive(Clone, Copy)]
pub(super) struct Late<'a> {
    /// The braking that motions are then joined to; none where the one before is still in time.
    pub(super) braking: &'a (dyn Fn() -> Option<Braking<'a>> + Sync),
    /// Whether that leaves time to plan the fastest motion anew.
    pub(super) plans_anew: bool,
    pub(super) selected: &'a (dyn Fn(Candidate) + Sync),
}

/// The draw of a motion, and the motion joined to the braking.
type Joined = (usize, Result<Candidate, Failure>);

impl JoinedSegments {
    /// The fastest motion of the request, where it is known: from rest to rest no path to the same goal configuration is faster than a
    /// straight segment (decision 0012), and joined to a braking hardly any.
    pub(super) fn selected(&self) -> Option<&Candidate> {
        let joined = self.segments.iter().map(|segment| &segment.joined);
        let joined = joined.filter(|_| self.is_settled);
        joined.min_by(|a, b| a.metrics.duration_s.total_cmp(&b.metrics.duration_s))
    }
}

impl Joining<'_> {
    /// Joins straight segments to the goal configurations of the first draws, until the fastest motion is known or cannot be.
    pub(super) fn segments(&self, goals: &[Configuration]) -> JoinedSegments {
        let (start, from_rest) = (self.braking.motion.end(), self.braking.after());
        let least_s = |goal: &Configuration| from_rest.least_duration_s(&[start, *goal]);
        let mut order: Vec<(usize, f64)> = goals.iter().map(least_s).enumerate().collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut segments: Vec<JoinedDraw> = Vec::new();
        // From rest, motions that take longer than this are not expected to be selected, and others than segments take at least that long.
        let (mut longest_s, mut others_s) = (f64::INFINITY, f64::INFINITY);
        for round in order.chunks(AT_ONCE) {
            if round[0].1 > longest_s || others_s < f64::INFINITY {
                break;
            }
            let segment = |&(draw, _): &(usize, f64)| self.segment(draw, &goals[draw], longest_s);
            let tried: Vec<_> = round.par_iter().map(segment).collect();
            for (segment, (_, least_s)) in tried.into_iter().zip(round) {
                match segment {
                    Ok(segment) => {
                        let joined_s = segment.joined.metrics.duration_s;
                        longest_s = longest_s.min(joined_s + self.largest_gain_s());
                        segments.push(segment);
                    }
                    Err(Failure::Slower) => {}
                    Err(_) => others_s = others_s.min(*least_s),
                }
            }
        }
        JoinedSegments {
            is_settled: others_s > longest_s,
            segments,
        }
    }

    /// The fastest of known segments, joined to this braking, which begins a moment later: it is still the fastest; where it is not certified from
    /// there, all segments anew.
    pub(super) fn fastest_again(
        &self,
        known: &JoinedSegments,
        goals: &[Configuration],
    ) -> JoinedSegments {
        let fastest = known.selected().map(|fastest| fastest.draw);
        let again = fastest.and_then(|draw| self.segment(draw, &goals[draw], f64::INFINITY).ok());
        match again {
            Some(segment) => JoinedSegments {
                segments: vec![segment],
                is_settled: true,
            },
            None => self.segments(goals),
        }
    }

    /// The segments, the fastest motion of the request among them with the best of more ways to brake.
    pub(super) fn with_fastest_braked_otherwise(&self, known: JoinedSegments) -> JoinedSegments {
        let fastest = known.selected().map(|fastest| fastest.draw);
        let otherwise = |it: JoinedDraw| match fastest == Some(it.joined.draw) {
            true => self.braked_otherwise(it),
            false => it,
        };
        JoinedSegments {
            segments: known.segments.into_iter().map(otherwise).collect(),
            ..known
        }
    }

    /// The draw with its motion joined with the best of more ways to brake, where the usual ones win little of the braking.
    fn braked_otherwise(&self, mut it: JoinedDraw) -> JoinedDraw {
        let braking_s = self.braking.motion.duration();
        let joined_s = it.joined.metrics.duration_s;
        let gain_s = braking_s + it.from_rest.metrics.duration_s - joined_s;
        if gain_s > LITTLE_GAIN * braking_s {
            return it;
        }
        let otherwise = self
            .braking
            .candidate_braked_otherwise(&it.from_rest, joined_s);
        if let Some(faster) = otherwise {
            it.draw.outcome = Ok(faster.certified());
            it.joined = faster;
        }
        it
    }

    /// The straight segment to a configuration as a motion joined to the braking; [`Failure::Slower`] where it takes longer than
    /// `longest_s` from rest.
    fn segment(
        &self,
        draw: usize,
        goal: &Configuration,
        longest_s: f64,
    ) -> Result<JoinedDraw, Failure> {
        if self.is_interrupted() {
            return Err(Failure::Truncated);
        }
        let constraints = self.braking.after();
        let path = straight_path(&self.braking.motion.end(), goal);
        let from_rest = constraints.time(&path)?;
        if from_rest.duration() > longest_s {
            return Err(Failure::Slower);
        }
        let from_rest = constraints.certified(from_rest)?;
        let from_rest = Candidate::of(draw, Source::StraightLine, &from_rest);
        let joined = self.braking.candidate(&from_rest)?;
        let draw = Draw {
            sampled: Some(path.clone()),
            path: Some(path),
            source: Source::StraightLine,
            outcome: Ok(joined.certified()),
        };
        Ok(JoinedDraw {
            draw,
            from_rest,
            joined,
        })
    }

    fn is_interrupted(&self) -> bool {
        (self.braking.after().interrupt)()
    }

    /// The duration by which a joined motion is expected to be shorter than the motion from rest at most, s.
    fn largest_gain_s(&self) -> f64 {
        LARGEST_GAIN * self.braking.motion.duration()
    }

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
            joined.extend(self.join_all(&others, rayon::current_num_threads()));
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
        let plans_anew = late.is_some_and(|late| late.plans_anew);
        let Some(braking) = late.and_then(|late| (late.braking)()) else {
            let others = from_rest.split_off(joined.len());
            return self.join_others(joined, &others, late);
        };
        let later = Joining {
            braking: &braking,
            anew: self.anew.filter(|_| plans_anew),
        };
        let fastest = select_of(&joined).map(|fastest| fastest.draw);
        from_rest.sort_by_key(|it| Some(it.draw) != fastest);
        let others = from_rest.split_off(from_rest.len().min(1));
        let mut first: Vec<Joined> = from_rest.iter().map(|it| later.outcome(it)).collect();
        later.put_fastest_anew(plan, &mut first, &mut from_rest);
        later.join_others(first, &others, late)
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

    /// Tells the fastest of what is joined, and joins the other motions to the braking meanwhile; all of them.
    fn join_others(
        &self,
        mut joined: Vec<Joined>,
        from_rest: &[Candidate],
        late: Option<Late<'_>>,
    ) -> Vec<Joined> {
        let fastest = select_of(&joined);
        let tell = || {
            if let Some((late, fastest)) = late.zip(fastest) {
                (late.selected)(fastest);
            }
        };
        // The selected motion is published meanwhile, and its way to the loop needs a processor.
        let workers = rayon::current_num_threads() - 1;
        let others = || self.join_all(from_rest, workers);
        joined.extend(rayon::join(tell, others).1);
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

    /// Joins motions that are not selected, on so many workers, until the request is interrupted.
    fn join_all(&self, from_rest: &[Candidate], workers: usize) -> Vec<Joined> {
        let joined = |from_rest: &Candidate| {
            if self.is_interrupted() {
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

    /// Plans anew to the goal configuration of the fastest motion alone, from where the robot now rests after braking, and puts the fastest
    /// motion of that plan in its place where it is faster: it is then no later than after a stop. Nothing is planned where that is known, or
    /// where the straight segment is certified. Returns the motion.
    fn plan_fastest_anew(&self, joined: &mut [Joined]) -> Option<JoinedDraw> {
        let anew = self.anew?;
        let fastest = joined
            .iter_mut()
            .min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))?;
        let end = fastest.1.as_ref().ok()?.end();
        if duration_s(fastest) <= self.braking.motion.duration() + self.straight_s(&end)? {
            return None;
        }
        let segment = self.segment(fastest.0, &end, f64::INFINITY).ok();
        let it = segment.or_else(|| self.joined(fastest.0, anew(self.braking, &end)?))?;
        let it = self.braked_otherwise(it);
        if it.joined.metrics.duration_s >= duration_s(fastest) {
            return None;
        }
        fastest.1 = Ok(it.joined.clone());
        Some(it)
    }

    /// The time of a straight segment from where the robot rests after braking, s: from rest no path takes less, whether or not the segment is
    /// clear.
    fn straight_s(&self, end: &Configuration) -> Option<f64> {
        let straight = straight_path(&self.braking.motion.end(), end);
        let motion = self.braking.after().time(&straight).ok()?;
        Some(motion.duration())
    }

    /// Whether the fastest motion of a plan from rest, joined, is expected to be planned anew.
    pub(super) fn is_planned_anew(&self, plan: &Plan) -> bool {
        let by_duration =
            |a: &&Candidate, b: &&Candidate| a.metrics.duration_s.total_cmp(&b.metrics.duration_s);
        let fastest = plan.candidates.iter().min_by(by_duration);
        let detour_s =
            fastest.and_then(|it| Some(it.metrics.duration_s - self.straight_s(&it.end())?));
        detour_s.is_some_and(|detour_s| detour_s > USUAL_GAIN * self.braking.motion.duration())
    }

    /// A draw in the place of another one with its motion joined to the braking.
    fn joined(&self, index: usize, mut draw: Draw) -> Option<JoinedDraw> {
        let from_rest = Candidate::of(index, draw.source, draw.outcome.as_ref().ok()?);
        let joined = self.braking.candidate(&from_rest).ok()?;
        draw.outcome = Ok(joined.certified());
        Some(JoinedDraw {
            draw,
            from_rest,
            joined,
        })
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
