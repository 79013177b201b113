//! Where a target is aimed at that moves.

use pcc_model::{Point, TendonLimits, UnitRobot};
use shared_types::clock::seconds;
use shared_types::valid::{Goal, StandingGoal};
use trajectory::{Knot, stopping_motion};

use super::target_motion::TargetMotion;
use crate::execution::RobotMotion;

/// Longest time after its stamp for which a target's velocity is believed, s.
const BELIEVED_S: f64 = 0.5;

/// Time ahead of a target at which a robot is expected to lag no more, beside a share of the time in which it can stop, s.
const AHEAD_S: f64 = 0.1;
/// That share: a robot comes to rest half-way through what it would have gone on.
const SHARE_OF_STOP: f64 = 0.5;
/// Share of its lag by which is aimed further ahead, and the largest lag that counts, s.
const SHARE_OF_LAG: f64 = 0.5;
const MOST_LAG_S: f64 = 0.2;
/// Most that is aimed beside the target's way because the tip is on its other side, m.
const MOST_BESIDE_M: f64 = 0.05;
/// Time in which the lag that is left is learned, s.
const LEARNS_IN_S: f64 = 0.8;
/// Longest time between two looks at the lag for the later one to stand for it, s.
const LONGEST_BETWEEN_LOOKS_S: f64 = 0.2;
/// Largest time that is learned, s.
const MOST_LEARNED_S: f64 = 0.5;
/// Time until a robot at rest has caught up with its target, s.
const CATCHES_UP_S: f64 = 0.3;
/// Slowest target whose lag is measured, m/s.
const SLOWEST_M_S: f64 = 0.01;

/// How far ahead of a moving target is aimed, so that the tip does not lag behind it: a robot comes to rest where it is sent to, and
/// the target does not.
#[derive(Clone, Debug, Default)]
pub(super) struct Anticipation {
    target: TargetMotion,
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
        let (position, velocity) = (position_m.into(), goal.tip_velocity_m_s.into());
        self.target.see(goal.stamp_mono_ns, position, velocity);
        if velocity == Point::zeros() {
            return goal.goal;
        }
        let age_s = seconds(now_mono_ns - goal.stamp_mono_ns).min(BELIEVED_S);
        let seen = position + self.target.way_after(age_s);
        let is_believed = age_s < BELIEVED_S;
        let (ahead_s, beside) = match motion {
            _ if !is_believed => (0.0, Point::zeros()),
            RobotMotion::Following(followed) => {
                let now = followed.state_at(now_mono_ns);
                let tip = robot.tip(&now.position).map(|part| robot.in_metres(part));
                let off = Off::of(&(seen - tip), &velocity);
                self.learn(off.lag_s, now_mono_ns);
                let lag_s = off.lag_s.clamp(-MOST_LAG_S, MOST_LAG_S);
                let stop_s = SHARE_OF_STOP * stop_s(&now, robot);
                let ahead_s = AHEAD_S + stop_s + self.learned_s + SHARE_OF_LAG * lag_s;
                (ahead_s, off.beside)
            }
            _ => (CATCHES_UP_S, Point::zeros()),
        };
        let aimed = position + self.target.way_after(age_s + ahead_s) + beside;
        Goal::Tip {
            position_m: aimed.into(),
            tolerance_m,
        }
    }

    fn learn(&mut self, lag_s: f64, now_mono_ns: i64) {
        let since_s = seconds(now_mono_ns - self.learned_mono_ns);
        self.learned_mono_ns = now_mono_ns;
        if since_s > LONGEST_BETWEEN_LOOKS_S {
            return;
        }
        let learned_s = self.learned_s + lag_s * since_s / LEARNS_IN_S;
        self.learned_s = learned_s.clamp(-MOST_LEARNED_S, MOST_LEARNED_S);
    }
}

/// Where a tip is that follows a target.
struct Off {
    /// Time by which it is behind along the target's way, s; 0 of a target that hardly moves.
    lag_s: f64,
    /// From the tip across the target's way to the target, at most [`MOST_BESIDE_M`] of it; 0 of a target that hardly moves.
    beside: Point,
}

impl Off {
    /// Of a tip from which it is so far to the target, m, which moves with this velocity, m/s.
    fn of(to_target: &Point, velocity: &Point) -> Self {
        if velocity.norm() < SLOWEST_M_S {
            let (lag_s, beside) = (0.0, Point::zeros());
            return Self { lag_s, beside };
        }
        let lag_s = to_target.dot(velocity) / velocity.norm_squared();
        Self {
            lag_s,
            beside: (to_target - lag_s * velocity).cap_magnitude(MOST_BESIDE_M),
        }
    }
}

