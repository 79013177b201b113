//! The loop thread: wake, receive, decide, send, report; nothing else.
//!
//! In a cycle it takes no lock, writes no log, makes no system call but its sleep (the clock is read through the vDSO)
//! and allocates only what iceoryx2's send does, from its own arena. When a robot comes or goes, the ports connect and
//! disconnect: that costs system calls once, in the cycle that sees it.

use std::sync::{Arc, atomic::Ordering};

use iceoryx2::port::update_connections::UpdateConnections;
use realtime::{Pages, reduce_wakeup_latency};
use shared_types::{
    ipc::{self, IpcError, IpcNode, IpcOptions, Publisher, Subscriber},
    message::{RobotState, Setpoint},
};
use tracing::{info, warn};

use super::{
    config::ControllerConfig,
    link::LoopEnd,
    loop_step::{LoopStep, RobotSide},
    periodic_deadlines::PeriodicDeadlines,
};
use crate::arena::LoopMemory;

/// The loop's ports: only these, so that tools that come and go never touch the loop.
struct Ports {
    setpoint: Publisher<Setpoint>,
    robot_state: Subscriber<RobotState>,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Ports {
    fn open(options: &IpcOptions) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "controller-loop")?;
        let setpoint = ipc::publisher(&node, &ipc::setpoint_service(&node)?)?;
        let robot_state = ipc::subscriber(&node, &ipc::robot_state_service(&node)?)?;
        Ok(Self {
            setpoint,
            robot_state,
            _node: node,
        })
    }

    /// Connects to running peers, so that the first cycle need not.
    fn touch(&mut self) {
        if let Err(error) = self.setpoint.update_connections() {
            warn!(?error, "cannot connect the set-points yet");
        }
        let _ = self.newest_state();
    }
}

impl RobotSide for Ports {
    fn newest_state(&mut self) -> Option<RobotState> {
        ipc::newest(&self.robot_state)
    }

    fn send(&mut self, setpoint: &Setpoint) {
        // A set-point that cannot be sent is missed by the robot, which says so.
        let _ = self.setpoint.send_copy(*setpoint);
    }
}

/// The loop thread's state: what it does, and the memory that its cycles run on.
pub(super) struct LoopThread {
    config: Arc<ControllerConfig>,
    ports: Ports,
    step: LoopStep,
    // Declared last: the arena outlives what was allocated from it.
    memory: LoopMemory,
}

impl LoopThread {
    /// Opens the ports, in the thread that is to run the loop.
    ///
    /// # Errors
    /// [`IpcError`] where a port cannot be made; once it runs it does not fail.
    pub(super) fn open(
        config: Arc<ControllerConfig>,
        options: &IpcOptions,
        link: LoopEnd,
    ) -> Result<Self, IpcError> {
        let Some(mut memory) = LoopMemory::claim() else {
            unreachable!("one loop a process");
        };
        // The ports' own blocks come from the arena, too: some are freed in the cycle that sees a robot go.
        let ports = memory.cycle(|| Ports::open(options))?;
        Ok(Self {
            step: LoopStep::new(&config, link),
            config,
            ports,
            memory,
        })
    }

    /// Runs until all threads are to end.
    pub(super) fn run(mut self) {
        let (ports, step) = (&mut self.ports, &mut self.step);
        self.memory.cycle(|| ports.touch());
        go_real_time(&self.config);
        let period_ns = self.config.executive.period_ns;
        info!(period_us = period_ns / 1_000, "loop begins");
        let mut deadlines = PeriodicDeadlines::from_now(period_ns);
        while !step.shared().is_quitting() {
            let deadline_ns = deadlines.wait();
            self.memory.cycle(|| step.cycle(deadline_ns, ports));
        }
        let ended = &step.shared().loop_has_ended;
        ended.store(true, Ordering::Release);
    }
}

/// Takes processor, priority and memory as configured; warns about each that the system refuses, and goes on without.
fn go_real_time(config: &ControllerConfig) {
    let processor = config
        .processor
        .map_or(Ok(()), |processor| realtime::set_cpu_affinity(&[processor]));
    let priority = config
        .realtime_priority
        .map_or(Ok(()), realtime::use_fifo_priority);
    let memory = if config.lock_memory {
        realtime::lock_memory(Pages::All)
    } else {
        Ok(())
    };
    for refused in [processor, priority, memory, reduce_wakeup_latency()]
        .into_iter()
        .filter_map(Result::err)
    {
        warn!("{refused}");
    }
}
