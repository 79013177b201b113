//! The running plan's motion: published before the plan is whole or after, and again where it came too late.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use planning::{Candidate, Via};
use shared_types::codes::{Outcome, Source};

use super::answer::{Answer, is_deliverable};
use super::asker::Asker;
use super::in_flight::{Attempt, EarlyExecution, InFlight, Queued};
use super::plan_runner::InWork;
use super::recent_plans::PlanBegin;
use super::service::Service;
use crate::execution::{ExecutionRefusal, ExecutionTiming, SelectedMotion, Switch, TimedGoal};
use crate::goal_keeping::{PublishedMotion, Wanted};

impl Service {
    /// Publishes the motion that is selected whatever the others will be; the plan goes on, unless it has to be made again.
    pub(super) fn execute_early(&mut self, candidate: &Candidate, in_work: &InWork) {
        let Some(mut in_flight) = self.in_flight.take() else {
            return;
        };
        let Queued { asker, task, .. } = &in_flight.queued;
        if asker.is_waiting() && is_deliverable(task, candidate, self.runner.robot()) {
            let published = self.execute(&mut in_flight, Some(candidate));
            self.note_foreign_motion(&in_flight, published.as_ref());
            if let (Asker::GoalKeeper(_), Some(Ok(id))) = (&in_flight.queued.asker, &published) {
                self.goal.keeper.hear_motion(PublishedMotion {
                    trajectory_id: *id,
                    duration_s: candidate.trajectory.duration(),
                });
            }
            if let Some(Err(refusal)) = &published
                && let Some(attempt) = in_flight.made_again(refusal)
            {
                let is_missed = matches!(refusal, ExecutionRefusal::SwitchMissed { .. });
                if is_missed && in_work.tell_too_late() {
                    let plan_id = in_flight.plan_id;
                    tracing::info!("the motion of plan {plan_id} is joined again: {refusal}");
                    in_flight.attempt = attempt;
                } else {
                    in_flight.cancelled.store(true, Ordering::Relaxed);
                }
            }
            in_flight.executed = published.map(|published| EarlyExecution {
                candidate: candidate.clone(),
                published,
            });
        }
        self.in_flight = Some(in_flight);
    }

