//! Where a target is aimed at that moves.

use pcc_model::{TendonLimits, UnitRobot};
use shared_types::clock::seconds;
use shared_types::valid::{Goal, StandingGoal};
use trajectory::{Knot, stopping_motion};

use crate::execution::{FollowedMotion, RobotMotion};

/// Longest time after its stamp for which a target's velocity is believed, s.
const BELIEVED_S: f64 = 0.5;

/// Time that the tip of a robot that follows lags behind its target, beside a share of the time in which it can stop, s.
const LAG_S: f64 = 0.12;
/// That share: it comes to rest half-way through what it would have gone on, and begins to do so later.
const SHARE_OF_STOP: f64 = 0.7;
/// Time until a robot at rest has caught up with its target, s.
const CATCHES_UP_S: f64 = 0.3;

/// The goal that a plan is made for: where the target is once a robot that moves with it can have come to rest, so that the tip lags behind
/// it no more than it must.
pub(super) fn aimed_at(
    goal: &StandingGoal,
    robot: &UnitRobot,
    motion: &RobotMotion,
    now_mono_ns: i64,
) -> Goal {
    let Goal::Tip {
        position_m,
        tolerance_m,
    } = goal.goal
    else {
        return goal.goal;
    };
    if goal.tip_velocity_m_s == [0.0; 3] {
        return goal.goal;
    }
    let ahead_s = match motion {
        RobotMotion::Following(followed) => {
            LAG_S + SHARE_OF_STOP * stop_s(followed, robot, now_mono_ns)
        }
        _ => CATCHES_UP_S,
    };
    let age_s = seconds(now_mono_ns - goal.stamp_mono_ns);
    let moved_s = if age_s <= BELIEVED_S {
        age_s + ahead_s
    } else {
        BELIEVED_S
    };
    let velocity = goal.tip_velocity_m_s;
    Goal::Tip {
        position_m: std::array::from_fn(|axis| position_m[axis] + moved_s * velocity[axis]),
        tolerance_m,
    }
}

/// Time in which the robot can come to rest from where it is on its motion, s.
fn stop_s(followed: &FollowedMotion, robot: &UnitRobot, now_mono_ns: i64) -> f64 {
    let state = followed.motion.at(followed.latest_s(now_mono_ns));
    let from = Knot {
        time: 0.0,
        position: state.position,
        velocity: state.velocity,
        acceleration: state.acceleration,
    };
    let limits: &TendonLimits = &robot.tendon_limits;
    let stop = stopping_motion(&from, &robot.tendons, limits);
    stop.map_or(0.0, |stop| stop.duration())
}
