//! Motions of the planner: straight ones, and curved ones round the balls of hard scenes.

use pcc_model::Robot;
use planning::scenes::{Setting, draw_target};
use planning::{Goal, Models, Planner, Problem, Request, Sampler, Selection};
use trajectory::{AllocationOptions, Trajectory};

const SEED: u64 = 1801;

/// `count` certified motions, straight and curved in turn.
pub(super) fn planned(robot: &Robot, count: usize) -> anyhow::Result<Vec<Trajectory>> {
    let planner = Planner::new(robot, Models::default(), 1)?;
    let mut motions = Vec::new();
    for index in 0.. {
        let (sampler, setting) = match index % 2 {
            0 => (Sampler::Straight, Setting::General(None)),
            _ => (Sampler::RrtConnect, Setting::Hard),
        };
        if let Some(motion) = plan(&planner, sampler, setting, index)? {
            motions.push(motion);
        }
        if motions.len() == count {
            break;
        }
    }
    Ok(motions)
}

fn plan(
    planner: &Planner,
    sampler: Sampler,
    setting: Setting,
    index: u64,
) -> anyhow::Result<Option<Trajectory>> {
    let Some(target) = draw_target(planner.robot(), setting, SEED, index) else {
        return Ok(None);
    };
    let problem = Problem {
        start: target.starts[0],
        goal: Goal::Tip(target.tip),
        scene: target.scene,
    };
    let request = Request {
        candidates: 1,
        seed: index,
        sampler,
        selection: Selection::ShortestTime,
        limits_scale: 1.0,
        growth: [0.0; 3],
        knots: AllocationOptions::default().knots,
        corrections: planning::MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
    };
    let Ok(plan) = planner.plan(&problem, &request, &|| false) else {
        return Ok(None);
    };
    let certified = plan.draws.into_iter().find_map(|draw| draw.outcome.ok());
    Ok(certified.map(|certified| (*certified.trajectory).clone()))
}
