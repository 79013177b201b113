use super::*;
use crate::codes::{Outcome, PlanField};

fn request() -> PlanRequest {
    let goal = Goal::Tip {
        position_m: [0.1, 0.2, 2.5],
        tolerance_m: None,
    };
    let ball = Ball {
        centre_m: [1.0, 0.0, 1.0],
        radius_m: 0.25,
    };
    PlanRequest {
        candidate_count: 16,
        balls: vec![ball; 2],
        requested_mono_ns: Some(7),
        ..PlanRequest::new([0.1; DOF], goal)
    }
}

fn wire() -> message::PlanRequest {
    (&request()).try_into().unwrap()
}

type Change = fn(&mut message::PlanRequest);

/// A change, the field that is wrong then, and what the error says.
const BAD: &[(Change, PlanField, &str)] = &[
    (
        |r| r.protocol_version = 1,
        PlanField::ProtocolVersion,
        "speaks 7",
    ),
    (
        |r| r.candidate_count = 0,
        PlanField::CandidateCount,
        "1..=64",
    ),
    (
        |r| r.candidate_count = 65,
        PlanField::CandidateCount,
        "1..=64",
    ),
    (
        |r| r.deadline_ns = u64::MAX,
        PlanField::Deadline,
        "0..=60000000000",
    ),
    (|r| r.sampler = 9, PlanField::Sampler, "8 (rrt-smooth)"),
    (|r| r.selection = 6, PlanField::Selection, "5 (by index)"),
    (
        |r| (r.selection, r.selected_index) = (5, 16),
        PlanField::SelectedIndex,
        "0..=15",
    ),
    (
        |r| r.execute = 3,
        PlanField::Execute,
        "0 (nothing), 1 (the selected candidate)",
    ),
    (
        |r| r.execute = 2,
        PlanField::Execute,
        "by a request that plans is not served",
    ),
    (
        |r| r.goals[0].kind = 2,
        PlanField::GoalKind,
        "1 (configuration)",
    ),
    (|r| r.ball_count = 65, PlanField::BallCount, "0..=64"),
    (
        |r| r.start_configuration_rad[5] = f64::NAN,
        PlanField::StartConfiguration,
        "[5] is NaN",
    ),
    (
        |r| r.start_configuration_rad[0] = -1.1e3,
        PlanField::StartConfiguration,
        "-1000..=1000 rad",
    ),
    (
        |r| (r.execute, r.start_velocity_rad_s[2]) = (1, 1e-3),
        PlanField::StartVelocity,
        "begins in motion",
    ),
    (
        |r| r.start_velocity_rad_s[2] = f64::INFINITY,
        PlanField::StartVelocity,
        "[2] is inf",
    ),
    (
        |r| (r.execute, r.start_acceleration_rad_s2[1]) = (1, -1.0),
        PlanField::StartAcceleration,
        "begins in motion",
    ),
    (
        |r| r.start_acceleration_rad_s2[1] = f64::NAN,
        PlanField::StartAcceleration,
        "[1] is NaN",
    ),
    (
        |r| r.goals[0].tip_m[2] = f64::NEG_INFINITY,
        PlanField::GoalTip,
        "goals.tip_m[0] is -inf",
    ),
    (
        |r| r.goals[0].tip_m[0] = 1e4,
        PlanField::GoalTip,
        "-1000..=1000 m",
    ),
    (
        |r| r.goals[0].tip_tolerance_m = -1e-9,
        PlanField::TipTolerance,
        "0..=1000 m",
    ),
    (
        |r| r.goals[0].tip_tolerance_m = f64::NAN,
        PlanField::TipTolerance,
        "NaN",
    ),
    (
        |r| (r.goals[0].kind, r.goals[0].configuration_rad[3]) = (1, f64::NAN),
        PlanField::GoalConfiguration,
        "[0] is NaN",
    ),
    (
        |r| (r.goal_count, r.goals[1].tip_m[0]) = (2, f64::NAN),
        PlanField::GoalTip,
        "goals.tip_m[1] is NaN",
    ),
    (|r| r.goal_count = 0, PlanField::GoalCount, "1..=8"),
    (|r| r.goal_count = 9, PlanField::GoalCount, "1..=8"),
    (
        |r| (r.goal_count, r.previous_plan_id) = (2, 9),
        PlanField::PreviousPlan,
        "with several goals",
    ),
    (
        |r| (r.start, r.previous_plan_id) = (2, 9),
        PlanField::PreviousPlan,
        "with several goals",
    ),
    (|r| r.limits_scale = 0.0, PlanField::LimitsScale, "1e-9..=1"),
    (
        |r| r.limits_scale = -0.5,
        PlanField::LimitsScale,
        "1e-9..=1",
    ),
    (
        |r| r.limits_scale = 1.0 + 1e-12,
        PlanField::LimitsScale,
        "1e-9..=1",
    ),
    (|r| r.limits_scale = f64::NAN, PlanField::LimitsScale, "NaN"),
    (|r| r.begin_mono_ns = -1, PlanField::Begin, "0 or later"),
    (
        |r| r.requested_mono_ns = -1,
        PlanField::Requested,
        "0 or later",
    ),
    (
        |r| (r.execute, r.requested_mono_ns) = (1, 0),
        PlanField::Requested,
        "the time of CLOCK_MONOTONIC",
    ),
    (
        |r| r.balls[1].radius_m = -0.1,
        PlanField::Balls,
        "balls[1] is -0.1; allowed is a radius of 0..=1000 m",
    ),
    (
        |r| r.balls[0].radius_m = f64::INFINITY,
        PlanField::Balls,
        "balls[0] is inf",
    ),
    (
        |r| r.balls[1].centre_m[2] = f64::NAN,
        PlanField::Balls,
        "balls[1] is NaN",
    ),
    (
        |r| r.early_candidate_count = 17,
        PlanField::EarlyCandidateCount,
        "0..=16",
    ),
    (
        |r| (r.previous_plan_id, r.sampler) = (9, 2),
        PlanField::PreviousPlan,
        "other than default and fast",
    ),
    (
        |r| (r.previous_plan_id, r.previous_candidate) = (9, 64),
        PlanField::PreviousCandidate,
        "0..=63",
    ),
    (|r| r.start = 3, PlanField::Start, "3 is no start"),
    (
        |r| r.ignores_live_scene = 2,
        PlanField::IgnoresLiveScene,
        "0 (no) and 1 (yes)",
    ),
];

