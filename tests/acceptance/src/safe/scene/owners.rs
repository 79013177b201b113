//! Whose scene it is, by which clock, and for how long it counts.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use client::ScenePublisher;
use pcc_model::{Configuration, Point};
use shared_types::clock::{mono_now_ns, wall_now_ns};
use shared_types::codes::{LoopState, ProcessKind, SceneRefusal};
use shared_types::ipc::{
    IpcNode, IpcOptions, controller_state_service, heartbeat_service, publisher, subscriber,
};
use shared_types::message::{ControllerState, MovingBall};
use tests::listener::Listener;
use tests::process::wait_for;
use tests::raw_scene::RawScenes;
use tests::stack::{MoveError, PATIENCE, Part, Stack};

use super::executed::wait_for_braking;
use super::scenario::{ENDS, SECOND_NS, ball, execute, refusal, settings};
use crate::report::Report;
use crate::scale::Scale;

/// Lifetime of the scenes that are not about lifetimes.
const LIFETIME_NS: i64 = SECOND_NS;
/// How the daemon names a source whose scene has ended.
const CAMERA: &str = "source \"camera\"";
/// How the daemon names an obstacle.
const IN_THE_WAY: &str = "the live scene is in the way";
/// How it names a source that it waits for.
const UNHEARD: &str = "has not been heard";
/// What refuses a motion right after a restart: the scene, or that it is not there yet.
const UNHEARD_OR_IN_THE_WAY: [&str; 2] = [IN_THE_WAY, UNHEARD];
/// How it says that a scene is expected and that there is none.
const NONE_THERE: &str = "one is expected";
/// Time for a restarted daemon to hear the scenes of those who live on.
const HEARD_AGAIN: Duration = Duration::from_secs(5);
/// How long after the end of its scene's lifetime a motion may go on, ms.
const STOPPED_MS: f64 = 100.0;

/// On the way of the motions between [`ENDS`], and leaving it at 1 m/s.
fn leaving_ball(stack: &Stack) -> MovingBall {
    let middle = Configuration::from(ENDS[1]) * 0.5;
    let velocity = Point::new(1.0, 0.0, 0.0);
    ball(stack.world.robot.tip(&middle), 0.3, velocity)
}

/// On the way of the motions between [`ENDS`].
fn resting_ball(stack: &Stack) -> MovingBall {
    let middle = Configuration::from(ENDS[1]) * 0.5;
    ball(stack.world.robot.tip(&middle), 0.3, Point::zeros())
}

/// Stamps of another clock, of the future, and of long ago.
pub(super) fn stamps(report: &mut Report) -> anyhow::Result<()> {
    type Stamp = fn() -> i64;
    let cases: [(&str, Stamp, SceneRefusal); 5] = [
        ("the wall clock", wall_now_ns, SceneRefusal::OtherClock),
        (
            "the wall clock, 9 s ago",
            || wall_now_ns() - 9 * SECOND_NS,
            SceneRefusal::OtherClock,
        ),
        (
            "the future, in 0.5 s",
            || mono_now_ns() + SECOND_NS / 2,
            SceneRefusal::InTheFuture,
        ),
        (
            "9 s ago",
            || mono_now_ns() - 9 * SECOND_NS,
            SceneRefusal::TooOld,
        ),
        ("a clock that began at 0", || 0, SceneRefusal::TooOld),
    ];
    for (name, stamp, wanted) in cases {
        let mut stack = Stack::running(&settings(false))?;
        let mut scenes = RawScenes::connect(&stack.world.options, "camera");
        let balls = [leaving_ball(&stack)];
        let sequence = scenes.send(stamp(), LIFETIME_NS, &balls);
        let said = scenes.verdict(sequence, PATIENCE)?;
        let told = format!("defect 6: a ball stamped by {name}: its publisher is told");
        report.check(&told, said.to_string(), wanted.text(), said == wanted);
        let what = format!("defect 6: a ball stamped by {name}: motions through where it was");
        refused(report, &what, &mut stack, CAMERA);
    }
    let mut stack = Stack::running(&settings(false))?;
    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    let sequence = scenes.send(mono_now_ns(), 60 * SECOND_NS, &[]);
    let said = scenes.verdict(sequence, PATIENCE)?;
    let moved = execute(&mut stack).is_ok();
    let figure = format!("{said}, executed: {moved}");
    let passed = said == SceneRefusal::None && moved;
    report.check(
        "defect 6: a scene as it should be",
        figure,
        "none, executed: true",
        passed,
    );
    Ok(())
}

/// A motion that is to be refused in these words.
fn refused(report: &mut Report, name: &str, stack: &mut Stack, words: &str) {
    let figure = refusal(stack).unwrap_or_else(|error| error.to_string());
    let passed = figure.contains(words);
    report.check(name, figure, &format!("refused: {words}"), passed);
}

