//! Where a motion is left, chosen while the one that leaves it is planned.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use shared_types::clock::mono_now_ns;

use super::lead_times::{EARLY_TO_THE_LOOP, Work, lead_of_the_same_work};
use super::plan_runner::LateSwitch;
use crate::execution::{RobotMotion, Shared, Switch};

/// The switch that was chosen last.
struct Chosen {
    switch: Switch,
    /// What was to be done then, and when that was; none of the switch with which the plan began.
    work: Option<(Work, Instant)>,
}

/// Where a motion is left by one that is ready within the one of `leads` that is for what is to be done, whenever it is asked, and not before
/// `not_before_mono_ns`; none where nothing is to be done and the switch that was chosen last is in time. Work that came too late may take as
/// long once more.
pub(super) fn late_switch(
    robot: Shared<RobotMotion>,
    first: Switch,
    leads: [(Work, Duration); Work::FROM_A_LATE_SWITCH.len()],
    not_before_mono_ns: Option<i64>,
) -> LateSwitch {
    let last = Mutex::new(Chosen {
        switch: first,
        work: None,
    });
    Box::new(move |to_be_done, can_begin| {
        let RobotMotion::Following(followed) = robot.get() else {
            return None;
        };
        let now = mono_now_ns();
        let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
        let in_time = followed.is_ahead(&last.switch, EARLY_TO_THE_LOOP.mul_f64(0.75), now);
        if to_be_done.is_known() && in_time {
            return None;
        }
        let (work, begun) = (Work::from(to_be_done), Instant::now());
        let (_, usual) = leads.into_iter().find(|(of, _)| *of == work)?;
        let lead = match last.work {
            Some((last_work, chosen)) if last_work == work => {
                lead_of_the_same_work(usual, begun - chosen)
            }
            _ => usual,
        };
        let switch = followed.switch_after(lead.max(until(not_before_mono_ns, now)), now)?;
        let is_of_the_same = switch.trajectory_id == last.switch.trajectory_id;
        let switch = Some(switch).filter(|it| is_of_the_same && can_begin(&it.state))?;
        *last = Chosen {
            switch,
            work: Some((work, begun)),
        };
        Some(switch)
    })
}

/// Time until a begin that is not to be sooner.
pub(super) fn until(not_before_mono_ns: Option<i64>, now_mono_ns: i64) -> Duration {
    let left_ns = not_before_mono_ns.map_or(0, |begin| begin.saturating_sub(now_mono_ns));
    Duration::from_nanos(left_ns.max(0).unsigned_abs())
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;

    use planning::ToBeDone;

    use super::*;
    use crate::fixtures;

    #[test]
    fn work_that_came_too_late_may_take_as_long_once_more() {
        let mut followed = fixtures::followed();
        followed.progress.mono_ns = mono_now_ns();
        let at_once = followed.switch_after(Duration::ZERO, followed.progress.mono_ns);
        let robot = Shared::default();
        robot.set(RobotMotion::Following(followed));
        let leads = Work::FROM_A_LATE_SWITCH.map(|work| (work, Duration::from_millis(1)));
        let choose = late_switch(robot, at_once.unwrap(), leads, None);
        let switch = || choose(ToBeDone::SegmentAgain, &|_| true).unwrap();
        let first = switch();
        let took = Duration::from_millis(20);
        sleep(took);
        let second = switch();
        let later_s = second.path_time_s - first.path_time_s;
        assert!(later_s > 2.0 * took.as_secs_f64(), "{later_s} s later");
    }
}
