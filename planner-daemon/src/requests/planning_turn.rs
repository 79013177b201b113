//! The turn of one request: its start, planning, execution, the answer.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use collision::SceneError;
use planning::{Candidate, Problem};
use shared_types::clock::{mono_now_ns, seconds};
use shared_types::codes::{Outcome, PlanDependence, PlanField};

use super::answer::{Answer, is_deliverable};
use super::asker::Asker;
use super::in_flight::{Attempt, InFlight, Queued};
use super::late_switch::{late_switch, until};
use super::lead_times::{PlanKind, Work};
use super::plan_runner::{Early, Job, LateBegin, PlanOutput};
use super::planned::Planned;
use super::planner_kind::PlannerKind;
use super::recent_plans::{KeptPlan, PlanBegin};
use super::refusal::Refusal;
use super::request_validator::PlanTask;
use super::robot_start::{NotReady, begin_at_robot};
use super::service::Service;
use crate::execution::{ExpectedBegin, RobotMotion};

/// Longest delay of the begin of a motion to the goal that stays, s: the next plan is made sooner.
const LONGEST_DELAY_TO_GOAL_S: f64 = 0.05;

/// Where and when a request begins.
struct Start {
    begin: PlanBegin,
    /// What is planned.
    problem: Arc<Problem>,
}

impl Service {
    /// Hands the next request over to planning, if that is idle and the request's start is known: beside a client's that waits for the robot,
    /// those that begin elsewhere.
    pub(super) fn begin_next(&mut self) -> bool {
        if self.in_flight.is_some() {
            return false;
        }
        if let Some((queued, attempt)) = self.deferred.take()
            && self.begin(queued, attempt)
        {
            return true;
        }
        let next = match &self.deferred {
            None => self.queue.pop(),
            Some((waiting, _)) if matches!(waiting.asker, Asker::Client(_)) => {
                self.queue.pop_if(|queued| !queued.task.starts_at_robot)
            }
            Some(_) => None,
        };
        let Some(queued) = next else {
            return false;
        };
        self.begin(queued, Attempt::FIRST);
        true
    }

    /// Refuses the request that waits for the robot, where it has waited for long enough and another one's plan is made.
    pub(super) fn end_waiting(&mut self, now: Instant) {
        let has_waited = |(waiting, _): &mut (Queued, Attempt)| !waiting.can_wait(now);
        if self.in_flight.is_none() {
            return;
        }
        let Some((mut queued, attempt)) = self.deferred.take_if(has_waited) else {
            return;
        };
        if now >= queued.expires() {
            self.answer_late(&queued, now);
            return;
        }
        match self.start(&mut queued.task, Duration::ZERO) {
            Ok(_) => self.deferred = Some((queued, attempt)),
            Err(NotReady::Passes(refusal) | NotReady::Stays(refusal)) => {
                self.refuse(&queued.asker, queued.task.request_id, &refusal);
            }
        }
    }

    /// Begins to plan a request; false where that is deferred.
    fn begin(&mut self, mut queued: Queued, attempt: Attempt) -> bool {
        let begun = Instant::now();
        let selects_early = self.selects_early(&queued);
        let kind = queued.kind(selects_early);
        let foreseen = attempt.lead(self.lead_times.lead(kind));
        let refusal = match self.start(&mut queued.task, foreseen) {
            Ok(start) => match begins_too_late(&queued.asker, &start.begin) {
                Some(refusal) => refusal,
                None => {
                    self.plan_from(start, queued, attempt, begun, selects_early);
                    return true;
                }
            },
            Err(NotReady::Passes(_)) if queued.can_wait(begun) => {
                self.deferred = Some((queued, attempt));
                return false;
            }
            Err(NotReady::Passes(refusal) | NotReady::Stays(refusal)) => refusal,
        };
        self.refuse(&queued.asker, queued.task.request_id, &refusal);
        true
    }

    /// Has a request planned from a start that is chosen from the instant `begun` on; `selects_early` says whether a motion may be executed before
    /// its plan is complete, where nothing moves.
    fn plan_from(
        &mut self,
        start: Start,
        queued: Queued,
        attempt: Attempt,
        begun: Instant,
        selects_early: bool,
    ) {
        let Start { begin, problem } = start;
        let waited = begun - queued.received;
        // Something may have begun to move since it was asked for.
        let selects_early = selects_early && problem.moving.is_empty();
        let kind = queued.kind(selects_early);
        let lead = |work| attempt.lead(self.lead_times.lead(PlanKind { work, ..kind }));
        let late_switch = match &begin {
            PlanBegin::AtSwitch(switch) if selects_early => Some(late_switch(
                self.execution.shared_robot_motion(),
                *switch,
                Work::FROM_A_LATE_SWITCH.map(|work| (work, lead(work))),
                queued.task.begin_mono_ns,
            )),
            _ => None,
        };
        let cancelled = Arc::new(AtomicBool::new(false));
        let depends_on = self.dependence(&begin, &queued.task, &problem);
        self.runner.begin(Job {
            problem,
            via: queued.task.whole_via(),
            request: queued.task.request.clone(),
            deadline: queued.deadline(waited),
            early: self.early(&queued.task),
            late_switch,
            cancelled: Arc::clone(&cancelled),
        });
        self.plans.free_older();
        self.in_flight = Some(InFlight {
            queued,
            kind: Some(kind),
            begin_chosen: begun,
            took: Duration::ZERO,
            waited,
            plan_id: self.next_plan_id,
            begin,
            depends_on,
            attempt,
            cancelled,
            executed: None,
            makes_way: false,
        });
        self.next_plan_id += 1;
    }

