//! The states of controller and robot, the loop's cycles, and commands to the controller.

use std::fmt::Debug;
use std::thread;
use std::time::Duration;

use iceoryx2::prelude::ZeroCopySend;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    CommandClient, CommandService, CycleSubscriber, IpcError, IpcNode, IpcOptions, Role,
    Subscriber, Topic, command_service, controller_state_service, cycle_service,
    guest_command_client, guest_subscriber, observer_subscriber, robot_state_service, subscriber,
};
use shared_types::message;
use shared_types::valid::{
    CommandReply, ControllerState, Cycle, Invalid, RobotState, SignedCommand,
};

use crate::ClientError;
use crate::waiting::{Cleaner, POLL_INTERVAL, TimeLimit, wait};

/// A constructor of a subscriber of `T`.
pub(crate) type Subscribe<T> = fn(&IpcNode, &Topic<T>) -> Result<Subscriber<T>, IpcError>;

pub(crate) const CONTROLLER: &str = "controller";
const ROBOT: &str = "robot";

/// The controller's state, and commands to it. The place among the commanding programs is taken by the first command, or earlier by
/// [`ControllerView::prepare_to_command`]; a program that only watches takes none.
#[derive(Debug)]
pub struct ControllerView {
    states: Subscriber<message::ControllerState>,
    latest: Option<ControllerState>,
    commands: Option<CommandClient>,
    command_service: CommandService,
    last_command_id: u64,
    cleaner: Cleaner,
    node: IpcNode,
}

impl ControllerView {
    /// Joins the services; the controller need not run yet.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        Self::join(options, guest_subscriber)
    }

    /// Joins like [`connect`](Self::connect) for a program that only watches: it leaves places free for those that act.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn watch(options: &IpcOptions) -> Result<Self, ClientError> {
        Self::join(options, observer_subscriber)
    }

    fn join(
        options: &IpcOptions,
        subscribe: Subscribe<message::ControllerState>,
    ) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-controller-view")?;
        let states = subscribe(&node, &controller_state_service(&node)?)?;
        let command_service = command_service(&node)?;
        Ok(Self {
            states,
            latest: None,
            commands: None,
            command_service,
            last_command_id: 0,
            cleaner: Cleaner::new(options, Role::Controller),
            node,
        })
    }

    /// The newest state received, however old: compare its stamp with [`shared_types::clock::mono_now_ns`]; none if the
    /// controller has not published yet.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn latest_state(&mut self) -> Result<Option<ControllerState>, ClientError> {
        self.cleaner.clean_if_due(&self.node);
        take_in(&self.states, &mut self.latest)
    }

    /// Waits for a state that the controller publishes after this call, and returns the newest; none where none comes in time.
    ///
    /// # Errors
    /// As [`ControllerView::latest_state`].
    pub fn next_state<'program>(
        &mut self,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<Option<ControllerState>, ClientError> {
        let (asked_mono_ns, limit) = (mono_now_ns(), timeout.into());
        let (states, latest) = (&self.states, &mut self.latest);
        let pause = |left: Duration| thread::sleep(POLL_INTERVAL.min(left));
        wait(&limit, &mut self.cleaner, &self.node, pause, || {
            let state = take_in(states, latest)?;
            Ok(state.filter(|state| state.values.stamp_mono_ns >= asked_mono_ns))
        })
    }

    /// Takes this program's place among the commanding programs, if it has none yet: a later command then needs neither memory nor a file
    /// of its own. For programs with a button to stop.
    ///
    /// # Errors
    /// [`ClientError::Ipc`], where there is no place left.
    pub fn prepare_to_command(&mut self) -> Result<(), ClientError> {
        if self.commands.is_none() {
            self.commands = Some(guest_command_client(&self.node, &self.command_service)?);
        }
        Ok(())
    }

    /// Gives an order, with the reason where one is given ([`shared_types::valid::Command::because`]), and waits for the reply; a
    /// refused order is no error.
    ///
    /// # Errors
    /// [`ClientError::InvalidRequest`], [`ClientError::Ipc`] (no place left), [`ClientError::NoServer`],
    /// [`ClientError::ServerLost`], [`ClientError::TimedOut`], [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn command<'program>(
        &mut self,
        command: impl Into<SignedCommand>,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<CommandReply, ClientError> {
        self.last_command_id += 1;
        let (id, limit) = (self.last_command_id, timeout.into());
        let wire = command.into().to_wire(id);
        SignedCommand::try_from(&wire).map_err(ClientError::InvalidRequest)?;
        self.prepare_to_command()?;
        let (node, cleaner, commands) = (&self.node, &mut self.cleaner, self.commands.as_ref());
        let pause = |left: Duration| thread::sleep(POLL_INTERVAL.min(left));
        let sent = wait(&limit, cleaner, node, pause, || {
            let pending = commands
                .ok_or_else(|| ClientError::transport("send a command", "it has no place"))?
                .send_copy(wire)
                .map_err(|reason| ClientError::transport("send a command", reason))?;
            Ok::<_, ClientError>((pending.number_of_server_connections() > 0).then_some(pending))
        })?;
        let waited = limit.duration();
        let pending = sent.ok_or(ClientError::NoServer {
            server: CONTROLLER,
            waited,
        })?;
        let reply = wait(&limit, cleaner, node, pause, || {
            let connected = pending.is_connected();
            let reply = pending
                .receive()
                .map_err(|reason| ClientError::transport("receive a reply", reason))?;
            match reply {
                None if !connected => Err(ClientError::ServerLost {
                    server: CONTROLLER,
                    id,
                    may_have_acted: true,
                }),
                reply => Ok(reply.map(|reply| *reply)),
            }
        })?;
        let reply = reply.ok_or(ClientError::TimedOut {
            server: CONTROLLER,
            id,
            waited,
            may_have_acted: true,
        })?;
        checked(CONTROLLER, CommandReply::try_from(&reply))
    }
}

