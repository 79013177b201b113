//! The turn of the goal that stays: its messages, its plans in the queue, its status.

use std::time::Instant;

use pcc_model::UnitRobot;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{GoalState, Outcome};
use shared_types::ipc::{IpcError, IpcNode};
use shared_types::message::{self, GoalStatus, ReasonText};
use shared_types::valid::{Invalid, MotionResult, PlanRequest, StandingGoal};

use super::answer::Answer;
use super::asker::{Asker, AskerId};
use super::in_flight::Queued;
use super::refusal::Refusal;
use super::request_validator::PlanTask;
use super::service::Service;
use crate::goal_keeping::{GoalKeeper, GoalPorts, PlanResult, PublishedMotion};

/// Time between two messages on the status of a goal that does not change, nanoseconds.
const STATUS_PERIOD_NS: i64 = 100_000_000;

/// The keeper of the goal that stays, its ports, and what was told last.
pub(super) struct GoalTurn {
    pub(super) keeper: GoalKeeper,
    ports: GoalPorts,
    told: GoalStatus,
    told_mono_ns: i64,
}

impl GoalTurn {
    /// Opens the services of the goal.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(super) fn open(node: &IpcNode, robot: &UnitRobot) -> Result<Self, IpcError> {
        Ok(Self {
            keeper: GoalKeeper::new(robot.clone()),
            ports: GoalPorts::open(node)?,
            told: GoalStatus::ZEROED,
            told_mono_ns: 0,
        })
    }

    /// Hears what came of a plan to the goal.
    pub(super) fn hear_answer(&mut self, answer: &Answer) {
        let report = &answer.report;
        let published = answer.selected().filter(|_| report.trajectory_id != 0);
        self.keeper.hear_plan(&PlanResult {
            plan_id: report.plan_id,
            outcome: answer.outcome().unwrap_or(Outcome::NoPath),
            reason: report.reason,
            published: published.map(|(_, candidate)| PublishedMotion {
                trajectory_id: report.trajectory_id,
                duration_s: candidate.trajectory.duration(),
            }),
        });
    }

    /// Hears goals and results of motions; returns the motion that is to be stopped, if any.
    fn hear(&mut self, now_mono_ns: i64) -> Option<u32> {
        let mut stopped = None;
        let (mut refused, mut replaced) = (None, None);
        for wire in self.ports.goals() {
            match read(&wire, now_mono_ns) {
                Ok(goal) => match self.keeper.give(goal) {
                    Ok(stop) => stopped = stop.or(stopped),
                    Err(status) => refused = Some(*status),
                },
                Err(reason) => refused = Some(refused_status(&wire, &reason)),
            }
            replaced = self.keeper.take_replaced().or(replaced);
        }
        for wire in self.ports.results() {
            match MotionResult::try_from(&wire) {
                Ok(result) => self.keeper.hear_result(&result),
                Err(error) => tracing::warn!("a motion's result is refused: {error}"),
            }
        }
        for status in [refused, replaced].into_iter().flatten() {
            self.ports.publish(status);
        }
        stopped
    }

    /// Publishes the status where it has changed, and now and then while there is a goal.
    fn tell(&mut self, now_mono_ns: i64) {
        let status = self.keeper.status();
        let is_due = self.keeper.has_goal() && now_mono_ns - self.told_mono_ns >= STATUS_PERIOD_NS;
        if status != self.told || is_due {
            self.ports.publish(status);
            (self.told, self.told_mono_ns) = (status, now_mono_ns);
        }
    }
}

/// A goal that is acceptable now.
fn read(wire: &message::StandingGoal, now_mono_ns: i64) -> Result<StandingGoal, String> {
    let goal = StandingGoal::try_from(wire).map_err(|invalid: Invalid| invalid.to_string())?;
    if goal.stamp_mono_ns > now_mono_ns {
        return Err(format!(
            "stamp_mono_ns is {}, now is {now_mono_ns}: it is of another clock than this machine's CLOCK_MONOTONIC; now or earlier is \
             allowed",
            goal.stamp_mono_ns
        ));
    }
    Ok(goal)
}

fn refused_status(wire: &message::StandingGoal, reason: &str) -> GoalStatus {
    GoalStatus {
        given_mono_ns: wire.given_mono_ns,
        goal_stamp_mono_ns: wire.stamp_mono_ns,
        state: GoalState::Refused.code(),
        reason: ReasonText::new(reason),
        ..GoalStatus::ZEROED
    }
}

impl Service {
    /// Hears goals, has what they want planned, and tells what becomes of them; returns whether a plan was asked for.
    pub(super) fn keep_goal(&mut self) -> bool {
        let now = mono_now_ns();
        let own_stop_mono_ns = self.execution.own_stop_mono_ns();
        self.goal.keeper.hear_own_stop(own_stop_mono_ns);
        if let Some(id) = self.goal.hear(now) {
            self.execution.stop(id);
        }
        let mut is_asked = false;
        if self.goal.keeper.has_goal() {
            let robot = self.execution.robot_motion();
            if let Some(request) = self.goal.keeper.next_plan(&robot, now) {
                self.ask_for_goal(request);
                is_asked = true;
            }
        }
        self.goal.tell(now);
        is_asked
    }

    /// Puts a plan to the goal into the queue.
    fn ask_for_goal(&mut self, request: PlanRequest) {
        let task = match self.goal_task(request) {
            Ok(task) => task,
            Err(refusal) => return self.refuse(&Asker::GoalKeeper, 0, &refusal),
        };
        let queued = Queued {
            asker: Asker::GoalKeeper,
            task,
            received: Instant::now(),
        };
        let pushed = self.queue.push(AskerId::GoalKeeper, queued);
        debug_assert!(pushed.is_ok(), "one plan to the goal at a time");
    }

    fn goal_task(&self, mut request: PlanRequest) -> Result<PlanTask, Refusal> {
        // Where other plans came since then it begins anew.
        request.previous = request
            .previous
            .filter(|named| self.plans.previous(named).is_ok());
        request.candidate_count = request
            .candidate_count
            .min(self.validator.capacity.candidates);
        self.validator.validate(&request, &self.plans)
    }
}
