//! Requests from a moving robot: motions that come too late for their switch, and plans that make way for the next request.
#![allow(clippy::unwrap_used)]

use std::thread::sleep;
use std::time::Duration;

use shared_types::codes::{MotionOutcome, Outcome};
use shared_types::valid::{Goal, PlanRequest};
use tests::judge::Judge;
use tests::listener::{Heard, Listener};
use tests::process::wait_for;
use tests::stack::{NO_DEADLINE, PATIENCE, Part, Stack};
use tests::world::Settings;

/// Tips that the robot is sent to in turn, m: far from each other, so that it is always on its way.
const TIPS: [[f64; 3]; 2] = [[1.5, 0.0, 2.4], [0.0, -1.55, 2.25]];
/// Times for which a process is held, in turn, ms: as long as the lead of a motion and longer, shorter than silence that counts as a loss.
const HELD_MS: [u64; 3] = [4, 8, 12];
/// Most requests until motions have come too late in both ways: it is a matter of a millisecond.
const ROUNDS: usize = 2_000;

/// A request for the tip of a round, to be executed.
fn request(round: usize) -> PlanRequest {
    PlanRequest {
        candidate_count: 10,
        seed: round as u64,
        deadline: Some(NO_DEADLINE),
        execute: true,
        ..PlanRequest::from_robot(Goal::tip(TIPS[round % TIPS.len()]))
    }
}

fn assert_within_limits(stack: &Stack, heard: &Heard) {
    let mut judge = Judge::new(stack.world.robot.tendon_limits);
    judge.look(heard);
    let verdict = judge.verdict();
    assert!(verdict.velocity > 0.1, "the premise, it moved: {verdict:?}");
    assert_eq!(verdict.offences, Vec::<String>::new());
}

#[test]
fn a_motion_that_comes_too_late_for_its_switch_is_joined_again_or_its_plan_made_again() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let listener = Listener::start(&stack.world.options);
    let late = [
        "is joined again: switch missed",
        "is made again: the controller has refused",
    ];
    let mut published = Vec::new();
    let mut seen = [false; 2];
    for round in 0..ROUNDS {
        let pending = stack.client.submit(&request(round)).unwrap();
        sleep(Duration::from_micros(1_000 + 250 * (round as u64 / 2 % 24)));
        let held = [Part::Daemon, Part::Controller][round % 2];
        stack.process(held).signal(libc::SIGSTOP);
        sleep(Duration::from_millis(HELD_MS[round / 2 % HELD_MS.len()]));
        stack.process(held).signal(libc::SIGCONT);
        let answer = stack.client.wait(pending, PATIENCE).unwrap();
        let report = answer.report();
        let id = report.trajectory_id;
        published.push(id.unwrap_or_else(|| panic!("{}: {}", report.outcome, report.reason)));
        let log = stack.process(Part::Daemon).log();
        seen = late.map(|words| log.contains(words));
        if seen == [true; 2] {
            break;
        }
    }
    assert_eq!(seen, [true; 2], "the premise, motions came too late");
    stack.wait_until_held().unwrap();
    sleep(Duration::from_millis(50));
    let heard = listener.take();
    for id in published {
        let mut results = heard.results.iter();
        let result = results.find(|it| it.trajectory_id == id).unwrap();
        let outcome = MotionOutcome::try_from(result.outcome).unwrap();
        let is_known_late =
            outcome == MotionOutcome::Refused && result.reason.text().contains("was passed");
        assert!(
            is_known_late || matches!(outcome, MotionOutcome::Reached | MotionOutcome::Joined),
            "{id}: {outcome:?}, {}",
            result.reason.text()
        );
    }
    assert_within_limits(&stack, &heard);
}

#[test]
fn a_plan_whose_motion_is_on_its_way_makes_way_for_the_next_request() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let listener = Listener::start(&stack.world.options);
    let mut has_made_way = false;
    for round in 0..100 {
        let known = listener.with(|heard| heard.motions.len());
        let first = stack.client.submit(&request(2 * round)).unwrap();
        let is_published = wait_for("its motion is published", PATIENCE, || {
            listener.with(|heard| (heard.motions.len() > known).then_some(()))
        });
        is_published.unwrap();
        let second = stack.client.submit(&request(2 * round + 1)).unwrap();
        let [first, second] = [first, second].map(|it| stack.client.wait(it, PATIENCE).unwrap());
        for answer in [&first, &second] {
            let report = answer.report();
            assert!(report.trajectory_id.is_some(), "{}", report.reason);
            assert!(report.selected.is_some());
        }
        let report = first.report();
        if report.outcome == Outcome::Truncated {
            assert!(
                report.reason.contains("a request came"),
                "{}",
                report.reason
            );
            has_made_way = true;
            break;
        }
        assert_eq!(report.outcome, Outcome::Ok, "{}", report.reason);
    }
    assert!(has_made_way, "the premise, a plan was in work");
    stack.wait_until_held().unwrap();
    let heard = listener.take();
    assert_within_limits(&stack, &heard);
}