/// Time in which the robot can come to rest from a state, s.
fn stop_s(from: &Knot, robot: &UnitRobot) -> f64 {
    let limits: &TendonLimits = &robot.tendon_limits;
    let stop = stopping_motion(from, &robot.tendons, limits);
    stop.map_or(0.0, |stop| stop.duration())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use pcc_model::Configuration;

    use super::*;
    use crate::execution::FollowedMotion;
    use crate::fixtures::{motion, unit_robot};

    const MS: i64 = 1_000_000;
    const STAMP: i64 = 5_000 * MS;
    const VELOCITY: [f64; 3] = [0.2, 0.0, 0.0];
    /// Most by which a lag brings what is aimed at nearer or further, s.
    const LAG_COUNTS_S: f64 = SHARE_OF_LAG * MOST_LAG_S;

    fn target(velocity: [f64; 3]) -> StandingGoal {
        StandingGoal {
            given_mono_ns: STAMP,
            stamp_mono_ns: STAMP,
            goal: Goal::Tip {
                position_m: [1.0, 0.5, 2.0],
                tolerance_m: Some(0.02),
            },
            tip_velocity_m_s: velocity,
            limits_scale: 1.0,
            is_withdrawn: false,
        }
    }

    /// Time ahead of its stamp at which a target that moves along x is aimed, s, and how far beside its way, m.
    fn ahead_and_beside(aimed: Goal) -> (f64, f64) {
        let Goal::Tip {
            position_m,
            tolerance_m,
        } = aimed
        else {
            panic!("a tip");
        };
        assert_eq!(tolerance_m, Some(0.02));
        let beside_m = (position_m[1] - 0.5).hypot(position_m[2] - 2.0);
        ((position_m[0] - 1.0) / VELOCITY[0], beside_m)
    }

    fn following(time_s: f64) -> RobotMotion {
        RobotMotion::Following(FollowedMotion {
            is_blocked: false,
            trajectory_id: 7,
            motion: Arc::new(motion()),
            goals: Arc::default(),
            time_s,
            rate: 1.0,
            fastest_rate: 1.0,
            state_mono_ns: i64::MAX,
        })
    }

    fn aim(anticipation: &mut Anticipation, motion: &RobotMotion, after_ms: i64) -> f64 {
        let now = STAMP + after_ms * MS;
        let aimed = anticipation.aim(&target(VELOCITY), &unit_robot(), motion, now);
        let (ahead_s, beside_m) = ahead_and_beside(aimed);
        let is_aimed_beside = matches!(motion, RobotMotion::Following(_)) && after_ms < 500;
        let most_m = if is_aimed_beside {
            MOST_BESIDE_M + 1e-9
        } else {
            0.0
        };
        assert!(beside_m <= most_m, "{beside_m} m");
        ahead_s
    }

    #[test]
    fn what_rests_is_aimed_at_where_it_is() {
        let rests = target([0.0; 3]);
        let configuration = StandingGoal {
            goal: Goal::Configuration([0.1; 6]),
            ..target(VELOCITY)
        };
        for goal in [rests, configuration] {
            let mut anticipation = Anticipation::default();
            let aimed = anticipation.aim(&goal, &unit_robot(), &following(0.3), STAMP + 100 * MS);
            assert_eq!(aimed, goal.goal);
        }
    }

    #[test]
    fn a_moving_target_is_aimed_ahead_further_the_faster_the_robot_goes() {
        let mut anticipation = Anticipation::default();
        let holding = RobotMotion::Holding(Configuration::zeros());
        let at_rest = aim(&mut anticipation, &holding, 100);
        assert!((at_rest - 0.1 - CATCHES_UP_S).abs() < 1e-9, "{at_rest}");
        let [slow, fast] =
            [0.0, 0.5].map(|time_s| aim(&mut Anticipation::default(), &following(time_s), 100));
        assert!(slow >= 0.1 + AHEAD_S - LAG_COUNTS_S - 1e-9, "{slow}");
        assert!(fast > slow + 0.05, "{fast} against {slow}");
    }

    #[test]
    fn a_velocity_is_believed_for_half_a_second() {
        let mut anticipation = Anticipation::default();
        assert!(aim(&mut anticipation, &following(0.3), 499) > 0.499 + AHEAD_S - LAG_COUNTS_S);
        for late_ms in [500, 501, 60_000] {
            let ahead = aim(&mut anticipation, &following(0.3), late_ms);
            assert!((ahead - BELIEVED_S).abs() < 1e-9, "{ahead}");
        }
    }

    #[test]
    fn lag_is_learned_little_by_little_up_to_half_a_second_and_unlearned() {
        let mut anticipation = Anticipation::default();
        anticipation.learn(10.0, STAMP);
        assert_eq!(anticipation.learned_s, 0.0, "the first look is no lag");
        anticipation.learn(0.1, STAMP + 80 * MS);
        assert!((anticipation.learned_s - 0.01).abs() < 1e-9);
        anticipation.learn(10.0, STAMP + 1_000 * MS);
        assert!((anticipation.learned_s - 0.01).abs() < 1e-9, "a gap");
        for look in 0..100 {
            anticipation.learn(10.0, STAMP + (1_000 + 10 * look) * MS);
        }
        assert_eq!(anticipation.learned_s, MOST_LEARNED_S);
        for look in 0..400 {
            anticipation.learn(-10.0, STAMP + (2_000 + 10 * look) * MS);
        }
        assert_eq!(anticipation.learned_s, -MOST_LEARNED_S);
    }

    #[test]
    fn lag_is_the_time_behind_along_the_targets_way_and_the_rest_is_beside_it() {
        let off = |to_target: [f64; 3]| Off::of(&to_target.into(), &VELOCITY.into());
        assert!((off([0.1, 0.0, 0.0]).lag_s - 0.5).abs() < 1e-9);
        assert!((off([-0.1, 0.0, 0.0]).lag_s + 0.5).abs() < 1e-9);
        let beside = off([0.1, -0.7, 0.0]);
        assert!((beside.lag_s - 0.5).abs() < 1e-9);
        assert!((beside.beside - Point::new(0.0, -MOST_BESIDE_M, 0.0)).norm() < 1e-9);
        let hardly = Point::new(0.5 * SLOWEST_M_S, 0.0, 0.0);
        let off = Off::of(&Point::new(1.0, 0.0, 0.0), &hardly);
        assert_eq!((off.lag_s, off.beside), (0.0, Point::zeros()));
    }
}
