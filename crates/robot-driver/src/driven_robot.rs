//! A robot as its motors are driven: the reference that they track, and what is told of them.

use pcc_model::{Robot, TendonMap};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{MotorFault, MotorState};
use shared_types::message::{RobotState, Setpoint};
use tracing::{info, warn};

use crate::reference::{Reference, largest_difference};
use crate::setpoint::{Mode, MotorTargets, ReferenceLimits, TendonState};
use crate::tendon_vector::{TENDONS, TendonVector};

/// A robot whose motors are driven: one call of [`Self::next_targets`] and one of [`Self::state`] a cycle.
pub struct DrivenRobot {
    tendons: TendonMap,
    robot_hash: u64,
    reference: Reference,
    /// The mode that was told to the log.
    mode: Mode,
    /// When this cycle began, ns of CLOCK_MONOTONIC.
    stamp_ns: i64,
    sequence: u64,
}

impl DrivenRobot {
    /// Motors that are in this state: where it moves, they first ramp to rest. They begin at the lengths of the configuration that fits theirs
    /// best, for the controller begins only at a configuration.
    #[must_use]
    pub fn new(robot: &Robot, limits: ReferenceLimits, state: &TendonState) -> Self {
        let (tendons, now_ns) = (robot.tendons.clone(), mono_now_ns());
        let state = TendonState {
            position_m: nearest_lengths(&tendons, &state.position_m),
            velocity_m_s: nearest_lengths(&tendons, &state.velocity_m_s),
        };
        let reference = Reference::new(limits, now_ns, &state);
        Self {
            mode: reference.mode(),
            robot_hash: robot.hash(),
            tendons,
            reference,
            stamp_ns: now_ns,
            sequence: 0,
        }
    }

    /// Begins a cycle at `now_ns` (CLOCK_MONOTONIC): what the motors are to do then, by the set-point that has arrived, if any.
    pub fn next_targets(&mut self, now_ns: i64, setpoint: Option<&Setpoint>) -> MotorTargets {
        self.stamp_ns = now_ns;
        let targets = self.reference.step(now_ns, setpoint);
        self.log_mode();
        targets
    }

    /// The robot's state: tendon lengths relative to straight as measured in this cycle, m (those beyond the robot's tendons are 0), and what
    /// is wrong with the motors.
    pub fn state(&mut self, measured_tendon_m: &TendonVector, fault: MotorFault) -> RobotState {
        let measured = &measured_tendon_m[..self.tendons.count()];
        self.sequence += 1;
        let fault = match self.reference.mode() {
            Mode::Fault(_) => MotorFault::Setpoint,
            _ => fault,
        };
        RobotState {
            sequence: self.sequence,
            stamp_mono_ns: self.stamp_ns,
            robot_hash: self.robot_hash,
            accepted_sequence: self.reference.accepted_sequence(),
            state: MotorState::from(self.reference.mode()).code(),
            fault: fault.code(),
            accepted_setpoint_m: *self.reference.position_m(),
            accepted_velocity_m_s: self.reference.velocity_m_s(),
            measured_tendon_m: *measured_tendon_m,
            measured_configuration_rad: self.tendons.configuration(measured).into(),
            ramps_to_rest: self.reference.ramps_to_rest(),
            rejected_setpoints: self.reference.refused(),
        }
    }

    /// Ramps to rest from now on.
    pub fn ramp_to_rest(&mut self) {
        self.reference.ramp_to_rest();
    }

    /// Whether the motors are to stand still.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.reference.velocity_m_s() == [0.0; TENDONS]
    }

    fn log_mode(&mut self) {
        let mode = self.reference.mode();
        if mode == self.mode {
            return;
        }
        match mode {
            Mode::Fault(refusal) => warn!(%refusal, "set-point refused: fault, ramping to rest"),
            Mode::Ramping => warn!(
                silent_ms = self.reference.silent_s() * 1e3,
                set_point_age_ms = self.reference.set_point_age_s(self.stamp_ns) * 1e3,
                "ramping to rest: no set-point, one that is too far after a hold-up of this driver, or the driver ends"
            ),
            Mode::Idle | Mode::Following | Mode::AtRestAfterLoss => info!(?mode, "robot"),
        }
        self.mode = mode;
    }
}

/// The lengths of the configuration that fits tendon lengths best, or the same of their rates: both are linear in it.
fn nearest_lengths(tendons: &TendonMap, lengths: &TendonVector) -> TendonVector {
    let count = tendons.count();
    let shape = tendons.configuration(&lengths[..count]);
    let mut nearest = [0.0; TENDONS];
    tendons.lengths(&shape, &mut nearest[..count]);
    nearest
}

/// How far tendon lengths (m, relative to the straight robot) are from those of the configuration that fits them best, m: so far motors that are
/// driven from there jump at the begin.
#[must_use]
pub fn off_configuration_m(robot: &Robot, lengths_m: &TendonVector) -> f64 {
    largest_difference(&nearest_lengths(&robot.tendons, lengths_m), lengths_m)
}