/// The robot's state.
#[derive(Debug)]
pub struct RobotView {
    states: Subscriber<message::RobotState>,
    latest: Option<RobotState>,
    _node: IpcNode,
}

impl RobotView {
    /// Joins the service; the robot need not run yet.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        Self::join(options, guest_subscriber)
    }

    /// Joins like [`connect`](Self::connect) for a program that only watches: it leaves places free for those that act.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn watch(options: &IpcOptions) -> Result<Self, ClientError> {
        Self::join(options, observer_subscriber)
    }

    fn join(
        options: &IpcOptions,
        subscribe: Subscribe<message::RobotState>,
    ) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-robot-view")?;
        let states = subscribe(&node, &robot_state_service(&node)?)?;
        Ok(Self {
            states,
            latest: None,
            _node: node,
        })
    }

    /// The newest state received, however old: look at its stamp; none if the robot has not published yet.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn latest(&mut self) -> Result<Option<RobotState>, ClientError> {
        if let Some(wire) = newest(&self.states)? {
            self.latest = Some(checked(ROBOT, RobotState::try_from(&wire))?);
        }
        Ok(self.latest)
    }
}

/// Every cycle of the controller's loop.
#[derive(Debug)]
pub struct CycleRecorder {
    batches: CycleSubscriber,
    next_sequence: Option<u64>,
    missed: u64,
    _node: IpcNode,
}

impl CycleRecorder {
    /// Joins the service; recording begins with the next cycle published.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-recorder")?;
        let batches = subscriber(&node, &cycle_service(&node)?)?;
        Ok(Self {
            batches,
            next_sequence: None,
            missed: 0,
            _node: node,
        })
    }

    /// Appends the cycles that arrived since the last call; call it at least twice a second. Returns how many.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn drain(&mut self, cycles: &mut Vec<Cycle>) -> Result<usize, ClientError> {
        let before = cycles.len();
        while let Some(batch) = receive(|| self.batches.receive())? {
            for wire in batch.payload() {
                let cycle = checked(CONTROLLER, Cycle::try_from(wire))?;
                self.count_missed(cycle.values.sequence);
                cycles.push(cycle);
            }
        }
        Ok(cycles.len() - before)
    }

    /// Cycles lost because [`CycleRecorder::drain`] was called too seldom.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// A sequence that falls is a new controller's, and nothing is missed.
    fn count_missed(&mut self, sequence: u64) {
        self.missed += sequence.saturating_sub(self.next_sequence.unwrap_or(sequence));
        self.next_sequence = Some(sequence.wrapping_add(1));
    }
}

pub(crate) fn receive<T, E: Debug>(
    receive: impl FnOnce() -> Result<T, E>,
) -> Result<T, ClientError> {
    receive().map_err(|reason| ClientError::transport("receive a state", reason))
}

/// Keeps the newest state that has come, if one has; returns the newest known.
fn take_in(
    states: &Subscriber<message::ControllerState>,
    latest: &mut Option<ControllerState>,
) -> Result<Option<ControllerState>, ClientError> {
    if let Some(wire) = newest(states)? {
        *latest = Some(checked(CONTROLLER, ControllerState::try_from(&wire))?);
    }
    Ok(*latest)
}

/// The newest message waiting, copied to private memory.
pub(crate) fn newest<T: Debug + ZeroCopySend + Copy>(
    states: &Subscriber<T>,
) -> Result<Option<T>, ClientError> {
    let mut newest = None;
    while let Some(sample) = receive(|| states.receive())? {
        newest = Some(*sample);
    }
    Ok(newest)
}

pub(crate) fn checked<T>(
    sender: &'static str,
    result: Result<T, Invalid>,
) -> Result<T, ClientError> {
    result.map_err(|invalid| ClientError::BadMessage { sender, invalid })
}
