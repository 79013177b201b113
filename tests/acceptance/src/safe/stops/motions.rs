//! Motions of the planner: straight ones, and curved ones round the balls of hard scenes.

use datasets::scenes::{Setting, draw_target};
use pcc_model::{Configuration, Robot, UnitRobot};
use planning::{Goal, Models, MovingObstacles, Planner, Problem, Request, Sampler};
use trajectory::{Knot, ParameterizationOptions, Trajectory};

const SEED: u64 = 1801;

/// `count` certified motions, straight and curved in turn.
pub(super) fn planned(robot: UnitRobot, count: usize) -> anyhow::Result<Vec<Trajectory>> {
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

/// The largest step of any tendon's jerk at a knot, ÷ the jerk limit, of each motion.
pub(super) fn largest_jerk_steps(robot: &Robot, motions: &[Trajectory]) -> Vec<f64> {
    let of_tendons = |jerk: Configuration| {
        let matrix = robot.tendons.matrix();
        (0..robot.tendons.count()).map(move |tendon| matrix.row(tendon).dot(&jerk.transpose()))
    };
    let step = |three: &[Knot]| {
        let before = jerk_between(&three[0], &three[1])[1];
        let after = jerk_between(&three[1], &three[2])[0];
        of_tendons(after - before).fold(0.0, |most: f64, step| most.max(step.abs()))
    };
    let largest = |motion: &Trajectory| {
        let steps = motion.knots().windows(3).map(step);
        steps.fold(0.0, f64::max) / robot.tendon_limits.jerk
    };
    motions.iter().map(largest).collect()
}

/// Jerk at the begin and at the end of the quintic (Hermite) through two knots, rad/s³.
fn jerk_between(from: &Knot, to: &Knot) -> [Configuration; 2] {
    let h = to.time - from.time;
    let way = (to.position - from.position) * 60.0;
    let (v0, v1) = (from.velocity * h, to.velocity * h);
    let (a0, a1) = (from.acceleration * (h * h), to.acceleration * (h * h));
    let begin = way - v0 * 36.0 - v1 * 24.0 - a0 * 9.0 + a1 * 3.0;
    let end = way - v0 * 24.0 - v1 * 36.0 - a0 * 3.0 + a1 * 9.0;
    [begin, end].map(|jerk| jerk / (h * h * h))
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
        moving: MovingObstacles::default(),
    };
    let request = Request {
        candidates: 1,
        seed: index,
        sampler,
        limits_scale: 1.0,
        padding: [0.0; 3],
        knots: ParameterizationOptions::default().knots,
        corrections: planning::MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    };
    let Ok(plan) = planner.plan(&problem, &request, &|| false) else {
        return Ok(None);
    };
    let certified = plan.draws.into_iter().find_map(|draw| draw.outcome.ok());
    Ok(certified.map(|certified| (*certified.trajectory).clone()))
}
