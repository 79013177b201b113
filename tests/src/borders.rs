//! Everything malformed that the processes must refuse by name: requests, and what they are started with.

use std::time::Duration;

use shared_types::clock::{mono_now_ns, wall_now_ns};
use shared_types::codes::{Execute, Outcome, PlanField, Sampler};
use shared_types::message::{Ball, PlanRequest};

use crate::raw::{RawClient, RawError, good_request};

const PATIENCE: Duration = Duration::from_secs(60);

/// A request that must not be planned, and what is to be said of it.
pub struct BadRequest {
    /// What is wrong.
    pub name: &'static str,
    /// Makes a good request bad.
    pub change: fn(&mut PlanRequest),
    /// The outcome.
    pub outcome: Outcome,
    /// The field named; none where the request is well formed.
    pub field: PlanField,
}

macro_rules! invalid {
    ($($field:ident $name:literal $change:expr;)*) => {
        &[$(BadRequest { name: $name, change: $change, outcome: Outcome::InvalidRequest, field: PlanField::$field },)*]
    };
}

/// Makes a request one to execute a candidate of a plan that no daemon has made.
fn execute_earlier(request: &mut PlanRequest) {
    *request = PlanRequest {
        protocol_version: request.protocol_version,
        request_id: request.request_id,
        execute: Execute::Named.code(),
        previous_plan_id: 1,
        requested_mono_ns: mono_now_ns(),
        ..PlanRequest::ZEROED
    };
}

/// Each rejection at the border.
const INVALID: &[BadRequest] = invalid! {
    CandidateCount "no candidates" |r| r.candidate_count = 0;
    CandidateCount "65 candidates" |r| r.candidate_count = 65;
    CandidateCount "more candidates than configured" |r| r.candidate_count = 17;
    CandidateCount "all bits" |r| r.candidate_count = u32::MAX;
    Deadline "deadline in years" |r| r.deadline_ns = u64::MAX;
    Sampler "unknown sampler" |r| r.sampler = 99;
    Selection "unknown selection" |r| r.selection = 6;
    SelectedIndex "index beyond the candidates" |r| (r.selection, r.selected_index) = (5, 2);
    Execute "execute = 3" |r| r.execute = 3;
    GoalCount "an earlier plan executed, with a goal" |r| { execute_earlier(r); r.goal_count = 1; };
    BallCount "an earlier plan executed, with a ball" |r| { execute_earlier(r); r.ball_count = 1; };
    EarlyCandidateCount "an earlier plan executed, with an early answer" |r| { execute_earlier(r); r.early_candidate_count = 1; };
    PreviousPlan "an earlier plan executed, and none named" |r| { execute_earlier(r); r.previous_plan_id = 0; };
    PreviousPlan "an earlier plan executed that is not kept" |r| execute_earlier(r);
    PreviousCandidate "candidate 64 of an earlier plan executed" |r| { execute_earlier(r); r.previous_candidate = 64; };
    Requested "an earlier plan executed, and nobody knows when it was asked for" |r| { execute_earlier(r); r.requested_mono_ns = 0; };
    Requested "an earlier plan executed, and asked for by the wall clock" |r| { execute_earlier(r); r.requested_mono_ns = wall_now_ns(); };
    Begin "an earlier plan executed before the machine" |r| { execute_earlier(r); r.begin_mono_ns = -1; };
    GoalCount "no goal" |r| r.goal_count = 0;
    GoalCount "nine goals" |r| r.goal_count = 9;
    GoalKind "unknown goal kind" |r| r.goals[0].kind = 2;
    BallCount "65 balls" |r| r.ball_count = 65;
    BallCount "all bits of balls" |r| r.ball_count = u32::MAX;
    StartConfiguration "start NaN" |r| r.start_configuration_rad[5] = f64::NAN;
    StartConfiguration "start infinite" |r| r.start_configuration_rad[1] = f64::INFINITY;
    StartVelocity "execution from a start in motion" |r| (r.execute, r.start_velocity_rad_s[2]) = (1, 1e-3);
    StartVelocity "velocity infinite" |r| r.start_velocity_rad_s[2] = f64::INFINITY;
    StartAcceleration "execution from an accelerating start" |r| (r.execute, r.start_acceleration_rad_s2[1]) = (1, -1.0);
    EarlyCandidateCount "more early candidates than candidates" |r| r.early_candidate_count = 65;
    PreviousPlan "a previous plan for straight segments" |r| (r.sampler, r.previous_plan_id) = (2, 1);
    PreviousPlan "a previous plan that is not kept" |r| (r.sampler, r.previous_plan_id) = (0, 1);
    PreviousCandidate "candidate 64 of a previous plan" |r| (r.sampler, r.previous_plan_id, r.previous_candidate) = (0, 1, 64);
    StartAcceleration "acceleration NaN" |r| r.start_acceleration_rad_s2[1] = f64::NAN;
    GoalTip "tip -infinite" |r| r.goals[0].tip_m[2] = f64::NEG_INFINITY;
    GoalTip "tip NaN" |r| r.goals[0].tip_m[0] = f64::NAN;
    TipTolerance "negative tolerance" |r| r.goals[0].tip_tolerance_m = -1e-9;
    TipTolerance "tolerance NaN" |r| r.goals[0].tip_tolerance_m = f64::NAN;
    GoalConfiguration "goal NaN" |r| (r.goals[0].kind, r.goals[0].configuration_rad[3]) = (1, f64::NAN);
    LimitsScale "limits times 0" |r| r.limits_scale = 0.0;
    LimitsScale "limits times -1" |r| r.limits_scale = -1.0;
    LimitsScale "limits times 2" |r| r.limits_scale = 2.0;
    LimitsScale "limits NaN" |r| r.limits_scale = f64::NAN;
    Begin "begins before the machine" |r| r.begin_mono_ns = -1;
    Requested "executed, and nobody knows when it was asked for" |r| (r.execute, r.requested_mono_ns) = (1, 0);
    Requested "executed, and asked for by the wall clock" |r| (r.execute, r.requested_mono_ns) = (1, wall_now_ns());
    Requested "asked for before the machine" |r| r.requested_mono_ns = -1;
    Balls "negative radius" |r| (r.ball_count, r.balls[1].radius_m) = (2, -0.1);
    Balls "radius infinite" |r| (r.ball_count, r.balls[0].radius_m) = (1, f64::INFINITY);
    Balls "centre NaN" |r| (r.ball_count, r.balls[63].centre_m[2]) = (64, f64::NAN);
};

