//! The turn of one request: its start, planning, execution, the answer.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use collision::SceneError;
use planning::{Candidate, Problem};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{Outcome, PlanField};

use super::answer::{Answer, is_deliverable};
use super::in_flight::{InFlight, Queued, is_wanted};
use super::plan_runner::{Early, Job, PlanOutput, Planned};
use super::refusal::Refusal;
use super::request_validator::PlanTask;
use super::robot_start::{NotReady, begin_at_robot};
use super::service::Service;
use crate::execution::{
    ExecutionRefusal, ExecutionTiming, ExpectedBegin, RobotMotion, SelectedMotion, Switch,
    TimedGoal,
};

/// Longest wait for a motion that ends or is left in a moment, before a request that begins where the robot is is refused.
const LONGEST_DEFERRAL: Duration = Duration::from_millis(100);
/// The same of a request whose goals are appended: a motion that is to be joined may be joined only once it has passed a goal.
const LONGEST_DEFERRAL_OF_GOALS: Duration = Duration::from_millis(600);
/// Times that a request is planned whose plan comes too late for its switch or for the live scene.
const ATTEMPTS: u32 = 3;

/// Where and when a request begins.
struct Start {
    /// Where it leaves the motion that is followed, if it does.
    leaves: Option<Switch>,
    /// What is planned.
    problem: Arc<Problem>,
    /// The begin, where that is delayed until no ball can be at the start.
    delayed_begin_mono_ns: Option<i64>,
}

impl Service {
    /// Hands the next request over to planning, if that is idle and the request's start is known.
    pub(super) fn begin_next(&mut self) -> bool {
        if self.in_flight.is_some() {
            return false;
        }
        let Some(queued) = self.deferred.take().or_else(|| self.queue.pop()) else {
            return false;
        };
        self.begin(queued, 1)
    }

    /// Begins to plan a request; false where that is deferred.
    fn begin(&mut self, mut queued: Queued, attempt: u32) -> bool {
        let begun = Instant::now();
        let waited = begun - queued.received;
        let Start {
            leaves,
            problem,
            delayed_begin_mono_ns,
        } = match self.start(&mut queued.task, attempt) {
            Ok(start) => start,
            Err(NotReady::Passes(_)) if waited < longest_deferral(&queued.task) => {
                self.deferred = Some(queued);
                return false;
            }
            Err(NotReady::Passes(refusal) | NotReady::Stays(refusal)) => {
                self.refuse(&queued.active, queued.task.request_id, &refusal);
                return true;
            }
        };
        let cancelled = Arc::new(AtomicBool::new(false));
        self.runner.begin(Job {
            problem,
            via: queued.task.whole_via(),
            request: queued.task.request.clone(),
            deadline: queued.deadline() + excused(&queued.task, waited),
            early: self.early(&queued.task),
            cancelled: Arc::clone(&cancelled),
        });
        let plan_id = self.next_plan_id;
        self.next_plan_id += 1;
        self.in_flight = Some(InFlight {
            queued,
            begun,
            waited,
            plan_id,
            leaves,
            delayed_begin_mono_ns,
            attempt,
            cancelled,
        });
        true
    }

    /// Sets the start of a task that begins where the robot is; returns where and when it begins, and the problem to be planned, with the
    /// live scene unless the request ignores that.
    fn start(&self, task: &mut PlanTask, attempt: u32) -> Result<Start, NotReady> {
        // A plan that came too late mostly was an exception: the second one is foreseen like the first.
        let lead = self.lead_times.lead(task.kind()) * attempt.div_ceil(2);
        let robot = self.execution.robot_motion();
        let leaves = match task.starts_at_robot {
            true => begin_at_robot(task, &robot, lead, mono_now_ns())?,
            false => None,
        };
        if task.ignores_live_scene {
            return Ok(Start {
                leaves,
                problem: Arc::clone(&task.problem),
                delayed_begin_mono_ns: None,
            });
        }
        let begin = match (&robot, &leaves) {
            (RobotMotion::Following(followed), Some(switch)) => {
                ExpectedBegin::AtSwitch(followed, switch)
            }
            _ if task.request.start_motion.is_some() => ExpectedBegin::InMotion,
            _ => ExpectedBegin::AtRest {
                not_before_mono_ns: task.execution.and_then(|timing| timing.begin_mono_ns),
            },
        };
        let problem = self.execution.with_live_scene(&task.problem, lead, begin);
        let too_many = |error: SceneError| {
            let reason = format!("with the obstacles of the live scene: {error}");
            NotReady::Stays(Refusal::field(PlanField::Balls, reason))
        };
        let (problem, delayed_begin_mono_ns) = problem.map_err(too_many)?;
        Ok(Start {
            leaves,
            problem,
            delayed_begin_mono_ns,
        })
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
        let Queued { active, task, .. } = &in_flight.queued;
        let mut answer = Answer::early(task, candidates, self.runner.robot());
        answer.set_plan(
            in_flight.plan_id,
            in_flight.motion_start(),
            in_flight.waited,
        );
        self.send(&mut answer, active);
    }

