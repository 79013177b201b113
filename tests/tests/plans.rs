//! The daemon's answers: to one client, to several at once, again and again, and to what is malformed.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use client::{Client, PlanAnswer};
use shared_types::codes::{LoopFault, Outcome};
use shared_types::valid::{Goal, PlanRequest, PreviousPlan};
use tests::borders::send_malformed;
use tests::concurrency::{CLIENTS, ask_at_once, general_requests};
use tests::process::Process;
use tests::raw::{RawClient, good_request};
use tests::stack::{NO_DEADLINE, PATIENCE, Part, Stack};
use tests::world::{Settings, World};
use toml::Value;

const GOAL: [f64; 3] = [0.0, -1.55, 2.25];
/// Requests for an early answer, of which some must be answered so.
const EARLY_ASKED: usize = 10;

#[test]
fn a_plan_starts_and_ends_where_it_should() {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    let request = PlanRequest {
        candidate_count: 4,
        sampler: stack.world.sampler(),
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new(
            [0.0; 6],
            Goal::Tip {
                position_m: GOAL,
                tolerance_m: None,
            },
        )
    };
    stack.client.wait_for_daemon(PATIENCE).unwrap();
    let answer = stack.client.plan(&request, PATIENCE).unwrap();
    assert_eq!(answer.report().outcome, Outcome::Ok);
    assert_eq!(answer.candidates().len(), 4);
    let body = stack.world.body();
    for candidate in answer.candidates() {
        let (first, last) = (candidate.knots[0], *candidate.knots.last().unwrap());
        assert_eq!(first.configuration_rad, [0.0; 6]);
        assert_eq!(first.velocity_rad_s, [0.0; 6]);
        assert_eq!(last.velocity_rad_s, [0.0; 6]);
        assert!(body.tip_error(&last.configuration_rad, &GOAL) <= 0.01);
        assert_eq!(
            last.time_s.to_bits(),
            candidate.summary.duration_s.to_bits()
        );
    }
    assert_eq!(answer.report().trajectory_id, None, "it was not asked for");
    drop(answer);
    let status = stack.process(Part::Daemon).sigterm(PATIENCE).unwrap();
    assert!(status.success(), "SIGTERM ends it cleanly: {status}");
}

#[test]
fn a_request_is_answered_early_goes_on_from_a_plan_and_begins_in_motion() {
    let world = World::new(&Settings::default());
    let _daemon = Part::Daemon.start(&world);
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(PATIENCE).unwrap();
    let goal = Goal::Tip {
        position_m: GOAL,
        tolerance_m: None,
    };
    let request = PlanRequest {
        candidate_count: 10,
        early_candidate_count: Some(3),
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new([0.05; 6], goal)
    };
    let mut early_answers = 0;
    for _ in 1..EARLY_ASKED {
        early_answers += usize::from(ask_early(&mut client, &request).0);
    }
    let (is_early, whole) = ask_early(&mut client, &request);
    early_answers += usize::from(is_early);
    assert!(
        early_answers > 0,
        "none of {EARLY_ASKED} was answered early"
    );
    let selected = whole.selected().unwrap();
    let middle = selected.knots[selected.knots.len() / 2];
    let end = selected.knots.last().unwrap().configuration_rad;

    let again = PlanRequest {
        previous: Some(PreviousPlan {
            plan_id: whole.report().plan_id,
            candidate: None,
        }),
        start_velocity_rad_s: middle.velocity_rad_s,
        start_acceleration_rad_s2: middle.acceleration_rad_s2,
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new(middle.configuration_rad, goal)
    };
    let answer = client.plan(&again, PATIENCE).unwrap();
    assert_eq!(answer.report().outcome, Outcome::Ok);
    let goes_on = answer.selected().unwrap();
    assert_eq!(goes_on.knots[0].velocity_rad_s, middle.velocity_rad_s);
    assert_eq!(
        goes_on.knots[0].acceleration_rad_s2,
        middle.acceleration_rad_s2
    );
    let last = goes_on.knots.last().unwrap().configuration_rad;
    let apart = end.iter().zip(&last).map(|(a, b)| (a - b).abs());
    assert!(
        apart.fold(0.0, f64::max) < 1e-3,
        "it ends in the shape that was followed"
    );

    let rushing = PlanRequest {
        start_velocity_rad_s: [5.0; 6],
        ..PlanRequest::new([0.05; 6], goal)
    };
    let refused = client.plan(&rushing, PATIENCE).unwrap();
    assert_eq!(refused.report().outcome, Outcome::StartCannotStop);
}

/// Waits for the whole answer to a request for three early candidates, and says whether the early one came before. The whole one may
/// overtake it in the client's buffer.
fn ask_early(client: &mut Client, request: &PlanRequest) -> (bool, PlanAnswer) {
    let mut pending = client.submit(request).unwrap();
    let first = client.next(&mut pending, PATIENCE).unwrap();
    let is_early = first.report().outcome == Outcome::Early;
    let whole = if is_early {
        assert_eq!(first.candidates().len(), 3);
        client.next(&mut pending, PATIENCE).unwrap()
    } else {
        first
    };
    assert_eq!(whole.report().outcome, Outcome::Ok);
    assert_eq!(whole.candidates().len(), 10);
    (is_early, whole)
}