const fn posed(name: &'static str, outcome: Outcome, change: fn(&mut PlanRequest)) -> BadRequest {
    BadRequest {
        name,
        change,
        outcome,
        field: PlanField::None,
    }
}

const fn ball(centre_m: [f64; 3], radius_m: f64) -> Ball {
    Ball { centre_m, radius_m }
}

/// Well-formed requests that have no answer.
const POSED: &[BadRequest] = &[
    BadRequest {
        name: "another protocol version",
        change: |r| r.protocol_version = 1,
        outcome: Outcome::WrongVersion,
        field: PlanField::ProtocolVersion,
    },
    posed("another robot", Outcome::WrongRobot, |r| r.robot_hash = 1),
    posed("start bent too far", Outcome::StartOutOfLimits, |r| {
        r.start_configuration_rad[0] = 1.7;
    }),
    posed("start inside a ball", Outcome::StartInCollision, |r| {
        (r.ball_count, r.balls[0]) = (1, ball([0.0, 0.0, 1.5], 0.4));
    }),
    posed("goal too far", Outcome::GoalOutOfReach, |r| {
        r.goals[0].tip_m = [0.0, 0.0, 3.5];
    }),
    posed("goal below the base", Outcome::GoalOutOfReach, |r| {
        r.goals[0].tip_m = [0.0, 0.0, -3.2];
    }),
    posed("goal inside a ball", Outcome::GoalInCollision, |r| {
        (r.ball_count, r.balls[0]) = (1, ball(r.goals[0].tip_m, 0.3));
    }),
];

/// What the daemon made of the malformed requests.
#[derive(Clone, Debug, Default)]
pub struct Refusals {
    /// Requests sent.
    pub sent: usize,
    /// Those refused with the outcome and the field expected, and with a text.
    pub named: usize,
    /// Good requests after each of them that were answered.
    pub good_after: usize,
    /// What was not as expected.
    pub unexpected: Vec<String>,
}

/// Sends every malformed request, and a good one after each, to the daemon that runs.
///
/// `has_weights`: whether it has a model; without one, asking for it is malformed too.
///
/// # Errors
/// [`RawError`] if the daemon no longer answers.
pub fn send_malformed(client: &RawClient, has_weights: bool) -> Result<Refusals, RawError> {
    let mut refusals = Refusals::default();
    let no_model = [posed("no model", Outcome::SamplerNotLoaded, |r| {
        r.sampler = Sampler::Fast.code();
    })];
    let no_model = if has_weights { &[][..] } else { &no_model };
    for bad in INVALID.iter().chain(POSED).chain(no_model) {
        let mut request = good_request();
        (bad.change)(&mut request);
        let report = client.ask(&request, PATIENCE)?.report;
        refusals.sent += 1;
        let text = report.reason.text();
        let is_named = report.outcome == bad.outcome.code()
            && report.invalid_field == bad.field.code()
            && report.candidate_count == 0
            && !text.is_empty();
        refusals.named += usize::from(is_named);
        if !is_named {
            let (outcome, field) = (report.outcome, report.invalid_field);
            let found = format!("{}: outcome {outcome}, field {field}, {text:?}", bad.name);
            refusals.unexpected.push(found);
        }
        let good = client.ask(&good_request(), PATIENCE)?.report;
        refusals.good_after += usize::from(good.outcome == Outcome::Ok.code());
    }
    Ok(refusals)
}
