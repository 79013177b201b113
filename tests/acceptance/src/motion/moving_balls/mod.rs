//! Balls that cross the workspace: kept on the way to a tip among them, beside arms that are stopped and plan again.

mod arm;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use client::ScenePublisher;
use serde::{Deserialize, Serialize};
use shared_types::clock::mono_now_ns;
use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use shared_types::valid::{Command, Goal};
use tests::brute_force::{Ball, Body, Tendons};
use tests::crossing_balls::Crossing;
use tests::judge::{Judge, Verdict};
use tests::listener::Listener;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use self::arm::{Arm, Follower, TOLERANCE_M};
use super::moving_goal::apart;
use super::setpoints::{no_offences, within_limits};
use super::standing::stays_clear_after_a_stop;
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::median;

/// Seed of the first run: nothing was trained with it.
const SEED: u64 = 88_000;
/// Speed of the tip on its way to a random tip, m/s: what is measured is shown beside it.
const TIP_SPEED_M_S: f64 = 1.0;
/// Time between two scenes, and for how long each is believed.
const SCENE_PERIOD: Duration = Duration::from_millis(20);
const SCENE_LIFETIME: Duration = Duration::from_millis(100);
/// A run ends when the tip is there, or after this time.
const LONGEST_RUN: Duration = Duration::from_secs(20);
/// Time between two looks at a robot that stays where it is, nanoseconds.
const LOOK_NS: usize = 1_000_000;
/// Cycles between two looks at the tip's speed.
const SPEED_LOOKS: usize = 20;

/// What came of the runs of all arms with the same balls.
#[derive(Deserialize, Serialize)]
struct Round {
    runs: [Run; 3],
    /// What was sent until its end, since the first one's begin.
    sent: Verdict,
}

/// What came of a run.
#[derive(Clone, Deserialize, Serialize)]
struct Run {
    /// When the commanded tip came to rest at the target, s.
    reached_s: Option<f64>,
    /// Whether balls may be as fast as the tip, or half as fast.
    is_fast: bool,
    /// How near each ball came.
    touches: Vec<Touch>,
    replans: u64,
    lasted_s: f64,
    /// Largest speed of the commanded tip, m/s.
    #[serde(with = "crate::as_text")]
    tip_speed_m_s: f64,
}

/// How near a ball came.
#[derive(Clone, Deserialize, Serialize)]
struct Touch {
    /// Least clearance from the run's begin to its end, m.
    #[serde(with = "crate::as_text")]
    clearance_m: f64,
    /// The same of a robot that then stays where it is until the balls are gone, m.
    #[serde(with = "crate::as_text")]
    at_rest_m: f64,
    /// Whether a stop right after the ball's first scene, and standing still from then on, would have stayed clear of it.
    stop_is_clear: bool,
}

impl Touch {
    fn is_contact(&self) -> bool {
        self.comes_before_the_end() || self.at_rest_m < 0.0 || self.at_rest_m.is_nan()
    }

    fn comes_before_the_end(&self) -> bool {
        self.clearance_m < 0.0 || self.clearance_m.is_nan()
    }
}

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "a goal and live scenes to planner-daemon";
    report.group("moving balls", command, |report| {
        let count = scale.pick(10, 500);
        let mut stack = Stack::running(&Settings::default())?;
        let body = stack.world.body();
        let listener = Listener::start(&stack.world.options);
        let mut judge = Judge::new(stack.world.robot.tendon_limits);
        let mut arms = Arm::ALL.map(|_| Vec::new());
        let (mut sent, mut sent_before) = (Verdict::default(), Verdict::default());
        for index in 0..count as u64 {
            let round = report.piece(&format!("run {index}"), || {
                let mut one = |arm| one(&mut stack, arm, index, &listener, &mut judge, &body);
                let [kept, stopped, as_seen] = Arm::ALL;
                let runs = [one(kept)?, one(stopped)?, one(as_seen)?];
                let sent = sent_before.clone().and(judge.verdict());
                Ok(Round { runs, sent })
            })?;
            let reached_s = round.runs.each_ref().map(|run| run.reached_s);
            for (run, runs) in round.runs.into_iter().zip(&mut arms) {
                runs.push(run);
            }
            sent = round.sent;
            if judge.verdict().setpoints == 0 {
                sent_before = sent.clone();
            }
            println!(
                "  {} of {count} runs, reached after {reached_s:?} s",
                index + 1
            );
        }
        for (arm, runs) in Arm::ALL.into_iter().zip(&arms) {
            show(report, arm, runs);
        }
        let [kept, others @ ..] = &arms;
        for (arm, runs) in Arm::ALL[1..].iter().zip(others) {
            compare(report, kept, arm.name(), runs);
        }
        show_kept(report, kept, &sent);
        Ok(())
    });
}