    /// Breaks the running plan off where the controller has refused its motion, since it had passed the switch: it is made again.
    pub(super) fn make_again(&mut self, not_begun: &[u32]) {
        if let Some(in_flight) = &mut self.in_flight
            && let Some(EarlyExecution { published, .. }) = &mut in_flight.executed
            && let Ok(id) = *published
            && not_begun.contains(&id)
        {
            *published = Err(ExecutionRefusal::NotBegun { id });
            in_flight.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Breaks the running plan off whose motion is on its way, where that is to be left for a request that waits.
    pub(super) fn make_way(&mut self) {
        // A client's motion ends the goal, and with it what was asked for on its behalf.
        let has_goal = self.goal.keeper.has_goal();
        let is_wanted = |queued: &Queued| has_goal || matches!(queued.asker, Asker::Client(_));
        if let Some(in_flight) = &mut self.in_flight
            && in_flight.has_motion_on_its_way()
            && self
                .queue
                .iter()
                .any(|queued| queued.leaves_motion() && is_wanted(queued))
        {
            in_flight.makes_way = true;
            in_flight.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Publishes the motion that an answer selects, if it is to be executed and wanted.
    pub(super) fn execute_answered(
        &mut self,
        in_flight: &mut InFlight,
        answer: &Answer,
    ) -> Option<Result<u32, ExecutionRefusal>> {
        let has_candidates = answer.outcome().is_some_and(Outcome::has_candidates);
        let is_wanted = in_flight.queued.asker.is_waiting() && has_candidates;
        if !is_wanted || answer.candidates.is_empty() {
            return None;
        }
        let selected = answer.selected().map(|(_, candidate)| candidate);
        let published = self.execute(in_flight, selected);
        self.note_foreign_motion(in_flight, published.as_ref());
        published
    }

    /// Publishes the selected motion, if it is to be executed.
    fn execute(
        &mut self,
        in_flight: &mut InFlight,
        selected: Option<&Candidate>,
    ) -> Option<Result<u32, ExecutionRefusal>> {
        let requested_mono_ns = in_flight.queued.task.requested_mono_ns?;
        // Of its time nothing can be learned for other plans.
        let is_moved_end = selected.is_some_and(|it| it.source == Source::MovedEnd);
        if let (PlanBegin::AtSwitch(_), Some(kind), false) =
            (in_flight.begin, in_flight.kind.take(), is_moved_end)
        {
            self.lead_times.note(kind, in_flight.begin_chosen.elapsed());
        }
        let published = self.publish_selected(in_flight, selected, requested_mono_ns);
        in_flight.took = in_flight.begin_chosen.elapsed();
        Some(published)
    }

    fn publish_selected(
        &self,
        in_flight: &InFlight,
        selected: Option<&Candidate>,
        requested_mono_ns: i64,
    ) -> Result<u32, ExecutionRefusal> {
        let (leaves, begin_mono_ns) = in_flight.begin.to_execute()?;
        if self.ends {
            return Err(ExecutionRefusal::DaemonEnds);
        }
        let candidate = selected.ok_or(ExecutionRefusal::NothingSelected)?;
        self.check_wanted(in_flight, leaves.as_ref(), candidate)?;
        self.execution.publish(SelectedMotion {
            motion: Arc::clone(&candidate.trajectory),
            goals: timed_goals(&in_flight.queued.task.goals(), candidate),
            leaves,
            draw: candidate.draw,
            plan_id: in_flight.plan_id,
            is_replanned: matches!(in_flight.queued.asker, Asker::GoalKeeper(_)),
            timing: ExecutionTiming {
                requested_mono_ns,
                begin_mono_ns,
            },
        })
    }

    /// Checks that a motion of a plan to the goal that stays is still wanted.
    fn check_wanted(
        &self,
        in_flight: &InFlight,
        leaves: Option<&Switch>,
        candidate: &Candidate,
    ) -> Result<(), ExecutionRefusal> {
        if !matches!(in_flight.queued.asker, Asker::GoalKeeper(_)) {
            return Ok(());
        }
        let duration_s = candidate.trajectory.duration();
        match self.goal.keeper.wants(leaves, duration_s) {
            Wanted::Yes => Ok(()),
            Wanted::NoBetter { remaining_s } => Err(ExecutionRefusal::NoBetter { remaining_s }),
            Wanted::GivenUp => Err(ExecutionRefusal::GoalGivenUp),
        }
    }

    /// Gives the goal that stays up where a client's motion is executed.
    fn note_foreign_motion(
        &mut self,
        in_flight: &InFlight,
        published: Option<&Result<u32, ExecutionRefusal>>,
    ) {
        if let (Asker::Client(_), Some(Ok(id))) = (&in_flight.queued.asker, published) {
            self.goal.keeper.end_for_foreign(*id);
        }
    }
}

impl InFlight {
    /// Whether its motion was published before its plan is whole.
    pub(super) fn has_motion_on_its_way(&self) -> bool {
        let executed = self.executed.as_ref();
        executed.is_some_and(|it| it.published.is_ok())
    }

    /// The next attempt of a request whose motion came too late for its switch or for the obstacles that it was planned among, where there is one.
    pub(super) fn made_again(&self, refusal: &ExecutionRefusal) -> Option<Attempt> {
        let is_out_of_date = matches!(
            refusal,
            ExecutionRefusal::SwitchMissed { .. }
                | ExecutionRefusal::NotBegun { .. }
                | ExecutionRefusal::SceneInTheWay(_)
        );
        let is_wanted = self.queued.asker.is_waiting();
        let is_in_time = Instant::now() < self.queued.deadline(self.waited);
        let next = self.attempt.next(self.took);
        next.filter(|_| is_out_of_date && is_wanted && is_in_time)
    }
}

/// Goals, with the times at which a candidate to them passes them.
pub(super) fn timed_goals(goals: &[Via], candidate: &Candidate) -> Arc<[TimedGoal]> {
    let passed_s = candidate.passages.iter().map(|passage| passage.time_s);
    let times_s = passed_s.chain([candidate.trajectory.duration()]);
    let goals = goals.iter().copied().zip(times_s);
    goals
        .map(|(goal, time_s)| TimedGoal { goal, time_s })
        .collect()
}
