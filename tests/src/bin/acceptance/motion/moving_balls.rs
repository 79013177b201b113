//! Balls that cross the workspace: kept on the way to a tip among them, beside an arm that is stopped and plans again.

use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::{GoalSender, ScenePublisher};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{GoalState, LoopState};
use shared_types::message::Cycle;
use shared_types::valid::{Goal, PlanRequest};
use tests::brute_force::{Ball, Body, Tendons};
use tests::crossing_balls::Crossing;
use tests::judge::{Judge, SENT_USE};
use tests::listener::{Heard, Listener};
use tests::process::wait_for;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::standing::stays_clear_after_a_stop;
use crate::report::Report;
use crate::scale::Scale;

/// Seed of the first run: nothing was trained with it.
const SEED: u64 = 88_000;
/// Mean speed of the tip on its way to a random tip without balls, m/s.
const TIP_SPEED_M_S: f64 = 1.0;
/// Time between two scenes, and for how long each is believed.
const SCENE_PERIOD: Duration = Duration::from_millis(20);
const SCENE_LIFETIME: Duration = Duration::from_millis(100);
/// A run ends when the tip is there, or after this time.
const LONGEST_RUN: Duration = Duration::from_secs(20);
/// In every second run the balls appear so long after the goal was given: mostly in motion.
const APPEAR_AFTER: Duration = Duration::from_millis(350);

/// Who brings the tip there.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Arm {
    /// The goal that stays.
    Kept,
    /// Executes a plan among the balls, and plans again where it was stopped.
    StopThenPlan,
}

/// What came of a run.
struct Run {
    reached_s: Option<f64>,
    /// Least clearance while the balls were there, m.
    clearance_m: f64,
    /// Whether a stop right after the balls were published, and standing still from then on, would have stayed clear.
    stop_is_clear: bool,
    replans: u64,
    lasted_s: f64,
}

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "a goal and live scenes to planner-daemon";
    report.group("moving balls", command, |report| {
        let count = scale.pick(10, 500);
        let mut stack = Stack::running(&Settings::default())?;
        let file = std::fs::read_to_string(stack.world.config("robots/unit.toml"))?;
        let body = Body::from_robot_file(&file);
        let listener = Listener::start(&stack.world.options);
        let mut judge = Judge::new(stack.world.robot.tendon_limits);
        let mut arms = [(Arm::Kept, Vec::new()), (Arm::StopThenPlan, Vec::new())];
        for index in 0..count as u64 {
            for (arm, runs) in &mut arms {
                let mut run = one(&mut stack, *arm, index, &listener, &body)?;
                judge.look(&run.1);
                run.1 = Heard::default();
                runs.push(run.0);
            }
            println!("  {} of {count} runs", index + 1);
        }
        let [(_, kept), (_, stopping)] = &arms;
        show(report, kept, stopping, &judge);
        Ok(())
    });
}

