//! Random queues of tips in random scenes: what was asked for, what was accepted, and everything that was heard meanwhile.

use std::thread::sleep;
use std::time::Duration;

use client::ResultView;
use rand::RngExt;
use rand_pcg::Pcg64;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState, StartKind};
use shared_types::valid::{Goal, PlanRequest};
use tests::geometry::seeded;
use tests::judge::Judge;
use tests::listener::Listener;
use tests::passages::Position;
use tests::replans::{ReplanScene, random_pause};
use tests::stack::{PATIENCE, Part, Stack};

use super::queue::{Accepted, Asked, Queue};
use super::queue_figures::Figures;
use super::replan_run::{Population, balls, refusal};

/// Seed of scenes, tips, divisions and pauses: nothing was trained with it.
const SEED: u64 = 9_301;
/// Fewest and most tips of a queue.
const TIPS: [usize; 2] = [2, 6];
/// Candidates of a request.
const CANDIDATES: usize = 4;
/// Longest time that an answer may take: a route takes longer than the daemon's default.
const DEADLINE: Duration = Duration::from_millis(500);
/// Queues in one scene.
const IN_A_SCENE: usize = 10;
/// Share of queues that are asked for in one request.
const WHOLE: f64 = 1.0 / 3.0;
/// Shortest and longest pause before goals are appended at the shipped limits.
const PAUSES: [Duration; 2] = [Duration::from_millis(50), Duration::from_millis(2_500)];
/// Time after which everything about a motion that is over has been heard.
const HEARD_WITHIN: Duration = Duration::from_millis(100);

/// Carries out so many queues.
pub(super) fn run(population: &Population) -> anyhow::Result<Figures> {
    let mut stack = Stack::running(&population.settings)?;
    let queues = population.count;
    let pauses = PAUSES.map(|pause| pause.div_f64(population.time_factor));
    let body = stack.world.body();
    let robot = stack.world.unit_robot();
    let listener = Listener::start(&stack.world.options);
    let mut results = ResultView::connect(&stack.world.options)?;
    let mut judge = Judge::new(stack.world.robot.tendon_limits);
    let mut figures = Figures::default();
    let mut random = seeded(SEED);
    let mut index = 0;
    while figures.queues < queues {
        let standing = stack.commanded();
        let scene = ReplanScene::around(&robot, &standing, SEED, &mut index);
        figures.asked.scenes += 1;
        figures.asked.scenes_drawn = index;
        for _ in 0..IN_A_SCENE.min(queues - figures.queues) {
            let queue = carry_out(
                &mut stack,
                &mut results,
                &scene,
                pauses,
                &mut figures.asked,
                &mut random,
            )?;
            sleep(HEARD_WITHIN);
            let heard = listener.take();
            judge.look(&heard);
            figures.look(&body, &queue, &heard, &balls(&scene));
            if queue.accepted.is_empty() {
                // Nothing may lead away from where the robot rests: the next scene is another one.
                break;
            }
        }
        println!("  {} of {queues} queues", figures.queues);
    }
    figures.sent = judge.verdict().clone();
    Ok(figures)
}

/// Asks for a queue, and waits until the robot rests.
fn carry_out(
    stack: &mut Stack,
    results: &mut ResultView,
    scene: &ReplanScene,
    [shortest, longest]: [Duration; 2],
    asked: &mut Asked,
    random: &mut Pcg64,
) -> anyhow::Result<Queue> {
    let mut queue = Queue::default();
    queue.between_mono_ns[0] = mono_now_ns();
    let parts = parts(&tips(stack, scene, random), random);
    asked.whole += usize::from(parts.len() == 1);
    for (index, tips_m) in parts.into_iter().enumerate() {
        if index > 0 {
            sleep(random_pause(shortest, longest, random));
        }
        let was_moving = is_moving(stack)?;
        let request = request(&tips_m, scene, asked.requests as u64, index > 0);
        let answer = stack.client.plan(&request, PATIENCE)?;
        let report = answer.report();
        asked.requests += 1;
        asked.appended_in_motion += usize::from(index > 0 && was_moving);
        match report.trajectory_id {
            Some(trajectory_id) => queue.accepted.push(Accepted {
                trajectory_id,
                tips_m,
            }),
            None => {
                let cause = refusal(report.outcome, &report.reason);
                *asked.refused.entry(cause).or_default() += 1;
                asked.tips_refused += tips_m.len();
            }
        }
        if queue.accepted.is_empty() {
            asked.not_begun += 1;
            break;
        }
    }
    if let Some(last) = queue.accepted.last() {
        // Where it has no result, that is found among those heard.
        let _ = results.wait_for(last.trajectory_id, PATIENCE)?;
    }
    stack.wait_until_held()?;
    queue.between_mono_ns[1] = mono_now_ns();
    Ok(queue)
}

fn is_moving(stack: &mut Stack) -> anyhow::Result<bool> {
    let state = stack.controller_state();
    anyhow::ensure!(
        state.fault == LoopFault::None,
        "the controller is in fault ({}): {}",
        state.fault,
        stack.process(Part::Controller).log()
    );
    Ok(state.state == LoopState::Executing)
}

fn tips(stack: &Stack, scene: &ReplanScene, random: &mut Pcg64) -> Vec<Position> {
    let robot = stack.world.unit_robot();
    let count = random.random_range(TIPS[0]..=TIPS[1]);
    let tip = |_| scene.tip(&robot, random).into();
    (0..count).map(tip).collect()
}

/// Divides tips among requests: all in one, or several in each.
fn parts(tips_m: &[Position], random: &mut Pcg64) -> Vec<Vec<Position>> {
    if random.random_bool(WHOLE) {
        return vec![tips_m.to_vec()];
    }
    let (mut left, mut parts) = (tips_m, Vec::new());
    while !left.is_empty() {
        let most = left.len().min(tips_m.len() - 1);
        let (part, rest) = left.split_at(random.random_range(1..=most));
        parts.push(part.to_vec());
        left = rest;
    }
    parts
}

/// A request for tips from where the robot is, or after those that it has ahead.
fn request(tips_m: &[Position], scene: &ReplanScene, seed: u64, appends: bool) -> PlanRequest {
    let tip = |position_m: &Position| Goal::tip(*position_m);
    let mut via: Vec<Goal> = tips_m.iter().map(tip).collect();
    let goal = via.pop().expect("there is a tip");
    PlanRequest {
        start: match appends {
            true => StartKind::AfterGoals,
            false => StartKind::Robot,
        },
        via,
        candidate_count: CANDIDATES,
        seed,
        deadline: Some(DEADLINE),
        execute: true,
        balls: scene.balls.clone(),
        ..PlanRequest::from_robot(goal)
    }
}