/// A publisher of a moving ball dies: motions are asked for while its scene still counts and when it does not any more.
pub(super) fn dead_publisher(report: &mut Report) -> anyhow::Result<()> {
    for (lifetime_s, ages_s) in [(5, &[0, 1, 4, 9][..]), (20, &[9][..])] {
        let mut stack = Stack::running(&settings(false))?;
        let ball = leaving_ball(&stack);
        let sent = send_and_die(&stack, lifetime_s, &ball)?;
        for &age_s in ages_s {
            sleep_until(sent, age_s);
            let name = format!(
                "defect 6: publisher of a moving ball dead for {age_s} s, lifetime {lifetime_s} s: a motion through where it was"
            );
            let ended = age_s >= lifetime_s;
            let words = if ended { CAMERA } else { IN_THE_WAY };
            refused(report, &name, &mut stack, words);
        }
    }
    for (lifetime_s, age_s) in [(5, 1), (5, 4), (20, 9)] {
        let mut stack = Stack::running(&settings(false))?;
        let reach_m: f64 = stack.world.robot.section_lengths.iter().sum();
        let beside = Point::new(0.0, reach_m + 2.0, 0.5 * reach_m);
        let ball = ball(beside, 0.3, Point::new(1.0, 0.0, 0.0));
        let sent = send_and_die(&stack, lifetime_s, &ball)?;
        sleep_until(sent, age_s);
        let name = format!(
            "defect 6: publisher of a moving ball dead for {age_s} s, lifetime {lifetime_s} s: a motion that it cannot reach"
        );
        let outcome = execute(&mut stack);
        let passed = outcome.is_ok();
        let figure =
            outcome.map_or_else(|error| error.to_string(), |id| format!("trajectory {id}"));
        report.check(&name, figure, "executed", passed);
    }
    Ok(())
}

/// A publisher tells of a ball and is gone without taking its leave; when that was.
fn send_and_die(stack: &Stack, lifetime_s: u64, ball: &MovingBall) -> anyhow::Result<Instant> {
    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    let sent = Instant::now();
    let lifetime_ns = i64::try_from(lifetime_s)? * SECOND_NS;
    let sequence = scenes.send(mono_now_ns(), lifetime_ns, &[*ball]);
    scenes.verdict(sequence, PATIENCE)?;
    Ok(sent)
}

fn sleep_until(begun: Instant, age_s: u64) {
    thread::sleep(Duration::from_secs(age_s).saturating_sub(begun.elapsed()));
}

/// A source falls silent during a motion, where a scene is expected and where none is.
pub(super) fn silent_source(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for expects in [false, true] {
        let mut stack = Stack::running(&settings(expects))?;
        let mut scenes = RawScenes::connect(&stack.world.options, "camera");
        let (mut braked_ms, mut failed) = (Vec::new(), Vec::new());
        for _ in 0..scale.pick(3, 20) {
            let listener = Listener::start(&stack.world.options);
            let sequence = scenes.send(mono_now_ns(), LIFETIME_NS, &[]);
            scenes.verdict(sequence, PATIENCE)?;
            let id = execute(&mut stack)?;
            let last_ns = mono_now_ns();
            scenes.send(last_ns, LIFETIME_NS, &[]);
            stack.wait_for_progress(id, 0.0)?;
            match wait_for_braking(&listener, last_ns, Duration::from_secs(4)) {
                Ok(at_ns) => braked_ms.push((at_ns - last_ns - LIFETIME_NS) as f64 * 1e-6),
                Err(error) => failed.push(error.to_string()),
            }
            match stack.wait_for_end(id) {
                Err(MoveError::CutShort(text)) => failed.push(text),
                ended => drop(ended?),
            }
        }
        let name = format!("defect 6: source silent during a motion (expected = {expects})");
        report.none_of(&format!("{name}: motions not stopped, and faults"), &failed);
        let latest = braked_ms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let what = format!("{name}: stopped, ms after the lifetime of its scene");
        report.at_most(&what, latest, STOPPED_MS);
        let earliest = braked_ms.iter().copied().fold(f64::INFINITY, f64::min);
        let what = format!("{name}: the earliest, ms after it");
        report.check(&what, format!("{earliest:.3}"), ">= 0", earliest >= 0.0);
        let what = format!("{name}: a motion afterwards");
        refused(report, &what, &mut stack, CAMERA);
    }
    Ok(())
}

