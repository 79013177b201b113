//! Motions through several tips beside stopping at each: `via_tips <weights folder> <robot file> <goals> <sets> [<balls>]`.
//!
//! Tips are those of random configurations, drawn by seed. A set is carried out by one request for all its tips, and by a request for
//! each from where the one before ended; of ten candidates the fastest counts.

use collision::{Scene, tracking_padding};
use datasets::scenes::{Setting, draw_target};
use denoiser::{FastModel, Manifest};
use pcc_model::{Configuration, Robot};
use planning::{
    Candidate, Goal, Models, MovingObstacles, Plan, Planner, PlannerError, Problem, Request,
    Sampler, Selection, Supervision, Via, random_configuration, select,
};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use std::path::Path;
use std::time::Instant;

const TIP_TOLERANCE: f64 = 0.01;

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn request(robot: &Robot, seed: u64, knots: usize) -> Request {
    Request {
        candidates: 10,
        seed,
        sampler: Sampler::Default,
        limits_scale: 1.0,
        padding: tracking_padding(robot, 0.01),
        knots,
        corrections: planning::MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}

/// The fastest candidate of a plan.
fn fastest(plan: &Plan, start: &Configuration) -> Option<Candidate> {
    let index = select(&plan.candidates, start, Selection::ShortestTime)?;
    Some(plan.candidates[index].clone())
}

/// Seconds of stopping at each tip, s.
fn one_after_the_other(
    planner: &Planner,
    problem: &Problem,
    goals: &[Goal],
    request: &Request,
) -> Option<f64> {
    let mut start = problem.start;
    let mut total_s = 0.0;
    for goal in goals {
        let problem = Problem {
            start,
            goal: *goal,
            ..problem.clone()
        };
        let plan = planner.plan(&problem, request, &|| false).ok()?;
        let candidate = fastest(&plan, &start)?;
        total_s += candidate.metrics.duration_s;
        start = candidate.end();
    }
    Some(total_s)
}

fn route(
    planner: &Planner,
    problem: &Problem,
    goals: &[Goal],
    request: &Request,
) -> Result<Plan, PlannerError> {
    let (last, via) = goals.split_last().expect("at least one goal");
    let via: Vec<Via> = via
        .iter()
        .map(|goal| Via {
            goal: *goal,
            tip_tolerance: TIP_TOLERANCE,
        })
        .collect();
    let problem = Problem {
        goal: *last,
        ..problem.clone()
    };
    planner.plan_route(&via, &problem, request, Supervision::new(&|| false))
}

fn problem(planner: &Planner, seed: u64, goals: usize, balls: usize) -> (Problem, Vec<Goal>) {
    let robot = planner.robot();
    let mut random = Pcg64::seed_from_u64(seed);
    let scene = (0..)
        .find_map(|index| draw_target(robot, Setting::General(Some(balls)), seed, index))
        .map(|t| t.scene);
    let scene: Scene = scene.unwrap_or_default();
    let mut draw = || loop {
        let configuration = random_configuration(robot, &mut random);
        if scene.clearance_at(robot, &configuration) > 0.1 {
            return configuration;
        }
    };
    let start = draw();
    let goals: Vec<Goal> = (0..goals).map(|_| Goal::Tip(robot.tip(&draw()))).collect();
    (
        Problem {
            start,
            goal: goals[0],
            scene: scene.clone(),
            moving: MovingObstacles::default(),
        },
        goals,
    )
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, weights, robot, counts @ ..] = arguments.as_slice() else {
        return Err("arguments: <weights folder> <robot file> <goals> <sets> [<balls>]".into());
    };
    let count = |index: usize| {
        counts
            .get(index)
            .map_or(Ok(0), |text| text.parse::<usize>())
    };
    let (goals, sets, balls) = (count(0)?, count(1)?, count(2)?);
    let robot = Robot::from_file(Path::new(robot))?;
    let file = Manifest::open(Path::new(weights))?.weights("fast")?;
    let models = Models {
        fast: Some(FastModel::from_weights(&file, robot.bending_limit)?),
        ..Models::default()
    };
    let planner = Planner::new(
        robot.to_unit().ok_or("sections of equal length")?,
        models,
        2,
    )?;
    let (mut ratios, mut times, mut rests, mut none, mut misses) = (vec![], vec![], 0, 0, 0.0_f64);
    let (mut candidates, mut stage) = (0, vec![]);
    for seed in 0..sets as u64 {
        let (problem, goals) = problem(&planner, seed, goals, balls);
        let clock = Instant::now();
        let plan = route(&planner, &problem, &goals, &request(&robot, seed, 153));
        times.push(1e3 * clock.elapsed().as_secs_f64());
        let stops_s = one_after_the_other(&planner, &problem, &goals, &request(&robot, seed, 96));
        let Ok(plan) = plan else {
            println!("{seed}: {:?} {stops_s:?}", plan.err());
            none += 1;
            continue;
        };
        let Some(candidate) = fastest(&plan, &problem.start) else {
            let failures: Vec<_> = plan
                .draws
                .iter()
                .map(|d| d.outcome.as_ref().err())
                .collect();
            println!("{seed}: none {failures:?} {stops_s:?}");
            none += 1;
            continue;
        };
        candidates += plan.candidates.len();
        stage.push(
            [planning::Stage::Condition, planning::Stage::Time].map(|s| 1e3 * plan.stages[s]),
        );
        let motion = &candidate.trajectory;
        let slow = candidate
            .passages
            .iter()
            .filter(|p| motion.at(p.time_s).velocity.norm() < 1e-3);
        rests += slow.count();
        for (passage, goal) in candidate.passages.iter().zip(&goals) {
            let Goal::Tip(tip) = goal else { continue };
            let at = planner.robot().tip(&motion.at(passage.time_s).position);
            misses = misses.max((at - tip).norm());
        }
        if let Some(stops_s) = stops_s {
            ratios.push(motion.duration() / stops_s);
        }
    }
    let worst = ratios.iter().copied().fold(0.0, f64::max);
    println!(
        "{} pairs: median ratio {:.3}, worst {worst:.3}; {none} without a motion; {rests} rests; tip miss {misses:.2e}; {candidates} candidates; {:.1} ms a route in the median",
        ratios.len(),
        median(ratios.clone()),
        median(times)
    );
    println!(
        "condition {:.1}, through {:.1}",
        median(stage.iter().map(|s| s[0]).collect()),
        median(stage.iter().map(|s| s[1]).collect())
    );
    Ok(())
}
