//! A daemon process plans over real shared memory.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod common;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use client::{Client, PlanAnswer};
use common::{PATIENCE, World, request, until};
use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{Outcome, PlanField, Sampler, Source, Stage};
use shared_types::ipc::{
    IpcNode, event_listener, open_plan_service, plan_answered_event, plan_asked_event, plan_client,
};
use shared_types::message::{self, Knot};
use shared_types::valid::{Goal, PlanReport, PlanRequest, check_knots};

fn knots(answer: &PlanAnswer) -> Vec<Knot> {
    let candidates = answer.candidates();
    candidates
        .flat_map(|candidate| candidate.knots.to_vec())
        .collect()
}

fn bits(knots: &[Knot]) -> Vec<u64> {
    let numbers = knots.iter().flat_map(|knot| {
        let vectors = [
            knot.configuration_rad,
            knot.velocity_rad_s,
            knot.acceleration_rad_s2,
        ];
        std::iter::once(knot.time_s).chain(vectors.into_iter().flatten())
    });
    numbers.map(f64::to_bits).collect()
}

/// A folder with the shipped few-step model and the small diffusion model of the parity test.
fn weights_of_both_kinds(world: &World) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folders = ["weights", "crates/planning/tests/fixtures"].map(|folder| root.join(folder));
    let both = world.path().join("weights");
    std::fs::create_dir(&both).unwrap();
    let manifests = folders.each_ref().map(|folder| {
        for name in ["fast", "sampled"] {
            let file = format!("{name}.safetensors");
            let _ = std::fs::copy(folder.join(&file), both.join(&file));
        }
        std::fs::read_to_string(folder.join("MANIFEST.toml")).unwrap()
    });
    std::fs::write(both.join("MANIFEST.toml"), manifests.concat()).unwrap();
    both
}

/// Whether candidates were sampled and each failed in a way of its own: the model is small and hardly trained.
fn has_drawn_in_vain(report: &PlanReport) -> bool {
    let causes = ["short of the goal", "not certified free"];
    report.outcome == Outcome::NoPath
        && report.stage_ns(Stage::Sample) > 0
        && report.reason.starts_with("none of 4 paths")
        && causes.iter().any(|cause| report.reason.contains(cause))
}

#[test]
fn a_diffusion_model_is_served_beside_the_default_one_where_it_is_configured() {
    let world = World::new();
    let weights = weights_of_both_kinds(&world);
    let table =
        "[diffusion]\nmodel = \"sampled\"\nsolver = \"ddim\"\nsteps = 10\nprecision = \"f32\"";
    for (table, expected) in [("", Outcome::SamplerNotLoaded), (table, Outcome::Ok)] {
        let settings = format!("weights = {weights:?}\n{table}");
        let daemon = world.start(&world.configuration(&settings));
        let named = match table {
            "" => "model fast, no diffusion model",
            _ => "diffusion model sampled (10 steps of ddim, f32)",
        };
        assert!(daemon.said().contains(named), "{}", daemon.said());
        let mut client = Client::connect(&world.options).unwrap();
        for sampler in [
            Sampler::DiffusionPost,
            Sampler::DiffusionGuided,
            Sampler::Default,
        ] {
            let answer = client.plan(
                &PlanRequest {
                    sampler,
                    ..request()
                },
                PATIENCE,
            );
            let answer = answer.unwrap();
            let report = answer.report();
            let expected = match sampler {
                Sampler::Default => Outcome::Ok,
                _ if has_drawn_in_vain(report) => Outcome::NoPath,
                _ => expected,
            };
            assert_eq!(report.outcome, expected, "{sampler}: {}", report.reason);
        }
        assert!(daemon.terminate().success());
    }
}

