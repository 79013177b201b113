//! What goes into a cycle of the state machine, and what comes out.

use pcc_model::Configuration;
use shared_types::codes::{LoopFault, LoopState, MotorState, Waiting};

use super::pace::Commanded;
use crate::TendonVector;

/// The robot's state as the loop uses it.
#[derive(Clone, Copy, Debug)]
pub struct RobotSample {
    /// Time of the measurement, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
    /// Which robot it is.
    pub robot_hash: u64,
    /// State of the motors.
    pub state: MotorState,
    /// The reference of the robot's motors, m.
    pub accepted_m: TendonVector,
    /// Velocity of the motors' reference, m/s.
    pub accepted_velocity_m_s: TendonVector,
    /// Measured tendon length changes, m.
    pub measured_m: TendonVector,
    /// Measured configuration, rad.
    pub measured_rad: Configuration,
}

/// The robot's state since the last cycle.
#[derive(Clone, Copy, Debug)]
pub enum RobotUpdate<'a> {
    /// No state.
    Nothing,
    /// Its newest state.
    State(&'a RobotSample),
    /// A state that is invalid.
    Invalid,
}

/// The inputs of one cycle beside its time and the robot's state.
#[derive(Clone, Copy, Debug)]
pub struct CycleInput {
    /// Whether the daemon's heartbeats arrive.
    pub daemon_alive: bool,
    /// Rounds of the guard thread so far; while they go on, stops and the loss of the daemon are noticed.
    pub guard_rounds: u64,
}

/// One cycle's result: the set-point, and everything that is published about it.
#[derive(Clone, Copy, Debug)]
pub struct CycleOutput {
    /// The instant for which the set-point was evaluated, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
    /// Whether the set-point is to be sent (not while detached).
    pub send: bool,
    /// State of the loop.
    pub state: LoopState,
    /// The latched fault, `None` of [`LoopFault`] without one.
    pub fault: LoopFault,
    /// Why the robot is not held.
    pub waiting: Waiting,
    /// Hash of the robot file that the robot is set up for; 0 before its first state.
    pub robot_hash: u64,
    /// Distance of the robot's accepted set-point from the tendon lengths of every configuration, m.
    pub accepted_residual_m: f64,
    /// Robot states that were refused since the loop began.
    pub refused_robot_states: u32,
    /// The trajectory being followed, 0 for none.
    pub trajectory_id: u32,
    /// The trajectory that is joined at its switch, 0 for none.
    pub pending_trajectory_id: u32,
    /// Commanded configuration and its derivatives.
    pub commanded: Commanded,
    /// Set-point of the tendon length changes, m.
    pub tendon_m: TendonVector,
    /// Velocity of the set-point, m/s.
    pub tendon_velocity_m_s: TendonVector,
    /// Acceleration of the set-point, m/s².
    pub tendon_acceleration_m_s2: TendonVector,
    /// Newest measured tendon length changes, m; zeros before the first.
    pub measured_m: TendonVector,
    /// Newest measured configuration, rad; zeros before the first.
    pub measured_rad: Configuration,
    /// Filtered tracking error, rad.
    pub tracking_error_rad: f64,
    /// The tracking error that is allowed, rad.
    pub path_tolerance_rad: f64,
    /// Distance of the measured tendon lengths from those of every configuration, m.
    pub slack_residual_m: f64,
    /// How far the set-point was from the last trajectory's start when it was taken, m (norm over the tendons); kept as a constant offset.
    pub splice_error_m: f64,
    /// Path time, s.
    pub path_time_s: f64,
    /// Path time per time, 0 to 1.
    pub rate: f64,
    /// The ordered rate, 0 to 1.
    pub speed: f64,
    /// Whether a pause holds the robot on its path.
    pub paused: bool,
    /// Whether this cycle came late.
    pub late: bool,
}
