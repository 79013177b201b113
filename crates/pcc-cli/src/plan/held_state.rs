//! Where the controller holds the robot at rest, for requests that start there.

use crate::foreign_orders::ForeignOrders;
use anyhow::{Context, bail};
use client::ControllerView;
use shared_types::clock::{STATE_LIFETIME_NS, mono_now_ns};
use shared_types::codes::{LoopState, Waiting};
use shared_types::ipc::IpcOptions;
use shared_types::valid::ControllerState;
use std::time::{Duration, Instant};

/// How long a running daemon and controller may take to show up or to reply.
pub(super) const TIMEOUT: Duration = Duration::from_secs(5);
/// Waits for the state of a controller that holds the robot at rest.
///
/// # Errors
/// Somebody has ordered a stop or a reset after `begun_ns` (nanoseconds of `CLOCK_MONOTONIC`), so that the robot is to stay where it
/// is; or no controller holds the robot at rest.
pub(super) fn held_state(options: &IpcOptions, begun_ns: i64) -> anyhow::Result<ControllerState> {
    let mut foreign = ForeignOrders::since(begun_ns);
    let mut controller = ControllerView::connect(options)?;
    let until = Instant::now() + TIMEOUT;
    let mut last = None;
    while Instant::now() < until {
        if let Some(state) = controller.latest_state()? {
            // An old state may report new orders all the same.
            let checked = foreign.check(&state.values);
            checked.context("ask again if the robot is to move")?;
            let is_fresh = mono_now_ns() - state.values.stamp_mono_ns < STATE_LIFETIME_NS;
            if is_fresh && is_held(&state) {
                return Ok(state);
            }
            last = is_fresh.then_some((state.state, state.waiting)).or(last);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    match last {
        None => bail!(
            "no controller within {TIMEOUT:?}: start it, set PCC_PREFIX and PCC_ROOT to where it runs, or give --start"
        ),
        Some((state, waiting)) => bail!(
            "the controller holds no robot at rest: it is {state} (it waits for: {waiting}); wait until it is holding, or give --start"
        ),
    }
}

/// Whether a motion may be planned from the robot's configuration in this state: the controller holds it at rest, and no stop, reset or
/// start of the controller is newer than the state.
fn is_held(state: &ControllerState) -> bool {
    let values = &state.values;
    matches!(state.state, LoopState::Holding | LoopState::Fault)
        && state.waiting == Waiting::None
        && values.stamp_mono_ns > values.wanted_from_mono_ns
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_types::ipc::{IpcNode, controller_state_service, publisher};
    use shared_types::message;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread::{sleep, spawn};

    const MS: i64 = 1_000_000;

    fn holding(stamp_mono_ns: i64, wanted_from_mono_ns: i64) -> message::ControllerState {
        message::ControllerState {
            stamp_mono_ns,
            wanted_from_mono_ns,
            instance: 1,
            state: LoopState::Holding.code(),
            ..message::ControllerState::ZEROED
        }
    }

    #[test]
    fn a_state_of_before_the_last_order_is_not_asked_from() {
        let is_held = |values| is_held(&ControllerState::try_from(&values).unwrap());
        assert!(is_held(holding(8, 7)));
        assert!(!is_held(holding(7, 7)));
        assert!(!is_held(holding(6, 7)));
        let state = LoopState::Executing.code();
        let executing = message::ControllerState {
            state,
            ..holding(8, 7)
        };
        assert!(!is_held(executing));
    }

    /// What [`held_state`] returns where a controller publishes `told(begin_ns, now_ns)` again and again.
    fn found_where(
        name: &str,
        told: impl Fn(i64, i64) -> message::ControllerState + Send + 'static,
    ) -> anyhow::Result<ControllerState> {
        let folder = tempfile::tempdir().unwrap();
        let options = IpcOptions {
            prefix: format!("plan-{name}"),
            root: folder.path().join("root"),
        };
        let (here, quit) = (options.clone(), Arc::<AtomicBool>::default());
        let quits = Arc::clone(&quit);
        let controller = spawn(move || {
            let node = IpcNode::create(&here, "controller").unwrap();
            let states = publisher(&node, &controller_state_service(&node).unwrap()).unwrap();
            let begin_ns = mono_now_ns();
            while !quits.load(Ordering::Relaxed) {
                states.send_copy(told(begin_ns, mono_now_ns())).unwrap();
                sleep(Duration::from_millis(5));
            }
        });
        let found = held_state(&options, mono_now_ns());
        quit.store(true, Ordering::Relaxed);
        controller.join().unwrap();
        found
    }

    #[test]
    fn a_stop_that_is_ordered_while_states_are_old_is_not_overruled() {
        let found = found_where("stop", |begin_ns, now_ns| {
            if now_ns < begin_ns + 600 * MS {
                holding(begin_ns - 1_000 * MS, 1)
            } else {
                holding(now_ns, begin_ns + 500 * MS)
            }
        });
        let error = format!("{:#}", found.unwrap_err());
        assert!(error.starts_with("ask again if the robot"), "{error}");
        assert!(error.contains("a stop or a reset"), "{error}");
    }

    #[test]
    fn orders_of_before_keep_nobody_from_asking() {
        let found = found_where("before", |begin_ns, now_ns| {
            holding(now_ns, begin_ns - 2_000 * MS)
        });
        assert_eq!(found.unwrap().state, LoopState::Holding);
    }
}
