//! Who brings a tip to its target among balls that cross the workspace.

use std::time::{Duration, Instant};

use client::GoalSender;
use shared_types::codes::{GoalState, LoopState};
use shared_types::message::{Ball as RestingBall, MovingBall};
use shared_types::valid::{Goal, PlanRequest, PreviousPlan};
use tests::brute_force::Body;
use tests::crossing_balls::Crossing;
use tests::stack::{PATIENCE, Stack};

/// Distance from the target within which a tip has reached it, m.
pub(super) const TOLERANCE_M: f64 = 0.01;

/// Who brings the tip there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Arm {
    /// The goal that stays.
    Kept,
    /// Executes a plan among the balls, and plans again where it was stopped.
    StopThenPlan,
    /// The same with plans among the balls where they are, as if they stayed there: no foresight but supervision's.
    StopThenPlanAsSeen,
}

impl Arm {
    pub(super) const ALL: [Self; 3] = [Self::Kept, Self::StopThenPlan, Self::StopThenPlanAsSeen];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Kept => "kept on the way",
            Self::StopThenPlan => "stop, then plan again",
            Self::StopThenPlanAsSeen => "stop, then plan again among balls as they are",
        }
    }
}

/// One arm at work.
pub(super) enum Follower {
    Kept(Box<GoalSender>),
    StopThenPlan {
        request: Box<PlanRequest>,
        tip_m: [f64; 3],
        body: Box<Body>,
        plans: u64,
        not_before: Instant,
        /// The balls, where plans take them to stay where they are.
        as_seen: Option<Crossing>,
    },
}

impl Follower {
    pub(super) fn new(stack: &Stack, arm: Arm, crossing: &Crossing) -> anyhow::Result<Self> {
        let goal = Goal::tip(crossing.tip_m);
        Ok(match arm {
            Arm::Kept => Self::Kept(GoalSender::connect(&stack.world.options)?.into()),
            Arm::StopThenPlan | Arm::StopThenPlanAsSeen => Self::StopThenPlan {
                request: Box::new(PlanRequest {
                    candidate_count: 4,
                    deadline: Some(Duration::from_millis(60)),
                    execute: true,
                    ignores_live_scene: arm == Arm::StopThenPlanAsSeen,
                    ..PlanRequest::from_robot(goal)
                }),
                tip_m: crossing.tip_m,
                body: stack.world.body().into(),
                plans: 0,
                not_before: Instant::now(),
                as_seen: (arm == Arm::StopThenPlanAsSeen).then(|| crossing.clone()),
            },
        })
    }

    /// Gives the goal that stays.
    pub(super) fn begin(&mut self, crossing: &Crossing) -> anyhow::Result<()> {
        if let Self::Kept(sender) = self {
            sender.give(Goal::tip(crossing.tip_m), 1.0)?;
        }
        Ok(())
    }

    /// Whether the tip is there, so long after the run's begin.
    pub(super) fn step(&mut self, stack: &mut Stack, elapsed_s: f64) -> anyhow::Result<bool> {
        match self {
            Self::Kept(goal) => {
                let status = goal.status()?;
                Ok(status.is_some_and(|status| status.state == GoalState::Reached))
            }
            Self::StopThenPlan {
                request,
                tip_m,
                body,
                plans,
                not_before,
                as_seen,
            } => {
                let state = stack.controller_state();
                let waits_for_its_begin = state.values.pending_trajectory_id != 0;
                let is_at_rest = state.state == LoopState::Holding && !waits_for_its_begin;
                if !is_at_rest || Instant::now() < *not_before {
                    return Ok(false);
                }
                let at = state.values.commanded_configuration_rad;
                if body.tip_error(&at, tip_m) < TOLERANCE_M {
                    return Ok(true);
                }
                if let Some(crossing) = as_seen {
                    request.balls = still(&crossing.seen_after(elapsed_s));
                }
                let answer = stack.client.plan(request, PATIENCE)?;
                *plans += 1;
                request.seed += 1;
                let is_under_way = answer.report().trajectory_id.is_some();
                if is_under_way {
                    request.previous = Some(PreviousPlan {
                        plan_id: answer.report().plan_id,
                        candidate: None,
                    });
                }
                // The motion begins some ms later; where there is none, as often as the keeper tries again.
                let pause = if is_under_way { 30 } else { 100 };
                *not_before = Instant::now() + Duration::from_millis(pause);
                Ok(false)
            }
        }
    }

    /// Plans made.
    pub(super) fn end(self) -> anyhow::Result<u64> {
        match self {
            Self::Kept(mut goal) => {
                let plans = goal.status()?.map_or(0, |status| status.values.plan_count);
                goal.withdraw()?;
                goal.confirm(PATIENCE)?;
                Ok(plans)
            }
            Self::StopThenPlan { plans, .. } => Ok(plans),
        }
    }
}

/// Balls that stay where these are.
fn still(moving: &[MovingBall]) -> Vec<RestingBall> {
    let still = moving.iter().map(|ball| RestingBall {
        centre_m: ball.centre_m,
        radius_m: ball.radius_m,
    });
    still.collect()
}
