//! The robot's place on the wire: set-points in, states and heartbeats out.

use std::time::Duration;

use pcc_model::{Robot, TendonMap};
use shared_types::{
    clock::mono_now_ns,
    codes::{MotorFault, MotorState, ProcessKind},
    ipc::{self, Heartbeats, IpcError, IpcNode, IpcOptions, Publisher, Role, RoleLock, Subscriber},
    message::{RobotState, Setpoint},
};
use tracing::{debug, info, warn};

use crate::reference::Reference;
use crate::setpoint::{Mode, MotorTargets, ReferenceLimits, TendonState};
use crate::shared_memory::claim_shared_memory;
use crate::tendon_vector::{TENDONS, TendonVector};

/// Time between two heartbeats, ns.
const HEARTBEAT_PERIOD_NS: i64 = 20_000_000;

/// How a driver's loop runs, and what it lets its motors do.
#[derive(Clone, Copy, Debug)]
pub struct DriverSettings {
    /// Length of a cycle; the controller's is 1 ms.
    pub period: Duration,
    /// Limits of the reference.
    pub limits: ReferenceLimits,
}

impl DriverSettings {
    /// A cycle of 1 ms, and the limits of the robot file.
    #[must_use]
    pub fn of(robot: &Robot) -> Self {
        Self {
            period: Duration::from_millis(1),
            limits: ReferenceLimits::of(robot),
        }
    }
}

/// The robot's place, taken by this process; it says nothing yet.
pub struct RobotConnection {
    setpoints: Subscriber<Setpoint>,
    states: Publisher<RobotState>,
    heartbeats: Heartbeats,
    tendons: TendonMap,
    robot_hash: u64,
    settings: DriverSettings,
    // Declared last: the node outlives its ports, and the role all.
    _node: IpcNode,
    _role: RoleLock,
}

impl RobotConnection {
    /// Takes the robot's place under a prefix and root.
    ///
    /// # Errors
    /// [`IpcError::AlreadyRunning`] where another robot lives there, or what a service or a port failed with.
    pub fn open(
        options: &IpcOptions,
        robot: &Robot,
        settings: &DriverSettings,
    ) -> Result<Self, IpcError> {
        let role = RoleLock::acquire(options, Role::Robot)?;
        let node = IpcNode::create(options, "robot")?;
        let connection = Self {
            setpoints: ipc::subscriber(&node, &ipc::setpoint_service(&node)?)?,
            states: ipc::publisher(&node, &ipc::robot_state_service(&node)?)?,
            heartbeats: Heartbeats::open(&node, ProcessKind::Robot)?,
            tendons: robot.tendons.clone(),
            robot_hash: robot.hash(),
            settings: *settings,
            _node: node,
            _role: role,
        };
        claim_shared_memory(options)?;
        Ok(connection)
    }

    /// Begins to drive motors that are in this state: where it moves, they first ramp to rest. They begin at the lengths of the configuration
    /// that fits theirs best, for the controller begins only at a configuration.
    #[must_use]
    pub fn drive_from(self, state: &TendonState) -> RobotDriver {
        let now_ns = mono_now_ns();
        let count = self.tendons.count();
        let shape = self.tendons.configuration(&state.position_m[..count]);
        let mut position_m = [0.0; TENDONS];
        self.tendons.lengths(&shape, &mut position_m[..count]);
        let state = TendonState {
            position_m,
            ..*state
        };
        let reference = Reference::new(self.settings.limits, now_ns, &state);
        RobotDriver {
            mode: reference.mode(),
            reference,
            deadline_ns: now_ns,
            stamp_ns: now_ns,
            sequence: 0,
            instance: now_ns.unsigned_abs(),
            next_beat_ns: now_ns,
            connection: self,
        }
    }
}

/// Drives a robot's motors: one call of [`Self::next_targets`] and one of [`Self::report`] a cycle.
pub struct RobotDriver {
    connection: RobotConnection,
    reference: Reference,
    /// The mode that was told to the log.
    mode: Mode,
    /// When the next cycle begins, ns of CLOCK_MONOTONIC.
    deadline_ns: i64,
    /// When this one began.
    stamp_ns: i64,
    sequence: u64,
    /// Instance number: the time of the start, ns of CLOCK_MONOTONIC, which differs from that of every other robot.
    instance: u64,
    next_beat_ns: i64,
}

impl RobotDriver {
    /// Waits for the next cycle, takes the newest set-point, and says what the motors are to do. Cycles that were missed are left out.
    pub fn next_targets(&mut self) -> MotorTargets {
        let period_ns = self.connection.settings.period.as_nanos() as i64;
        self.deadline_ns = (self.deadline_ns + period_ns).max(mono_now_ns());
        realtime::sleep_until(self.deadline_ns);
        let setpoint = ipc::newest(&self.connection.setpoints);
        // The clock is read after the set-point, whose stamp must not lie in the future because of a stall in between.
        self.stamp_ns = mono_now_ns();
        let targets = self.reference.step(self.stamp_ns, setpoint.as_ref());
        self.log_mode();
        self.beat();
        targets
    }

    /// Publishes the robot's state: tendon lengths relative to straight as measured in this cycle, m (those beyond the robot's tendons are 0),
    /// and what is wrong with the motors.
    pub fn report(&mut self, measured_tendon_m: &TendonVector, fault: MotorFault) {
        let RobotConnection {
            tendons,
            robot_hash,
            states,
            ..
        } = &self.connection;
        let measured = &measured_tendon_m[..tendons.count()];
        self.sequence += 1;
        let fault = match self.reference.mode() {
            Mode::Fault(_) => MotorFault::Setpoint,
            _ => fault,
        };
        let state = RobotState {
            sequence: self.sequence,
            stamp_mono_ns: self.stamp_ns,
            robot_hash: *robot_hash,
            accepted_sequence: self.reference.accepted_sequence(),
            state: MotorState::from(self.reference.mode()).code(),
            fault: fault.code(),
            accepted_setpoint_m: *self.reference.position_m(),
            accepted_velocity_m_s: self.reference.velocity_m_s(),
            measured_tendon_m: *measured_tendon_m,
            measured_configuration_rad: tendons.configuration(measured).into(),
            ramps_to_rest: self.reference.ramps_to_rest(),
            rejected_setpoints: self.reference.refused(),
        };
        if let Err(error) = states.send_copy(state) {
            debug!(?error, "cannot send the state");
        }
    }

    fn log_mode(&mut self) {
        let mode = self.reference.mode();
        if mode == self.mode {
            return;
        }
        match mode {
            Mode::Fault(refusal) => warn!(%refusal, "set-point refused: fault, ramping to rest"),
            Mode::Ramping => warn!("no set-point: ramping to rest"),
            Mode::Idle | Mode::Following | Mode::AtRestAfterLoss => info!(?mode, "robot"),
        }
        self.mode = mode;
    }

    fn beat(&mut self) {
        if self.stamp_ns < self.next_beat_ns {
            return;
        }
        self.next_beat_ns = self.stamp_ns + HEARTBEAT_PERIOD_NS;
        if let Err(error) = self.connection.heartbeats.send(self.instance) {
            debug!(?error, "cannot send a heartbeat");
        }
    }
}
