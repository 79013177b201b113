//! The wire form of a plan request.

use std::time::Duration;

use super::invalid::Invalid;
use super::plan::{Goal, PlanRequest, SelectionRule};
use crate::PROTOCOL_VERSION;
use crate::clock::mono_now_ns;
use crate::codes::{GoalKind, Selection};
use crate::message::{self, NONE_SELECTED};

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
            execute: u32::from(request.execute),
            ball_count: wire_count(request.balls.len()),
            start_configuration_rad: request.start_configuration_rad,
            start_velocity_rad_s: request.start_velocity_rad_s,
            start_acceleration_rad_s2: request.start_acceleration_rad_s2,
            early_candidate_count: request.early_candidate_count.map_or(0, wire_count),
            limits_scale: request.limits_scale,
            begin_mono_ns: request.begin_mono_ns.unwrap_or(0),
            requested_mono_ns: requested_mono_ns(request),
            ..Self::ZEROED
        };
        match request.selection {
            SelectionRule::Best(selection) => wire.selection = selection.code(),
            SelectionRule::Index(index) => {
                wire.selection = Selection::ByIndex.code();
                wire.selected_index = wire_count(index);
            }
        }
        match request.goal {
            Goal::Tip {
                position_m,
                tolerance_m,
            } => {
                wire.goal_tip_m = position_m;
                wire.tip_tolerance_m = tolerance_m.unwrap_or(0.0);
            }
            Goal::Configuration(configuration_rad) => {
                wire.goal_kind = GoalKind::Configuration.code();
                wire.goal_configuration_rad = configuration_rad;
            }
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
