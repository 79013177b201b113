//! A motion that is to leave the supervised one: supervised beside it until the controller has changed over, or says that it does not.

use super::later_stop::Surroundings;
use super::supervised_motion::{MotionStatus, is_fresh};
use super::supervisor::Supervisor;

impl Supervisor {
    /// Takes the joining motion over as the supervised one once the controller follows it; forgets it where the controller refuses it, or
    /// says nothing of it 300 ms after it was to begin (one that it begins later is stopped as nobody's).
    pub(super) fn watch_joining(&mut self, now_mono_ns: i64) {
        let fresh = self.state.as_ref();
        let fresh = fresh.filter(|state| is_fresh(state, now_mono_ns));
        let (Some(joining), Some(state)) = (&mut self.joining, fresh) else {
            return;
        };
        let id = joining.id;
        match joining.update(state) {
            MotionStatus::Executing(_) | MotionStatus::Stopping => {
                let left = std::mem::replace(&mut self.supervised, self.joining.take());
                if let Some(left) = left {
                    tracing::info!("trajectory {} is over: joined by {id}", left.id);
                }
            }
            MotionStatus::Over(reason) => {
                self.joining = None;
                tracing::info!("trajectory {id} is not begun: {reason}");
            }
            MotionStatus::Pending => {
                let is_known = state.values.pending_trajectory_id == id;
                if joining.is_overdue() && !is_known {
                    self.joining = None;
                    tracing::warn!(
                        "trajectory {id} is not begun: the controller does not speak of it"
                    );
                }
            }
        }
    }

    /// Requests a stop where the joining motion is not certified any more, as it comes after the supervised one.
    pub(super) fn check_joining(&mut self, now_mono_ns: i64) {
        let (Some(left), Some(joining)) = (&self.supervised, &mut self.joining) else {
            return;
        };
        let Some(switch) = &joining.leaves else {
            return;
        };
        let progress = left.progress_of_joining_motion(switch, now_mono_ns);
        let surroundings = Surroundings {
            rules: &self.rules,
            live: &self.live,
            now_mono_ns,
        };
        surroundings.check(joining, progress);
    }
}
