//! What the controller does, for everyone, and each cycle of it, for recorders.

use iceoryx2::prelude::ZeroCopySend;

use super::reason::ReasonText;
use super::wire::wire_message;
use crate::capacity::{DOF, HISTOGRAM_BINS, TENDONS};

wire_message! {
    /// State of the controller (service `controller_state`, one publisher: its relay thread, about 50 Hz).
    pub struct ControllerState: "pcc.v7.ControllerState", 832 bytes {
        /// Time of the cycle that the message describes, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// Identifies the process among all that had this role since the machine was booted: its start time, nanoseconds of
        /// `CLOCK_MONOTONIC`. Trajectories name their controller by it.
        pub instance: u64,
        /// [`super::RobotDescription::robot_hash`] of the controller's robot; a daemon of another one publishes nothing for it.
        pub robot_hash: u64,
        /// Cycles since the loop began.
        pub cycle: u64,
        /// The loop's period, nanoseconds.
        pub period_ns: u64,
        /// [`crate::codes::LoopState`].
        pub state: u32,
        /// [`crate::codes::LoopFault`], latched until reset.
        pub fault: u32,
        /// The trajectory executing, or the last one executed; 0: none yet.
        pub trajectory_id: u32,
        /// The last trajectory refused; 0: none yet.
        pub refused_trajectory_id: u32,
        /// [`crate::codes::Refusal`]: why `refused_trajectory_id` was refused.
        pub refusal: u32,
        /// The trajectory that will be joined at its switch; 0: none.
        pub pending_trajectory_id: u32,
        /// 1: a pause holds the robot on its path; 0: none does.
        pub paused: u32,
        /// Cycles that began more than one and a half periods after the one before.
        pub late_cycles: u32,
        /// Most late cycles that came one after the other.
        pub longest_late_run: u32,
        /// Linux thread id of the loop, so that its system calls can be counted from outside.
        pub loop_thread_id: u32,
        /// Commanded configuration, radians.
        pub commanded_configuration_rad: [f64; DOF],
        /// Velocity of the commanded configuration, rad/s.
        pub commanded_velocity_rad_s: [f64; DOF],
        /// Commanded tendon length changes, metres.
        pub commanded_tendon_m: [f64; TENDONS],
        /// Configuration that the measured tendons mean, radians.
        pub measured_configuration_rad: [f64; DOF],
        /// Norm of the low-passed difference between commanded and measured configuration, radians.
        pub tracking_error_rad: f64,
        /// Part of the measured tendon lengths that no configuration explains, metres (norm).
        pub slack_residual_m: f64,
        /// How far the set-point was from the last trajectory's start when the loop took it, metres (norm over the tendons); kept as a
        /// constant offset, so that nothing jumps.
        pub splice_error_m: f64,
        /// Time on the executing trajectory, seconds.
        pub trajectory_time_s: f64,
        /// Rate at which the time on the trajectory runs, 0..=1.
        pub rate: f64,
        /// Share of their own rate at which trajectories are followed, 0..=1, as last ordered; 1 when the process starts.
        pub speed: f64,
        /// What was requested before this does not begin: the newest of the process's start (not later than `instance`), the newest stop and
        /// the newest reset, nanoseconds of `CLOCK_MONOTONIC`. It may be later than `stamp_mono_ns`.
        pub wanted_from_mono_ns: i64,
        /// A goal that was given before this is over (service `goal`): as `wanted_from_mono_ns`, but without the stops that the daemon
        /// itself has ordered, nanoseconds of `CLOCK_MONOTONIC`; not later than `wanted_from_mono_ns`.
        pub goals_from_mono_ns: i64,
        /// [`super::Heartbeat::instance`] of the daemon whose trajectories are taken; 0: none was heard yet, any is.
        pub daemon_instance: u64,
        /// Set-points sent.
        pub setpoints_sent: u64,
        /// Allocations of the loop thread that its own arena served.
        pub loop_arena_allocations: u64,
        /// Allocations of the loop thread that reached the system allocator.
        pub loop_system_allocations: u64,
        /// [`crate::codes::Waiting`]: why the loop does not hold the robot.
        pub waiting: u32,
        /// Robot states that were not taken: invalid, repeated, too old or from the future.
        pub refused_robot_states: u32,
        /// Part of the robot's accepted set-point that no configuration explains, metres (norm); over 1e-6 the robot is not
        /// taken hold of.
        pub accepted_residual_m: f64,
        /// Wake-ups by lateness ([`crate::lateness`]).
        pub lateness_histogram: [u32; HISTOGRAM_BINS],
        /// What happened where a fault is latched, and what the loop waits for where it does not hold the robot.
        pub reason: ReasonText,
    }
}

wire_message! {
    /// One cycle of the loop (service `cycle`: slices of them, every cycle exactly once).
    pub struct Cycle: "pcc.v7.Cycle", 408 bytes {
        /// Counts the loop's cycles.
        pub sequence: u64,
        /// Time at which the trajectory was evaluated, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// Set-point: tendon length changes, metres.
        pub setpoint_m: [f64; TENDONS],
        /// Set-point: velocities of the tendons, m/s.
        pub setpoint_velocity_m_s: [f64; TENDONS],
        /// Set-point: accelerations of the tendons, m/s².
        pub setpoint_acceleration_m_s2: [f64; TENDONS],
        /// Measured tendon length changes, metres.
        pub measured_tendon_m: [f64; TENDONS],
        /// Commanded configuration, radians.
        pub commanded_configuration_rad: [f64; DOF],
        /// Measured configuration, radians.
        pub measured_configuration_rad: [f64; DOF],
        /// [`crate::codes::LoopState`].
        pub state: u32,
        /// The executing trajectory; 0: none.
        pub trajectory_id: u32,
    }
}