#[test]
fn answers_are_not_lost_not_mixed_up_and_the_same_with_one_thread_and_with_two() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let pool = general_requests(&stack.world.robot, 25, stack.world.sampler());
    stack.disconnect_client();
    let two_threads = ask_at_once(&stack.world, &pool, 1);
    assert_eq!(two_threads.sent, 25 * CLIENTS);
    assert_eq!(two_threads.lost, Vec::<String>::new());
    assert_eq!(two_threads.mixed_up, Vec::<String>::new());
    assert_eq!(two_threads.differing, 0, "four clients asked the same");
    assert!(two_threads.with_candidates > 0 && two_threads.executed > 0);
    let state = stack.controller_state();
    assert_eq!(state.fault, LoopFault::None);

    let one_thread = Settings {
        daemon: vec![("threads", Value::Integer(1))],
        ..Settings::default()
    };
    let world = World::new(&one_thread);
    let _daemon = Part::Daemon.start(&world);
    wait_for_daemon(&world);
    let one_thread = ask_at_once(&world, &pool, 1);
    assert_eq!(one_thread.fingerprints.len(), pool.len());
    assert_eq!(one_thread.fingerprints, two_threads.fingerprints);
}

#[test]
fn every_malformed_request_is_named_and_the_next_good_one_is_served() {
    for without_weights in [false, true] {
        let world = World::new(&Settings {
            without_weights,
            ..Settings::default()
        });
        let mut daemon = Part::Daemon.start(&world);
        let client = RawClient::connect(&world.options, PATIENCE).unwrap();
        let refusals = send_malformed(&client, world.has_weights).unwrap();
        assert_eq!(refusals.unexpected, Vec::<String>::new());
        assert!(refusals.sent > 30);
        assert_eq!(refusals.named, refusals.sent);
        assert_eq!(refusals.good_after, refusals.sent);
        assert!(daemon.is_running());
    }
}

#[test]
fn raw_answers_repeat_to_the_bit() {
    let world = World::new(&Settings::default());
    let _daemon = Part::Daemon.start(&world);
    let client = RawClient::connect(&world.options, PATIENCE).unwrap();
    let ask = || client.ask(&good_request(), PATIENCE).unwrap();
    let (first, second) = (ask(), ask());
    assert_eq!(first.report.outcome, Outcome::Ok.code());
    assert_eq!(first.report.plan_hash, second.report.plan_hash);
    assert!(second.report.plan_id > first.report.plan_id);
    let times = |knots: &[shared_types::message::Knot]| -> Vec<u64> {
        knots.iter().map(|knot| knot.time_s.to_bits()).collect()
    };
    assert_eq!(times(&first.knots), times(&second.knots));
}

#[test]
fn a_robot_that_ramped_to_rest_a_little_beyond_its_bending_limit_gets_away_from_there() {
    let world = World::new(&Settings::default());
    let _daemon = Part::Daemon.start(&world);
    let client = RawClient::connect(&world.options, PATIENCE).unwrap();
    for (excess_rad, outcome) in [(4e-3, Outcome::Ok), (6e-3, Outcome::StartOutOfLimits)] {
        let mut request = good_request();
        request.start_configuration_rad[2] = world.robot.bending_limit + excess_rad;
        let answer = client.ask(&request, PATIENCE).unwrap();
        assert_eq!(answer.report.outcome, outcome.code(), "{excess_rad}");
    }
}

fn wait_for_daemon(world: &World) {
    let mut client = Client::connect(&world.options).unwrap();
    client.wait_for_daemon(Duration::from_secs(60)).unwrap();
}

#[test]
fn the_tool_prints_a_plan_as_json_to_the_bit() {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE).unwrap();
    let words =
        "plan --start 0 0 0 0 0 0 --tip 0 -1.55 2.25 --candidates 3 --deadline-ms 60000 --json";
    let arguments: Vec<&str> = words.split(' ').collect();
    let mut tool = Process::start(&stack.world, "pcc", &arguments);
    let status = tool.wait(PATIENCE).unwrap();
    assert!(status.success(), "{}", tool.log());
    let printed: serde_json::Value = serde_json::from_str(&tool.log()).unwrap();
    let request = PlanRequest {
        candidate_count: 3,
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new([0.0; 6], Goal::tip(GOAL))
    };
    let answer = stack.client.plan(&request, PATIENCE).unwrap();
    let hash = format!("{:016x}", answer.report().plan_hash);
    assert_eq!(printed["plan_hash"], hash);
    assert_eq!(printed["selected"], answer.report().selected.unwrap());
    assert_eq!(
        printed["candidates"][0]["clearance_m"],
        serde_json::Value::Null
    );
    for (candidate, printed) in answer
        .candidates()
        .zip(printed["candidates"].as_array().unwrap())
    {
        let knots = printed["knots"].as_array().unwrap();
        assert_eq!(knots.len(), candidate.knots.len());
        for (knot, printed) in candidate.knots.iter().zip(knots) {
            let time_s = printed["time_s"].as_f64().unwrap();
            assert_eq!(time_s.to_bits(), knot.time_s.to_bits());
            let accelerations = printed["acceleration_rad_s2"].as_array().unwrap();
            for (exact, printed) in knot.acceleration_rad_s2.iter().zip(accelerations) {
                assert_eq!(printed.as_f64().unwrap().to_bits(), exact.to_bits());
            }
        }
    }
    let mut refused = Process::start(
        &stack.world,
        "pcc",
        &[
            "plan", "--start", "0", "0", "0", "0", "0", "0", "--tip", "9", "0", "0", "--json",
        ],
    );
    assert!(!refused.wait(PATIENCE).unwrap().success());
    assert!(
        refused.log().contains("\"outcome\": \"goal out of reach\""),
        "{}",
        refused.log()
    );
}
