//! When a motion to the goal that stays is planned, and what becomes of the goal. It has no port and no clock.

use std::time::Duration;

use pcc_model::{Configuration, UnitRobot};
use shared_types::codes::{CommandSender, GoalState, MotionOutcome, Outcome, Refusal, StopCause};
use shared_types::message::{GoalStatus, ReasonText};
use shared_types::valid::{Goal, MotionResult, PlanRequest, PreviousPlan, StandingGoal};

use super::kept_goal::{
    Heading, KeptGoal, PublishedMotion, SAME_CONFIGURATION_RAD, Target, are_nearby,
};
use crate::execution::{HeardOrders, RobotMotion, StopReason, Switch};
use crate::tip_tolerance::tip_tolerance;

/// Candidates of a plan.
const CANDIDATES: usize = 4;
/// Time that a plan may take: a goal that cannot be reached is told of within 100 ms.
const DEADLINE: Duration = Duration::from_millis(60);
/// Least time between the begins of two plans, nanoseconds.
const PERIOD_NS: i64 = 20_000_000;
/// Time between two looks for a better motion to the same goal, and between two attempts where there was none, nanoseconds.
const LOOK_AGAIN_NS: i64 = 100_000_000;
/// Share of what remains of a motion that another one to the same goal may take to be worth a change.
const WORTH_A_CHANGE: f64 = 0.9;
/// For so long a motion from rest is followed before another one to a goal nearby may leave it, s: left again and again before it has gathered
/// speed, the robot creeps.
const GATHERS_SPEED_S: f64 = 0.15;
/// Share of a tip's tolerance within which a robot at rest stays where it is.
const AT_REST_SHARE: f64 = 0.1;

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

/// Keeps the robot on its way to the goal that was given last.
pub(crate) struct GoalKeeper {
    robot: UnitRobot,
    kept: Option<KeptGoal>,
    /// What the plan in work is made for, whatever has become of the goal.
    planned_for: Option<Target>,
    /// Whether that plan was given up for a goal elsewhere, and whether the one before it was.
    is_overtaken: bool,
    was_overtaken: bool,
    orders: HeardOrders,
    /// When the last goal that was given up had been given, nanoseconds: nothing given until then counts.
    ended_given_mono_ns: i64,
    status: GoalStatus,
}

impl GoalKeeper {
    /// No goal, for a robot in units of its section length.
    pub(crate) fn new(robot: UnitRobot) -> Self {
        Self {
            robot,
            kept: None,
            planned_for: None,
            is_overtaken: false,
            was_overtaken: false,
            orders: HeardOrders::default(),
            ended_given_mono_ns: 0,
            status: GoalStatus::ZEROED,
        }
    }

    /// What becomes of the goal; its stamp is not set.
    pub(crate) fn status(&self) -> GoalStatus {
        self.status
    }

    /// Whether there is a goal.
    pub(crate) fn has_goal(&self) -> bool {
        self.kept.is_some()
    }

