//! The validated plan request, and its wire form.

use std::time::Duration;

use super::check::{
    Quantity, check_array, check_code, check_count, check_flag, check_limits_scale,
    check_optional_stamp, check_radius, check_stamp, check_version, check_within, named_robot,
};
use super::goal::{Goal, goals};
use super::invalid::{Invalid, Reason, invalid, invalid_at};
use crate::PROTOCOL_VERSION;
use crate::capacity::{DOF, MAX_BALLS, MAX_CANDIDATES};
use crate::clock::mono_now_ns;
use crate::codes::{Execute, Sampler, Selection, StartKind};
use crate::message::{self, Ball, NONE_SELECTED};

/// The longest deadline, nanoseconds.
const MAX_DEADLINE_NS: u64 = 60_000_000_000;

/// Which candidate is selected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelectionRule {
    /// The best candidate by a measure; never [`Selection::ByIndex`] in a validated request.
    Best(Selection),
    /// The candidate with this index.
    Index(usize),
}

/// An earlier plan, and one of its candidates: the one that is being followed, or is to be executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviousPlan {
    /// [`message::PlanReport::plan_id`] of the plan's answer.
    pub plan_id: u64,
    /// Index of the candidate; none: the one that was selected.
    pub candidate: Option<usize>,
}

/// A plan request without contradictions; lengths metres, angles radians.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanRequest {
    /// The sender's number of the request.
    pub request_id: u64,
    /// Seed of all random draws.
    pub seed: u64,
    /// Candidates wanted, 1..=64.
    pub candidate_count: usize,
    /// Time the answer may take; none: the daemon's default.
    pub deadline: Option<Duration>,
    /// The sampler that proposes paths.
    pub sampler: Sampler,
    /// Which candidate is selected.
    pub selection: SelectionRule,
    /// Whether the selected candidate is to be published for execution.
    pub execute: bool,
    /// Where the motion begins.
    pub start: StartKind,
    /// Whether the live scene's obstacles are left out of planning.
    pub ignores_live_scene: bool,
    /// Configuration at the begin, radians; where the start is not given it does not matter, nor do velocity and acceleration.
    pub start_configuration_rad: [f64; DOF],
    /// Velocity at the begin, rad/s; a plan from a given start in motion is not executed.
    pub start_velocity_rad_s: [f64; DOF],
    /// Acceleration at the begin, rad/s².
    pub start_acceleration_rad_s2: [f64; DOF],
    /// Goals that the motion passes on its way, in their order, at most 7: the tip within its tolerance, configurations within 1e-3 rad,
    /// without rest where that is certified.
    pub via: Vec<Goal>,
    /// The goal in which the motion ends.
    pub goal: Goal,
    /// Share of the tendon limits, [`LEAST_LIMITS_SCALE`](super::LEAST_LIMITS_SCALE) to 1.
    pub limits_scale: f64,
    /// When the motion begins at rest, or leaves the one that the robot follows, at the earliest, nanoseconds of `CLOCK_MONOTONIC`; none:
    /// as soon as possible.
    pub begin_mono_ns: Option<i64>,
    /// When it was asked for, nanoseconds of `CLOCK_MONOTONIC`: what is asked for before a stop is not executed; none: when it is
    /// written for the wire, if it is to be executed.
    pub requested_mono_ns: Option<i64>,
    /// [`message::RobotDescription::robot_hash`] of the robot file that the sender is set up for: a daemon that plans for another robot refuses
    /// the request; none: it does not say.
    pub robot_hash: Option<u64>,
    /// Obstacles, at most 64.
    pub balls: Vec<Ball>,
    /// Certified candidates that are answered before the whole answer, at most `candidate_count`; none: no early answer.
    pub early_candidate_count: Option<usize>,
    /// The plan to go on from, for the samplers [`Sampler::Default`] and [`Sampler::Fast`].
    pub previous: Option<PreviousPlan>,
}

impl PlanRequest {
    /// A request for one candidate from where the robot is to a goal, with the daemon's defaults, no balls, not executed.
    #[must_use]
    pub fn from_robot(goal: Goal) -> Self {
        Self {
            start: StartKind::Robot,
            ..Self::new([0.0; DOF], goal)
        }
    }

    /// A request for one candidate from a configuration to a goal, with the daemon's defaults, no balls, not executed.
    #[must_use]
    pub fn new(start_configuration_rad: [f64; DOF], goal: Goal) -> Self {
        Self {
            request_id: 0,
            seed: 0,
            candidate_count: 1,
            deadline: None,
            sampler: Sampler::Default,
            selection: SelectionRule::Best(Selection::ShortestTime),
            execute: false,
            start: StartKind::Given,
            ignores_live_scene: false,
            start_configuration_rad,
            start_velocity_rad_s: [0.0; DOF],
            start_acceleration_rad_s2: [0.0; DOF],
            via: Vec::new(),
            goal,
            limits_scale: 1.0,
            begin_mono_ns: None,
            requested_mono_ns: None,
            robot_hash: None,
            balls: Vec::new(),
            early_candidate_count: None,
            previous: None,
        }
    }