    /// Whether a motion is executed before its plan is complete: planning tells of none among obstacles that move.
    fn selects_early(&self, queued: &Queued) -> bool {
        !self.execution.live_scene_moves() && queued.wants_early_selection()
    }

    /// Sets the start of a task that begins where the robot is; returns where and when it begins, and the problem to be planned, with the
    /// live scene unless the request ignores that.
    fn start(&self, task: &mut PlanTask, lead: Duration) -> Result<Start, NotReady> {
        let robot = self.execution.robot_motion();
        let not_before_mono_ns = task.begin_mono_ns;
        let now = mono_now_ns();
        let switch = match task.starts_at_robot {
            true => begin_at_robot(task, &robot, lead.max(until(not_before_mono_ns, now)), now)?,
            false => None,
        };
        let (begin, expected) = match (&robot, switch) {
            (RobotMotion::Following(followed), Some(switch)) => (
                PlanBegin::AtSwitch(switch),
                ExpectedBegin::AtSwitch(followed, switch),
            ),
            _ if task.request.start_motion.is_some() => {
                (PlanBegin::InGivenMotion, ExpectedBegin::InMotion)
            }
            _ => (
                PlanBegin::AtRest { not_before_mono_ns },
                ExpectedBegin::AtRest { not_before_mono_ns },
            ),
        };
        if task.ignores_live_scene {
            let problem = Arc::clone(&task.problem);
            return Ok(Start { begin, problem });
        }
        let problem = self
            .execution
            .with_live_scene(&task.problem, lead, expected);
        let too_many = |error: SceneError| {
            let reason = format!("with the obstacles of the live scene: {error}");
            NotReady::Stays(Refusal::field(PlanField::Balls, reason))
        };
        let (problem, delayed_begin_mono_ns) = problem.map_err(too_many)?;
        let delayed = delayed_begin_mono_ns.map(|begin| PlanBegin::AtRest {
            not_before_mono_ns: Some(begin),
        });
        Ok(Start {
            begin: delayed.unwrap_or(begin),
            problem,
        })
    }

    /// What a plan depends on beside its request.
    fn dependence(
        &self,
        begin: &PlanBegin,
        task: &PlanTask,
        problem: &Arc<Problem>,
    ) -> PlanDependence {
        match begin {
            _ if self.validator.planner == PlannerKind::Null => PlanDependence::NotPlanned,
            PlanBegin::AtSwitch(_) => PlanDependence::Motion,
            _ if task.request.previous.is_some() => PlanDependence::EarlierPlan,
            // With an obstacle of the live scene it is another problem than the request's.
            _ if !Arc::ptr_eq(problem, &task.problem) => PlanDependence::LiveScene,
            _ => PlanDependence::Nothing,
        }
    }

    fn early(&self, task: &PlanTask) -> Option<Early> {
        let (count, task, robot) = (task.early?, task.clone(), self.runner.robot().clone());
        Some(Early {
            count,
            is_deliverable: Box::new(move |candidate| is_deliverable(&task, candidate, &robot)),
        })
    }

    /// Takes the next output of the running plan and answers it; returns whether there was one.
    pub(super) fn take_output(&mut self) -> bool {
        if self.in_flight.is_none() {
            return false;
        }
        match self.runner.take() {
            Some(PlanOutput::Early(candidates)) => self.answer_early(candidates),
            Some(PlanOutput::Begins(begin)) => self.begin_at(&begin),
            Some(PlanOutput::Selected(candidate, in_work)) => {
                self.execute_early(&candidate, &in_work);
            }
            Some(PlanOutput::Plan(planned)) => self.answer(planned),
            None => return false,
        }
        true
    }

    /// Answers the first certified candidates; the plan goes on.
    fn answer_early(&self, candidates: Vec<Candidate>) {
        let Some(in_flight) = &self.in_flight else {
            return;
        };
        let Queued { asker, task, .. } = &in_flight.queued;
        let Asker::Client(active) = asker else {
            return;
        };
        let mut answer = Answer::early(task, candidates, self.runner.robot());
        answer.set_plan(in_flight.plan_id, &in_flight.begin, in_flight.waited);
        self.send_to_client(&mut answer, active);
    }

