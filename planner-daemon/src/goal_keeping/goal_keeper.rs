//! When a motion to the goal that stays is planned, and what becomes of the goal. It has no port and no clock.

use std::time::Duration;

use pcc_model::{Configuration, UnitRobot};
use shared_types::codes::{CommandSender, GoalState, MotionOutcome, Outcome, Refusal, StopCause};
use shared_types::message::{GoalStatus, ReasonText};
use shared_types::valid::{Goal, MotionResult, PlanRequest, PreviousPlan, StandingGoal};

use super::moving_target::Anticipation;
use crate::execution::{RobotMotion, Switch};

/// Candidates of a plan.
const CANDIDATES: usize = 4;
/// Time that a plan may take: a goal that cannot be reached is told of within 100 ms.
const DEADLINE: Duration = Duration::from_millis(60);
/// Least time between the begins of two plans, nanoseconds.
const PERIOD_NS: i64 = 10_000_000;
/// Time between two looks for a better motion to the same goal, and between two attempts where there was none, nanoseconds.
const LOOK_AGAIN_NS: i64 = 100_000_000;
/// Share of what remains of a motion that another one to the same goal may take to be worth a change.
const WORTH_A_CHANGE: f64 = 0.9;
/// Share of a tip's tolerance within which a robot at rest stays where it is.
const AT_REST_SHARE: f64 = 0.1;
/// Difference from a goal configuration within which a robot at rest stays where it is, rad.
const SAME_CONFIGURATION_RAD: f64 = 1e-6;
/// Distance from the goal that counts as reached where the goal does not say, section lengths.
const DEFAULT_TIP_TOLERANCE: f64 = 0.01;

/// What came of a plan to the goal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanResult {
    pub(crate) plan_id: u64,
    pub(crate) outcome: Outcome,
    /// Why it is no better.
    pub(crate) reason: ReasonText,
    /// The motion that was published.
    pub(crate) published: Option<PublishedMotion>,
}

/// A motion that was published for the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PublishedMotion {
    pub(crate) trajectory_id: u32,
    pub(crate) duration_s: f64,
}

/// Whether a motion to the goal is to be executed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanted {
    Yes,
    /// What remains of the one under way is not longer by a tenth.
    NoBetter {
        remaining_s: f64,
    },
    /// The goal was given up or replaced while the motion was planned.
    GivenUp,
}

/// Where a goal was when a plan was made.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Target {
    given_mono_ns: i64,
    /// Stops ordered after this time hold for the plan, nanoseconds.
    requested_mono_ns: i64,
    goal: Goal,
}

/// A motion to the goal that is under way, or about to be.
#[derive(Clone, Copy, Debug)]
struct Heading {
    motion: PublishedMotion,
    target: Target,
}

/// A goal that was not given up.
#[derive(Clone, Debug)]
struct KeptGoal {
    newest: StandingGoal,
    /// What the plan in work is made for.
    planned_for: Option<Target>,
    /// What the last plan was made for, where that still counts.
    last_planned_for: Option<Target>,
    heading: Option<Heading>,
    /// The goal at which the robot has arrived.
    arrived_at: Option<Goal>,
    previous_plan_id: Option<u64>,
    anticipation: Anticipation,
    /// No plan begins before this time, nanoseconds.
    next_plan_mono_ns: i64,
    /// No plan for the same as the last one begins before this time, nanoseconds.
    look_again_mono_ns: i64,
}

/// Keeps the robot on its way to the goal that was given last.
pub(crate) struct GoalKeeper {
    robot: UnitRobot,
    kept: Option<KeptGoal>,
    /// When the last goal that was given up had been given, nanoseconds: nothing given until then counts.
    ended_given_mono_ns: i64,
    status: GoalStatus,
    /// What became of a goal whose place another one has taken, until it is told.
    replaced: Option<GoalStatus>,
    /// Until when stops that were ordered are this daemon's own, nanoseconds: they do not end the goal.
    own_stop_mono_ns: i64,
}