/// A scene is published once; the daemon is killed and starts again. A motion is asked for as soon as the new one lives.
pub(super) fn restarted_daemon(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for expects in [false, true] {
        let mut stack = Stack::running(&settings(expects))?;
        let mut scenes = ScenePublisher::connect(&stack.world.options, "camera")?;
        scenes.publish(&[resting_ball(&stack)], Duration::from_secs(600))?;
        scenes.confirm(PATIENCE)?;
        let (mut otherwise, mut reasons) = (Vec::new(), BTreeMap::new());
        let mut once_heard = Vec::new();
        for _ in 0..scale.pick(5, 30) {
            restart_daemon(&mut stack)?;
            match refusal(&mut stack) {
                Ok(reason) if UNHEARD_OR_IN_THE_WAY.iter().any(|w| reason.contains(w)) => {
                    *reasons.entry(reason).or_insert(0) += 1;
                }
                Ok(reason) => otherwise.push(reason),
                Err(error) => otherwise.push(error.to_string()),
            }
            if let Err(reason) = in_the_way_once_heard(&mut stack)? {
                once_heard.push(reason);
            }
        }
        let name = format!(
            "defect 6: scene published once, daemon restarted (expected = {expects}): motions into it, not refused at the first try"
        );
        report.none_of(&name, &otherwise);
        let name = format!(
            "defect 6: scene published once, daemon restarted (expected = {expects}): motions into it, not refused for it once it was heard"
        );
        report.none_of(&name, &once_heard);
        let name = format!("defect 6: why they were refused at first (expected = {expects})");
        report.shown(&name, format!("{reasons:?}"));
    }
    let mut stack = Stack::running(&settings(true))?;
    let name = "defect 6: a scene is expected and nobody tells of one: a motion";
    refused(report, name, &mut stack, NONE_THERE);
    Ok(())
}

/// What a motion is refused with as soon as the daemon has the scene again: that an obstacle is in its way. Else what came of it.
fn in_the_way_once_heard(stack: &mut Stack) -> anyhow::Result<Result<(), String>> {
    let mut last = Ok(());
    let heard = wait_for("a refusal for the scene itself", HEARD_AGAIN, || {
        let said = refusal(stack).map_err(|error| error.to_string());
        let waits = said
            .as_ref()
            .is_ok_and(|reason| reason.contains(UNHEARD) || reason.contains(NONE_THERE));
        last = match said {
            Ok(reason) if reason.contains(IN_THE_WAY) => Ok(()),
            Ok(reason) | Err(reason) => Err(reason),
        };
        (!waits).then_some(())
    });
    Ok(heard.map_err(|error| error.to_string()).and(last))
}

/// A scene is published once by a program that then ends; the daemon is killed and starts again. The ball counts for its lifetime.
pub(super) fn ended_program(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for expects in [false, true] {
        let mut stack = Stack::running(&settings(expects))?;
        let mut otherwise = Vec::new();
        let name = format!(
            "defect 6: scene published once by a program that has ended (expected = {expects})"
        );
        send_and_die(&stack, 600, &resting_ball(&stack))?;
        let before = format!("{name}: a motion into it before the daemon's end");
        refused(report, &before, &mut stack, IN_THE_WAY);
        for turn in 0..scale.pick(3, 20) {
            restart_daemon(&mut stack)?;
            match refusal(&mut stack) {
                Ok(reason) if reason.contains(IN_THE_WAY) => {}
                Ok(reason) => otherwise.push(format!("restart {turn}: {reason}")),
                Err(error) => otherwise.push(format!("restart {turn}: {error}")),
            }
        }
        let what = "daemon restarted: motions into it, not refused for it";
        report.none_of(&format!("{name}, {what}"), &otherwise);
    }
    Ok(())
}

/// Kills the daemon and waits for the first heartbeat of the next one, and for a controller that holds.
fn restart_daemon(stack: &mut Stack) -> anyhow::Result<()> {
    let node = IpcNode::create(&stack.world.options, "heart-listener")?;
    let beats = subscriber(&node, &heartbeat_service(&node)?)?;
    stack.kill9(Part::Daemon);
    stack.start(Part::Daemon);
    let pid = stack.process(Part::Daemon).pid();
    wait_for("the new daemon's heart beats", PATIENCE, || {
        let beat = beats.receive().ok().flatten()?;
        (beat.kind == ProcessKind::Daemon.code() && beat.pid == pid).then_some(())
    })?;
    stack.wait_until_ready()?;
    Ok(())
}

/// A controller's state is there, but nobody serves `command`.
pub(super) fn nobody_serves_command(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&settings(false));
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let (options, quit) = (stack.world.options.clone(), AtomicBool::new(false));
    let robot_hash = stack.world.robot.hash();
    let figure = thread::scope(|scope| {
        scope.spawn(|| play_deaf_controller(&options, robot_hash, &quit));
        thread::sleep(Duration::from_millis(200));
        let outcome = refusal(&mut stack);
        quit.store(true, Ordering::Relaxed);
        outcome.unwrap_or_else(|error| error.to_string())
    });
    let named = figure.contains("nobody serves `command`");
    let name = "defect 6: nobody serves `command`: a motion";
    report.check(name, figure, "refused by name", named);
    Ok(())
}

/// Publishes the state of a controller that holds at zero, 50 times a second.
fn play_deaf_controller(options: &IpcOptions, robot_hash: u64, quit: &AtomicBool) {
    let node = IpcNode::create(options, "deaf-controller").unwrap();
    let states = publisher(&node, &controller_state_service(&node).unwrap()).unwrap();
    while !quit.load(Ordering::Relaxed) {
        let state = ControllerState {
            stamp_mono_ns: mono_now_ns(),
            instance: 1,
            robot_hash,
            state: LoopState::Holding.code(),
            rate: 1.0,
            ..ControllerState::ZEROED
        };
        states.send_copy(state).unwrap();
        thread::sleep(Duration::from_millis(20));
    }
}