/// One run of an arm, and what was heard.
fn one(
    stack: &mut Stack,
    arm: Arm,
    index: u64,
    listener: &Listener,
    body: &Body,
) -> anyhow::Result<(Run, Heard)> {
    let fastest_m_s = TIP_SPEED_M_S * if index % 4 < 2 { 0.5 } else { 1.0 };
    let crossing = Crossing::draw(&stack.world.unit_robot(), SEED + index, fastest_m_s);
    go_to_start(stack, &crossing)?;
    drop(listener.take());
    let mut scenes = ScenePublisher::connect(&stack.world.options, "crossing")?;
    let appear_after = if index.is_multiple_of(2) {
        Duration::ZERO
    } else {
        APPEAR_AFTER
    };
    let mut follower = Follower::new(stack, arm, &crossing)?;
    let begun = Instant::now();
    let mut appeared_ns = None;
    let mut next_scene = begun + appear_after;
    if appear_after.is_zero() {
        appeared_ns = Some(publish(&mut scenes, &crossing, None)?);
        next_scene += SCENE_PERIOD;
        sleep(Duration::from_millis(3));
    }
    let mut reached_s = None;
    while begun.elapsed() < LONGEST_RUN {
        if Instant::now() >= next_scene {
            appeared_ns = Some(publish(&mut scenes, &crossing, appeared_ns)?);
            next_scene += SCENE_PERIOD;
        }
        if reached_s.is_none() && follower.step(stack)? {
            reached_s = Some(begun.elapsed().as_secs_f64());
        }
        let since_s = appeared_ns.map_or(0.0, |ns| (mono_now_ns() - ns) as f64 * 1e-9);
        if reached_s.is_some() && since_s > crossing.gone_s() {
            break;
        }
        sleep(Duration::from_micros(500));
    }
    let lasted_s = begun.elapsed().as_secs_f64();
    let replans = follower.end(stack)?;
    scenes.take_leave()?;
    scenes.confirm(PATIENCE)?;
    rest(stack)?;
    sleep(Duration::from_millis(30));
    let heard = listener.take();
    let appeared_ns = appeared_ns.context("the balls appeared")?;
    let balls = crossing.judged(appeared_ns);
    let gone_ns = appeared_ns + (crossing.gone_s() * 1e9) as i64;
    let run = Run {
        reached_s,
        clearance_m: clearance_m(body, &heard.cycles, &balls, [appeared_ns, gone_ns]),
        stop_is_clear: stays_clear_after_a_stop(
            body,
            &stack.world.robot,
            &heard,
            &balls,
            [appeared_ns, gone_ns],
        ),
        replans,
        lasted_s,
    };
    Ok((run, heard))
}

/// Publishes the balls where they are; returns when they appeared first.
fn publish(
    scenes: &mut ScenePublisher,
    crossing: &Crossing,
    appeared_ns: Option<i64>,
) -> anyhow::Result<i64> {
    let now = mono_now_ns();
    let appeared_ns = appeared_ns.unwrap_or(now);
    let balls = crossing.after((now - appeared_ns) as f64 * 1e-9);
    scenes.publish_stamped(now, &balls, SCENE_LIFETIME)?;
    Ok(appeared_ns)
}

fn go_to_start(stack: &mut Stack, crossing: &Crossing) -> anyhow::Result<()> {
    rest(stack)?;
    let id = stack.begin_motion(Goal::Configuration(crossing.start.into()))?;
    stack.wait_for_end(id)?;
    rest(stack)
}

fn rest(stack: &mut Stack) -> anyhow::Result<()> {
    let held = wait_for("the robot rests", PATIENCE, || {
        (stack.controller_state().state == LoopState::Holding).then_some(())
    });
    held.context("beside a run")
}

/// One arm at work.
enum Follower {
    Kept(Box<GoalSender>),
    StopThenPlan {
        request: Box<PlanRequest>,
        under_way: Option<u32>,
        plans: u64,
        not_before: Instant,
    },
}

impl Follower {
    fn new(stack: &Stack, arm: Arm, crossing: &Crossing) -> anyhow::Result<Self> {
        let goal = Goal::Tip {
            position_m: crossing.tip_m,
            tolerance_m: None,
        };
        Ok(match arm {
            Arm::Kept => {
                let mut sender = GoalSender::connect(&stack.world.options)?;
                sender.give(goal, 1.0)?;
                Self::Kept(sender.into())
            }
            Arm::StopThenPlan => Self::StopThenPlan {
                request: Box::new(PlanRequest {
                    candidate_count: 4,
                    deadline: Some(Duration::from_millis(60)),
                    execute: true,
                    ..PlanRequest::from_robot(goal)
                }),
                under_way: None,
                plans: 0,
                not_before: Instant::now(),
            },
        })
    }