impl GoalKeeper {
    /// No goal, for a robot in units of its section length.
    pub(crate) fn new(robot: UnitRobot) -> Self {
        Self {
            robot,
            kept: None,
            ended_given_mono_ns: 0,
            status: GoalStatus::ZEROED,
            replaced: None,
            own_stop_mono_ns: 0,
        }
    }

    /// The end of the goal whose place another one has taken, once; its stamp is not set.
    pub(crate) fn take_replaced(&mut self) -> Option<GoalStatus> {
        self.replaced.take()
    }

    /// What becomes of the goal; its stamp is not set.
    pub(crate) fn status(&self) -> GoalStatus {
        self.status
    }

    /// Whether there is a goal.
    pub(crate) fn has_goal(&self) -> bool {
        self.kept.is_some()
    }

    /// Takes a goal in; returns the motion to stop where it is withdrawn.
    ///
    /// # Errors
    /// The status of a goal that was given up before: it does not count.
    pub(crate) fn give(&mut self, goal: StandingGoal) -> Result<Option<u32>, Box<GoalStatus>> {
        if goal.given_mono_ns <= self.ended_given_mono_ns {
            return Err(Box::new(GoalStatus {
                given_mono_ns: goal.given_mono_ns,
                goal_stamp_mono_ns: goal.stamp_mono_ns,
                state: GoalState::Ended.code(),
                reason: ReasonText::new("it was given up before: give another one"),
                ..GoalStatus::ZEROED
            }));
        }
        let heading_id = self.heading_id();
        match &mut self.kept {
            Some(kept) if kept.newest.given_mono_ns == goal.given_mono_ns => {
                if goal.stamp_mono_ns > kept.newest.stamp_mono_ns {
                    kept.newest = goal;
                    self.status.goal_stamp_mono_ns = goal.stamp_mono_ns;
                }
            }
            _ => self.begin(goal),
        }
        if !goal.is_withdrawn {
            return Ok(None);
        }
        self.end("it was withdrawn");
        Ok(heading_id)
    }

    /// Takes another goal in; a motion to the one before goes on until it is left.
    fn begin(&mut self, goal: StandingGoal) {
        let before = self.kept.take();
        if let Some(before) = &before {
            self.ended_given_mono_ns = before.newest.given_mono_ns;
            self.replaced = Some(GoalStatus {
                state: GoalState::Ended.code(),
                reason: ReasonText::new("another goal has taken its place"),
                ..self.status
            });
        }
        self.kept = Some(KeptGoal {
            newest: goal,
            planned_for: before.as_ref().and_then(|before| before.planned_for),
            last_planned_for: None,
            heading: before.as_ref().and_then(|before| before.heading),
            arrived_at: None,
            previous_plan_id: None,
            anticipation: Anticipation::default(),
            next_plan_mono_ns: before.map_or(0, |before| before.next_plan_mono_ns),
            look_again_mono_ns: 0,
        });
        self.status = GoalStatus {
            given_mono_ns: goal.given_mono_ns,
            goal_stamp_mono_ns: goal.stamp_mono_ns,
            state: GoalState::Planning.code(),
            ..GoalStatus::ZEROED
        };
    }

    /// Gives the goal up.
    pub(crate) fn end(&mut self, reason: &str) {
        if let Some(kept) = self.kept.take() {
            tracing::info!("the goal is given up: {reason}");
            self.ended_given_mono_ns = kept.newest.given_mono_ns;
            self.tell(GoalState::Ended, reason);
        }
    }

    /// Gives the goal up where a client has had a motion of its own executed.
    pub(crate) fn end_for_foreign(&mut self, trajectory_id: u32) {
        self.end(&format!(
            "a client has executed a plan of its own, trajectory {trajectory_id}"
        ));
    }

    fn heading_id(&self) -> Option<u32> {
        let heading = self.kept.as_ref()?.heading?;
        Some(heading.motion.trajectory_id)
    }

    fn tell(&mut self, state: GoalState, reason: &str) {
        self.status.state = state.code();
        self.status.reason = ReasonText::new(reason);
    }

