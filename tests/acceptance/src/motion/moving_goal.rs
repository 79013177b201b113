//! A tip goal that moves: kept on the way to it, beside an arm that stops to replan; and one that goes out of reach.

use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::GoalSender;
use shared_types::capacity::DOF;
use shared_types::clock::mono_now_ns;
use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use shared_types::valid::{Command, Goal, PlanRequest};
use tests::brute_force::Body;
use tests::judge::{Judge, Verdict};
use tests::listener::Listener;
use tests::moving_target::MovingTarget;
use tests::process::wait_for;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::setpoints::{no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;

/// Time between two messages on where the goal is.
const PERIOD: Duration = Duration::from_millis(10);
/// Cycles of which one is looked at.
const EVERY: usize = 5;
/// How far the goal moves before the arm that stops to replan does, m.
const STOPS_AFTER_M: f64 = 0.1;

/// From here all arms go to where the target begins, so that they begin there in the same configuration.
const STRAIGHT: [f64; DOF] = [0.0; DOF];

/// How a robot follows the target.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Arm {
    /// By the goal that stays.
    Kept,
    /// Goes to the target, rests, and goes to it again.
    RestsFirst(Aim),
    /// As that, but stops as soon as what it aims at is too far from where it goes.
    Stops(Aim),
}

/// What an arm that stops aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    /// Where the target is.
    There,
    /// Where it will be after as long as the last motion took, straight ahead.
    Ahead,
    /// The same on the circle of its velocity and its turn in the last 0.2 s.
    OnItsCircle,
}

/// The arms that rest before they replan.
const STOPPING: [(Arm, &str); 6] = [
    (Arm::RestsFirst(Aim::There), "rests first"),
    (Arm::RestsFirst(Aim::Ahead), "rests first, aims ahead"),
    (
        Arm::RestsFirst(Aim::OnItsCircle),
        "rests first, aims ahead on a circle",
    ),
    (Arm::Stops(Aim::There), "stops"),
    (Arm::Stops(Aim::Ahead), "stops, aims ahead"),
    (
        Arm::Stops(Aim::OnItsCircle),
        "stops, aims ahead on a circle",
    ),
];

impl Aim {
    /// Where a target is aimed at that is there after `elapsed_s`, when a motion takes `ahead_s`, m.
    fn at(self, target: &MovingTarget, elapsed_s: f64, ahead_s: f64) -> [f64; 3] {
        let (now, velocity) = (target.at(elapsed_s), target.velocity_m_s(elapsed_s));
        let way: [f64; 3] = match self {
            Self::There => [0.0; 3],
            Self::Ahead => velocity.map(|part| part * ahead_s),
            Self::OnItsCircle => way_on_circle(target, elapsed_s, ahead_s),
        };
        std::array::from_fn(|axis| now[axis] + way[axis])
    }
}

/// Way of a target that goes on turning as it has in the last 0.2 s, m.
fn way_on_circle(target: &MovingTarget, elapsed_s: f64, ahead_s: f64) -> [f64; 3] {
    let [before, now] = [elapsed_s - 0.2, elapsed_s].map(|at| target.velocity_m_s(at.max(0.0)));
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let change: [f64; 3] = std::array::from_fn(|axis| (now[axis] - before[axis]) / 0.2);
    let along = dot(change, now) / dot(now, now);
    let turn: [f64; 3] = std::array::from_fn(|axis| change[axis] - along * now[axis]);
    let [speed, bend] = [now, turn].map(|vector| dot(vector, vector).sqrt());
    let angle = (bend / speed * ahead_s).min(1.5);
    let turns = elapsed_s >= 0.2 && speed > 0.0 && bend > 0.0 && angle >= 1e-6;
    if !turns {
        return now.map(|part| part * ahead_s);
    }
    let radius = speed * speed / bend;
    std::array::from_fn(|axis| {
        radius * (now[axis] / speed * angle.sin() + turn[axis] / bend * (1.0 - angle.cos()))
    })
}

/// What one arm did.
struct Followed {
    /// Mean distance of the tip to the target, and the largest one, m.
    mean_error_m: f64,
    largest_error_m: f64,
    /// Motions begun.
    motions: u64,
    /// What was sent to the robot.
    sent: Verdict,
}

impl Followed {
    fn text(&self) -> String {
        let Self {
            mean_error_m,
            largest_error_m,
            motions,
            ..
        } = self;
        format!(
            "mean tip error {mean_error_m:.4} m (largest {largest_error_m:.3} m) in {motions} motions"
        )
    }
}

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "a moving goal to planner-daemon";
    report.group("goals, moving", command, |report| {
        let lasts = Duration::from_secs(scale.pick(8, 30));
        let mut targets = vec![
            MovingTarget::circle(0.5, 0.2, lasts),
            MovingTarget::circle(0.5, 0.5, lasts),
            MovingTarget::walk(1, 0.3, lasts),
        ];
        if scale.full {
            targets.push(MovingTarget::circle(0.3, 0.1, lasts));
            targets.push(MovingTarget::circle(0.6, 1.0, lasts));
            let walks = (2..10).map(|seed| {
                let speed = [0.1, 0.3, 0.6, 1.0][seed as usize % 4];
                MovingTarget::walk(seed, speed, lasts)
            });
            targets.extend(walks);
        }
        let mut stack = Stack::running(&Settings::default())?;
        let mut sums = [0.0; 2];
        for target in &targets {
            let kept = follow(&mut stack, Arm::Kept, target)?;
            let name = format!("goals, moving: {}", target.name);
            report.shown(&format!("{name}: kept on the way"), kept.text());
            let mut best = f64::INFINITY;
            for (arm, what) in STOPPING {
                let other = follow(&mut stack, arm, target)?;
                best = best.min(other.mean_error_m);
                report.shown(&format!("{name}: {what}"), other.text());
            }
            sums[0] += kept.mean_error_m;
            sums[1] += best;
            let what = format!(
                "goals, moving: {}: mean tip error ÷ that of the best arm that stops to replan",
                target.name
            );
            let best_m = if best.is_finite() { best } else { f64::NAN };
            report.at_most(&what, kept.mean_error_m / best_m, 0.5);
            let line = |what: &str| format!("{name}: {what}");
            within_limits(report, &line, &kept.sent);
            no_offences(report, &line, &kept.sent);
        }
        let what =
            "goals, moving: mean tip error of all ÷ that of the best arms that stop to replan";
        report.at_most(what, sums[0] / sums[1], 0.5);
        Ok(())
    });
}

