//! Replans at random instants of motion, one after the other, and everything that was heard meanwhile.

use std::fs::File;
use std::io::Write;
use std::thread::sleep;
use std::time::{Duration, Instant};

use rand_pcg::Pcg64;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState, Outcome};
use shared_types::valid::PlanRequest;
use tests::brute_force::{Ball, Body};
use tests::geometry::seeded;
use tests::judge::Judge;
use tests::knots::{Knot, state_at};
use tests::listener::{Heard, Listener, Published};
use tests::replans::{Destination, ReplanScene, StopThenGo, random_pause, replan, stop_then_go};
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

use super::figures::{Answered, Asked, Figures, first_followed, motion_of};
use crate::runs::folder;

/// Seed of scenes, tips and pauses: nothing was trained with it.
const SEED: u64 = 9_101;
/// Replans in one scene.
const IN_A_SCENE: usize = 25;
/// Shortest time within which the pause between two replans is drawn, at the shipped limits, where a motion is shorter: it is drawn from none
/// to the whole motion that was asked for.
const SHORTEST_MOTION: Duration = Duration::from_millis(60);

/// How replans, or queues, are made.
pub(super) struct Population {
    pub(super) settings: Settings,
    /// How many times as fast as shipped everything happens.
    pub(super) time_factor: f64,
    /// How many of them.
    pub(super) count: usize,
}

/// Replans until so many have begun in motion or were refused there.
pub(super) fn run(population: &Population) -> anyhow::Result<Figures> {
    let mut stack = Stack::running(&population.settings)?;
    let body = stack.world.body();
    let robot = stack.world.unit_robot();
    let listener = Listener::start(&stack.world.options);
    let mut judge = Judge::new(stack.world.robot.tendon_limits);
    let mut figures = Figures::of(&stack.world.robot.tendon_limits);
    let mut random = seeded(SEED);
    let mut index = 0;
    while figures.in_motion < population.count {
        figures.faults.rest(&mut stack, figures.in_motion)?;
        let standing = stack.commanded();
        let scene = ReplanScene::around(&robot, &standing, SEED, &mut index);
        figures.scenes += 1;
        figures.scenes_drawn = index;
        let count = IN_A_SCENE
            .min(population.count.div_ceil(20))
            .min(population.count - figures.in_motion);
        let asked = replans(
            &mut stack,
            population,
            &scene,
            count,
            &mut figures,
            &mut random,
        )?;
        figures.faults.rest(&mut stack, figures.in_motion)?;
        sleep(Duration::from_millis(50));
        let heard = listener.take();
        judge.look(&heard);
        figures.look_at_requests(asked, &heard);
        figures.look(&body, &heard, &balls(&scene));
        references(&mut stack, &body, &scene, &heard, &mut figures)?;
        println!("  {} of {} replans", figures.in_motion, population.count);
    }
    let log = stack.process(Part::Daemon).log();
    figures.made_again = made_again(&log);
    let chosen_again = log
        .lines()
        .filter_map(|line| line.split("another is chosen: ").nth(1));
    for work in chosen_again {
        *figures.chosen_again.entry(work.to_owned()).or_default() += 1;
    }
    figures.sent = judge.verdict().clone();
    Ok(figures)
}

/// Why motions that came too late for their switch were joined or planned again, as the daemon's log tells.
pub(super) fn made_again(log: &str) -> Vec<String> {
    let made_again = log.lines().filter_map(|line| {
        let again = ["is made again: ", "is joined again: "];
        again.iter().find_map(|words| line.split(words).nth(1))
    });
    let missed = made_again.filter(|why| why.starts_with("switch missed"));
    missed.map(str::to_owned).collect()
}

/// The balls of a scene as they are looked at.
pub(super) fn balls(scene: &ReplanScene) -> Vec<Ball> {
    let ball = |ball: &shared_types::message::Ball| Ball::resting(ball.centre_m, ball.radius_m);
    scene.balls.iter().map(ball).collect()
}

/// Asks for tips one after the other until so many have found the robot in motion, as its states tell, or the controller is in fault.
fn replans(
    stack: &mut Stack,
    population: &Population,
    scene: &ReplanScene,
    count: usize,
    figures: &mut Figures,
    random: &mut Pcg64,
) -> anyhow::Result<Vec<Asked>> {
    let robot = stack.world.unit_robot();
    let shortest = SHORTEST_MOTION.div_f64(population.time_factor);
    let (mut asked, mut in_motion) = (Vec::new(), 0);
    while in_motion < count {
        let tip = scene.tip(&robot, random);
        let state = stack.controller_state();
        if state.fault != LoopFault::None {
            break;
        }
        let was_moving = state.state == LoopState::Executing;
        let request = replan(tip.into(), &scene.balls, figures.requests as u64);
        let (answered, duration) = ask(stack, &request)?;
        figures.requests += 1;
        in_motion += usize::from(was_moving);
        let is_refused = matches!(answered.answered, Answered::Refused(_));
        asked.push(answered);
        if is_refused && !was_moving {
            // Nothing may lead away from where the robot rests: the next scene is another one.
            break;
        }
        sleep(random_pause(Duration::ZERO, duration.max(shortest), random));
    }
    Ok(asked)
}