    /// Takes a goal in; returns the motion to stop, with those that it leaves, where it is withdrawn.
    ///
    /// # Errors
    /// Why a goal is over: it was given up before, or one that was given later has its place.
    pub(crate) fn give(&mut self, goal: StandingGoal) -> Result<Option<u32>, &'static str> {
        let kept_given = self.kept.as_ref().map(|kept| kept.newest.given_mono_ns);
        if goal.given_mono_ns <= self.ended_given_mono_ns {
            return Err("it was given up before: give another one");
        }
        if kept_given.is_some_and(|given| goal.given_mono_ns < given) {
            return Err("another one was given later");
        }
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
        let heading = self.kept.as_ref().and_then(|kept| kept.headings.last());
        let id = heading.map(|heading| heading.motion.trajectory_id);
        self.end("it was withdrawn");
        Ok(id)
    }

    /// Takes another goal in; a motion to the one before goes on until it is left.
    fn begin(&mut self, goal: StandingGoal) {
        let before = self.kept.take();
        if let Some(before) = &before {
            self.ended_given_mono_ns = before.newest.given_mono_ns;
        }
        self.kept = Some(KeptGoal::after(before, goal));
        self.status = GoalStatus {
            given_mono_ns: goal.given_mono_ns,
            goal_stamp_mono_ns: goal.stamp_mono_ns,
            state: GoalState::Planning.code(),
            ..GoalStatus::ZEROED
        };
    }

    /// Gives the goal up.
    pub(super) fn end(&mut self, reason: &str) {
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

    fn tell(&mut self, state: GoalState, reason: &str) {
        self.status.state = state.code();
        self.status.reason = ReasonText::new(reason);
    }

    /// Hears what the controller says of orders. A stop or a reset since the goal was given ends it; where a motion is under way its result
    /// does, which says more.
    pub(crate) fn hear_orders(&mut self, orders: HeardOrders) {
        self.orders = orders;
        let is_at_rest = self.kept.as_ref().is_some_and(|it| it.headings.is_empty());
        if is_at_rest && self.is_over() {
            self.end("a stop, a reset or a start of the controller came after it was given");
        }
    }

    fn is_over(&self) -> bool {
        let kept = self.kept.as_ref();
        kept.is_some_and(|kept| kept.newest.given_mono_ns <= self.orders.goals_from_mono_ns)
    }

    /// The plan that is to be made now, if any.
    pub(crate) fn next_plan(
        &mut self,
        robot: &RobotMotion,
        now_mono_ns: i64,
    ) -> Option<PlanRequest> {
        let is_planning = self.planned_for.is_some();
        if let RobotMotion::Busy {
            stopped_for: Some(reason),
            ..
        } = robot
        {
            self.tell_stop(*reason);
            return None;
        }
        let has_jumped = self.has_jumped();
        let kept = self.kept.as_mut()?;
        let is_long_busy = kept.is_long_busy(robot, now_mono_ns);
        if is_planning || now_mono_ns < kept.next_plan_mono_ns(has_jumped) {
            return None;
        }
        let target = kept.target(&self.robot, robot, now_mono_ns);
        let is_blocked = matches!(robot, RobotMotion::Following(followed) if followed.is_blocked);
        kept.is_blocked = is_blocked;
        if let RobotMotion::Holding(_) = robot {
            if kept.awaits_result(now_mono_ns) {
                return None;
            }
        } else {
            kept.rests_since_mono_ns = None;
        }
        if kept.was_planned_nearby(&target, &self.robot) && gathers_speed(robot, now_mono_ns) {
            return None;
        }
        let is_new = is_blocked || kept.last_planned_for != Some(target);
        if !is_new && now_mono_ns < kept.look_again_mono_ns {
            return None;
        }
        match robot {
            RobotMotion::Holding(configuration)
                if kept.still_rests(&target.goal, configuration)
                    || self.is_at(&target.goal, configuration) =>
            {
                self.tell(GoalState::Reached, "");
                None
            }
            RobotMotion::Holding(_) | RobotMotion::Following(_) if self.is_over() => None,
            RobotMotion::Holding(_) | RobotMotion::Following(_) => {
                self.plan(target, has_jumped, now_mono_ns)
            }
            RobotMotion::Busy { passes: true, .. } if !is_long_busy => None,
            RobotMotion::Busy { .. } | RobotMotion::Unknown => {
                let reason = robot.why_not_ready().unwrap_or_default();
                self.tell(GoalState::RobotNotReady, &reason);
                None
            }
        }
    }

    /// The motion to a target that moves, whose end may be moved to it: the newest one, where it keeps the limits that are wanted now.
    pub(crate) fn motion_to_target(&self) -> Option<u32> {
        let kept = self.kept.as_ref()?;
        let (newest, heading) = (&kept.newest, kept.headings.last()?);
        let may_move = newest.tip_velocity_m_s != [0.0; 3]
            && heading.target.limits_scale == newest.limits_scale;
        may_move.then_some(heading.motion.trajectory_id)
    }

    /// Whether the goal is elsewhere than where it was when the last plan was made.
    fn has_jumped(&self) -> bool {
        self.kept.as_ref().is_some_and(|kept| {
            let last = kept.last_goal.as_ref();
            let goal = &kept.newest.goal;
            last.is_none_or(|last| last != goal && !are_nearby(last, goal, &self.robot))
        })
    }

    /// Whether the plan in work is to be given up now, since the goal is elsewhere. Of two plans without a motion one after the other one is
    /// not given up, so that the robot comes on its way wherever a goal jumps.
    pub(crate) fn overtakes(&mut self, has_motion: bool, now_mono_ns: i64) -> bool {
        let is_due = |kept: &KeptGoal| now_mono_ns >= kept.next_plan_mono_ns(true);
        let may_give_up = has_motion || !self.was_overtaken;
        let is_planning = self.planned_for.is_some() && !self.is_overtaken && may_give_up;
        let overtakes = is_planning && self.has_jumped() && self.kept.as_ref().is_some_and(is_due);
        self.is_overtaken |= overtakes;
        overtakes
    }

    /// Whether a robot at rest stays where it is.
    fn is_at(&self, goal: &Goal, configuration: &Configuration) -> bool {
        match *goal {
            Goal::Configuration(goal) => {
                (Configuration::from(goal) - configuration).amax() <= SAME_CONFIGURATION_RAD
            }
            Goal::Tip { position_m, .. } => {
                let target = self.robot.point_in_section_lengths(position_m);
                let tolerance = tip_tolerance(goal, &self.robot);
                (self.robot.tip(configuration) - target).norm() <= AT_REST_SHARE * tolerance
            }
        }
    }

    fn plan(&mut self, target: Target, has_jumped: bool, now_mono_ns: i64) -> Option<PlanRequest> {
        let requested_mono_ns = self.requested_mono_ns(target.given_mono_ns);
        let kept = self.kept.as_mut()?;
        self.planned_for = Some(target);
        kept.last_planned_for = Some(target);
        kept.last_goal = Some(kept.newest.goal);
        kept.note_plan(has_jumped, now_mono_ns + PERIOD_NS);
        kept.look_again_mono_ns = now_mono_ns + LOOK_AGAIN_NS;
        self.status.plan_count += 1;
        if has_jumped {
            // Another way may be faster, and the fastest is known sooner without what remains.
            kept.previous_plan_id = None;
        }
        Some(PlanRequest {
            seed: self.status.plan_count,
            candidate_count: CANDIDATES,
            deadline: Some(DEADLINE),
            execute: true,
            limits_scale: target.limits_scale,
            requested_mono_ns: Some(requested_mono_ns),
            previous: kept.previous_plan_id.map(|plan_id| PreviousPlan {
                plan_id,
                candidate: None,
            }),
            ..PlanRequest::from_robot(target.goal)
        })
    }

    /// The time of the request of a motion to a goal: a stop that is ordered after the goal was given refuses the motion, unless it is one
    /// of this daemon's own that the controller has told of.
    fn requested_mono_ns(&self, given_mono_ns: i64) -> i64 {
        given_mono_ns.max(self.orders.wanted_from_mono_ns + 1)
    }

    /// Whether the motion of a plan to the goal is to be executed: not where the goal was given up meanwhile, and not where it leaves one
    /// to the same goal that is nearly as fast.
    pub(crate) fn wants(&self, leaves: Option<&Switch>, duration_s: f64) -> Wanted {
        let Some((kept, target)) = self.pursued() else {
            return Wanted::GivenUp;
        };
        let there = Wanted::NoBetter { remaining_s: 0.0 };
        let heading = kept.headings.last();
        let heading = heading.filter(|heading| heading.target.is_same(&target));
        match (leaves, heading) {
            (None, None) if kept.has_arrived(&target.goal) => there,
            // The motion has ended meanwhile: its result says where.
            (None, Some(_)) => there,
            (Some(switch), Some(heading))
                if heading.motion.trajectory_id == switch.trajectory_id =>
            {
                let remaining_s = heading.motion.duration_s - switch.path_time_s;
                if !kept.is_blocked && duration_s > WORTH_A_CHANGE * remaining_s {
                    return Wanted::NoBetter { remaining_s };
                }
                Wanted::Yes
            }
            _ => Wanted::Yes,
        }
    }

    /// Whether the plan in work is for the goal as it is: neither given up, nor replaced, nor elsewhere.
    pub(crate) fn wants_plan_in_work(&self) -> bool {
        self.pursued().is_some()
    }

    /// The goal, and what the plan in work is made for, where that is still wanted.
    fn pursued(&self) -> Option<(&KeptGoal, Target)> {
        let (kept, target) = self.kept.as_ref().zip(self.planned_for)?;
        let is_of_goal = target.given_mono_ns == kept.newest.given_mono_ns;
        (is_of_goal && !self.is_over() && !self.is_overtaken).then_some((kept, target))
    }

    /// Hears of the motion of the plan in work, which may not be complete yet.
    pub(crate) fn hear_motion(&mut self, motion: PublishedMotion) {
        let Some((kept, target)) = self.kept.as_mut().zip(self.planned_for) else {
            return;
        };
        let is_known = self.status.trajectory_id == motion.trajectory_id;
        if is_known || target.given_mono_ns != kept.newest.given_mono_ns {
            return;
        }
        kept.head(Heading { motion, target });
        self.status.outcome = Outcome::Ok.code();
        self.status.motion_count += 1;
        self.status.trajectory_id = motion.trajectory_id;
        self.tell(GoalState::Underway, "");
    }

    /// Hears what came of the plan that was to be made.
    pub(crate) fn hear_plan(&mut self, result: &PlanResult) {
        if let Some(motion) = result.published {
            self.hear_motion(motion);
        }
        let is_overtaken = std::mem::take(&mut self.is_overtaken);
        self.was_overtaken = is_overtaken && result.published.is_none();
        let target = self.planned_for.take();
        let Some((kept, target)) = self.kept.as_mut().zip(target) else {
            return;
        };
        if target.given_mono_ns != kept.newest.given_mono_ns {
            return;
        }
        if is_overtaken && result.published.is_none() {
            // The goal may be where it was before it jumped.
            kept.last_planned_for = None;
            return;
        }
        self.status.outcome = result.outcome.code();
        if result.published.is_some() {
            kept.previous_plan_id = Some(result.plan_id);
            return;
        }
        let is_barred = kept.is_blocked && !result.says_nothing_of_the_goal();
        if kept.is_headed_for(&target) && !is_barred {
            return self.tell(GoalState::Underway, "");
        }
        let is_moving = !kept.headings.is_empty();
        if kept.has_arrived(&target.goal) || is_moving && result.says_nothing_of_the_goal() {
            return;
        }
        self.tell_failure(result);
    }

    /// Tells that supervision has the motion to the goal stopped: another one is planned once the robot rests.
    fn tell_stop(&mut self, reason: StopReason) {
        if self.kept.as_ref().is_some_and(|it| !it.headings.is_empty()) {
            self.status.outcome = Outcome::NoPath.code();
            self.tell(
                GoalState::Unreachable,
                &format!("the robot is stopped on its way: {reason}"),
            );
        }
    }

    fn tell_failure(&mut self, result: &PlanResult) {
        let state = match result.outcome {
            Outcome::RobotNotReady => GoalState::RobotNotReady,
            Outcome::Truncated if result.says_nothing_of_the_goal() => GoalState::Planning,
            _ => GoalState::Unreachable,
        };
        let reason = result.outcome.explained(&result.reason.text());
        self.tell(state, &reason);
    }

    /// Hears how a motion ended.
    pub(crate) fn hear_result(&mut self, result: &MotionResult) {
        let Some(kept) = &mut self.kept else {
            return;
        };
        let id = result.values.trajectory_id;
        let is_of = |heading: &Heading| heading.motion.trajectory_id == id;
        let Some(index) = kept.headings.iter().position(is_of) else {
            return;
        };
        let heading = kept.headings.remove(index);
        let is_for_this_goal = heading.target.given_mono_ns == kept.newest.given_mono_ns;
        let was_refused = result.outcome == MotionOutcome::Refused;
        match result.outcome {
            MotionOutcome::Joined => {
                kept.was_refused = false;
                return;
            }
            MotionOutcome::Reached => kept.arrive(heading.target.goal),
            _ if is_for_this_goal && ends_the_goal(result) => {
                return self.end(&result.to_string());
            }
            MotionOutcome::Refused | MotionOutcome::Stopped | MotionOutcome::SetAside => {}
        }
        if was_refused {
            kept.previous_plan_id = None;
        }
        // A plan in work is made again where the controller has refused its motion. Else what was planned last does not bring the robot there any
        // more. Where the controller refuses again and again, there is no hurry.
        let is_made_again = was_refused && self.planned_for == Some(heading.target);
        if !(is_made_again || was_refused && kept.was_refused) {
            kept.last_planned_for = None;
            if result.refusal == Refusal::SwitchMissed {
                kept.plan_at_once();
            }
        }
        kept.was_refused = was_refused;
    }
}

impl PlanResult {
    /// Whether it leaves open if there is a way to the goal: it was not planned, or its motion came too late.
    fn says_nothing_of_the_goal(&self) -> bool {
        match self.outcome {
            Outcome::Truncated => self.plan_id == 0,
            outcome => outcome == Outcome::ExecutionRefused,
        }
    }
}

/// Whether the motion to a goal ended in a way after which the robot moves only to another goal: by anything but this daemon's own
/// supervision. A refusal does not say by whom the stop was ordered that a request came before: the orders do.
fn ends_the_goal(result: &MotionResult) -> bool {
    result.outcome != MotionOutcome::Refused
        && (result.cause, result.sender) != (StopCause::Command, CommandSender::Supervision)
}

/// Whether the robot follows a motion that began at rest a moment ago and is certified to its end.
fn gathers_speed(robot: &RobotMotion, now_mono_ns: i64) -> bool {
    let RobotMotion::Following(followed) = robot else {
        return false;
    };
    let began_at_rest = followed.motion.knots()[0].velocity == Configuration::zeros();
    began_at_rest && !followed.is_blocked && followed.latest_s(now_mono_ns) < GATHERS_SPEED_S
}

#[cfg(test)]
mod tests;
