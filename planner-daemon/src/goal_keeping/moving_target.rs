//! Where a target is aimed at that moves.

use pcc_model::{TendonLimits, UnitRobot};
use shared_types::clock::seconds;
use shared_types::valid::{Goal, StandingGoal};
use trajectory::{Knot, stopping_motion};

use crate::execution::RobotMotion;

/// Longest time after its stamp for which a target's velocity is believed, s.
const BELIEVED_S: f64 = 0.5;

/// Time ahead of a target at which a robot is expected to lag no more, beside a share of the time in which it can stop, s.
const AHEAD_S: f64 = 0.15;
/// That share: a robot comes to rest half-way through what it would have gone on.
const SHARE_OF_STOP: f64 = 0.7;
/// Time in which the lag that is left is learned, s.
const LEARNS_IN_S: f64 = 0.8;
/// Largest time that is learned, s.
const MOST_LEARNED_S: f64 = 0.5;
/// Time until a robot at rest has caught up with its target, s.
const CATCHES_UP_S: f64 = 0.3;
/// Slowest target whose lag is measured, m/s.
const SLOWEST_M_S: f64 = 0.01;

/// How far ahead of a moving target is aimed, so that the tip does not lag behind it: a robot comes to rest where it is sent to, and
/// the target does not.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Anticipation {
    /// Time ahead beside the expected one, by the lag that was left, s.
    learned_s: f64,
    learned_mono_ns: i64,
}

impl Anticipation {
    /// The goal that a plan is made for now.
    pub(super) fn aim(
        &mut self,
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
        let velocity = goal.tip_velocity_m_s;
        if velocity == [0.0; 3] {
            return goal.goal;
        }
        let age_s = seconds(now_mono_ns - goal.stamp_mono_ns).min(BELIEVED_S);
        let after = |time_s: f64| -> [f64; 3] {
            std::array::from_fn(|axis| position_m[axis] + time_s * velocity[axis])
        };
        let is_believed = age_s < BELIEVED_S;
        let ahead_s = match motion {
            _ if !is_believed => 0.0,
            RobotMotion::Following(followed) => {
                let now = followed.state_at(now_mono_ns);
                let tip_m = robot.tip(&now.position).map(|part| robot.in_metres(part));
                self.learn(lag_s(&after(age_s), &velocity, &tip_m.into()), now_mono_ns);
                AHEAD_S + SHARE_OF_STOP * stop_s(&now, robot) + self.learned_s
            }
            _ => CATCHES_UP_S,
        };
        Goal::Tip {
            position_m: after(age_s + ahead_s),
            tolerance_m,
        }
    }

    fn learn(&mut self, lag_s: f64, now_mono_ns: i64) {
        let since_s = seconds(now_mono_ns - self.learned_mono_ns).min(LEARNS_IN_S);
        self.learned_mono_ns = now_mono_ns;
        let learned_s = self.learned_s + lag_s * since_s / LEARNS_IN_S;
        self.learned_s = learned_s.clamp(-MOST_LEARNED_S, MOST_LEARNED_S);
    }
}

/// Time by which a tip is behind a target that moves with this velocity (m/s), s; 0 of a target that hardly moves.
fn lag_s(target_m: &[f64; 3], velocity_m_s: &[f64; 3], tip_m: &[f64; 3]) -> f64 {
    let squared: f64 = velocity_m_s.iter().map(|part| part * part).sum();
    let behind = (0..3).map(|axis| (target_m[axis] - tip_m[axis]) * velocity_m_s[axis]);
    if squared < SLOWEST_M_S * SLOWEST_M_S {
        return 0.0;
    }
    behind.sum::<f64>() / squared
}

/// Time in which the robot can come to rest from a state, s.
fn stop_s(from: &Knot, robot: &UnitRobot) -> f64 {
    let limits: &TendonLimits = &robot.tendon_limits;
    let stop = stopping_motion(from, &robot.tendons, limits);
    stop.map_or(0.0, |stop| stop.duration())
}
