//! What was executed, from the controller's cycles.

use std::time::Duration;

use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use tests::brute_force::{Ball, Body, Tendons};
use tests::listener::Listener;
use tests::process::{TimedOut, wait_for};

/// Cycles farther apart, ns, have a pause between them, in which nothing moved.
const PAUSE_NS: i64 = 5_000_000;

/// A lower bound of the distance between a ball and the body as the set-points have it, while these moved, m.
pub(super) fn clearance(body: &Body, cycles: &[Cycle], ball: &Ball) -> f64 {
    let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
    let moving = cycles.iter().filter(|cycle| moving.contains(&cycle.state));
    let setpoints: Vec<(i64, Tendons)> = moving
        .map(|cycle| (cycle.stamp_mono_ns, cycle.setpoint_m))
        .collect();
    let balls = [*ball];
    let runs = setpoints.chunk_by(|a, b| b.0 - a.0 < PAUSE_NS);
    let clearances = runs.map(|run| body.least_clearance(run, |_| &balls).at_least_m());
    clearances.fold(f64::INFINITY, f64::min)
}

/// Waits for the first cycle after a time in which the loop brakes; its stamp, nanoseconds.
///
/// # Errors
/// [`TimedOut`] if it never does.
pub(super) fn wait_for_braking(
    listener: &Listener,
    after_mono_ns: i64,
    limit: Duration,
) -> Result<i64, TimedOut> {
    wait_for("the controller brakes", limit, || {
        listener.with(|heard| {
            let brakes = |cycle: &&Cycle| {
                cycle.stamp_mono_ns > after_mono_ns && cycle.state == LoopState::Stopping.code()
            };
            heard.cycles.iter().find(brakes).map(|c| c.stamp_mono_ns)
        })
    })
}
