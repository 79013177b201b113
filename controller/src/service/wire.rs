//! Conversion between messages and the loop's own types.

use pcc_model::Configuration;
use shared_types::{
    codes::{MotorFault, MotorState},
    message::{Cycle, RobotState, Setpoint, TrajectoryMessage},
    valid,
};

use trajectory::Knot;

use super::link::Report;
use crate::executive::{CycleOutput, Departure, Motion, RobotSample, TrajectoryRefusal};

/// Fills `motion` with a message's content; everything but its form is checked later.
///
/// # Errors
/// [`TrajectoryRefusal::Invalid`].
pub(super) fn fill(
    motion: &mut Motion,
    message: &TrajectoryMessage,
) -> Result<(), TrajectoryRefusal> {
    let checked = valid::Trajectory::try_from(message)?;
    motion.id = checked.id;
    motion.plan_id = checked.plan_id;
    motion.daemon_instance = checked.daemon_instance;
    motion.requested_ns = checked.requested_mono_ns;
    motion.begin_ns = checked.begin_mono_ns;
    motion.path_tolerance_rad = checked.path_tolerance_rad;
    motion.leaves = checked.leaves.map(|departure| Departure {
        trajectory_id: departure.trajectory_id,
        path_time_s: departure.path_time_s,
    });
    motion.knots.clear();
    motion.knots.extend(checked.knots.iter().map(|knot| Knot {
        time: knot.time_s,
        position: Configuration::from(knot.configuration_rad),
        velocity: Configuration::from(knot.velocity_rad_s),
        acceleration: Configuration::from(knot.acceleration_rad_s2),
    }));
    Ok(())
}

/// The robot's state, or `None` where the message is invalid. A robot that reports a fault counts as in fault whatever its state says;
/// a fault that a test has injected does not count, since it shows in the measurements.
pub(super) fn robot_sample(message: &RobotState) -> Option<RobotSample> {
    let valid::RobotState {
        state,
        fault,
        values,
    } = valid::RobotState::try_from(message).ok()?;
    let state = match fault {
        MotorFault::None | MotorFault::Injected => state,
        MotorFault::Motor | MotorFault::Sensor | MotorFault::Bus | MotorFault::Setpoint => {
            MotorState::Fault
        }
    };
    Some(RobotSample {
        stamp_ns: values.stamp_mono_ns,
        robot_hash: values.robot_hash,
        state,
        accepted_m: values.accepted_setpoint_m,
        accepted_velocity_m_s: values.accepted_velocity_m_s,
        measured_m: values.measured_tendon_m,
        measured_rad: Configuration::from(values.measured_configuration_rad),
    })
}

/// The set-point of a cycle.
pub(super) fn setpoint(sequence: u64, output: &CycleOutput) -> Setpoint {
    Setpoint {
        sequence,
        stamp_mono_ns: output.stamp_ns,
        trajectory_id: output.trajectory_id,
        state: output.state.code(),
        position_m: output.tendon_m,
        velocity_m_s: output.tendon_velocity_m_s,
        acceleration_m_s2: output.tendon_acceleration_m_s2,
    }
}

/// A cycle for recorders.
pub(super) fn cycle(report: &Report) -> Cycle {
    let output = &report.output;
    Cycle {
        sequence: report.sequence,
        stamp_mono_ns: output.stamp_ns,
        setpoint_m: output.tendon_m,
        setpoint_velocity_m_s: output.tendon_velocity_m_s,
        setpoint_acceleration_m_s2: output.tendon_acceleration_m_s2,
        measured_tendon_m: output.measured_m,
        commanded_configuration_rad: output.commanded.position.into(),
        measured_configuration_rad: output.measured_rad.into(),
        state: output.state.code(),
        trajectory_id: output.trajectory_id,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_that_tells_of_a_fault_is_in_fault_whatever_it_does() {
        for (fault, state) in [
            (MotorFault::None, MotorState::Following),
            (MotorFault::Injected, MotorState::Following),
            (MotorFault::Motor, MotorState::Fault),
            (MotorFault::Sensor, MotorState::Fault),
            (MotorFault::Bus, MotorState::Fault),
            (MotorFault::Setpoint, MotorState::Fault),
        ] {
            let message = RobotState {
                state: MotorState::Following.code(),
                fault: fault.code(),
                ..RobotState::ZEROED
            };
            let sample = robot_sample(&message);
            assert_eq!(sample.map(|sample| sample.state), Some(state), "{fault}");
        }
    }
}