/// One run of an arm; what was sent is judged.
fn one(
    stack: &mut Stack,
    arm: Arm,
    index: u64,
    listener: &Listener,
    judge: &mut Judge,
    body: &Body,
) -> anyhow::Result<Run> {
    let fastest_m_s = TIP_SPEED_M_S * if index % 4 < 2 { 0.5 } else { 1.0 };
    let crossing = Crossing::draw(&stack.world.unit_robot(), SEED + index, fastest_m_s);
    go_to_start(stack, &crossing)?;
    judge.look(&listener.take());
    let mut follower = Follower::new(stack, arm, &crossing)?;
    let scenes = ScenePublisher::connect(&stack.world.options, "crossing")?;
    let (begun, begun_ns) = (Instant::now(), mono_now_ns());
    let scenes = SceneFeed::start(scenes, crossing.clone(), begun_ns);
    follower.begin(&crossing)?;
    let mut is_there = false;
    while !is_there && begun.elapsed() < LONGEST_RUN {
        is_there = follower.step(stack, begun.elapsed().as_secs_f64())?;
        sleep(Duration::from_micros(500));
    }
    let lasted_s = begun.elapsed().as_secs_f64();
    let ended_ns = mono_now_ns();
    let replans = follower.end()?;
    if !is_there {
        stack.controller.command(Command::Stop, PATIENCE)?;
    }
    stack.wait_until_held()?;
    let rests_ns = mono_now_ns();
    let published_ns = scenes.end()?;
    sleep(Duration::from_millis(30));
    let heard = listener.take();
    judge.look(&heard);
    let reached_s = arrival_s(body, &heard.cycles, crossing.tip_m, [begun_ns, ended_ns]);
    let gone_ns = begun_ns + (crossing.gone_s() * 1e9) as i64;
    let touches = crossing
        .judged(begun_ns)
        .iter()
        .zip(&published_ns)
        .map(|(ball, published_ns)| {
            let ball = std::slice::from_ref(ball);
            let seen_ns = published_ns.unwrap_or(ended_ns);
            Touch {
                clearance_m: clearance_m(body, &heard.cycles, ball, [begun_ns, rests_ns]),
                at_rest_m: clearance_at_rest_m(body, &heard.cycles, ball, [rests_ns, gone_ns]),
                stop_is_clear: seen_ns < ended_ns
                    && stays_clear_after_a_stop(
                        body,
                        stack.world.robot.tendon_limits.acceleration,
                        &heard,
                        ball,
                        [seen_ns, gone_ns],
                    ),
            }
        })
        .collect();
    Ok(Run {
        reached_s: reached_s.filter(|_| is_there),
        is_fast: fastest_m_s >= TIP_SPEED_M_S,
        touches,
        replans,
        lasted_s,
        tip_speed_m_s: largest_tip_speed_m_s(body, &heard.cycles, [begun_ns, ended_ns]),
    })
}