    /// The plan that is to be made now, if any.
    pub(crate) fn next_plan(
        &mut self,
        robot: &RobotMotion,
        now_mono_ns: i64,
    ) -> Option<PlanRequest> {
        let kept = self.kept.as_mut()?;
        if kept.planned_for.is_some() || now_mono_ns < kept.next_plan_mono_ns {
            return None;
        }
        let given_mono_ns = kept.newest.given_mono_ns;
        let target = Target {
            given_mono_ns,
            requested_mono_ns: given_mono_ns.max(self.own_stop_mono_ns),
            goal: kept
                .anticipation
                .aim(&kept.newest, &self.robot, robot, now_mono_ns),
        };
        let is_new = kept.last_planned_for != Some(target);
        if !is_new && now_mono_ns < kept.look_again_mono_ns {
            return None;
        }
        let arrived_at = kept.arrived_at;
        match robot {
            RobotMotion::Holding(configuration)
                if arrived_at == Some(target.goal) || self.is_at(&target.goal, configuration) =>
            {
                self.tell(GoalState::Reached, "");
                None
            }
            RobotMotion::Holding(_) | RobotMotion::Following(_) => self.plan(target, now_mono_ns),
            RobotMotion::Busy { passes: true, .. } => None,
            RobotMotion::Busy { state, fault, .. } => {
                let reason = format!("the controller is {state} (fault: {fault})");
                self.tell(GoalState::RobotNotReady, &reason);
                None
            }
            RobotMotion::Unknown => {
                let reason = "no controller: its state is missing or older than 200 ms";
                self.tell(GoalState::RobotNotReady, reason);
                None
            }
        }
    }

    /// Whether a robot at rest stays where it is.
    fn is_at(&self, goal: &Goal, configuration: &Configuration) -> bool {
        match *goal {
            Goal::Configuration(goal) => {
                (Configuration::from(goal) - configuration).amax() <= SAME_CONFIGURATION_RAD
            }
            Goal::Tip {
                position_m,
                tolerance_m,
            } => {
                let target = self.robot.point_in_section_lengths(position_m);
                let tolerance = tolerance_m.map_or(DEFAULT_TIP_TOLERANCE, |tolerance_m| {
                    self.robot.in_section_lengths(tolerance_m)
                });
                (self.robot.tip(configuration) - target).norm() <= AT_REST_SHARE * tolerance
            }
        }
    }

    fn plan(&mut self, target: Target, now_mono_ns: i64) -> Option<PlanRequest> {
        let kept = self.kept.as_mut()?;
        kept.planned_for = Some(target);
        kept.last_planned_for = Some(target);
        kept.next_plan_mono_ns = now_mono_ns + PERIOD_NS;
        kept.look_again_mono_ns = now_mono_ns + LOOK_AGAIN_NS;
        self.status.plan_count += 1;
        Some(PlanRequest {
            seed: self.status.plan_count,
            candidate_count: CANDIDATES,
            deadline: Some(DEADLINE),
            execute: true,
            limits_scale: kept.newest.limits_scale,
            requested_mono_ns: Some(target.requested_mono_ns),
            previous: kept.previous_plan_id.map(|plan_id| PreviousPlan {
                plan_id,
                candidate: None,
            }),
            ..PlanRequest::from_robot(target.goal)
        })
    }

    /// Whether the motion of a plan to the goal is to be executed: not where the goal was given up meanwhile, and not where it leaves one
    /// to the same goal that is nearly as fast.
    pub(crate) fn wants(&self, leaves: Option<&Switch>, duration_s: f64) -> Wanted {
        let planned_for = |kept: &KeptGoal| {
            let target = kept.planned_for?;
            (target.given_mono_ns == kept.newest.given_mono_ns).then_some(target)
        };
        let kept = self.kept.as_ref();
        let Some((kept, target)) = kept.and_then(|kept| Some((kept, planned_for(kept)?))) else {
            return Wanted::GivenUp;
        };
        let (Some(switch), Some(heading)) = (leaves, kept.heading) else {
            return Wanted::Yes;
        };
        let is_same = heading.motion.trajectory_id == switch.trajectory_id
            && heading.target.goal == target.goal;
        let remaining_s = heading.motion.duration_s - switch.path_time_s;
        if is_same && duration_s > WORTH_A_CHANGE * remaining_s {
            return Wanted::NoBetter { remaining_s };
        }
        Wanted::Yes
    }