#[test]
fn each_field_is_checked_and_named() {
    for (change, field, text) in BAD {
        let mut wire = wire();
        change(&mut wire);
        let error = PlanRequest::try_from(&wire).expect_err(text);
        assert_eq!(error.plan_field(), *field, "{error}");
        assert!(
            error.to_string().contains(text),
            "{error} does not say {text:?}"
        );
        let version = *field == PlanField::ProtocolVersion;
        assert_eq!(
            error.outcome(),
            if version {
                Outcome::WrongVersion
            } else {
                Outcome::InvalidRequest
            }
        );
    }
    for field in PlanField::ALL
        .iter()
        .filter(|&&field| field != PlanField::None)
    {
        assert!(
            BAD.iter().any(|(_, tested, _)| tested == field),
            "no case for {field}"
        );
    }
}

#[test]
fn the_ends_of_every_range_are_accepted_and_what_is_not_used_is_not_read() {
    let changes: &[Change] = &[
        |r| r.candidate_count = 1,
        |r| r.candidate_count = 64,
        |r| r.deadline_ns = MAX_DEADLINE_NS,
        |r| (r.selection, r.selected_index) = (5, 15),
        |r| (r.selection, r.selected_index) = (0, u32::MAX),
        |r| r.ball_count = 0,
        |r| r.ball_count = 64,
        |r| r.balls[2].radius_m = f64::NAN,
        |r| r.balls[0].radius_m = 0.0,
        |r| r.limits_scale = 1e-9,
        |r| r.goals[0].configuration_rad[0] = f64::NAN,
        |r| r.goals[1].tip_m[0] = f64::NAN,
        |r| r.goal_count = 8,
        |r| (r.start, r.start_configuration_rad[0]) = (2, f64::NAN),
        |r| (r.goals[0].kind, r.goals[0].tip_m[0]) = (1, f64::NAN),
        |r| (r.execute, r.start_velocity_rad_s[0]) = (1, -0.0),
        |r| r.start_velocity_rad_s[0] = 0.1,
        |r| r.early_candidate_count = 16,
        |r| (r.previous_plan_id, r.previous_candidate) = (0, 77),
        |r| (r.previous_plan_id, r.previous_candidate) = (9, NONE_SELECTED),
    ];
    for (index, change) in changes.iter().enumerate() {
        let mut wire = wire();
        change(&mut wire);
        PlanRequest::try_from(&wire).unwrap_or_else(|error| panic!("change {index}: {error}"));
    }
}

#[test]
fn a_request_survives_the_wire() {
    let tip = request();
    let by_index = PlanRequest {
        request_id: 7,
        seed: 8,
        deadline: Some(Duration::from_millis(20)),
        sampler: Sampler::RrtConnect,
        selection: SelectionRule::Index(3),
        execute: true,
        goal: Goal::Configuration([0.3; DOF]),
        limits_scale: 0.5,
        begin_mono_ns: Some(9),
        robot_hash: Some(u64::MAX),
        balls: Vec::new(),
        ..tip.clone()
    };
    let goes_on = PlanRequest {
        start_velocity_rad_s: [0.1; DOF],
        start_acceleration_rad_s2: [-0.2; DOF],
        early_candidate_count: Some(3),
        previous: Some(PreviousPlan {
            plan_id: 77,
            candidate: Some(2),
        }),
        ..tip.clone()
    };
    let route = PlanRequest {
        start: StartKind::AfterGoals,
        via: vec![Goal::Configuration([0.2; DOF]); 7],
        ..tip.clone()
    };
    assert!(!tip.starts_in_motion() && goes_on.starts_in_motion());
    for request in [tip, by_index, goes_on, route] {
        let wire = message::PlanRequest::try_from(&request).unwrap();
        assert_eq!(PlanRequest::try_from(&wire), Ok(request));
    }
}

#[test]
fn what_does_not_fit_the_wire_is_refused_by_the_sender() {
    let balls = vec![Ball::ZEROED; MAX_BALLS + 1];
    let error = message::PlanRequest::try_from(&PlanRequest { balls, ..request() }).unwrap_err();
    assert_eq!(error.plan_field(), PlanField::BallCount);
    let via = vec![Goal::Configuration([0.2; DOF]); 8];
    let error = message::PlanRequest::try_from(&PlanRequest { via, ..request() }).unwrap_err();
    assert_eq!(error.plan_field(), PlanField::GoalCount);
    let error = message::PlanRequest::try_from(&PlanRequest {
        candidate_count: 0,
        ..request()
    })
    .unwrap_err();
    assert_eq!(error.plan_field(), PlanField::CandidateCount);
}