/// The largest speed of the commanded tip, over [`SPEED_LOOKS`] cycles each, m/s.
fn largest_tip_speed_m_s(body: &Body, cycles: &[Cycle], [from_ns, until_ns]: [i64; 2]) -> f64 {
    let during = |cycle: &&Cycle| (from_ns..=until_ns).contains(&cycle.stamp_mono_ns);
    let looks: Vec<_> = cycles.iter().filter(during).step_by(SPEED_LOOKS).collect();
    let tip = |cycle: &Cycle| body.tip(&body.explain(&cycle.setpoint_m).configuration);
    let speed = |pair: &[&Cycle]| {
        let way_m = apart(tip(pair[0]), tip(pair[1]));
        way_m / ((pair[1].stamp_mono_ns - pair[0].stamp_mono_ns) as f64 * 1e-9)
    };
    looks.windows(2).map(speed).fold(0.0, f64::max)
}

/// Scenes that a thread of its own publishes, whatever an arm waits for.
struct SceneFeed {
    ended: Arc<AtomicBool>,
    thread: JoinHandle<anyhow::Result<Vec<Option<i64>>>>,
}

impl SceneFeed {
    fn start(mut scenes: ScenePublisher, crossing: Crossing, begun_ns: i64) -> Self {
        let ended = Arc::<AtomicBool>::default();
        let is_over = Arc::clone(&ended);
        let thread = std::thread::spawn(move || {
            let mut first_ns = vec![None; crossing.balls.len()];
            let mut next = Instant::now();
            while !is_over.load(Ordering::Relaxed) {
                let now = mono_now_ns();
                let elapsed_s = (now - begun_ns) as f64 * 1e-9;
                scenes.publish_stamped(now, &crossing.seen_after(elapsed_s), SCENE_LIFETIME)?;
                for (first_ns, seen_s) in first_ns.iter_mut().zip(&crossing.seen_s) {
                    if elapsed_s >= *seen_s {
                        first_ns.get_or_insert(now);
                    }
                }
                next += SCENE_PERIOD;
                sleep(next.saturating_duration_since(Instant::now()));
            }
            scenes.take_leave()?;
            scenes.confirm(PATIENCE)?;
            Ok(first_ns)
        });
        Self { ended, thread }
    }

    /// Takes leave; returns when each ball was first published, nanoseconds.
    fn end(self) -> anyhow::Result<Vec<Option<i64>>> {
        self.ended.store(true, Ordering::Relaxed);
        let first_ns = self.thread.join();
        first_ns.map_err(|_| anyhow::anyhow!("the scenes' thread panicked"))?
    }
}

/// When the commanded tip came to rest within its tolerance for good, s; none where it is elsewhere at the end.
fn arrival_s(
    body: &Body,
    cycles: &[Cycle],
    tip_m: [f64; 3],
    [begun_ns, ended_ns]: [i64; 2],
) -> Option<f64> {
    let during = |cycle: &&Cycle| (begun_ns..=ended_ns).contains(&cycle.stamp_mono_ns);
    let is_there = |cycle: &&Cycle| {
        let tip = body.tip(&body.explain(&cycle.setpoint_m).configuration);
        cycle.state == LoopState::Holding.code() && apart(tip, tip_m) <= TOLERANCE_M
    };
    let from_the_end = cycles.iter().rev().filter(during);
    let first = from_the_end.take_while(is_there).last()?;
    Some((first.stamp_mono_ns - begun_ns) as f64 * 1e-9)
}

