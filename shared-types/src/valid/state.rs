//! States: the wire values once they are known to be finite, next to their codes' meanings.
//!
//! No allocation, so the loop may use them.

use super::check::{Quantity, check_array, check_code, check_range, check_stamp, check_time};
use super::invalid::{Invalid, Reason, invalid};
use crate::codes::{LoopFault, LoopState, MotorFault, MotorState, Refusal, Waiting};
use crate::message;

/// Checks that the numbers of array fields are finite and of a magnitude that arithmetic survives; returns the first error.
macro_rules! check_arrays {
    ($values:ident { $($field:ident: $quantity:ident,)* }) => {
        $(check_array(stringify!($field), &$values.$field, Quantity::$quantity)?;)*
    };
}

/// A robot's state with known codes and finite numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotState {
    /// What the motor end does.
    pub state: MotorState,
    /// What is wrong with the motor end.
    pub fault: MotorFault,
    /// The values, all finite.
    pub values: message::RobotState,
}

impl TryFrom<&message::RobotState> for RobotState {
    type Error = Invalid;

    fn try_from(wire: &message::RobotState) -> Result<Self, Invalid> {
        let values = *wire;
        check_stamp("stamp_mono_ns", values.stamp_mono_ns)?;
        check_arrays!(values {
            accepted_setpoint_m: Length,
            accepted_velocity_m_s: Rate,
            measured_tendon_m: Length,
            measured_configuration_rad: Angle,
        });
        let (state, fault) = (
            check_code("state", values.state)?,
            check_code("fault", values.fault)?,
        );
        Ok(Self {
            state,
            fault,
            values,
        })
    }
}

/// A controller's state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerState {
    /// What the loop does.
    pub state: LoopState,
    /// Why the loop is in fault.
    pub fault: LoopFault,
    /// Why the loop does not hold the robot.
    pub waiting: Waiting,
    /// Why the last refused trajectory was refused.
    pub refusal: Refusal,
    /// The values, all finite.
    pub values: message::ControllerState,
}

impl TryFrom<&message::ControllerState> for ControllerState {
    type Error = Invalid;

    fn try_from(wire: &message::ControllerState) -> Result<Self, Invalid> {
        let values = *wire;
        check_stamp("stamp_mono_ns", values.stamp_mono_ns)?;
        check_arrays!(values {
            commanded_configuration_rad: Angle,
            commanded_velocity_rad_s: Rate,
            commanded_tendon_m: Length,
            measured_configuration_rad: Angle,
        });
        check_finite("tracking_error_rad", values.tracking_error_rad)?;
        check_finite("slack_residual_m", values.slack_residual_m)?;
        check_finite("splice_error_m", values.splice_error_m)?;
        check_time("trajectory_time_s", values.trajectory_time_s)?;
        check_finite("accepted_residual_m", values.accepted_residual_m)?;
        check_range(values.rate, 0.0, 1.0, "0..=1").map_err(|reason| invalid("rate", reason))?;
        check_range(values.speed, 0.0, 1.0, "0..=1").map_err(|reason| invalid("speed", reason))?;
        check_stamp("wanted_from_mono_ns", values.wanted_from_mono_ns)?;
        check_stamp("goals_from_mono_ns", values.goals_from_mono_ns)?;
        Ok(Self {
            state: check_code("state", values.state)?,
            fault: check_code("fault", values.fault)?,
            waiting: check_code("waiting", values.waiting)?,
            refusal: check_code("refusal", values.refusal)?,
            values,
        })
    }
}

/// One cycle of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// The controller's state.
    pub state: LoopState,
    /// The values, all finite.
    pub values: message::Cycle,
}

impl TryFrom<&message::Cycle> for Cycle {
    type Error = Invalid;

    fn try_from(wire: &message::Cycle) -> Result<Self, Invalid> {
        let values = *wire;
        check_stamp("stamp_mono_ns", values.stamp_mono_ns)?;
        check_arrays!(values {
            setpoint_m: Length,
            setpoint_velocity_m_s: Rate,
            setpoint_acceleration_m_s2: Rate,
            measured_tendon_m: Length,
            commanded_configuration_rad: Angle,
            measured_configuration_rad: Angle,
        });
        Ok(Self {
            state: check_code("state", values.state)?,
            values,
        })
    }
}

