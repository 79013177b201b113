//! The check that a controller can execute a motion.

use pcc_model::Configuration;
use shared_types::codes::{LoopFault, LoopState};
use shared_types::valid;

use super::refusal::ExecutionRefusal;
use super::supervised_motion::is_fresh;

/// Largest distance of a motion's start from the commanded configuration, rad.
const START_TOLERANCE_RAD: f64 = 1e-6;

/// Checks that a fresh state reports a controller that is idle and holds the motion's start (within 1e-6 rad); returns its instance.
///
/// # Errors
/// The first [`ExecutionRefusal`] that applies.
pub(crate) fn check_controller(
    state: Option<&valid::ControllerState>,
    robot_hash: u64,
    start: &Configuration,
    busy: Option<u32>,
    now_mono_ns: i64,
) -> Result<u64, ExecutionRefusal> {
    let state = controller_there(state, robot_hash, now_mono_ns)?;
    if let Some(id) = busy {
        return Err(ExecutionRefusal::Busy { id });
    }
    if state.state != LoopState::Holding || state.fault != LoopFault::None {
        return Err(ExecutionRefusal::NotHolding {
            state: state.state,
            fault: state.fault,
        });
    }
    let commanded = Configuration::from(state.values.commanded_configuration_rad);
    let distance_rad = (start - commanded).norm();
    if distance_rad > START_TOLERANCE_RAD {
        return Err(ExecutionRefusal::StartsElsewhere { distance_rad });
    }
    Ok(state.values.instance)
}

/// The state of a controller that is there, at most 200 ms old, and set up for the robot with this hash.
///
/// # Errors
/// [`ExecutionRefusal::ControllerAbsent`] or [`ExecutionRefusal::OtherRobot`].
pub(super) fn controller_there(
    state: Option<&valid::ControllerState>,
    robot_hash: u64,
    now_mono_ns: i64,
) -> Result<&valid::ControllerState, ExecutionRefusal> {
    let state = state
        .filter(|state| is_fresh(state, now_mono_ns))
        .ok_or(ExecutionRefusal::ControllerAbsent)?;
    let (found, expected) = (state.values.robot_hash, robot_hash);
    match found == expected {
        true => Ok(state),
        false => Err(ExecutionRefusal::OtherRobot { found, expected }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::controller_state;

    const NOW: i64 = 5_000_000_000;
    const ROBOT: u64 = 3;

    fn holding() -> valid::ControllerState {
        controller_state(|values| {
            values.stamp_mono_ns = NOW - 20_000_000;
            values.state = LoopState::Holding.code();
            values.instance = 8;
            values.robot_hash = ROBOT;
            values.commanded_configuration_rad = [0.1; 6];
        })
    }

    fn check(state: Option<&valid::ControllerState>) -> Result<u64, ExecutionRefusal> {
        check_controller(state, ROBOT, &Configuration::repeat(0.1), None, NOW)
    }

    #[test]
    fn a_holding_controller_at_the_start_takes_a_motion() {
        assert_eq!(check(Some(&holding())), Ok(8));
    }

    #[test]
    fn every_other_controller_is_refused_with_its_reason() {
        use ExecutionRefusal as Refusal;
        assert_eq!(check(None), Err(Refusal::ControllerAbsent));
        let mut old = holding();
        old.values.stamp_mono_ns = NOW - 200_000_001;
        assert_eq!(check(Some(&old)), Err(Refusal::ControllerAbsent));
        let mut future = holding();
        future.values.stamp_mono_ns = NOW + 1;
        assert_eq!(check(Some(&future)), Err(Refusal::ControllerAbsent));
        let mut other = holding();
        other.values.robot_hash = 4;
        let (found, expected) = (4, ROBOT);
        let refusal = Refusal::OtherRobot { found, expected };
        assert_eq!(check(Some(&other)), Err(refusal));
        other.values.stamp_mono_ns = NOW + 1;
        assert_eq!(check(Some(&other)), Err(Refusal::ControllerAbsent));
        let mut busy = holding();
        busy.state = LoopState::Executing;
        let refusal = check(Some(&busy)).unwrap_err();
        assert!(refusal.to_string().contains("executing"), "{refusal}");
        let mut faulty = holding();
        (faulty.state, faulty.fault) = (LoopState::Fault, LoopFault::RobotLost);
        let refusal = check(Some(&faulty)).unwrap_err();
        assert!(refusal.to_string().contains("robot lost"), "{refusal}");
        let elsewhere = Configuration::repeat(0.1 + 1e-6);
        let refusal = check_controller(Some(&holding()), ROBOT, &elsewhere, None, NOW).unwrap_err();
        assert!(refusal.to_string().contains("1e-6 rad"), "{refusal}");
        let start = Configuration::repeat(0.1);
        let refusal = check_controller(Some(&holding()), ROBOT, &start, Some(4), NOW).unwrap_err();
        assert_eq!(refusal, Refusal::Busy { id: 4 });
    }
}