    /// Whether the request states a start in motion.
    #[must_use]
    pub fn starts_in_motion(&self) -> bool {
        let rates = [self.start_velocity_rad_s, self.start_acceleration_rad_s2];
        let rests = rates.as_flattened().iter().all(|&rate| rate == 0.0);
        self.start == StartKind::Given && !rests
    }
}

impl TryFrom<&message::PlanRequest> for PlanRequest {
    type Error = Invalid;

    fn try_from(wire: &message::PlanRequest) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let execute = execute(wire)?;
        let candidate_count =
            check_count("candidate_count", wire.candidate_count, 1, MAX_CANDIDATES)?;
        let sampler = check_code("sampler", wire.sampler)?;
        let (via, goal) = goals(wire)?;
        let request = Self {
            request_id: wire.request_id,
            seed: wire.seed,
            candidate_count,
            deadline: deadline(wire.deadline_ns)?,
            sampler,
            selection: selection(wire, candidate_count)?,
            execute,
            start: check_code("start", wire.start)?,
            ignores_live_scene: check_flag("ignores_live_scene", wire.ignores_live_scene)?,
            start_configuration_rad: wire.start_configuration_rad,
            start_velocity_rad_s: wire.start_velocity_rad_s,
            start_acceleration_rad_s2: wire.start_acceleration_rad_s2,
            via,
            goal,
            limits_scale: check_limits_scale(wire.limits_scale)?,
            begin_mono_ns: check_optional_stamp("begin_mono_ns", wire.begin_mono_ns)?,
            requested_mono_ns: check_optional_stamp("requested_mono_ns", wire.requested_mono_ns)?,
            robot_hash: named_robot(wire.robot_hash),
            balls: balls(wire)?,
            early_candidate_count: early(wire.early_candidate_count, candidate_count)?,
            previous: previous(wire, sampler)?,
        };
        check_start(&request)?;
        if execute {
            check_requested(wire)?;
        }
        check_previous(&request)?;
        Ok(request)
    }
}

/// Whether the selected candidate is executed.
fn execute(wire: &message::PlanRequest) -> Result<bool, Invalid> {
    match check_code("execute", wire.execute)? {
        Execute::Nothing => Ok(false),
        Execute::Selected => Ok(true),
        Execute::Named => {
            let what = "executing an earlier plan by a request that plans";
            Err(invalid("execute", Reason::NotServed { what }))
        }
    }
}

/// When something that is to be executed was asked for.
pub(super) fn check_requested(wire: &message::PlanRequest) -> Result<i64, Invalid> {
    let reason = Reason::OutOfRange {
        value: 0.0,
        allowed: "the time of CLOCK_MONOTONIC at which the motion was asked for",
    };
    match check_stamp("requested_mono_ns", wire.requested_mono_ns)? {
        0 => Err(invalid("requested_mono_ns", reason)),
        requested_mono_ns => Ok(requested_mono_ns),
    }
}

fn check_previous(request: &PlanRequest) -> Result<(), Invalid> {
    let is_route = !request.via.is_empty() || request.start == StartKind::AfterGoals;
    if is_route && request.previous.is_some() {
        let what = "going on from a previous plan with several goals";
        return Err(invalid("previous_plan_id", Reason::NotServed { what }));
    }
    Ok(())
}

fn deadline(deadline_ns: u64) -> Result<Option<Duration>, Invalid> {
    check_within(deadline_ns, 0, MAX_DEADLINE_NS)
        .map_err(|reason| invalid("deadline_ns", reason))?;
    Ok((deadline_ns != 0).then(|| Duration::from_nanos(deadline_ns)))
}

fn selection(
    wire: &message::PlanRequest,
    candidate_count: usize,
) -> Result<SelectionRule, Invalid> {
    match check_code("selection", wire.selection)? {
        Selection::ByIndex => {
            let index = check_count(
                "selected_index",
                wire.selected_index,
                0,
                candidate_count - 1,
            )?;
            Ok(SelectionRule::Index(index))
        }
        selection => Ok(SelectionRule::Best(selection)),
    }
}

fn check_start(request: &PlanRequest) -> Result<(), Invalid> {
    if request.start != StartKind::Given {
        return Ok(());
    }
    let start = &request.start_configuration_rad;
    check_array("start_configuration_rad", start, Quantity::Angle)?;
    for (field, rates) in [
        ("start_velocity_rad_s", &request.start_velocity_rad_s),
        (
            "start_acceleration_rad_s2",
            &request.start_acceleration_rad_s2,
        ),
    ] {
        check_array(field, rates, Quantity::Rate)?;
        let moving = rates.iter().position(|&rate| rate != 0.0);
        if let Some(index) = moving.filter(|_| request.execute) {
            let what = "executing a plan that begins in motion";
            return Err(invalid_at(field, index, Reason::NotServed { what }));
        }
    }
    Ok(())
}

