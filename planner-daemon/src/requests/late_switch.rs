//! Where a motion is left, chosen while the one that leaves it is planned.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use shared_types::clock::mono_now_ns;

use super::lead_times::{EARLY_TO_THE_LOOP, Work};
use super::plan_runner::LateSwitch;
use crate::execution::{RobotMotion, Shared, Switch};

/// Where a motion is left by one that is ready within the one of `leads` that is for what is to be done, whenever it is asked, and not before
/// `not_before_mono_ns`; none where nothing is to be done and the switch that was chosen last is in time.
pub(super) fn late_switch(
    robot: Shared<RobotMotion>,
    first: Switch,
    leads: [(Work, Duration); 6],
    not_before_mono_ns: Option<i64>,
) -> LateSwitch {
    let last = Mutex::new(first);
    Box::new(move |to_be_done, can_begin| {
        let RobotMotion::Following(followed) = robot.get() else {
            return None;
        };
        let now = mono_now_ns();
        let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
        let in_time = followed.is_ahead(&last, EARLY_TO_THE_LOOP.mul_f64(0.75), now);
        if to_be_done.is_known() && in_time {
            return None;
        }
        let work = Work::from(to_be_done);
        let (_, lead) = leads.into_iter().find(|(of, _)| *of == work)?;
        let switch = followed.switch_after(lead.max(until(not_before_mono_ns, now)), now)?;
        let is_of_the_same = switch.trajectory_id == last.trajectory_id;
        let switch = Some(switch).filter(|it| is_of_the_same && can_begin(&it.state))?;
        *last = switch;
        Some(switch)
    })
}

/// Time until a begin that is not to be sooner.
pub(super) fn until(not_before_mono_ns: Option<i64>, now_mono_ns: i64) -> Duration {
    let left_ns = not_before_mono_ns.map_or(0, |begin| begin.saturating_sub(now_mono_ns));
    Duration::from_nanos(left_ns.max(0).unsigned_abs())
}
