//! What became of a motion that was published: whether the controller takes it, and how it ended.

use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::bail;
use client::{ControllerView, ResultView};
use shared_types::clock::mono_now_ns;
use shared_types::codes::MotionOutcome;
use shared_types::ipc::IpcOptions;

use crate::order::STANDS_STILL;

/// How long a running controller may take to reply.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Time between two looks whether the controller is there while the end of a motion is waited for.
const LOOK_INTERVAL: Duration = Duration::from_millis(200);

/// Views of the controller, opened before a motion is asked for, so that nothing of it is missed.
pub(crate) struct Follower {
    controller: ControllerView,
    /// Where the end of the motion is waited for.
    results: Option<ResultView>,
}

impl Follower {
    /// Joins the services; `waits` for the end of the motion where that is wanted.
    pub(crate) fn connect(options: &IpcOptions, waits: bool) -> anyhow::Result<Self> {
        let results = waits.then(|| ResultView::connect(options)).transpose()?;
        Ok(Self {
            controller: ControllerView::connect(options)?,
            results,
        })
    }

    /// Tells what becomes of a trajectory; an error where it is not executed or its end, if that is waited for, is not reached.
    pub(crate) fn follow(&mut self, id: u32) -> anyhow::Result<()> {
        wait_until_taken(&mut self.controller, id)?;
        match &mut self.results {
            Some(results) => wait_until_ended(results, &mut self.controller, id),
            None => Ok(()),
        }
    }
}

/// Waits until a motion has ended, however long it pauses, and tells how; an error where its end was not reached.
fn wait_until_ended(
    results: &mut ResultView,
    controller: &mut ControllerView,
    id: u32,
) -> anyhow::Result<()> {
    loop {
        match results.wait_for(id, LOOK_INTERVAL)? {
            Some(result) if result.outcome == MotionOutcome::Reached => {
                say!("reached after {:.3} s", result.values.path_time_s);
                return Ok(());
            }
            Some(result) => bail!("trajectory {id} was not reached: {result}"),
            None => {}
        }
        let state = controller.latest_state()?;
        let stamp_ns = state.map_or(0, |state| state.values.stamp_mono_ns);
        if mono_now_ns() - stamp_ns > TIMEOUT.as_nanos() as i64 {
            bail!(
                "the controller has not said for {TIMEOUT:?} what it does: trajectory {id} may be under way"
            );
        }
    }
}

/// Waits until the controller says that it executes a trajectory, or is about to change over to it.
fn wait_until_taken(controller: &mut ControllerView, id: u32) -> anyhow::Result<()> {
    let until = Instant::now() + TIMEOUT;
    while Instant::now() < until {
        let state = controller.latest_state()?;
        match state {
            Some(state)
                if [
                    state.values.trajectory_id,
                    state.values.pending_trajectory_id,
                ]
                .contains(&id) =>
            {
                say!("the controller executes it");
                if let Some(note) = speed_note(state.values.speed) {
                    say!("{note}");
                }
                return Ok(());
            }
            Some(state) if state.values.refused_trajectory_id == id => {
                let refusal = state.refusal;
                bail!("not executed: the controller refuses trajectory {id}: {refusal}");
            }
            _ => sleep(Duration::from_millis(2)),
        }
    }
    bail!(
        "the controller has not said within {TIMEOUT:?} whether it executes trajectory {id}: it may have begun it (`pcc watch` shows what it does)"
    )
}

/// A sentence about an ordered speed below 1; none where motions are followed at their own rate.
fn speed_note(speed: f64) -> Option<String> {
    if speed <= 0.0 {
        return Some(STANDS_STILL.into());
    }
    (speed < 1.0).then(|| format!("the controller follows it at speed {speed} of its own rate"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_below_one_is_said() {
        assert_eq!(speed_note(1.0), None);
        let half = "the controller follows it at speed 0.5 of its own rate";
        assert_eq!(speed_note(0.5).as_deref(), Some(half));
        assert_eq!(speed_note(0.0).as_deref(), Some(STANDS_STILL));
    }
}
