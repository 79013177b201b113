//! A follower that is told to end in motion: it comes to rest on its path first.

use std::time::Duration;

use anyhow::Context;
use shared_types::codes::MotionOutcome;
use shared_types::message::Cycle;
use shared_types::valid::Goal;
use tests::judge::ALLOWED_USE;
use tests::listener::{Heard, Listener};
use tests::motion::{largest, raise};
use tests::process::wait_for;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

use super::examples::{Examples, LIMIT, TIP_M, wait_until_held};
use crate::report::Report;

/// How far into its motion the follower is told to end, s.
const INTO_MOTION_S: f64 = 0.8;
/// Ctrl-C, and what a service manager sends.
const SIGNALS: [(&str, libc::c_int); 2] = [("SIGINT", libc::SIGINT), ("SIGTERM", libc::SIGTERM)];
/// A set-point faster than this moves, m/s.
const MOVING_M_S: f64 = 0.01;
/// A set-point slower than this rests, m/s.
const AT_REST_M_S: f64 = 1e-9;
/// How long the last cycles take to be heard.
const HEARD_WITHIN: Duration = Duration::from_millis(500);

pub(super) fn run(examples: &Examples, report: &mut Report) {
    let group = format!("{}: follow until it is ended", examples.language);
    report.group(&group, examples.command, |report| {
        for (name, signal) in SIGNALS {
            end_in_motion(examples, report, name, signal)?;
        }
        Ok(())
    });
}

fn end_in_motion(
    examples: &Examples,
    report: &mut Report,
    name: &str,
    signal: libc::c_int,
) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    let limit = stack.world.robot.tendon_limits.acceleration;
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let listener = Listener::start(&stack.world.options);
    let file = stack.world.config("controller.toml").display().to_string();
    let mut process = examples.start(&stack.world, "follow", &[&file])?;
    wait_until_held(&mut stack).with_context(|| process.log())?;
    let id = stack.begin_motion(Goal::tip(TIP_M))?;
    stack.wait_for_progress(id, INTO_MOTION_S)?;
    process.signal(signal);
    let status = process.wait(LIMIT).with_context(|| process.log())?;
    let rests = wait_for("its last cycle", HEARD_WITHIN, || {
        listener
            .with(|heard| {
                heard
                    .cycles
                    .last()
                    .is_some_and(|it| speed(it) < AT_REST_M_S)
            })
            .then_some(())
    });
    let heard = listener.take();
    let result = heard.results.iter().find(|it| it.trajectory_id == id);
    let is_stopped = result.is_some_and(|it| it.outcome == MotionOutcome::Stopped.code());
    let result = result.map_or_else(|| "no result".to_owned(), |it| it.reason.to_string());
    let used = acceleration_use(&heard, limit);
    let fastest = heard.cycles.iter().map(speed).fold(0.0, f64::max);
    report.check(
        &examples.line(&format!(
            "{name} {INTO_MOTION_S} s into a motion: its end, the motion's, and the largest step of velocity ÷ (acceleration limit × time)"
        )),
        format!(
            "{status}; {}: {result}; {used:.4}, {}",
            if is_stopped { "stopped" } else { "not stopped" },
            if rests.is_ok() { "at rest" } else { "in motion" }
        ),
        &format!("success, stopped, <= {ALLOWED_USE}, at rest"),
        status.success() && is_stopped && rests.is_ok() && fastest > MOVING_M_S && used <= ALLOWED_USE,
    );
    Ok(())
}

/// The largest speed of a tendon, m/s.
fn speed(cycle: &Cycle) -> f64 {
    largest(&cycle.setpoint_velocity_m_s)
}

fn acceleration_use(heard: &Heard, limit_m_s2: f64) -> f64 {
    let mut used = 0.0;
    for pair in heard.cycles.windows(2) {
        let [before, after] = [&pair[0], &pair[1]];
        let elapsed_s = (after.stamp_mono_ns - before.stamp_mono_ns) as f64 * 1e-9;
        let [from, to] = [before, after].map(|it| it.setpoint_velocity_m_s);
        for (from, to) in from.iter().zip(to) {
            raise(&mut used, (to - from).abs() / (limit_m_s2 * elapsed_s));
        }
    }
    used
}
