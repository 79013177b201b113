//! The `plan` service: a request, and the answer's header (its payload is a slice of [`Knot`](super::Knot)).

use iceoryx2::prelude::ZeroCopySend;

use super::reason::ReasonText;
use super::wire::wire_message;
use crate::capacity::{DOF, MAX_BALLS, MAX_CANDIDATES, MAX_GOALS, STAGES};

/// [`PlanReport::selected`] when no candidate is.
pub const NONE_SELECTED: u32 = u32::MAX;

wire_message! {
    /// An obstacle at rest.
    pub struct Ball: "pcc.v7.Ball", 32 bytes {
        /// Centre in the base frame, metres.
        pub centre_m: [f64; 3],
        /// Radius, metres, not negative.
        pub radius_m: f64,
    }
}

wire_message! {
    /// A goal of a plan request.
    pub struct Goal: "pcc.v7.Goal", 88 bytes {
        /// [`crate::codes::GoalKind`], as wide as the numbers that follow.
        pub kind: u64,
        /// The tip to reach in the base frame, metres, if the goal is a tip.
        pub tip_m: [f64; 3],
        /// The configuration to reach, radians, if the goal is a configuration.
        pub configuration_rad: [f64; DOF],
        /// Distance from the goal tip that counts as reached, metres; 0: a hundredth of a section's length.
        pub tip_tolerance_m: f64,
    }
}

wire_message! {
    /// A plan request (service `plan`).
    pub struct PlanRequest: "pcc.v7.PlanRequest", 3008 bytes {
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// Candidates wanted, 1..=64; the daemon's own limit may be lower.
        pub candidate_count: u32,
        /// The sender's number for this request; returned in the answer.
        pub request_id: u64,
        /// Seed of all random draws: same request, same seed, same previous plan, same answer.
        pub seed: u64,
        /// Time the answer may take, nanoseconds from its reception; 0: the daemon's default.
        pub deadline_ns: u64,
        /// [`crate::codes::Sampler`].
        pub sampler: u32,
        /// [`crate::codes::Selection`].
        pub selection: u32,
        /// The candidate to select, if the selection is by index.
        pub selected_index: u32,
        /// [`crate::codes::Execute`]: what is published for execution. A candidate of an earlier plan is named by `previous_plan_id` and
        /// `previous_candidate`; nothing is planned then, goals, balls and early candidates are 0, and of the other fields only the
        /// version, the request's number, `robot_hash`, `requested_mono_ns` and `begin_mono_ns` are read.
        pub execute: u32,
        /// Goals in use, 1..=8; 0 where an earlier plan is executed.
        pub goal_count: u32,
        /// Balls in use, 0..=64; 0 where an earlier plan is executed.
        pub ball_count: u32,
        /// As soon as so many candidates are certified they are answered (outcome early), before the whole answer; 0: no
        /// early answer.
        pub early_candidate_count: u32,
        /// The candidate of the previous plan that is being followed, or is to be executed, if one is named below; [`NONE_SELECTED`]: the
        /// one that was selected.
        pub previous_candidate: u32,
        /// The plan to go on from, or whose candidate is to be executed: [`PlanReport::plan_id`] of one of the last
        /// [`crate::capacity::RECENT_PLANS`] whole answers with candidates, or of the goal's newest motion; 0: none.
        pub previous_plan_id: u64,
        /// [`crate::codes::StartKind`].
        pub start: u32,
        /// 1: the live scene's obstacles are left out of planning (what is executed is certified against them all the same); 0: they
        /// belong to the request.
        pub ignores_live_scene: u32,
        /// Configuration at the begin, radians; read only where the start is given, as are the next two.
        pub start_configuration_rad: [f64; DOF],
        /// Velocity at the begin, rad/s.
        pub start_velocity_rad_s: [f64; DOF],
        /// Acceleration at the begin, rad/s².
        pub start_acceleration_rad_s2: [f64; DOF],
        /// Share of the tendon limits to use, 1e-9 to 1.
        pub limits_scale: f64,
        /// When the motion is to begin at rest, or to leave the one that the robot follows, at the earliest, nanoseconds of
        /// `CLOCK_MONOTONIC`; 0: as soon as possible.
        pub begin_mono_ns: i64,
        /// When the request's sender was asked for it, nanoseconds of `CLOCK_MONOTONIC`; only a request to execute needs one. The motion is
        /// not executed where a stop or a reset was ordered, or the controller was started, after it.
        pub requested_mono_ns: i64,
        /// [`super::RobotDescription::robot_hash`] of the robot file that the sender is set up for: a daemon that plans for another robot
        /// refuses the request (outcome wrong robot); 0: it does not say.
        pub robot_hash: u64,
        /// The first `goal_count` are the goals, in their order: the motion passes them, and ends in the last one; the others are not read.
        pub goals: [Goal; MAX_GOALS],
        /// The first `ball_count` are obstacles; the others are not read.
        pub balls: [Ball; MAX_BALLS],
    }
}