#[test]
fn the_same_request_gives_the_same_bits_whatever_the_threads_and_sigterm_ends_it() {
    let world = World::new();
    let samplers = [
        Sampler::Straight,
        Sampler::StraightDrawn,
        Sampler::RrtConnect,
        Sampler::RrtSmooth,
        Sampler::Straight,
    ];
    let mut plans: Vec<(Vec<u64>, u64)> = Vec::new();
    for threads in [1, 2] {
        let daemon = world.start(&world.configuration(&format!("threads = {threads}")));
        let mut client = Client::connect(&world.options).unwrap();
        for sampler in samplers {
            let request = PlanRequest {
                sampler,
                ..request()
            };
            let answer = client.plan(&request, PATIENCE).unwrap();
            let report = answer.report();
            assert_eq!(report.outcome, Outcome::Ok, "{}", report.reason);
            assert!(!report.candidates.is_empty());
            for candidate in answer.candidates() {
                check_knots(candidate.knots).unwrap();
                assert_eq!(candidate.knots[0].configuration_rad, [0.0; 6]);
                assert!(candidate.summary.tip_error_m < 0.01);
                assert!(candidate.summary.clearance_m >= 0.0);
                let duration = candidate.knots[candidate.knots.len() - 1].time_s;
                assert_eq!(candidate.summary.duration_s, duration);
            }
            assert!(report.stage_ns(Stage::Condition) > 0 && report.stage_ns(Stage::Write) > 0);
            plans.push((bits(&knots(&answer)), report.plan_hash));
        }
        drop(client);
        let status = daemon.terminate();
        assert!(status.success(), "{status}");
    }
    assert_eq!(plans[0], plans[4], "straight, twice");
    let hashes: HashSet<u64> = plans.iter().map(|(_, hash)| *hash).collect();
    assert_eq!(hashes.len(), 4, "every sampler plans in a way of its own");
    assert_eq!(plans[..5], plans[5..], "one thread and two");
}

/// A change to a good request, and the outcome and the field that it must be answered with.
type Case = (fn(&mut message::PlanRequest), Outcome, PlanField);

const MALFORMED: &[Case] = &[
    (
        |r| r.protocol_version = PROTOCOL_VERSION + 1,
        Outcome::WrongVersion,
        PlanField::ProtocolVersion,
    ),
    (|r| r.robot_hash = 1, Outcome::WrongRobot, PlanField::None),
    (
        |r| r.candidate_count = 0,
        Outcome::InvalidRequest,
        PlanField::CandidateCount,
    ),
    (
        |r| r.candidate_count = 17,
        Outcome::InvalidRequest,
        PlanField::CandidateCount,
    ),
    (
        |r| r.sampler = 9,
        Outcome::InvalidRequest,
        PlanField::Sampler,
    ),
    (
        |r| r.selection = 9,
        Outcome::InvalidRequest,
        PlanField::Selection,
    ),
    (
        |r| (r.selection, r.selected_index) = (5, 4),
        Outcome::InvalidRequest,
        PlanField::SelectedIndex,
    ),
    (
        |r| r.execute = 3,
        Outcome::InvalidRequest,
        PlanField::Execute,
    ),
    (
        |r| r.goals[0].kind = 2,
        Outcome::InvalidRequest,
        PlanField::GoalKind,
    ),
    (
        |r| r.ball_count = 65,
        Outcome::InvalidRequest,
        PlanField::BallCount,
    ),
    (
        |r| r.balls[0].radius_m = -1.0,
        Outcome::InvalidRequest,
        PlanField::Balls,
    ),
    (
        |r| r.goals[0].tip_m[2] = f64::INFINITY,
        Outcome::InvalidRequest,
        PlanField::GoalTip,
    ),
    (
        |r| r.start_configuration_rad[5] = f64::NAN,
        Outcome::InvalidRequest,
        PlanField::StartConfiguration,
    ),
    (
        |r| (r.execute, r.start_velocity_rad_s[0]) = (1, 0.1),
        Outcome::InvalidRequest,
        PlanField::StartVelocity,
    ),
    (
        |r| (r.sampler, r.previous_plan_id) = (Sampler::Fast.code(), 1),
        Outcome::InvalidRequest,
        PlanField::PreviousPlan,
    ),
    (
        |r| r.limits_scale = 0.0,
        Outcome::InvalidRequest,
        PlanField::LimitsScale,
    ),
    (
        |r| r.deadline_ns = u64::MAX,
        Outcome::InvalidRequest,
        PlanField::Deadline,
    ),
    (|r| r.deadline_ns = 1, Outcome::Truncated, PlanField::None),
    (
        |r| r.sampler = Sampler::Fast.code(),
        Outcome::SamplerNotLoaded,
        PlanField::None,
    ),
    (
        |r| r.sampler = Sampler::Default.code(),
        Outcome::SamplerNotLoaded,
        PlanField::None,
    ),
    (
        |r| r.start_configuration_rad[0] = 2.0,
        Outcome::StartOutOfLimits,
        PlanField::None,
    ),
    (
        |r| r.balls[0].centre_m = [0.0, 0.0, 1.5],
        Outcome::StartInCollision,
        PlanField::None,
    ),
    (
        |r| r.goals[0].tip_m = [0.0, 0.0, 4.0],
        Outcome::GoalOutOfReach,
        PlanField::None,
    ),
    (
        |r| r.balls[0].centre_m = r.goals[0].tip_m,
        Outcome::GoalInCollision,
        PlanField::None,
    ),
    (
        |r| r.goals[0].tip_tolerance_m = 1e-300,
        Outcome::NoPath,
        PlanField::None,
    ),
    (
        |r| {
            (r.execute, r.goal_count, r.ball_count) = (2, 0, 0);
            (r.previous_plan_id, r.requested_mono_ns) = (1, mono_now_ns());
        },
        Outcome::InvalidRequest,
        PlanField::PreviousPlan,
    ),
    (
        |r| r.execute = 1,
        Outcome::InvalidRequest,
        PlanField::Requested,
    ),
    (
        |r| (r.execute, r.requested_mono_ns) = (1, mono_now_ns()),
        Outcome::ExecutionRefused,
        PlanField::None,
    ),
];

