//! Where a target is aimed at that moves.

use pcc_model::{Point, UnitRobot};
use shared_types::clock::seconds;
use shared_types::valid::{Goal, StandingGoal};

use super::target_motion::TargetMotion;
use crate::execution::RobotMotion;

/// Longest time after its stamp for which a target's velocity is believed, s.
const BELIEVED_S: f64 = 0.5;

/// Time ahead of a target at which a robot is aimed that follows it: half of the time within which the end of its motion is mostly moved, s.
const AHEAD_S: f64 = 0.2;
/// Share of its lag by which is aimed further ahead, and the largest lag that counts, s.
const SHARE_OF_LAG: f64 = 0.3;
const MOST_LAG_S: f64 = 0.2;
/// Time until a robot at rest has caught up with its target, s.
const CATCHES_UP_S: f64 = 0.3;
/// Slowest target whose lag is measured, m/s.
const SLOWEST_M_S: f64 = 0.01;

/// How far ahead of a moving target is aimed, so that the tip does not lag behind it: a robot comes to rest where it is sent to, and
/// the target does not.
#[derive(Clone, Debug, Default)]
pub(super) struct Anticipation {
    target: TargetMotion,
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
        let ahead_s = match motion {
            _ if !is_believed => 0.0,
            RobotMotion::Following(followed) => {
                let now = followed.state_at(now_mono_ns);
                let tip = robot.tip(&now.position).map(|part| robot.in_metres(part));
                let lag_s = lag_s(&(seen - tip), &velocity);
                AHEAD_S + SHARE_OF_LAG * lag_s.clamp(-MOST_LAG_S, MOST_LAG_S)
            }
            _ => CATCHES_UP_S,
        };
        let aimed = position + self.target.way_after(age_s + ahead_s);
        Goal::Tip {
            position_m: aimed.into(),
            tolerance_m,
        }
    }
}

/// Time by which a tip is behind along the way of a target that moves with this velocity, m/s, and is so far from it, m; 0 of a target that
/// hardly moves, s.
fn lag_s(to_target: &Point, velocity: &Point) -> f64 {
    if velocity.norm() < SLOWEST_M_S {
        return 0.0;
    }
    to_target.dot(velocity) / velocity.norm_squared()
}

#[cfg(test)]
mod tests {
    use pcc_model::Configuration;

    use super::*;
    use crate::execution::FollowedMotion;
    use crate::fixtures::{followed, motion, unit_robot};
    use crate::live_scene::Progress;

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
            robot_hash: None,
            is_withdrawn: false,
        }
    }

    /// Time ahead of its stamp at which a target is aimed at that moves along x, s.
    fn ahead_s(aimed: Goal) -> f64 {
        let Goal::Tip {
            position_m,
            tolerance_m,
        } = aimed
        else {
            panic!("a tip");
        };
        assert_eq!(tolerance_m, Some(0.02));
        assert_eq!(position_m[1..], [0.5, 2.0]);
        (position_m[0] - 1.0) / VELOCITY[0]
    }

    fn following(time_s: f64) -> RobotMotion {
        RobotMotion::Following(FollowedMotion {
            progress: Progress {
                time_s,
                ..Progress::from_begin(i64::MAX)
            },
            ..followed()
        })
    }

    fn aim(anticipation: &mut Anticipation, motion: &RobotMotion, after_ms: i64) -> f64 {
        let now = STAMP + after_ms * MS;
        ahead_s(anticipation.aim(&target(VELOCITY), &unit_robot(), motion, now))
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
    fn a_moving_target_is_aimed_ahead_by_a_time_and_a_share_of_the_lag() {
        let mut anticipation = Anticipation::default();
        let holding = RobotMotion::Holding(Configuration::zeros());
        let at_rest = aim(&mut anticipation, &holding, 100);
        assert!((at_rest - 0.1 - CATCHES_UP_S).abs() < 1e-9, "{at_rest}");
        let tip = unit_robot().tip(&motion().at(0.3).position);
        let lag_s = (1.0 + 0.1 * VELOCITY[0] - tip.x) / VELOCITY[0];
        let counts_s = lag_s.clamp(-MOST_LAG_S, MOST_LAG_S);
        let ahead = aim(&mut anticipation, &following(0.3), 100);
        let expected = 0.1 + AHEAD_S + SHARE_OF_LAG * counts_s;
        assert!((ahead - expected).abs() < 1e-9, "{ahead} {expected}");
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
    fn lag_is_the_time_behind_along_the_targets_way() {
        let lag = |to_target: [f64; 3]| lag_s(&to_target.into(), &VELOCITY.into());
        assert!((lag([0.1, 0.0, 0.0]) - 0.5).abs() < 1e-9);
        assert!((lag([-0.1, -0.7, 0.3]) + 0.5).abs() < 1e-9);
        let hardly = Point::new(0.5 * SLOWEST_M_S, 0.0, 0.0);
        assert_eq!(lag_s(&Point::new(1.0, 0.0, 0.0), &hardly), 0.0);
    }
}