fn early(count: u32, candidates: usize) -> Result<Option<usize>, Invalid> {
    let count = check_count("early_candidate_count", count, 0, candidates)?;
    Ok((count > 0).then_some(count))
}

fn previous(
    wire: &message::PlanRequest,
    sampler: Sampler,
) -> Result<Option<PreviousPlan>, Invalid> {
    let goes_on = matches!(sampler, Sampler::Default | Sampler::Fast);
    if !goes_on && wire.previous_plan_id != 0 {
        let what = "going on from a previous plan with a sampler other than default and fast";
        return Err(invalid("previous_plan_id", Reason::NotServed { what }));
    }
    named_plan(wire)
}

/// The earlier plan that a request names, if it does.
pub(super) fn named_plan(wire: &message::PlanRequest) -> Result<Option<PreviousPlan>, Invalid> {
    if wire.previous_plan_id == 0 {
        return Ok(None);
    }
    let named = (wire.previous_candidate != NONE_SELECTED).then_some(wire.previous_candidate);
    let most = MAX_CANDIDATES - 1;
    let check = |index| check_count("previous_candidate", index, 0, most);
    Ok(Some(PreviousPlan {
        plan_id: wire.previous_plan_id,
        candidate: named.map(check).transpose()?,
    }))
}

fn balls(wire: &message::PlanRequest) -> Result<Vec<Ball>, Invalid> {
    let count = check_count("ball_count", wire.ball_count, 0, MAX_BALLS)?;
    let balls = wire.balls[..count].to_vec();
    for (index, ball) in balls.iter().enumerate() {
        Quantity::Length
            .check_all(&ball.centre_m)
            .and(check_radius(ball.radius_m))
            .map_err(|reason| invalid_at("balls", index, reason))?;
    }
    Ok(balls)
}

impl TryFrom<&PlanRequest> for message::PlanRequest {
    type Error = Invalid;

    /// Writes the wire form; fails where that would not be accepted.
    fn try_from(request: &PlanRequest) -> Result<Self, Invalid> {
        let mut wire = Self {
            protocol_version: PROTOCOL_VERSION,
            candidate_count: wire_count(request.candidate_count),
            request_id: request.request_id,
            seed: request.seed,
            deadline_ns: request.deadline.map_or(0, wire_deadline_ns),
            sampler: request.sampler.code(),
            execute: match request.execute {
                true => Execute::Selected.code(),
                false => Execute::Nothing.code(),
            },
            start: request.start.code(),
            ignores_live_scene: u32::from(request.ignores_live_scene),
            goal_count: wire_count(request.via.len() + 1),
            ball_count: wire_count(request.balls.len()),
            start_configuration_rad: request.start_configuration_rad,
            start_velocity_rad_s: request.start_velocity_rad_s,
            start_acceleration_rad_s2: request.start_acceleration_rad_s2,
            early_candidate_count: request.early_candidate_count.map_or(0, wire_count),
            limits_scale: request.limits_scale,
            begin_mono_ns: request.begin_mono_ns.unwrap_or(0),
            requested_mono_ns: requested_mono_ns(request),
            robot_hash: request.robot_hash.unwrap_or(0),
            ..Self::ZEROED
        };
        match request.selection {
            SelectionRule::Best(selection) => wire.selection = selection.code(),
            SelectionRule::Index(index) => {
                wire.selection = Selection::ByIndex.code();
                wire.selected_index = wire_count(index);
            }
        }
        let goals = request.via.iter().chain([&request.goal]);
        for (slot, goal) in wire.goals.iter_mut().zip(goals) {
            *slot = goal.into();
        }
        if let Some(previous) = request.previous {
            wire.previous_plan_id = previous.plan_id;
            wire.previous_candidate = previous.candidate.map_or(NONE_SELECTED, wire_count);
        }
        for (slot, ball) in wire.balls.iter_mut().zip(&request.balls) {
            *slot = *ball;
        }
        PlanRequest::try_from(&wire)?;
        Ok(wire)
    }
}

/// Only what is executed needs it: a request that is only planned is the same whenever it is sent.
fn requested_mono_ns(request: &PlanRequest) -> i64 {
    let now = || if request.execute { mono_now_ns() } else { 0 };
    request.requested_mono_ns.unwrap_or_else(now)
}

/// A count that does not fit is too large for every field.
fn wire_count(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// No deadline at all is 0 on the wire, so the shortest one is 1 ns.
fn wire_deadline_ns(deadline: Duration) -> u64 {
    u64::try_from(deadline.as_nanos())
        .unwrap_or(u64::MAX)
        .max(1)
}

#[cfg(test)]
mod tests;