    /// Hears what came of the plan that was to be made.
    pub(crate) fn hear_plan(&mut self, result: &PlanResult) {
        let Some(kept) = &mut self.kept else {
            return;
        };
        let Some(target) = kept.planned_for.take() else {
            return;
        };
        if target.given_mono_ns != kept.newest.given_mono_ns {
            return;
        }
        self.status.outcome = result.outcome.code();
        if let Some(motion) = result.published {
            kept.heading = Some(Heading { motion, target });
            kept.arrived_at = None;
            kept.previous_plan_id = Some(result.plan_id);
            self.status.motion_count += 1;
            self.status.trajectory_id = motion.trajectory_id;
            self.tell(GoalState::Underway, "");
            return;
        }
        // A motion that came too late to join says nothing of the one under way, which goes on, nor of the goal.
        let is_left_alone = |heading: Heading| {
            let is_for_this_goal = heading.target.given_mono_ns == target.given_mono_ns;
            let is_late = result.outcome == Outcome::ExecutionRefused && is_for_this_goal;
            heading.target.goal == target.goal || is_late
        };
        if kept.heading.is_some_and(is_left_alone) {
            return;
        }
        let state = match result.outcome {
            Outcome::RobotNotReady => GoalState::RobotNotReady,
            _ => GoalState::Unreachable,
        };
        let outcome = result.outcome.text();
        match result.reason.text().as_ref() {
            "" => self.tell(state, outcome),
            reason if reason.starts_with(outcome) => self.tell(state, reason),
            reason => self.tell(state, &format!("{outcome}: {reason}")),
        }
    }

    /// Hears until when stops that were ordered are this daemon's own supervision's, nanoseconds.
    pub(crate) fn hear_own_stop(&mut self, own_stop_mono_ns: i64) {
        self.own_stop_mono_ns = own_stop_mono_ns;
    }

    /// Hears how a motion ended.
    pub(crate) fn hear_result(&mut self, result: &MotionResult) {
        let id = result.values.trajectory_id;
        let heading = self.kept.as_ref().and_then(|kept| kept.heading);
        let Some(heading) = heading.filter(|heading| heading.motion.trajectory_id == id) else {
            return;
        };
        let ends_the_goal = self.ends_the_goal(result, heading.target);
        let Some(kept) = &mut self.kept else {
            return;
        };
        let is_for_this_goal = heading.target.given_mono_ns == kept.newest.given_mono_ns;
        match result.outcome {
            MotionOutcome::Joined => return,
            MotionOutcome::Reached => kept.arrived_at = Some(heading.target.goal),
            _ if is_for_this_goal && ends_the_goal => {
                return self.end(&result.to_string());
            }
            MotionOutcome::Refused | MotionOutcome::Stopped | MotionOutcome::SetAside => {}
        }
        kept.heading = None;
        // What was planned last does not bring the robot there any more.
        kept.last_planned_for = None;
    }

    /// Whether the motion to a goal ended in a way after which the robot moves only to another goal: by anything but this daemon's own
    /// supervision, or a refusal that another plan can avoid.
    fn ends_the_goal(&self, result: &MotionResult, target: Target) -> bool {
        let own_stop_came_later = self.own_stop_mono_ns > target.requested_mono_ns;
        match result.outcome {
            MotionOutcome::Refused => {
                result.refusal == Refusal::RequestedBefore && !own_stop_came_later
            }
            _ => (result.cause, result.sender) != (StopCause::Command, CommandSender::Supervision),
        }
    }
}

#[cfg(test)]
mod tests;