#[test]
fn every_malformed_or_impossible_request_has_its_outcome_and_the_daemon_lives() {
    let world = World::new();
    let mut daemon = world.start(&world.configuration(""));
    let node = IpcNode::create(&world.options, "test").unwrap();
    let client = plan_client(&node, &open_plan_service(&node).unwrap()).unwrap();
    for (index, (change, outcome, field)) in MALFORMED.iter().enumerate() {
        for (changed, expected) in [(true, *outcome), (false, Outcome::Ok)] {
            let mut wire = message::PlanRequest::try_from(&request()).unwrap();
            wire.request_id = 100 + index as u64;
            if changed {
                change(&mut wire);
            }
            let pending = client.send_copy(wire).unwrap();
            let response = until(|| pending.receive().unwrap());
            let report =
                PlanReport::try_new(response.user_header(), response.payload().len()).unwrap();
            let case = format!("case {index}: {}", report.reason);
            assert_eq!(report.outcome, expected, "{case}");
            assert_eq!(report.request_id, wire.request_id, "{case}");
            let expected_field = if changed { *field } else { PlanField::None };
            assert_eq!(report.invalid_field, expected_field, "{case}");
            if changed {
                assert!(!report.reason.is_empty(), "case {index}");
                assert_eq!(report.trajectory_id, None);
            } else {
                assert!(
                    report
                        .candidates
                        .iter()
                        .all(|candidate| { candidate.source == Source::StraightLine.code() })
                );
            }
        }
    }
    assert!(daemon.is_alive());
    assert!(daemon.terminate().success());
}

#[test]
fn requests_of_several_clients_at_once_are_all_answered_once_and_not_mixed_up() {
    let world = World::new();
    let _daemon = world.start(&world.configuration("wait = \"poll\""));
    let mut clients: Vec<Client> = (0..4)
        .map(|_| Client::connect(&world.options).unwrap())
        .collect();
    let mut expected: HashMap<u64, u64> = HashMap::new();
    for round in 0..3 {
        let mut pending = Vec::new();
        for (number, client) in clients.iter_mut().enumerate() {
            for slot in 0..4_u64 {
                let id = 1 + slot + 4 * number as u64;
                let goal = Goal::Tip {
                    position_m: [0.8 + 0.03 * id as f64, 0.2, 2.3],
                    tolerance_m: None,
                };
                let request = PlanRequest {
                    request_id: id,
                    goal,
                    ..request()
                };
                pending.push((number, id, client.submit(&request).unwrap()));
            }
        }
        for (number, id, pending) in pending {
            let answer = clients[number].wait(pending, PATIENCE).unwrap();
            let report = answer.report();
            assert_eq!((report.outcome, report.request_id), (Outcome::Ok, id));
            let hash = *expected.entry(id).or_insert(report.plan_hash);
            assert_eq!(report.plan_hash, hash, "round {round}, request {id}");
        }
    }
    let mut hashes: Vec<u64> = expected.values().copied().collect();
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), 16, "16 goals have 16 plans");
}

