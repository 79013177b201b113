//! Planning again: from a previous plan, and with candidates before the answer.
#![allow(clippy::unwrap_used)] // tests

mod beside_a_ball;
mod requests;
mod shipped;

use beside_a_ball::{plan, problem, request};
use collision::{Ball, Scene, certify_trajectory};
use planning::{
    Candidate, Plan, PreviousPlan, Problem, Request, Sampler, Selection, Source, Supervision,
    WAYPOINTS, select,
};
use shipped::planner;
use std::sync::{Arc, Mutex};

fn selected_index(plan: &Plan) -> Option<usize> {
    select(&plan.candidates, &problem().start, Selection::ShortestTime)
}

fn selected(plan: &Plan) -> &Candidate {
    &plan.candidates[selected_index(plan).unwrap()]
}

fn previous(plan: &Plan) -> Option<Arc<PreviousPlan>> {
    let paths = plan
        .candidates
        .iter()
        .map(|c| c.trajectory.sample(WAYPOINTS));
    Some(Arc::new(PreviousPlan {
        paths: paths.collect(),
        followed: selected_index(plan),
    }))
}

#[test]
fn a_plan_goes_on_in_the_shape_that_is_followed() {
    let planner = planner(2);
    let first = plan(&planner, &problem(), &request());
    let followed = selected(&first);
    let motion = &followed.trajectory;
    let later = Problem {
        start: motion.at(0.4 * motion.duration()).position,
        ..problem()
    };
    let again = Request {
        seed: 77,
        previous: previous(&first),
        ..request()
    };
    let second = plan(&planner, &later, &again);
    let goes_on = selected(&second);
    assert_eq!(goes_on.source, Source::Kept);
    assert!((goes_on.end() - followed.end()).norm() < 1e-6);
    assert_eq!(goes_on.trajectory.knots()[0].position, later.start);
    assert_eq!(second.candidates.len(), 10);
    let afresh = plan(
        &planner,
        &later,
        &Request {
            seed: 77,
            ..request()
        },
    );
    assert!(afresh.candidates.iter().all(|c| c.source != Source::Kept));
    let kept_ends = first.candidates.iter().filter(|old| {
        let near = |new: &&Candidate| (new.end() - old.end()).norm() < 1e-6;
        second.candidates.iter().any(|new| near(&new))
    });
    assert!(
        kept_ends.count() >= 8,
        "the shapes of the plan before are kept"
    );
}

#[test]
fn a_motion_that_an_obstacle_took_is_not_kept() {
    let planner = planner(2);
    let first = plan(&planner, &problem(), &request());
    let end = selected(&first).end();
    let elbow = planner.robot().backbone(&end).point(1, 0.7);
    let in_the_way = Ball {
        centre: elbow,
        radius: 0.1,
    };
    let blocked = Problem {
        scene: Scene::new(vec![in_the_way]).unwrap(),
        ..problem()
    };
    let again = Request {
        previous: previous(&first),
        ..request()
    };
    let second = plan(&planner, &blocked, &again);
    assert!((selected(&second).end() - end).norm() > 0.01);
    for candidate in &second.candidates {
        let motion = &candidate.trajectory;
        assert!(certify_trajectory(planner.robot(), &blocked.scene, motion, 0.0).is_free());
    }
}

#[test]
fn candidates_are_told_as_they_certify() {
    let planner = planner(2);
    let told = Mutex::new(Vec::new());
    let tell = |candidate: Candidate| told.lock().unwrap().push(candidate);
    let supervision = Supervision {
        certified: Some(&tell),
        ..Supervision::new(&|| false)
    };
    let answer = planner
        .plan_supervised(&problem(), &request(), supervision)
        .unwrap();
    let told = told.into_inner().unwrap();
    assert_eq!(told.len(), 10);
    for early in &told {
        let same = |c: &&Candidate| c.draw == early.draw && c.source == early.source;
        if let Some(candidate) = answer.candidates.iter().find(same) {
            assert!(candidate.trajectory.knots() == early.trajectory.knots());
        }
    }
}

#[test]
fn the_fastest_straight_segment_competes() {
    let planner = planner(2);
    for seed in 0..5 {
        let request = |sampler| Request {
            sampler,
            seed,
            ..request()
        };
        let default = plan(&planner, &problem(), &request(Sampler::Default));
        let straight = plan(&planner, &problem(), &request(Sampler::Straight));
        assert!(default.learned_certified > 0);
        for candidate in &default.candidates {
            assert_eq!(candidate.trajectory.knots()[0].position, problem().start);
        }
        let [ours, theirs] = [&default, &straight].map(|p| selected(p).metrics.duration_s);
        assert!(ours <= theirs, "{ours} s against {theirs} s");
    }
}