    /// Notes where the candidates of the running plan begin, and what can be learned of the time that its work takes.
    fn begin_at(&mut self, begin: &LateBegin) {
        let Some(in_flight) = &mut self.in_flight else {
            return;
        };
        let work = Work::from(begin.to_be_done);
        let kind = in_flight.kind.take();
        if let (Some(kind), true) = (kind, begin.to_be_done.is_known()) {
            // The work took too long for its switch.
            let took = begin.chosen - in_flight.begin_chosen;
            self.lead_times.note(kind, took);
        }
        if let Some(switch) = begin.switch {
            if begin.to_be_done.is_known() {
                let plan_id = in_flight.plan_id;
                tracing::info!(
                    "plan {plan_id}: its switch was too near, another is chosen: {work:?}"
                );
            }
            in_flight.begin = PlanBegin::AtSwitch(switch);
            in_flight.begin_chosen = begin.chosen;
            let kind = in_flight.queued.kind(true);
            in_flight.kind = Some(PlanKind { work, ..kind });
        }
    }

    fn answer(&mut self, mut planned: Planned) {
        let Some(mut in_flight) = self.in_flight.take() else {
            return;
        };
        if let Err(fault) = &planned {
            tracing::debug!("no plan: {fault}");
        }
        let plan_id = in_flight.plan_id;
        let InFlight { queued, .. } = &in_flight;
        let (task, robot) = (&queued.task, self.runner.robot());
        let mut answer = match (&mut planned, &in_flight.executed) {
            (Err(fault), Some(executed)) => {
                Answer::broken_off(task, &executed.candidate, fault, robot)
            }
            (planned, _) => Answer::of_plan(task, planned, robot),
        };
        if in_flight.makes_way {
            answer.tell_that_it_made_way();
        }
        answer.set_plan(plan_id, &in_flight.begin, in_flight.waited);
        let start = in_flight.begin.start().unwrap_or(task.problem.start);
        answer.set_dependence(in_flight.depends_on, start);
        let published = match in_flight.executed.take() {
            Some(executed) => {
                answer.select_draw(executed.candidate.draw);
                Some(executed.published)
            }
            None => self.execute_answered(&mut in_flight, &answer),
        };
        let is_published = matches!(published, Some(Ok(_)));
        if let Some(published) = published {
            if let Err(refusal) = &published
                && let Some(attempt) = in_flight.made_again(refusal)
                && self.is_still_wanted(&in_flight.queued.asker)
            {
                tracing::info!("plan {plan_id} is made again: {refusal}");
                self.begin(in_flight.queued, attempt);
                return;
            }
            answer.report_execution(published.map_err(|refusal| refusal.to_string()));
        }
        self.send(&mut answer, &in_flight.queued.asker);
        let plan = kept(&in_flight, answer);
        match &in_flight.queued.asker {
            Asker::GoalKeeper(_) if is_published => self.plans.keep_to_goal(plan),
            Asker::GoalKeeper(_) => {}
            Asker::Client(_) => self.plans.keep(plan),
        }
    }

    /// Whether a plan is still wanted where it was to lead to.
    fn is_still_wanted(&self, asker: &Asker) -> bool {
        match asker {
            Asker::Client(_) => true,
            Asker::GoalKeeper(_) => self.goal.keeper.wants_plan_in_work(),
        }
    }
}

/// Why a motion to the goal that stays is not planned yet: it would begin so much later that it is planned again until then.
fn begins_too_late(asker: &Asker, begin: &PlanBegin) -> Option<Refusal> {
    let PlanBegin::AtRest { not_before_mono_ns } = begin else {
        return None;
    };
    let delay_s = seconds((*not_before_mono_ns)? - mono_now_ns());
    if !matches!(asker, Asker::GoalKeeper(_)) || delay_s <= LONGEST_DELAY_TO_GOAL_S {
        return None;
    }
    let reason =
        format!("a moving obstacle may be where the robot rests for another {delay_s:.1} s");
    Some(Refusal::new(Outcome::NoPath, reason))
}

/// A plan as it was answered.
fn kept(in_flight: &InFlight, answer: Answer) -> KeptPlan {
    let selected = answer.selected().map(|(index, _)| index);
    let summaries = answer.report.candidates.iter().copied();
    KeptPlan {
        plan_id: in_flight.plan_id,
        begin: in_flight.begin,
        goals: in_flight.queued.task.goals(),
        selected,
        summaries: summaries.take(answer.candidates.len()).collect(),
        candidates: answer.candidates,
    }
}