    /// Whether the tip is there.
    fn step(&mut self, stack: &mut Stack) -> anyhow::Result<bool> {
        match self {
            Self::Kept(goal) => {
                let status = goal.status()?;
                Ok(status.is_some_and(|status| status.state == GoalState::Reached))
            }
            Self::StopThenPlan {
                request,
                under_way,
                plans,
                not_before,
            } => {
                let state = stack.controller_state();
                if state.state != LoopState::Holding || Instant::now() < *not_before {
                    return Ok(false);
                }
                let target = match request.goal {
                    Goal::Tip { position_m, .. } => position_m,
                    Goal::Configuration(_) => unreachable!("the goal is a tip"),
                };
                let at = state.values.commanded_configuration_rad;
                if tests::stack::tip_error(&stack.world.robot, &at, &target) < 0.01 {
                    return Ok(true);
                }
                let answer = stack.client.plan(request, PATIENCE)?;
                *plans += 1;
                request.seed += 1;
                *under_way = answer.report().trajectory_id;
                // The motion begins some ms later; where there is none, as often as the keeper tries again.
                let pause = if under_way.is_some() { 30 } else { 100 };
                *not_before = Instant::now() + Duration::from_millis(pause);
                Ok(false)
            }
        }
    }

    /// Plans made.
    fn end(self, _stack: &mut Stack) -> anyhow::Result<u64> {
        match self {
            Self::Kept(mut goal) => {
                let plans = goal.status()?.map_or(0, |status| status.values.plan_count);
                goal.withdraw()?;
                goal.confirm(PATIENCE)?;
                Ok(plans)
            }
            Self::StopThenPlan { plans, .. } => Ok(plans),
        }
    }
}

/// Least clearance of what was commanded while the balls were there, m.
fn clearance_m(body: &Body, cycles: &[Cycle], balls: &[Ball], during_ns: [i64; 2]) -> f64 {
    let setpoints: Vec<(i64, Tendons)> = cycles
        .iter()
        .filter(|cycle| (during_ns[0]..=during_ns[1]).contains(&cycle.stamp_mono_ns))
        .map(|cycle| (cycle.stamp_mono_ns, cycle.setpoint_m))
        .collect();
    body.least_clearance(&setpoints, |_| balls).at_least_m()
}

fn show(report: &mut Report, kept: &[Run], stopping: &[Run], judge: &Judge) {
    let line = |what: &str| format!("moving balls: {what}");
    for (runs, name) in [
        (kept, "kept on the way"),
        (stopping, "stop, then plan again"),
    ] {
        let touched = |run: &&Run| run.clearance_m < 0.0;
        let contacts = runs.iter().filter(touched).count();
        let avoidable = runs
            .iter()
            .filter(touched)
            .filter(|run| run.stop_is_clear)
            .count();
        let reached = runs.iter().filter(|run| run.reached_s.is_some()).count();
        let figure = format!(
            "{reached} of {} reached, median {:.2} s; contacts {contacts}, {avoidable} of them avoidable by a stop right after the balls \
             appeared; {:.1} plans a second",
            runs.len(),
            median(runs.iter().filter_map(|run| run.reached_s).collect()),
            runs.iter().map(|run| run.replans as f64).sum::<f64>()
                / runs.iter().map(|run| run.lasted_s).sum::<f64>()
        );
        report.shown(&line(name), figure);
    }
    let avoidable: Vec<String> = (0..kept.len())
        .filter(|&index| kept[index].clearance_m < 0.0 && kept[index].stop_is_clear)
        .map(|index| format!("run {index}: {:.4} m", kept[index].clearance_m))
        .collect();
    report.none_of(&line("avoidable contacts"), &avoidable);
    let reached = |runs: &[Run]| runs.iter().filter(|run| run.reached_s.is_some()).count();
    let (own, others) = (reached(kept), reached(stopping));
    report.check(
        &line("targets reached"),
        own.to_string(),
        &format!(">= {others} of stop, then plan again"),
        own >= others,
    );
    let both = kept.iter().zip(stopping);
    let both = both.filter_map(|(own, other)| Some((own.reached_s?, other.reached_s?)));
    let (own, others): (Vec<f64>, Vec<f64>) = both.unzip();
    let what = "median time where both arrive ÷ that of stop, then plan again";
    report.at_most(&line(what), median(own) / median(others), 0.8);
    let verdict = judge.verdict();
    let offences = verdict.offence_count;
    report.check(
        &line("set-points: offences"),
        offences.to_string(),
        "0",
        offences == 0,
    );
    let largest = verdict.velocity.max(verdict.acceleration);
    report.at_most(&line("set-points: largest ÷ limit"), largest, SENT_USE);
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
