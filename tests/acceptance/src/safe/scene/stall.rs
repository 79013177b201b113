//! Motions that are still supervised after something stood still, and trajectories that outlive whom they were for.

use std::thread;
use std::time::Duration;

use pcc_model::Configuration;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState, Refusal};
use shared_types::message::Cycle;
use shared_types::valid::PlanRequest;
use tests::listener::Listener;
use tests::process::wait_for;
use tests::raw_scene::RawScenes;
use tests::stack::{MoveError, PATIENCE, Part, Stack};

use super::executed::moves;
use super::scenario::{
    ENDS, SECOND_NS, comes_to, execute, on_the_body, request, running_with, settings,
};
use crate::report::Report;
use crate::scale::Scale;

/// A scene of a few seconds.
const LIFETIME_NS: i64 = 5 * SECOND_NS;
/// Longest time from a fresh state of the controller, with the ball there, to a robot that brakes or is at rest, ms.
const STOPPED_MS: f64 = 100.0;
/// A `daemon_lost_ms` that no pause reaches, so that the controller waits for the daemon's order.
const NEVER_LOST_MS: i64 = 10_000;

/// What a ball did to a motion.
struct Stopped {
    /// From a fresh state and the ball until the first cycle that brakes or rests, ms; none where it went on to its end.
    after_ms: Option<f64>,
    /// Why it was not the ball that stopped it, where that is so.
    fault: LoopFault,
    /// Whether the robot still moved on at full speed when there were the ball and a fresh state.
    moved: bool,
}

/// Daemon, controller and robot stand still for 300 to 500 ms; a ball comes onto the body meanwhile, or right after.
pub(super) fn whole_machine(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let shipped: (&str, &[_]) = ("as shipped", &[]);
    let patient: (&str, &[_]) = (
        "a controller that waits for the daemon",
        &[("daemon_lost_ms", NEVER_LOST_MS)],
    );
    for (settings, controller) in [shipped, patient] {
        for (when, meanwhile) in [("during", true), ("after", false)] {
            let name = format!("defect 3: pauses of 300 to 500 ms, a ball {when} them, {settings}");
            let (mut after_ms, mut went_on, mut faults) = (Vec::new(), Vec::new(), Vec::new());
            let (mut cut_short, mut moved) = (Vec::new(), 0);
            for pause_ms in [300, 400, 500].repeat(scale.pick(1, 10)) {
                let pause = Duration::from_millis(pause_ms);
                let Some(stopped) = after_a_pause(controller, pause, meanwhile)? else {
                    cut_short.push(format!("{pause_ms} ms"));
                    continue;
                };
                match stopped.after_ms {
                    Some(ms) => after_ms.push(ms),
                    None => went_on.push(format!("{pause_ms} ms")),
                }
                if stopped.fault != LoopFault::None {
                    faults.push(format!("{pause_ms} ms: {}", stopped.fault));
                }
                moved += usize::from(stopped.moved);
            }
            report.none_of(&format!("{name}: motions that went on"), &went_on);
            report.none_of(
                &format!("{name}: refused, or cut short before them"),
                &cut_short,
            );
            report.none_of(&format!("{name}: faults"), &faults);
            let latest = after_ms.iter().copied().fold(0.0, f64::max);
            let what = format!("{name}: ms from ball and fresh state to braking or rest");
            report.at_most(&what, latest, STOPPED_MS);
            let tried = after_ms.len() + went_on.len();
            let what =
                format!("{name}: the robot still moved when there were ball and fresh state");
            // The shipped controller may stop by itself for a daemon that it has not heard; one that waits leaves that to the daemon.
            let (least, bar) = if controller.is_empty() {
                (1, ">= 1")
            } else {
                (tried.div_ceil(2).max(1), ">= half, and 1")
            };
            report.check(&what, format!("{moved} of {tried}"), bar, moved >= least);
        }
    }
    Ok(())
}

/// None where the motion was refused, or cut short before the pause.
fn after_a_pause(
    controller: &[(&str, i64)],
    pause: Duration,
    meanwhile: bool,
) -> anyhow::Result<Option<Stopped>> {
    let mut stack = running_with(controller)?;
    let mut scenes = RawScenes::connect(&stack.world.options, "camera");
    scenes.send(mono_now_ns(), LIFETIME_NS, &[]);
    let listener = Listener::start(&stack.world.options);
    // The controller has only just met the daemon.
    thread::sleep(Duration::from_millis(200));
    let id = match execute(&mut stack) {
        Err(MoveError::Refused { .. }) => return Ok(None),
        id => id?,
    };
    if !comes_to(&mut stack, id, 0.5)? {
        return Ok(None);
    }
    let on_the_body = on_the_body(&mut stack);
    let mut resumed_ns = 0;
    stack.pause(pause, || {
        if meanwhile {
            scenes.send(mono_now_ns(), LIFETIME_NS, &[on_the_body]);
        }
        resumed_ns = mono_now_ns();
    });
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
    wait_for("the robot rests", PATIENCE, || {
        let since = |cycle: &&Cycle| cycle.stamp_mono_ns > from_ns;
        listener.with(|heard| {
            heard
                .cycles
                .iter()
                .filter(since)
                .any(|c| !moves(c))
                .then_some(())
        })
    })?;
    let state = stack.controller_state();
    let commanded = Configuration::from(state.values.commanded_configuration_rad);
    let reached_its_end = (commanded - Configuration::from(ENDS[1])).norm() < 1e-6;
    let executing = LoopState::Executing.code();
    let (stopped_ns, moved) = listener.with(|heard| {
        let resumed = |cycle: &&Cycle| cycle.stamp_mono_ns > resumed_ns;
        let mut cycles = heard.cycles.iter().filter(resumed);
        let stopped = cycles.find(|cycle| cycle.state != executing);
        let moved = stopped.is_none_or(|cycle| cycle.stamp_mono_ns > from_ns);
        (stopped.map(|cycle| cycle.stamp_mono_ns), moved)
    });
    let after_ms = stopped_ns.map(|at_ns| (at_ns - from_ns).max(0) as f64 * 1e-6);
    Ok(Some(Stopped {
        after_ms: after_ms.filter(|_| !reached_its_end),
        fault: state.fault,
        moved,
    }))
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
    let name = "defect 3: an old trajectory that a restarted controller executes";
    report.check(name, figure, "None", moved.is_none());
    let state = stack.controller_state();
    let refusal = (state.values.refused_trajectory_id, state.refusal.text());
    let named = refusal.0 == id && state.refusal.text() == OTHER_CONTROLLER;
    let name = "defect 3: the restarted controller refuses it by name";
    report.check(name, format!("{refusal:?}"), OTHER_CONTROLLER, named);
    stack.wait_until_ready()?;
    let again = execute(&mut stack);
    let figure = again
        .as_ref()
        .map_or_else(ToString::to_string, |id| format!("trajectory {id}"));
    report.check(
        "defect 3: a new motion afterwards",
        figure,
        "published",
        again.is_ok(),
    );
    Ok(())
}

const OTHER_CONTROLLER: &str = Refusal::OtherController.text();
