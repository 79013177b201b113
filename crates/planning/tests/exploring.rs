//! Where no draw of the few-step model certifies, it explores.
#![allow(clippy::unwrap_used)] // tests

mod requests;
mod shipped;

use datasets::scenes::{Setting, draw_target};
use planning::{
    Candidate, Failure, Goal, MovingObstacles, Plan, Planner, Problem, Request, Sampler, Source,
};
use shipped::planner;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Two candidates: exploring leads to the same goal configuration more than once.
fn request(seed: u64) -> Request {
    Request {
        candidates: 2,
        ..requests::request(Sampler::Fast, seed)
    }
}

/// Problems in hard scenes, most of which a draw solves.
fn problems(planner: &Planner) -> impl Iterator<Item = Problem> {
    let targets = (0..).filter_map(|i| draw_target(planner.robot(), Setting::Hard, 9002, i));
    targets.map(|target| Problem {
        start: target.starts[0],
        goal: Goal::Tip(target.tip),
        scene: target.scene,
        moving: MovingObstacles::default(),
    })
}

/// The first problem that exploring solves, its seed, and the answer.
fn explored(planner: &Planner) -> (Problem, u64, Plan) {
    let mut answers = problems(planner).zip(0..300).filter_map(|(problem, seed)| {
        let plan = planner.plan(&problem, &request(seed), &|| false).ok()?;
        (plan.explored > 0 && !plan.candidates.is_empty()).then_some((problem, seed, plan))
    });
    answers.next().expect("one of 300 needs exploring")
}

#[test]
fn exploring_gives_the_same_bits_with_one_thread_and_with_two() {
    let [one, two] = [1, 2].map(planner);
    let (problem, seed, plan) = explored(&one);
    assert_eq!(plan.learned_certified, 0, "it is not counted as a draw");
    let is_explored = |candidate: &Candidate| candidate.source == Source::Explored;
    assert!(plan.candidates.iter().all(is_explored));
    let other = two.plan(&problem, &request(seed), &|| false).unwrap();
    assert_eq!(plan.explored, other.explored);
    let knots = |plan: &Plan| -> Vec<_> {
        let knots = |c: &Candidate| c.trajectory.knots().to_vec();
        plan.candidates.iter().map(knots).collect()
    };
    assert!(knots(&plan) == knots(&other));
}

#[test]
fn every_candidate_that_exploring_tells_of_is_in_the_answer() {
    let planner = planner(2);
    let (problem, seed, _) = explored(&planner);
    let told: Mutex<Vec<Candidate>> = Mutex::default();
    let supervision = planning::Supervision {
        certified: Some(&|candidate| told.lock().unwrap().push(candidate)),
        ..planning::Supervision::new(&|| false)
    };
    let plan = planner
        .plan_supervised(&problem, &request(seed), supervision)
        .unwrap();
    let told = told.into_inner().unwrap();
    assert_eq!(told.len(), plan.candidates.len());
    for candidate in told {
        let mut all = plan.candidates.iter();
        assert!(all.any(|c| c.trajectory == candidate.trajectory));
    }
}

#[test]
fn exploring_that_is_interrupted_says_so() {
    let planner = planner(2);
    let (problem, seed, plan) = explored(&planner);
    let asked = AtomicUsize::new(0);
    let interrupt = |limit: usize| {
        let asked = &asked;
        move || asked.fetch_add(1, Ordering::Relaxed) >= limit
    };
    let limits = [1, 5, 10, 20, 30, 40];
    let truncated = limits.iter().filter(|&&limit| {
        asked.store(0, Ordering::Relaxed);
        let plan = planner
            .plan(&problem, &request(seed), &interrupt(limit))
            .unwrap();
        let is_empty = plan.candidates.is_empty();
        assert!(!is_empty || plan.truncated, "limit {limit}");
        let first = plan.draws.first().map(|draw| draw.outcome.as_ref().err());
        is_empty && first.flatten() == Some(&Failure::Truncated)
    });
    assert!(truncated.count() > 0);
    assert!(!plan.truncated);
}