wire_message! {
    /// One certified candidate of a plan.
    pub struct CandidateSummary: "pcc.v7.CandidateSummary", 56 bytes {
        /// Index in the answer's slice at which the candidate's knots begin.
        pub first_knot: u32,
        /// Number of the candidate's knots.
        pub knot_count: u32,
        /// [`crate::codes::Source`].
        pub source: u32,
        /// Index of the random draw that the candidate came from; the same for the same request and seed.
        pub draw: u32,
        /// Duration of the motion, seconds.
        pub duration_s: f64,
        /// Length of the tip's path, metres.
        pub tip_path_m: f64,
        /// Least distance of the body's surface to an obstacle, metres; infinite without obstacles.
        pub clearance_m: f64,
        /// Smoothness measure, less is smoother.
        pub smoothness: f64,
        /// Distance of the final tip to the goal tip, metres.
        pub tip_error_m: f64,
    }
}

wire_message! {
    /// The answer's user header: what happened, how long it took, and where each candidate's knots are.
    pub struct PlanReport: "pcc.v7.PlanReport", 3896 bytes {
        /// [`crate::PROTOCOL_VERSION`] of the daemon.
        pub protocol_version: u32,
        /// [`crate::codes::Outcome`].
        pub outcome: u32,
        /// The request's number, as its sender gave it.
        pub request_id: u64,
        /// The daemon's number of this plan.
        pub plan_id: u64,
        /// [`super::RobotDescription::robot_hash`] of the robot that is planned for.
        pub robot_hash: u64,
        /// [`super::RobotDescription::weights_hash`] of the daemon, whichever sampler was asked for.
        pub weights_hash: u64,
        /// Hash of all candidates' knots: equal plans have equal hashes.
        pub plan_hash: u64,
        /// Candidates in the answer, 0..=64.
        pub candidate_count: u32,
        /// Index of the selected candidate, or [`NONE_SELECTED`].
        pub selected: u32,
        /// Id under which the selected candidate was published for execution; 0: it was not.
        pub trajectory_id: u32,
        /// [`crate::codes::PlanField`] that was wrong, if the outcome is an invalid request.
        pub invalid_field: u32,
        /// Draws of the learned sampler.
        pub learned_drawn: u32,
        /// Draws of the learned sampler that became certified motions.
        pub learned_certified: u32,
        /// Candidates that are not the learned sampler's.
        pub classical_certified: u32,
        /// [`crate::codes::MotionStart`]: how the candidates begin.
        pub start: u32,
        /// Time of each [`crate::codes::Stage`], nanoseconds.
        pub stages_ns: [u64; STAGES],
        /// Why the outcome is what it is.
        pub reason: ReasonText,
        /// The first `candidate_count` are candidates; the others are not read.
        pub candidates: [CandidateSummary; MAX_CANDIDATES],
    }
}
