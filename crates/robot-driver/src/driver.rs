//! The robot's place on the wire: set-points in, states and heartbeats out.

use std::time::Duration;

use pcc_model::Robot;
use shared_types::{
    clock::mono_now_ns,
    codes::{MotorFault, ProcessKind},
    ipc::{self, Heartbeats, IpcError, IpcNode, IpcOptions, Publisher, Role, RoleLock, Subscriber},
    message::{RobotState, Setpoint},
};
use tracing::debug;

use crate::driven_robot::DrivenRobot;
use crate::setpoint::{MotorTargets, ReferenceLimits, TendonState};
use crate::shared_memory::claim_shared_memory;
use crate::shutdown::Shutdown;
use crate::tendon_vector::TendonVector;

/// Time between two heartbeats, ns.
const HEARTBEAT_PERIOD_NS: i64 = 20_000_000;
/// Usual length of a cycle.
const PERIOD: Duration = Duration::from_millis(1);

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
            period: PERIOD,
            limits: ReferenceLimits::of(robot, PERIOD),
        }
    }
}

/// The robot's place, taken by this process; it says nothing yet.
pub struct RobotConnection {
    setpoints: Subscriber<Setpoint>,
    states: Publisher<RobotState>,
    heartbeats: Heartbeats,
    robot: Robot,
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
            robot: robot.clone(),
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
        self.drive_until(Shutdown::default(), state)
    }

    /// As [`Self::drive_from`], for a program that can be asked to end before the robot is driven.
    #[must_use]
    pub fn drive_until(self, shutdown: Shutdown, state: &TendonState) -> RobotDriver {
        let now_ns = mono_now_ns();
        RobotDriver {
            driven: DrivenRobot::new(&self.robot, self.settings.limits, state),
            deadline_ns: now_ns,
            instance: now_ns.unsigned_abs(),
            next_beat_ns: now_ns,
            shutdown,
            connection: self,
        }
    }
}

/// Drives a robot's motors: one call of [`Self::next_targets`] and one of [`Self::report`] a cycle.
///
/// It leaves the robot's place when it is dropped, which is to be done at rest alone: [`Self::shut_down`].
pub struct RobotDriver {
    connection: RobotConnection,
    driven: DrivenRobot,
    /// When the next cycle begins, ns of CLOCK_MONOTONIC.
    deadline_ns: i64,
    /// Instance number: the time of the start, ns of CLOCK_MONOTONIC, which differs from that of every other robot.
    instance: u64,
    next_beat_ns: i64,
    shutdown: Shutdown,
}

impl RobotDriver {
    /// Waits for the next cycle, takes the newest set-point, and says what the motors are to do; none once it was shut down and they stand
    /// still. Cycles that were missed are left out.
    pub fn next_targets(&mut self) -> Option<MotorTargets> {
        if self.shutdown.is_asked() {
            if self.driven.is_at_rest() {
                return None;
            }
            self.driven.ramp_to_rest();
        }
        let period_ns = self.connection.settings.period.as_nanos() as i64;
        self.deadline_ns = (self.deadline_ns + period_ns).max(mono_now_ns());
        realtime::sleep_until(self.deadline_ns);
        let setpoint = ipc::newest(&self.connection.setpoints);
        // The clock is read after the set-point, whose stamp must not lie in the future because of a stall in between.
        let targets = self.driven.next_targets(mono_now_ns(), setpoint.as_ref());
        self.beat(targets.stamp_ns);
        Some(targets)
    }

    /// Publishes the robot's state: tendon lengths relative to straight as measured in this cycle, m (those beyond the robot's tendons are 0),
    /// and what is wrong with the motors. One that cannot be sent is left out: the controller stops the robot where they stay away.
    pub fn report(&mut self, measured_tendon_m: &TendonVector, fault: MotorFault) {
        let state = self.driven.state(measured_tendon_m, fault);
        if let Err(error) = self.connection.states.send_copy(state) {
            debug!(?error, "cannot send the state");
        }
    }

    /// Ramps the motors to rest; go on with cycles until there are no targets.
    pub fn shut_down(&self) {
        self.shutdown.ask();
    }

    /// Has Ctrl-C and SIGTERM do what [`Self::shut_down`] does, in place of ending the process in motion, until this is dropped.
    ///
    /// # Errors
    /// [`IpcError::Failed`] where the system refuses a handler.
    pub fn shut_down_at_signals(&mut self) -> Result<(), IpcError> {
        self.shutdown.ask_at_signals("robot")
    }

    fn beat(&mut self, now_ns: i64) {
        if now_ns < self.next_beat_ns {
            return;
        }
        self.next_beat_ns = now_ns + HEARTBEAT_PERIOD_NS;
        if let Err(error) = self.connection.heartbeats.send(self.instance) {
            debug!(?error, "cannot send a heartbeat");
        }
    }
}
