//! Whose scene it is, by which clock, and for how long it counts.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use client::ScenePublisher;
use pcc_model::{Configuration, Point};
use shared_types::clock::{mono_now_ns, wall_now_ns};
use shared_types::codes::{LoopState, SceneRefusal};
use shared_types::ipc::{IpcNode, IpcOptions, controller_state_service, publisher};
use shared_types::message::{ControllerState, MovingBall};
use tests::listener::Listener;
use tests::raw_scene::RawScenes;
use tests::stack::{PATIENCE, Part, Stack};

use super::executed::wait_for_braking;
use super::{ENDS, SECOND_NS, ball, execute, refusal, settings};
use crate::{Report, Scale};

/// Lifetime of the scenes that are not about lifetimes.
const LIFETIME_NS: i64 = SECOND_NS;

/// On the way of the motions between [`ENDS`], and leaving it at 1 m/s.
fn leaving_ball(stack: &Stack) -> MovingBall {
    let middle = Configuration::from(ENDS[1]) * 0.5;
    let velocity = Point::new(1.0, 0.0, 0.0);
    ball(stack.world.robot.tip(&middle), 0.3, velocity)
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
        let told = format!("a ball stamped by {name}: its publisher is told");
        report.check(&told, said.to_string(), wanted.text(), said == wanted);
        let (figure, refused) = outcome(&mut stack);
        let what = format!("a ball stamped by {name}: motions through where it was");
        report.check(&what, figure, "refused, the source named", refused);
    }
    let mut stack = Stack::running(&settings(false))?;
    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    let sequence = scenes.send(mono_now_ns(), 60 * SECOND_NS, &[]);
    let said = scenes.verdict(sequence, PATIENCE)?;
    let moved = execute(&mut stack).is_ok();
    let figure = format!("{said}, executed: {moved}");
    let passed = said == SceneRefusal::None && moved;
    report.check(
        "a scene as it should be",
        figure,
        "none, executed: true",
        passed,
    );
    Ok(())
}

/// What became of a motion, and whether it was refused because of the source `camera` or an obstacle.
fn outcome(stack: &mut Stack) -> (String, bool) {
    match refusal(stack) {
        Ok(reason) => {
            let named = reason.contains("camera") || reason.contains("live scene is in the way");
            (reason, named)
        }
        Err(error) => (error.to_string(), false),
    }
}

/// A publisher dies: 9 s before a motion is asked for, and during one.
pub(super) fn dead_publisher(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&settings(false))?;
    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    let balls = [leaving_ball(&stack)];
    let sequence = scenes.send(mono_now_ns(), 5 * SECOND_NS, &balls);
    scenes.verdict(sequence, PATIENCE)?;
    drop(scenes);
    let (figure, refused) = outcome(&mut stack);
    let name =
        "publisher of a moving ball dead, within its lifetime: a motion through where it was";
    report.check(name, figure, "refused", refused);
    thread::sleep(Duration::from_secs(9));
    let (figure, refused) = outcome(&mut stack);
    let name = "publisher of a moving ball dead for 9 s: a motion through where it was";
    report.check(name, figure, "refused, the source named", refused);

    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    let (mut braked_ms, mut failed) = (Vec::new(), Vec::new());
    for _ in 0..scale.pick(2, 20) {
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
        stack.wait_for_end(id)?;
    }
    report.none_of(
        "source silent during a motion: motions not stopped",
        &failed,
    );
    let latest = braked_ms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let name = "source silent during a motion: stopped, ms after the lifetime of its scene";
    report.at_most(name, latest, 100.0);
    Ok(())
}

/// A scene is published once; the daemon is killed and starts again.
pub(super) fn restarted_daemon(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for expects in [false, true] {
        let mut stack = Stack::running(&settings(expects))?;
        let mut scenes = ScenePublisher::connect(&stack.world.options, "camera")?;
        let middle = Configuration::from(ENDS[1]) * 0.5;
        let resting = ball(stack.world.robot.tip(&middle), 0.3, Point::zeros());
        scenes.publish(&[resting], Duration::from_secs(600))?;
        scenes.confirm(PATIENCE)?;
        let mut executed = Vec::new();
        for _ in 0..scale.pick(3, 20) {
            stack.kill9(Part::Daemon);
            stack.start(Part::Daemon);
            stack.wait_until_ready()?;
            thread::sleep(Duration::from_millis(if expects { 0 } else { 50 }));
            let (mut figure, mut refused) = outcome(&mut stack);
            while figure.contains("went away") {
                // It was the killed daemon that still looked alive.
                (figure, refused) = outcome(&mut stack);
            }
            if !refused && !figure.contains("one is expected") {
                executed.push(figure);
            }
        }
        let name = format!(
            "scene published once, daemon restarted (expected = {expects}): motions into it"
        );
        report.none_of(&name, &executed);
    }
    let mut stack = Stack::running(&settings(true))?;
    let figure = match refusal(&mut stack) {
        Ok(reason) => reason,
        Err(error) => error.to_string(),
    };
    let named = figure.contains("one is expected");
    let name = "a scene is expected and nobody tells of one: a motion";
    report.check(name, figure, "refused by name", named);
    Ok(())
}

/// A controller's state is there, but nobody serves `command`.
pub(super) fn nobody_serves_command(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&settings(false));
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let (options, quit) = (stack.world.options.clone(), AtomicBool::new(false));
    let figure = thread::scope(|scope| {
        scope.spawn(|| play_deaf_controller(&options, &quit));
        thread::sleep(Duration::from_millis(200));
        let outcome = refusal(&mut stack);
        quit.store(true, Ordering::Relaxed);
        outcome.unwrap_or_else(|error| error.to_string())
    });
    let named = figure.contains("nobody serves `command`");
    let name = "nobody serves `command`: a motion";
    report.check(name, figure, "refused by name", named);
    Ok(())
}

/// Publishes the state of a controller that holds at zero, 50 times a second.
fn play_deaf_controller(options: &IpcOptions, quit: &AtomicBool) {
    let node = IpcNode::create(options, "deaf-controller").unwrap();
    let states = publisher(&node, &controller_state_service(&node).unwrap()).unwrap();
    while !quit.load(Ordering::Relaxed) {
        let state = ControllerState {
            stamp_mono_ns: mono_now_ns(),
            instance: 1,
            state: LoopState::Holding.code(),
            rate: 1.0,
            ..ControllerState::ZEROED
        };
        states.send_copy(state).unwrap();
        thread::sleep(Duration::from_millis(20));
    }
}