/// What came of a request, and how long the selected motion lasts.
fn ask(stack: &mut Stack, request: &PlanRequest) -> anyhow::Result<(Asked, Duration)> {
    let (at, mono_ns) = (Instant::now(), mono_now_ns());
    let answer = stack.client.plan(request, PATIENCE)?;
    let took = at.elapsed();
    let report = answer.report();
    let refused = || refusal(report.outcome, &report.reason);
    let answered = report.trajectory_id.map(Answered::Published);
    let duration_s = |index: usize| report.candidates[index].duration_s;
    let lasts_s = report.selected.map_or(0.0, duration_s);
    let asked = Asked {
        seed: request.seed,
        at,
        mono_ns,
        answered: answered.unwrap_or_else(|| Answered::Refused(refused())),
        took,
        stages_ns: report.stages_ns,
        is_truncated: report.outcome == Outcome::Truncated,
    };
    Ok((asked, Duration::from_secs_f64(lasts_s)))
}

/// A refusal without the numbers that differ from one to the next.
pub(super) fn refusal(outcome: Outcome, reason: &str) -> String {
    let words = reason.split_whitespace();
    let words = words.filter(|word| !word.chars().any(|c| c.is_ascii_digit()));
    format!("{outcome}: {}", words.collect::<Vec<_>>().join(" "))
}

/// What each motion that was joined would have taken with a stop before it.
fn references(
    stack: &mut Stack,
    body: &Body,
    scene: &ReplanScene,
    heard: &Heard,
    figures: &mut Figures,
) -> anyhow::Result<()> {
    for motion in &heard.motions {
        let asked = figures.published.get(&motion.id);
        let (seed, in_motion) = asked.map_or((0, false), |it| (it.asked.seed, it.in_motion));
        let is_truncated = asked.is_some_and(|it| it.asked.is_truncated);
        let is_begun = first_followed(&heard.cycles, motion.id).is_some();
        if motion.leaves.is_none() || !is_begun {
            figures.began_at_rest += usize::from(in_motion && motion.leaves.is_none());
            if in_motion {
                figures.wins_nothing();
            }
            continue;
        }
        let (Some(first), Some(last)) = (motion.knots.first(), motion.knots.last()) else {
            continue;
        };
        if !in_motion {
            continue;
        }
        let destination = Destination {
            end: last.values[0],
            balls: &scene.balls,
            seed,
        };
        let reference = stop_then_go(stack, body, first, &destination)?;
        if let Some((lead_s, at_request)) = when_asked(motion, heard, figures) {
            let reference = stop_then_go(stack, body, &at_request, &destination)?;
            figures.compare_from_the_request(motion, &reference, lead_s);
        }
        let by_the_shortest_stop = || reference.by_the_shortest_stop(stack, body, &destination);
        if figures.compare(motion, &reference, is_truncated, by_the_shortest_stop)? {
            let log = stack.process(Part::Daemon).log();
            let chosen_again = format!("plan {}: its switch was too near", motion.plan_id);
            let chosen_again = log.lines().find(|line| line.contains(&chosen_again));
            keep_later(motion, &reference, scene, (seed, chosen_again))?;
        }
    }
    Ok(())
}

/// How long before its switch a joined motion was asked for, s, and the state of the motion that it leaves then; none where that had not
/// begun yet.
fn when_asked(motion: &Published, heard: &Heard, figures: &Figures) -> Option<(f64, Knot)> {
    let (left, at_s) = motion.leaves?;
    let asked_ns = figures.published.get(&motion.id)?.asked.mono_ns;
    let lead_s = (motion.begin_mono_ns - asked_ns) as f64 * 1e-9;
    let left = motion_of(&heard.motions, left)?;
    let values = (lead_s <= at_s).then(|| state_at(&left.knots, at_s - lead_s))??;
    Some((
        lead_s,
        Knot {
            time_s: 0.0,
            values,
        },
    ))
}

/// Adds a motion that arrived later than after a stop to a file, with all that it takes to plan it again.
fn keep_later(
    motion: &Published,
    reference: &StopThenGo,
    scene: &ReplanScene,
    (seed, chosen_again): (u64, Option<&str>),
) -> anyhow::Result<()> {
    let knots = motion.knots.iter();
    let knots: Vec<_> = knots.map(|knot| (knot.time_s, knot.values)).collect();
    let balls = scene.balls.iter();
    let balls: Vec<_> = balls.map(|ball| (ball.centre_m, ball.radius_m)).collect();
    let case = serde_json::json!({
        "seed": seed,
        "chosen_again": chosen_again,
        "balls": balls,
        "knots": knots,
        "go_s": reference.go_s,
        "own_stop_s": reference.own_stop_s,
    });
    std::fs::create_dir_all(folder())?;
    let mut file = File::options()
        .create(true)
        .append(true)
        .open(folder().join("later-replans.jsonl"))?;
    Ok(writeln!(file, "{case}")?)
}
