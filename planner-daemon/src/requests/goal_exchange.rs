//! What is heard and told of the goal that stays.

use std::collections::VecDeque;

use pcc_model::UnitRobot;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{self, GoalState, Outcome};
use shared_types::ipc::{IpcError, IpcNode};
use shared_types::message::{self, GoalStatus, ReasonText};
use shared_types::valid::{Invalid, MotionResult, StandingGoal};

use super::answer::Answer;
use super::refusal::check_robot;
use crate::goal_keeping::{GoalKeeper, GoalPorts, PlanResult, PublishedMotion};

/// Time between two messages on the status of a goal that does not change, nanoseconds.
const STATUS_PERIOD_NS: i64 = 100_000_000;
/// Least time between two messages on the same state, and between two on goals that do not count, nanoseconds.
const LEAST_PERIOD_NS: i64 = 5_000_000;
/// Most goals that do not count of which is still to be told.
const MOST_REFUSED: usize = 16;

/// What was heard that concerns motions under way.
#[derive(Default)]
pub(super) struct HeardOfMotions {
    /// The motion that is to be stopped.
    pub(super) stopped: Option<u32>,
    /// Motions that the controller has refused, since it had passed their switch.
    pub(super) not_begun: Vec<u32>,
}

/// The keeper of the goal that stays, its ports, and what was told last.
pub(super) struct GoalExchange {
    pub(super) keeper: GoalKeeper,
    ports: GoalPorts,
    robot_hash: u64,
    told: GoalStatus,
    told_mono_ns: i64,
    /// What is still to be said of goals that do not count, one for each goal.
    refused: VecDeque<GoalStatus>,
    refused_mono_ns: i64,
}

impl GoalExchange {
    /// Opens the services of the goal.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(super) fn open(
        node: &IpcNode,
        robot: &UnitRobot,
        robot_hash: u64,
    ) -> Result<Self, IpcError> {
        Ok(Self {
            keeper: GoalKeeper::new(robot.clone()),
            ports: GoalPorts::open(node)?,
            robot_hash,
            told: GoalStatus::ZEROED,
            told_mono_ns: 0,
            refused: VecDeque::new(),
            refused_mono_ns: 0,
        })
    }

    /// Hears what came of a plan to the goal.
    pub(super) fn hear_answer(&mut self, answer: &Answer) {
        let report = &answer.report;
        // What was published before its plan was whole is known already, whatever the answer selects.
        let duration_s = answer
            .selected()
            .map_or(0.0, |(_, it)| it.trajectory.duration());
        self.keeper.hear_plan(&PlanResult {
            plan_id: report.plan_id,
            outcome: answer.outcome().unwrap_or(Outcome::NoPath),
            reason: report.reason,
            published: (report.trajectory_id != 0).then_some(PublishedMotion {
                trajectory_id: report.trajectory_id,
                duration_s,
            }),
        });
    }

    /// Hears goals and results of motions.
    pub(super) fn hear(&mut self) -> HeardOfMotions {
        let mut heard = HeardOfMotions::default();
        for wire in self.ports.goals() {
            // The clock is read after the message came, which may be stamped this very moment.
            let before = self.keeper.status();
            let refused = match read(&wire, self.robot_hash, mono_now_ns()) {
                Ok(goal) => match self.keeper.give(goal) {
                    Ok(stop) => {
                        heard.stopped = stop.or(heard.stopped);
                        let Some(status) = replaced_status(&before, &self.keeper.status()) else {
                            continue;
                        };
                        status
                    }
                    Err(reason) => status_of(&wire, GoalState::Ended, reason),
                },
                Err(reason) => status_of(&wire, GoalState::Refused, &reason),
            };
            note_refused(&mut self.refused, refused);
        }
        for wire in self.ports.results() {
            match MotionResult::try_from(&wire) {
                Ok(result) => {
                    self.keeper.hear_result(&result);
                    let is_missed = result.refusal == codes::Refusal::SwitchMissed;
                    let id = is_missed.then_some(result.values.trajectory_id);
                    heard.not_begun.extend(id);
                }
                Err(error) => tracing::warn!("a motion's result is refused: {error}"),
            }
        }
        heard
    }

    /// Publishes the status where it has changed, and now and then while there is a goal; changes of numbers alone, and words on goals that
    /// do not count, only so often that a flood of goals makes none of statuses.
    pub(super) fn tell(&mut self, now_mono_ns: i64) {
        if now_mono_ns - self.refused_mono_ns >= LEAST_PERIOD_NS
            && let Some(status) = self.refused.pop_front()
        {
            self.ports.publish(status);
            self.refused_mono_ns = now_mono_ns;
        }
        let status = self.keeper.status();
        let since_ns = now_mono_ns - self.told_mono_ns;
        let is_due = self.keeper.has_goal() && since_ns >= STATUS_PERIOD_NS;
        let may_change = since_ns >= LEAST_PERIOD_NS || is_other_state(&status, &self.told);
        if is_due || status != self.told && may_change {
            self.ports.publish(status);
            (self.told, self.told_mono_ns) = (status, now_mono_ns);
        }
    }
}

/// Whether a status says more than other numbers of the same state of the same goal.
fn is_other_state(status: &GoalStatus, told: &GoalStatus) -> bool {
    let of = |status: &GoalStatus| (status.given_mono_ns, status.state, status.trajectory_id);
    of(status) != of(told)
}

/// Notes what is to be said of a goal that does not count; the newest of each goal, and no more than [`MOST_REFUSED`].
fn note_refused(refused: &mut VecDeque<GoalStatus>, status: GoalStatus) {
    let given_mono_ns = status.given_mono_ns;
    let mut noted = refused.iter_mut();
    if let Some(noted) = noted.find(|it| it.given_mono_ns == given_mono_ns) {
        *noted = status;
    } else if refused.len() < MOST_REFUSED {
        refused.push_back(status);
    }
}

/// A goal that is acceptable now.
fn read(
    wire: &message::StandingGoal,
    robot_hash: u64,
    now_mono_ns: i64,
) -> Result<StandingGoal, String> {
    let goal = StandingGoal::try_from(wire).map_err(|invalid: Invalid| invalid.to_string())?;
    check_robot("goal", goal.robot_hash, robot_hash).map_err(|refusal| refusal.reason)?;
    if goal.stamp_mono_ns > now_mono_ns {
        return Err(format!(
            "stamp_mono_ns is {}, now is {now_mono_ns}: it is of another clock than this machine's CLOCK_MONOTONIC; now or earlier is \
             allowed",
            goal.stamp_mono_ns
        ));
    }
    Ok(goal)
}

/// The last status of a goal whose place another one has taken.
fn replaced_status(before: &GoalStatus, now: &GoalStatus) -> Option<GoalStatus> {
    let was_kept = before.given_mono_ns != 0 && before.state != GoalState::Ended.code();
    let is_replaced = was_kept && before.given_mono_ns != now.given_mono_ns;
    is_replaced.then(|| GoalStatus {
        state: GoalState::Ended.code(),
        reason: ReasonText::new("another goal has taken its place"),
        ..*before
    })
}

/// The status of a goal that does not count.
fn status_of(wire: &message::StandingGoal, state: GoalState, reason: &str) -> GoalStatus {
    GoalStatus {
        given_mono_ns: wire.given_mono_ns,
        goal_stamp_mono_ns: wire.stamp_mono_ns,
        state: state.code(),
        reason: ReasonText::new(reason),
        ..GoalStatus::ZEROED
    }
}
