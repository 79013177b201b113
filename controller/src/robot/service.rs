//! The simulated robot's process: one loop that takes set-points and publishes what the motors do.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::{heartbeat::Heartbeats, shared_memory};
use shared_types::{
    clock::mono_now_ns,
    codes::{MotorFault, ProcessKind},
    ipc::{self, IpcError, IpcNode, IpcOptions, Publisher, Role, RoleLock, Subscriber},
    message::{RobotState, Setpoint},
};
use tracing::{debug, info, warn};

use super::{Measurement, Mode, PoseMemory, RememberedPose, RobotConfig, SimulatedRobot};

/// Time between two heartbeats, ns.
const HEARTBEAT_PERIOD_NS: i64 = 20_000_000;

/// Switches from outside, turned by signals.
#[derive(Clone, Debug, Default)]
pub struct Switches {
    /// Whether the robot is to end.
    pub shutdown: Arc<AtomicBool>,
    /// Whether the configured tendon's motor sticks.
    pub stuck: Arc<AtomicBool>,
    /// Whether `robot_state` stays unpublished.
    pub mute: Arc<AtomicBool>,
}

struct Ports {
    setpoint: Subscriber<Setpoint>,
    state: Publisher<RobotState>,
    heartbeats: Heartbeats,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Ports {
    fn open(options: &IpcOptions) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "simulated-robot")?;
        Ok(Self {
            setpoint: ipc::subscriber(&node, &ipc::setpoint_service(&node)?)?,
            state: ipc::publisher(&node, &ipc::robot_state_service(&node)?)?,
            heartbeats: Heartbeats::open(&node, ProcessKind::Robot)?,
            _node: node,
        })
    }
}

/// The robot with its ports and its memory.
struct Process<'a> {
    config: &'a RobotConfig,
    switches: &'a Switches,
    ports: Ports,
    robot: SimulatedRobot,
    memory: Option<PoseMemory>,
    mode: Mode,
    sequence: u64,
    /// Instance number: the time of the start, ns of CLOCK_MONOTONIC, which differs from that of every other robot.
    instance: u64,
    robot_hash: u64,
    next_beat_ns: i64,
}

/// Runs the simulated robot until it is told to shut down.
///
/// # Errors
/// [`IpcError::AlreadyRunning`] where another robot lives under the same prefix and root, or what a service or a port
/// failed with.
pub fn run(
    config: &RobotConfig,
    options: &IpcOptions,
    switches: &Switches,
) -> Result<(), IpcError> {
    let _role = RoleLock::acquire(options, Role::Robot)?;
    let ports = Ports::open(options)?;
    shared_memory::claim(options)?;
    let memory = if config.remembers_pose {
        open_memory(options)
    } else {
        None
    };
    let pose = memory
        .as_ref()
        .and_then(PoseMemory::recall)
        .inspect(|_| info!("standing where the robot before this one stood"))
        .unwrap_or_else(|| config.start_pose());
    let now_ns = mono_now_ns();
    let robot = SimulatedRobot::new(config, now_ns, &pose);
    let mode = robot.reference().mode();
    let process = Process {
        config,
        switches,
        ports,
        robot,
        memory,
        mode,
        sequence: 0,
        instance: now_ns.unsigned_abs(),
        robot_hash: config.robot.hash(),
        next_beat_ns: now_ns,
    };
    if let Some(Err(refused)) = config.realtime_priority.map(realtime::use_fifo_priority) {
        warn!("{refused}");
    }
    if let Err(refused) = realtime::reduce_wakeup_latency() {
        warn!("{refused}");
    }
    process.serve();
    Ok(())
}

fn open_memory(options: &IpcOptions) -> Option<PoseMemory> {
    let path = options.root.join(format!("{}.robot.pose", options.prefix));
    PoseMemory::open(&path)
        .inspect_err(
            |error| warn!(%error, path = %path.display(), "the pose will not survive a kill"),
        )
        .ok()
}

impl Process<'_> {
    fn serve(mut self) {
        info!(period_us = self.config.period_ns / 1_000, "robot begins");
        let mut deadline_ns = mono_now_ns();
        while !self.switches.shutdown.load(Ordering::Relaxed) {
            deadline_ns = (deadline_ns + self.config.period_ns).max(mono_now_ns());
            realtime::sleep_until(deadline_ns);
            self.cycle();
        }
        if let Some(memory) = self.memory
            && let Err(error) = memory.forget()
        {
            warn!(%error, "the pose file stays");
        }
        info!("ended");
    }

    fn cycle(&mut self) {
        let target = ipc::newest(&self.ports.setpoint);
        // The clock is read after the set-point, whose stamp must not lie in the future because of a stall in between.
        let now_ns = mono_now_ns();
        let stuck = self.switches.stuck.load(Ordering::Relaxed);
        let stuck_tendon = stuck.then_some(self.config.stuck_tendon);
        let measured = self.robot.step(now_ns, target.as_ref(), stuck_tendon);
        self.remember();
        self.log_mode();
        self.sequence += 1;
        if !self.switches.mute.load(Ordering::Relaxed) {
            let state = self.state(now_ns, &measured);
            if let Err(error) = self.ports.state.send_copy(state) {
                debug!(?error, "cannot send the state");
            }
        }
        self.beat(now_ns);
    }

    fn remember(&mut self) {
        let reference = self.robot.reference();
        let pose = RememberedPose {
            position_m: *reference.position_m(),
            velocity_m_s: reference.velocity_m_s(),
        };
        if let Some(memory) = &mut self.memory {
            memory.remember(&pose);
        }
    }

    fn log_mode(&mut self) {
        let mode = self.robot.reference().mode();
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

    fn state(&self, now_ns: i64, measured: &Measurement) -> RobotState {
        let reference = self.robot.reference();
        let fault = match reference.mode() {
            Mode::Fault(_) => MotorFault::Setpoint,
            _ if self.switches.stuck.load(Ordering::Relaxed) => MotorFault::Injected,
            _ => MotorFault::None,
        };
        RobotState {
            sequence: self.sequence,
            stamp_mono_ns: now_ns,
            robot_hash: self.robot_hash,
            accepted_sequence: reference.accepted_sequence(),
            state: shared_types::codes::MotorState::from(reference.mode()).code(),
            fault: fault.code(),
            accepted_setpoint_m: *reference.position_m(),
            accepted_velocity_m_s: reference.velocity_m_s(),
            measured_tendon_m: measured.tendon_m,
            measured_configuration_rad: measured.configuration_rad.into(),
            ramps_to_rest: reference.ramps_to_rest(),
            rejected_setpoints: reference.refused(),
        }
    }

    fn beat(&mut self, now_ns: i64) {
        if now_ns < self.next_beat_ns {
            return;
        }
        self.next_beat_ns = now_ns + HEARTBEAT_PERIOD_NS;
        self.ports.heartbeats.send(self.instance);
    }
}