/// Begins at rest where the target is, in the configuration that all arms begin in, and follows it.
fn follow(stack: &mut Stack, arm: Arm, target: &MovingTarget) -> anyhow::Result<Followed> {
    let body = stack.world.body();
    for goal in [Goal::Configuration(STRAIGHT), Goal::tip(target.at(0.0))] {
        stack.wait_until_held()?;
        let id = stack.begin_motion(goal)?;
        stack.wait_for_end(id)?;
    }
    stack.wait_until_held()?;
    let listener = Listener::start(&stack.world.options);
    let (begun, begun_ns) = (Instant::now(), mono_now_ns());
    let motions = match arm {
        Arm::Kept => keep(stack, target, begun)?,
        Arm::RestsFirst(aim) => replan_at_rest(stack, target, begun, false, aim)?,
        Arm::Stops(aim) => replan_at_rest(stack, target, begun, true, aim)?,
    };
    let heard = listener.take();
    let mut judge = Judge::new(stack.world.robot.tendon_limits);
    judge.look(&heard);
    let errors_m = errors_m(&body, &heard.cycles, target, begun_ns);
    Ok(Followed {
        mean_error_m: errors_m.iter().sum::<f64>() / errors_m.len() as f64,
        largest_error_m: errors_m.iter().copied().fold(0.0, f64::max),
        motions,
        sent: judge.verdict().clone(),
    })
}

fn keep(stack: &Stack, target: &MovingTarget, begun: Instant) -> anyhow::Result<u64> {
    let mut goal = GoalSender::connect(&stack.world.options)?;
    goal.give(Goal::tip(target.at(0.0)), 1.0)?;
    while begun.elapsed() < target.lasts() {
        let elapsed_s = begun.elapsed().as_secs_f64();
        goal.move_to(
            Goal::tip(target.at(elapsed_s)),
            target.velocity_m_s(elapsed_s),
        )?;
        sleep(PERIOD);
    }
    let status = goal
        .status()?
        .context("the daemon says nothing of the goal")?;
    goal.withdraw()?;
    goal.confirm(PATIENCE)?;
    Ok(status.values.motion_count)
}

/// Plans whenever the robot rests, within the goal keeper's deadline, and stops it where the arm does.
fn replan_at_rest(
    stack: &mut Stack,
    target: &MovingTarget,
    begun: Instant,
    stops: bool,
    aim: Aim,
) -> anyhow::Result<u64> {
    let (mut motions, mut going_to, mut ahead_s) = (0, target.at(0.0), 0.3);
    while begun.elapsed() < target.lasts() {
        let elapsed_s = begun.elapsed().as_secs_f64();
        let aim = |ahead_s: f64| aim.at(target, elapsed_s, ahead_s);
        let state = stack.controller_state();
        match state.state {
            LoopState::Holding => {
                let request = PlanRequest {
                    candidate_count: 10,
                    deadline: Some(Duration::from_millis(60)),
                    execute: true,
                    ..PlanRequest::from_robot(Goal::tip(aim(ahead_s)))
                };
                let answer = stack.client.plan(&request, PATIENCE)?;
                let report = answer.report();
                if let (Some(_), Some(selected)) = (report.trajectory_id, report.selected) {
                    (motions, going_to) = (motions + 1, aim(ahead_s));
                    ahead_s = report.candidates[selected].duration_s;
                    wait_until_begun(stack);
                }
            }
            LoopState::Executing if stops => {
                let left_s = (ahead_s - state.values.trajectory_time_s).max(0.0);
                if apart(aim(left_s), going_to) > STOPS_AFTER_M {
                    stack.controller.command(Command::Stop, PATIENCE)?;
                }
            }
            _ => sleep(Duration::from_millis(1)),
        }
    }
    Ok(motions)
}

/// Waits until the controller has taken a motion up; where it does not, the next look at its state tells.
fn wait_until_begun(stack: &mut Stack) {
    let _ = wait_for("the motion begins", Duration::from_millis(500), || {
        (stack.controller_state().state != LoopState::Holding).then_some(())
    });
}

/// Distance of two points, m.
pub(super) fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// Distances of the commanded tip to the target from the first goal until the target rests, m.
fn errors_m(body: &Body, cycles: &[Cycle], target: &MovingTarget, begun_ns: i64) -> Vec<f64> {
    cycles
        .iter()
        .step_by(EVERY)
        .map(|cycle| ((cycle.stamp_mono_ns - begun_ns) as f64 * 1e-9, cycle))
        .filter(|(elapsed_s, _)| (0.0..target.lasts().as_secs_f64()).contains(elapsed_s))
        .map(|(elapsed_s, cycle)| {
            let configuration = body.explain(&cycle.setpoint_m).configuration;
            apart(body.tip(&configuration), target.at(elapsed_s))
        })
        .collect()
}
