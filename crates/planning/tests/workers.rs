//! The answer of the default planner does not depend on who works on it.
#![allow(clippy::unwrap_used)] // tests

mod requests;
mod shipped;

use datasets::scenes::{Setting, draw_target};
use planning::{Goal, MovingObstacles, Plan, Problem, Sampler, Source};
use requests::request;
use shipped::planner;
use trajectory::Knot;

type Answer = Vec<(Source, usize, Vec<Knot>)>;

fn answer(plan: &Plan) -> Answer {
    let candidates = plan.candidates.iter();
    let candidate = candidates.map(|c| (c.source, c.draw, c.trajectory.knots().to_vec()));
    candidate.collect()
}

#[test]
fn hard_requests_get_the_same_bits_however_many_workers_there_are_and_whenever() {
    let planners = [1, 2, 3, 2].map(planner);
    let targets = (0..).filter_map(|i| draw_target(planners[0].robot(), Setting::Hard, 9010, i));
    let (mut seen, mut by_trees_alone) = (Vec::new(), 0);
    for (target, seed) in targets.zip(0..40) {
        let problem = Problem {
            start: target.starts[0],
            goal: Goal::Tip(target.tip),
            scene: target.scene,
            moving: MovingObstacles::default(),
        };
        let answers = planners.each_ref().map(|planner| {
            let request = request(Sampler::Default, seed);
            answer(&planner.plan(&problem, &request, &|| false).unwrap())
        });
        let [alone, others @ ..] = answers;
        seen.extend(alone.iter().map(|candidate| candidate.0));
        let is_tree = |candidate: &(Source, usize, Vec<Knot>)| candidate.0 == Source::Classical;
        by_trees_alone += usize::from(!alone.is_empty() && alone.iter().all(is_tree));
        for other in others {
            assert!(alone == other, "target {seed}");
        }
    }
    for source in [Source::Learned, Source::StraightLine, Source::Classical] {
        let count = seen.iter().filter(|seen| **seen == source).count();
        assert!(count >= 10, "{count} by {source:?}");
    }
    assert!(by_trees_alone >= 1, "a first path is sought, too");
}