fn check_finite(field: &'static str, value: f64) -> Result<(), Invalid> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(invalid(field, Reason::NotFinite { value }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valid::BadCase;

    /// Applies each change to the message of zeros, which is valid, and expects an error that begins with the text.
    fn assert_refused<W: Copy, V: std::fmt::Debug>(
        good: W,
        validate: fn(&W) -> Result<V, Invalid>,
        cases: &[BadCase<W>],
    ) {
        validate(&good).unwrap();
        for (change, text) in cases {
            let mut wire = good;
            change(&mut wire);
            let error = validate(&wire).expect_err(text);
            assert!(
                error.to_string().starts_with(text),
                "{error} does not begin with {text:?}"
            );
        }
    }

    #[test]
    fn robot_states_are_checked() {
        assert_refused(
            message::RobotState::ZEROED,
            |wire| RobotState::try_from(wire),
            &[
                (|s| s.stamp_mono_ns = -1, "stamp_mono_ns"),
                (|s| s.state = 5, "state: 5"),
                (|s| s.fault = 6, "fault: 6"),
                (
                    |s| s.accepted_setpoint_m[0] = f64::NAN,
                    "accepted_setpoint_m[0]",
                ),
                (
                    |s| s.accepted_velocity_m_s[0] = f64::NAN,
                    "accepted_velocity_m_s[0]",
                ),
                (
                    |s| s.measured_tendon_m[8] = f64::INFINITY,
                    "measured_tendon_m[8]",
                ),
                (
                    |s| s.measured_configuration_rad[5] = f64::NAN,
                    "measured_configuration_rad[5]",
                ),
            ],
        );
    }

    #[test]
    fn controller_states_are_checked() {
        assert_refused(
            message::ControllerState::ZEROED,
            |wire| ControllerState::try_from(wire),
            &[
                (|s| s.stamp_mono_ns = -1, "stamp_mono_ns"),
                (|s| s.state = 5, "state: 5"),
                (|s| s.fault = 99, "fault: 99"),
                (|s| s.refusal = 99, "refusal: 99"),
                (|s| s.waiting = 99, "waiting: 99"),
                (|s| s.accepted_residual_m = f64::NAN, "accepted_residual_m"),
                (
                    |s| s.commanded_configuration_rad[0] = f64::NAN,
                    "commanded_configuration_rad[0]",
                ),
                (
                    |s| s.commanded_velocity_rad_s[0] = f64::NAN,
                    "commanded_velocity_rad_s[0]",
                ),
                (
                    |s| s.commanded_tendon_m[0] = f64::NAN,
                    "commanded_tendon_m[0]",
                ),
                (
                    |s| s.measured_configuration_rad[0] = f64::NAN,
                    "measured_configuration_rad[0]",
                ),
                (|s| s.tracking_error_rad = f64::NAN, "tracking_error_rad"),
                (|s| s.slack_residual_m = f64::NAN, "slack_residual_m"),
                (|s| s.splice_error_m = f64::INFINITY, "splice_error_m"),
                (|s| s.trajectory_time_s = f64::NAN, "trajectory_time_s"),
                (|s| s.trajectory_time_s = -1e300, "trajectory_time_s is -1"),
                (
                    |s| s.trajectory_time_s = 1.1e6,
                    "trajectory_time_s is 1100000; allowed is 0..=1e6 s",
                ),
                (|s| s.rate = 1.5, "rate is 1.5; allowed is 0..=1"),
                (|s| s.speed = -0.5, "speed is -0.5; allowed is 0..=1"),
                (|s| s.wanted_from_mono_ns = -1, "wanted_from_mono_ns"),
                (|s| s.goals_from_mono_ns = -1, "goals_from_mono_ns"),
            ],
        );
    }

    #[test]
    fn cycles_are_checked() {
        assert_refused(
            message::Cycle::ZEROED,
            |wire| Cycle::try_from(wire),
            &[
                (|c| c.stamp_mono_ns = -1, "stamp_mono_ns"),
                (|c| c.state = 5, "state: 5"),
                (|c| c.setpoint_m[0] = f64::NAN, "setpoint_m[0]"),
                (
                    |c| c.setpoint_velocity_m_s[0] = f64::NAN,
                    "setpoint_velocity_m_s[0]",
                ),
                (
                    |c| c.setpoint_acceleration_m_s2[0] = f64::NAN,
                    "setpoint_acceleration_m_s2[0]",
                ),
                (
                    |c| c.measured_tendon_m[0] = f64::NAN,
                    "measured_tendon_m[0]",
                ),
                (
                    |c| c.commanded_configuration_rad[0] = f64::NAN,
                    "commanded_configuration_rad[0]",
                ),
                (
                    |c| c.measured_configuration_rad[0] = f64::NAN,
                    "measured_configuration_rad[0]",
                ),
            ],
        );
    }
}
