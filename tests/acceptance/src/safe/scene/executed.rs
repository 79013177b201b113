//! What was executed, from the controller's cycles.

use std::sync::LazyLock;
use std::time::Duration;

use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use tests::brute_force::{Ball, Body, Tendons};
use tests::listener::Listener;
use tests::process::{TimedOut, wait_for};
use tests::world::shipped_number;

/// The shipped controller's `step_cap_ms`, ns: after a longer time between two cycles the set-point has moved on by no more than this, and
/// stood where it was before.
static STEP_CAP_NS: LazyLock<i64> =
    LazyLock::new(|| (1e6 * shipped_number("controller.toml", "step_cap_ms")) as i64);

/// A lower bound of the distance between a ball and the body as the set-points have it, moving or at rest, m.
pub(super) fn clearance(body: &Body, cycles: &[Cycle], ball: &Ball) -> f64 {
    let balls = [*ball];
    let setpoints = set_points(cycles);
    body.least_clearance(&setpoints, |_| &balls).at_least_m()
}

/// The set-points with their stamps, and those at which the robot waited for a late one.
fn set_points(cycles: &[Cycle]) -> Vec<(i64, Tendons)> {
    let mut setpoints: Vec<(i64, Tendons)> = Vec::with_capacity(cycles.len());
    for cycle in cycles {
        if let Some((last_ns, waited_m)) = setpoints.last().copied()
            && cycle.stamp_mono_ns - last_ns > *STEP_CAP_NS
        {
            setpoints.push((cycle.stamp_mono_ns - *STEP_CAP_NS, waited_m));
        }
        setpoints.push((cycle.stamp_mono_ns, cycle.setpoint_m));
    }
    setpoints
}

/// Whether the loop moves the robot in a cycle.
pub(super) fn moves(cycle: &Cycle) -> bool {
    let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
    moving.contains(&cycle.state)
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
