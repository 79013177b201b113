//! The goal that stays: the daemon keeps the robot on its way to it, and says how that goes.

use iceoryx2::prelude::ZeroCopySend;

use super::plan::Goal;
use super::reason::ReasonText;
use super::wire::wire_message;

wire_message! {
    /// A goal that the daemon keeps the robot on its way to (service `goal`; the newest one counts, whoever sent it). Where it moves it is sent
    /// again with another stamp; a stop or a reset after it was given ends it, however often it is sent again.
    pub struct StandingGoal: "pcc.v7.StandingGoal", 152 bytes {
        /// When the goal was first given, nanoseconds of `CLOCK_MONOTONIC`: it is known by this, and no motion to it begins after a stop or
        /// a reset that was ordered later.
        pub given_mono_ns: i64,
        /// When it was where it is told to be, nanoseconds of `CLOCK_MONOTONIC`; not before `given_mono_ns` and not in the future.
        pub stamp_mono_ns: i64,
        /// The goal.
        pub goal: Goal,
        /// Velocity of a tip goal, base frame, m/s; believed for half a second from the stamp on. Not read where the goal is a configuration.
        pub tip_velocity_m_s: [f64; 3],
        /// Share of the tendon limits to use, 1e-9 to 1.
        pub limits_scale: f64,
        /// [`super::RobotDescription::robot_hash`] of the robot file that the sender is set up for: a daemon that plans for another robot
        /// refuses the goal; 0: it does not say.
        pub robot_hash: u64,
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// 1: the goal is given up, and the robot brakes along its path; 0: it is not.
        pub is_withdrawn: u32,
    }
}

wire_message! {
    /// What becomes of the goal that stays (service `goal_status`, publisher: the daemon): at each change, and every 100 ms while there
    /// is a goal.
    pub struct GoalStatus: "pcc.v7.GoalStatus", 224 bytes {
        /// When this was so, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// [`StandingGoal::given_mono_ns`]; 0: there was none yet.
        pub given_mono_ns: i64,
        /// [`StandingGoal::stamp_mono_ns`] of the last one that was heard, or of the one that is refused.
        pub goal_stamp_mono_ns: i64,
        /// Plans made for it.
        pub plan_count: u64,
        /// Motions of these that were published for execution.
        pub motion_count: u64,
        /// The motion to it that was published last; 0: none.
        pub trajectory_id: u32,
        /// [`crate::codes::GoalState`].
        pub state: u32,
        /// [`crate::codes::Outcome`] of the last plan made for it.
        pub outcome: u32,
        /// [`crate::PROTOCOL_VERSION`] of the daemon.
        pub protocol_version: u32,
        /// Why it is as it is; empty where there is nothing to explain.
        pub reason: ReasonText,
    }
}