#[test]
fn requests_and_answers_are_told_of() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let node = IpcNode::create(&world.options, "listener").unwrap();
    let asked = event_listener(&node, &plan_asked_event(&node).unwrap()).unwrap();
    let answered = event_listener(&node, &plan_answered_event(&node).unwrap()).unwrap();
    let mut client = Client::connect(&world.options).unwrap();
    for (sampler, outcome) in [
        (Sampler::Straight, Outcome::Ok),
        (Sampler::Fast, Outcome::SamplerNotLoaded),
    ] {
        let request = PlanRequest {
            sampler,
            ..request()
        };
        let answer = client.plan(&request, PATIENCE).unwrap();
        assert_eq!(answer.report().outcome, outcome);
        assert!(
            asked.wait(None, PATIENCE).unwrap(),
            "{sampler} was asked for"
        );
        assert!(
            answered.wait(None, PATIENCE).unwrap(),
            "{outcome:?} was told"
        );
        for event in [&asked, &answered] {
            assert!(!event.wait(None, Duration::from_millis(5)).unwrap());
        }
    }
}

#[test]
fn more_than_a_client_may_queue_is_answered_overloaded_and_cancelling_makes_room() {
    let world = World::new();
    let _daemon = world.start(&world.configuration("queued_per_client = 1"));
    let mut client = Client::connect(&world.options).unwrap();
    let slow = PlanRequest {
        sampler: Sampler::RrtConnect,
        candidate_count: 16,
        ..request()
    };
    let pending: Vec<_> = (0..4).map(|_| client.submit(&slow).unwrap()).collect();
    let outcomes: Vec<Outcome> = pending
        .into_iter()
        .map(|pending| client.wait(pending, PATIENCE).unwrap().report().outcome)
        .collect();
    let count = |outcome| outcomes.iter().filter(|&&other| other == outcome).count();
    assert!(count(Outcome::Overloaded) >= 1, "{outcomes:?}");
    assert_eq!(
        count(Outcome::Overloaded) + count(Outcome::Ok),
        4,
        "{outcomes:?}"
    );

    drop((client.submit(&slow).unwrap(), client.submit(&slow).unwrap()));
    let answer = client.plan(&request(), PATIENCE).unwrap();
    assert_eq!(answer.report().outcome, Outcome::Ok);
}

#[test]
fn a_deadline_that_passes_in_the_queue_is_answered_while_another_plan_is_under_way() {
    let world = World::new();
    let _daemon = world.start(&world.configuration(""));
    let mut clients = [0, 1].map(|_| Client::connect(&world.options).unwrap());
    let slow = PlanRequest {
        sampler: Sampler::RrtConnect,
        candidate_count: 16,
        ..request()
    };
    let hasty = PlanRequest {
        deadline: Some(Duration::from_nanos(1)),
        ..request()
    };
    let mut answered_before_the_slow_one = || {
        let mut first = clients[0].submit(&slow).unwrap();
        let second = clients[1].submit(&hasty).unwrap();
        let answer = clients[1].wait(second, PATIENCE).unwrap();
        let report = answer.report();
        assert_eq!(report.outcome, Outcome::Truncated);
        assert!(
            report.reason.contains("while the request waited"),
            "{}",
            report.reason
        );
        clients[0].poll(&mut first).unwrap().is_none()
    };
    assert!((0..20).any(|_| answered_before_the_slow_one()));
}

#[test]
fn after_sigkill_a_restart_needs_no_help_and_clients_go_on() {
    let world = World::new();
    let configuration = world.configuration("");
    let mut client = Client::connect(&world.options).unwrap();
    for _ in 0..3 {
        let daemon = world.start(&configuration);
        let answer = client.plan(&request(), PATIENCE).unwrap();
        assert_eq!(answer.report().outcome, Outcome::Ok);
        drop(answer);
        daemon.kill();
    }
}