    fn answer(&mut self, planned: Planned) {
        let Some(in_flight) = self.in_flight.take() else {
            return;
        };
        if let Err(fault) = &planned {
            tracing::debug!("no plan: {fault}");
        }
        let plan_id = in_flight.plan_id;
        let InFlight { queued, .. } = &in_flight;
        let mut answer = Answer::of_plan(&queued.task, planned, self.runner.robot());
        answer.set_plan(plan_id, in_flight.motion_start(), in_flight.waited);
        let has_candidates = answer.outcome().is_some_and(Outcome::has_candidates);
        if is_wanted(&queued.active) && has_candidates && !answer.candidates.is_empty() {
            let published = self.execute(&in_flight, &answer);
            if published.as_ref().is_some_and(is_out_of_date)
                && in_flight.attempt < ATTEMPTS
                && Instant::now() < in_flight.queued.deadline()
            {
                tracing::info!("plan {plan_id} is out of date and planned again");
                self.begin(in_flight.queued, in_flight.attempt + 1);
                return;
            }
            report_execution(&mut answer, plan_id, published);
        }
        self.send(&mut answer, &in_flight.queued.active);
        let selected = answer.selected().map(|(index, _)| index);
        self.plans.keep(plan_id, &answer.candidates, selected);
    }

    /// Publishes the selected motion, if it is to be executed.
    fn execute(
        &mut self,
        in_flight: &InFlight,
        answer: &Answer,
    ) -> Option<Result<u32, ExecutionRefusal>> {
        let task = &in_flight.queued.task;
        let timing = task.execution?;
        let begin_mono_ns = in_flight.delayed_begin_mono_ns.or(timing.begin_mono_ns);
        self.lead_times.note(task.kind(), in_flight.begun.elapsed());
        Some(match answer.selected() {
            _ if self.ends => Err(ExecutionRefusal::DaemonEnds),
            Some((candidate_index, candidate)) => self.execution.publish(SelectedMotion {
                motion: Arc::clone(&candidate.trajectory),
                goals: timed_goals(task, candidate),
                leaves: in_flight.leaves,
                candidate_index,
                plan_id: in_flight.plan_id,
                timing: ExecutionTiming {
                    begin_mono_ns,
                    ..timing
                },
            }),
            None => Err(ExecutionRefusal::NothingSelected),
        })
    }
}

/// Whether a motion is refused because it came too late for its switch, or for the obstacles that it was planned among.
fn is_out_of_date(published: &Result<u32, ExecutionRefusal>) -> bool {
    matches!(
        published,
        Err(ExecutionRefusal::SwitchMissed { .. } | ExecutionRefusal::SceneInTheWay { .. })
    )
}

/// Longest wait of a task before it is refused where it cannot begin yet.
fn longest_deferral(task: &PlanTask) -> Duration {
    if task.appends {
        LONGEST_DEFERRAL_OF_GOALS
    } else {
        LONGEST_DEFERRAL
    }
}

/// The time that a task has waited and that does not count against its deadline: appended goals wait for a switch that is under way.
fn excused(task: &PlanTask, waited: Duration) -> Duration {
    if task.appends {
        waited.min(LONGEST_DEFERRAL_OF_GOALS)
    } else {
        Duration::ZERO
    }
}

/// The goals of a task, with the times at which a candidate passes them.
fn timed_goals(task: &PlanTask, candidate: &Candidate) -> Arc<[TimedGoal]> {
    let passed_s = candidate.passages.iter().map(|passage| passage.time_s);
    let times_s = passed_s.chain([candidate.trajectory.duration()]);
    let goals = task.goals().into_iter().zip(times_s);
    goals
        .map(|(goal, time_s)| TimedGoal { goal, time_s })
        .collect()
}

/// States in the answer what became of the execution, where one was asked for.
fn report_execution(
    answer: &mut Answer,
    plan_id: u64,
    published: Option<Result<u32, ExecutionRefusal>>,
) {
    match published {
        Some(Ok(id)) => {
            tracing::info!("trajectory {id} of plan {plan_id} is published for execution");
            answer.report.trajectory_id = id;
        }
        Some(Err(refusal)) => {
            tracing::info!("plan {plan_id} is not executed: {refusal}");
            answer.set_execution_refused(&refusal.to_string());
        }
        None => {}
    }
}