fn go_to_start(stack: &mut Stack, crossing: &Crossing) -> anyhow::Result<()> {
    stack.wait_until_held()?;
    let id = stack.begin_motion(Goal::Configuration(crossing.start.into()))?;
    stack.wait_for_end(id)?;
    Ok(stack.wait_until_held()?)
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

/// Least clearance of a robot that stays where it was commanded at the first of two times until the second, m.
fn clearance_at_rest_m(
    body: &Body,
    cycles: &[Cycle],
    balls: &[Ball],
    [from_ns, until_ns]: [i64; 2],
) -> f64 {
    let Some(last) = cycles
        .iter()
        .rev()
        .find(|cycle| cycle.stamp_mono_ns <= from_ns)
    else {
        return f64::NAN;
    };
    let at = &last.commanded_configuration_rad;
    let clearances = (from_ns..=until_ns)
        .step_by(LOOK_NS)
        .map(|stamp_ns| body.clearance(at, balls, stamp_ns) - body.chord_error_m());
    clearances.fold(f64::INFINITY, f64::min)
}

fn line(what: &str) -> String {
    format!("moving balls: {what}")
}

/// Shows what became of the runs of an arm.
fn show(report: &mut Report, arm: Arm, runs: &[Run]) {
    let contacts = || {
        let touches = runs.iter().flat_map(|run| &run.touches);
        touches.filter(|touch| touch.is_contact())
    };
    let on_the_way = contacts()
        .filter(|touch| touch.comes_before_the_end())
        .count();
    let avoidable = contacts().filter(|touch| touch.stop_is_clear).count();
    let contacts = contacts().count();
    let fast = runs.iter().filter(|run| run.is_fast);
    let of_fast = fast
        .flat_map(|run| &run.touches)
        .filter(|touch| touch.is_contact())
        .count();
    let reached_s: Vec<f64> = runs.iter().filter_map(|run| run.reached_s).collect();
    let speeds: Vec<f64> = runs.iter().map(|run| run.tip_speed_m_s).collect();
    let figure = format!(
        "{} of {} reached, median {:.2} s; contacts {contacts}, {of_fast} of them where balls are as fast as the tip and the others where they \
         are half as fast; {on_the_way} of them before the end and the others of a robot that stays there, {avoidable} avoidable by a stop \
         right after the ball was seen; {:.1} plans a second; largest tip speed of a run, median {:.2} m/s (balls are up to {TIP_SPEED_M_S} and half of it)",
        reached_s.len(),
        runs.len(),
        median(&reached_s),
        runs.iter().map(|run| run.replans as f64).sum::<f64>()
            / runs.iter().map(|run| run.lasted_s).sum::<f64>(),
        median(&speeds)
    );
    report.shown(&line(arm.name()), figure);
}

/// Holds the arm that is kept on the way against one that is stopped.
fn compare(report: &mut Report, kept: &[Run], name: &str, stopping: &[Run]) {
    let reached = |runs: &[Run]| runs.iter().filter(|run| run.reached_s.is_some()).count();
    let (own, others) = (reached(kept), reached(stopping));
    report.check(
        &line(&format!("targets reached, beside: {name}")),
        own.to_string(),
        &format!(">= {others}"),
        own >= others,
    );
    let both = kept.iter().zip(stopping);
    let both = both.filter_map(|(own, other)| Some((own.reached_s?, other.reached_s?)));
    let (own, others): (Vec<f64>, Vec<f64>) = both.unzip();
    let what = format!("median time where both arrive ÷ that of: {name}");
    report.at_most(&line(&what), median(&own) / median(&others), 0.8);
}

/// What the arm that is kept on the way has touched, and what all were sent.
fn show_kept(report: &mut Report, kept: &[Run], sent: &Verdict) {
    let avoidable: Vec<String> = kept
        .iter()
        .enumerate()
        .flat_map(|(index, run)| run.touches.iter().map(move |touch| (index, touch)))
        .filter(|(_, touch)| touch.is_contact() && touch.stop_is_clear)
        .map(|(index, touch)| {
            let Touch {
                clearance_m,
                at_rest_m,
                ..
            } = touch;
            format!("run {index}: {clearance_m:.4} m, {at_rest_m:.4} m at rest")
        })
        .collect();
    report.none_of(&line("avoidable contacts"), &avoidable);
    let all = || kept.iter().flat_map(|run| &run.touches);
    let clear = all().filter(|touch| touch.stop_is_clear).count();
    report.check(
        &line("balls that a certified stop right after they were seen would have stayed clear of"),
        format!("{clear} of {}", all().count()),
        "> 0",
        clear > 0,
    );
    within_limits(report, &line, sent);
    no_offences(report, &line, sent);
}
