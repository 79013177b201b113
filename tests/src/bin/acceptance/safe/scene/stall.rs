//! Motions that are still supervised after something stood still, and trajectories that outlive whom they were for.

use std::thread;
use std::time::Duration;

use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState, Refusal};
use shared_types::valid::PlanRequest;
use tests::listener::Listener;
use tests::process::wait_for;
use tests::raw_scene::RawScenes;
use tests::stack::{PATIENCE, Part, Stack};

use super::executed::wait_for_braking;
use super::{SECOND_NS, execute, on_the_body, pause_all, request, resume_all, settings};
use crate::{Report, Scale};

/// A scene of a few seconds.
const LIFETIME_NS: i64 = 5 * SECOND_NS;
/// How long a motion that nobody stops is watched: they last some 6 s.
const MOTION: Duration = Duration::from_secs(7);

/// What a ball did to a motion.
struct Stopped {
    /// Whether it was up to the daemon to stop it: the robot still moved when there was a ball and a fresh state, or was stopped before
    /// without a fault.
    moved: bool,
    /// From then until the first cycle that brakes, ms; none where it did not brake.
    after_ms: Option<f64>,
}

/// Daemon, controller and robot stand still for 300 to 500 ms; a ball comes onto the body meanwhile, or right after.
pub(super) fn whole_machine(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    for (name, meanwhile) in [("during", true), ("after", false)] {
        let name = format!("all processes paused for 300 to 500 ms, a ball came {name} the pause");
        let (mut after_ms, mut missed, mut moved) = (Vec::new(), Vec::new(), 0);
        let pauses = [300, 400, 500].repeat(scale.pick(1, 10));
        for pause_ms in &pauses {
            let stopped = after_a_pause(Duration::from_millis(*pause_ms), meanwhile)?;
            moved += usize::from(stopped.moved);
            match stopped.after_ms {
                Some(ms) => after_ms.push(ms),
                None if stopped.moved => missed.push(format!("{pause_ms} ms")),
                None => {}
            }
        }
        report.none_of(&format!("{name}: motions that went on"), &missed);
        let latest = after_ms.iter().copied().fold(0.0, f64::max);
        let what = format!("{name}: braked, ms after there were a fresh state and the ball");
        report.at_most(&what, latest, 100.0);
        let enough = 2 * moved >= pauses.len();
        let figure = format!("{moved} of {}", pauses.len());
        report.check(
            &format!("{name}: it was up to the daemon to stop the robot"),
            figure,
            "at least half",
            enough,
        );
    }
    Ok(())
}

fn after_a_pause(pause: Duration, meanwhile: bool) -> anyhow::Result<Stopped> {
    let mut stack = Stack::running(&settings(false))?;
    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    scenes.send(mono_now_ns(), LIFETIME_NS, &[]);
    let listener = Listener::start(&stack.world.options);
    let id = execute(&mut stack)?;
    stack.wait_for_progress(id, 0.5)?;
    let on_the_body = on_the_body(&mut stack);
    let paused_ns = mono_now_ns();
    pause_all(&mut stack, pause);
    if meanwhile {
        scenes.send(mono_now_ns(), LIFETIME_NS, &[on_the_body]);
    }
    resume_all(&mut stack);
    let resumed_ns = paused_ns + pause.as_nanos() as i64;
    let mut from_ns = wait_for("a fresh state of the controller", PATIENCE, || {
        listener.with(|heard| {
            let mut stamps = heard.controller.iter().map(|state| state.stamp_mono_ns);
            stamps.find(|stamp| *stamp > resumed_ns)
        })
    })?;
    if !meanwhile {
        from_ns = mono_now_ns();
        scenes.send(from_ns, LIFETIME_NS, &[on_the_body]);
    }
    let braked = wait_for_braking(&listener, resumed_ns, MOTION);
    let in_fault = stack.controller_state().fault != LoopFault::None;
    let stopped_before = meanwhile && braked.is_ok() && !in_fault;
    Ok(Stopped {
        moved: executes_at(&listener, from_ns) || stopped_before,
        after_ms: braked
            .ok()
            .map(|at_ns| (at_ns - from_ns).max(0) as f64 * 1e-6),
    })
}

/// Whether the loop executed in the last cycle before a time, or in the first one from then on.
fn executes_at(listener: &Listener, mono_ns: i64) -> bool {
    let executing = LoopState::Executing.code();
    listener.with(|heard| {
        let next = heard
            .cycles
            .iter()
            .position(|cycle| cycle.stamp_mono_ns >= mono_ns);
        let next = next.unwrap_or(heard.cycles.len());
        let around = &heard.cycles[next.saturating_sub(1)..(next + 1).min(heard.cycles.len())];
        around.iter().any(|cycle| cycle.state == executing)
    })
}

/// A motion is to begin in 8 s; the controller is killed and starts again while the daemon stands still.
pub(super) fn old_trajectory(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::running(&settings(false))?;
    let begin_ns = mono_now_ns() + 8 * SECOND_NS;
    let later = PlanRequest {
        begin_mono_ns: Some(begin_ns),
        ..request(&mut stack)
    };
    let id = stack.try_motion(&later)?;
    thread::sleep(Duration::from_millis(100));
    stack.kill9(Part::Controller);
    stack.process(Part::Daemon).signal(libc::SIGSTOP);
    thread::sleep(Duration::from_millis(300));
    let listener = Listener::start(&stack.world.options);
    stack.start(Part::Controller);
    // Past what a restarted controller takes for an inheritance, and the daemon for a controller that is there.
    thread::sleep(Duration::from_millis(700));
    stack.process(Part::Daemon).signal(libc::SIGCONT);
    let over_ns = begin_ns + SECOND_NS;
    let remaining = u64::try_from(over_ns - mono_now_ns())?;
    thread::sleep(Duration::from_nanos(remaining));
    let executing = LoopState::Executing.code();
    let moved = listener.with(|heard| {
        let mut cycles = heard.cycles.iter();
        cycles
            .find(|cycle| cycle.state == executing)
            .map(|cycle| cycle.trajectory_id)
    });
    let figure = format!("{moved:?} of {id}");
    let name = "an old trajectory that a restarted controller executes";
    report.check(name, figure, "None", moved.is_none());
    let state = stack.controller_state();
    let refusal = (state.values.refused_trajectory_id, state.refusal.text());
    let named = refusal.0 == id && state.refusal.text() == OTHER_CONTROLLER;
    let name = "the restarted controller refuses it by name";
    report.check(name, format!("{refusal:?}"), OTHER_CONTROLLER, named);
    stack.wait_until_ready()?;
    let again = execute(&mut stack);
    let figure = again
        .as_ref()
        .map_or_else(ToString::to_string, |id| format!("trajectory {id}"));
    report.check(
        "a new motion afterwards",
        figure,
        "published",
        again.is_ok(),
    );
    Ok(())
}

const OTHER_CONTROLLER: &str = Refusal::OtherController.text();
