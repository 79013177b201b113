//! Carries what a daemon and a controller say to each other between two worlds, and lets a check change it on its way.
//!
//! `trajectory` has one publisher, so nobody can speak to a controller beside its daemon. Where the daemon runs in a world of its own,
//! what the controller hears from it is what the bridge publishes.

use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{self, Child, ChildStdin, ChildStdout, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{ZeroCopySend, ipc};
use realtime::use_fifo_priority;
use shared_types::codes::{MotionStart, ProcessKind};
use shared_types::ipc::{
    CommandClient, CommandRequest, CommandServer, IpcError, IpcNode, IpcOptions, Publisher,
    Subscriber, command_client, command_server, command_service, controller_state_service,
    heartbeat_service, publisher, subscriber, trajectory_service,
};
use shared_types::message::{Command, CommandReply, ControllerState, Heartbeat, TrajectoryMessage};

use crate::priority::OF_A_WATCH;
use crate::programs::program;

/// Time between two looks for messages.
const EVERY: Duration = Duration::from_micros(200);
/// Looks between two looks for dead processes.
const TIDY_EVERY: u32 = 500;

/// Trajectories of a flood that are sent in one look: as many as a subscriber keeps.
const FLOODED_A_LOOK: u64 = 4;

/// What is done to a trajectory that leaves another one.
type Change = Box<dyn Fn(&mut TrajectoryMessage) + Send>;

#[derive(Default)]
struct Traffic {
    /// Done to each joining trajectory before it is passed on.
    change: Option<Change>,
    /// Whether joining trajectories are kept back.
    is_held: bool,
    held: Vec<TrajectoryMessage>,
    /// The last joining trajectory as the daemon sent it.
    joining: Option<TrajectoryMessage>,
    /// To be sent besides.
    outbox: Vec<TrajectoryMessage>,
    /// Sent again and again under new ids while it is there.
    flood: Option<TrajectoryMessage>,
    flooded: u64,
    /// Whether the next message is begun and never sent.
    tears: bool,
    /// Whether it is.
    is_torn: bool,
}

/// The bridge's thread, ended when dropped.
pub struct Bridge {
    traffic: Arc<Mutex<Traffic>>,
    quit: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), IpcError>>>,
}

impl Bridge {
    /// Joins the services of a daemon's world and of a controller's; nobody needs to run yet.
    #[must_use]
    pub fn start(daemon: &IpcOptions, controller: &IpcOptions) -> Self {
        let (traffic, quit) = (
            Arc::<Mutex<Traffic>>::default(),
            Arc::<AtomicBool>::default(),
        );
        let (options, shared, stop) = (
            [daemon.clone(), controller.clone()],
            Arc::clone(&traffic),
            Arc::clone(&quit),
        );
        Self {
            traffic,
            quit,
            thread: Some(thread::spawn(move || carry(&options, &shared, &stop))),
        }
    }

    fn traffic(&self) -> MutexGuard<'_, Traffic> {
        self.traffic.lock().unwrap()
    }

    /// Changes each trajectory that leaves another one from now on.
    pub fn change_joining(&self, change: impl Fn(&mut TrajectoryMessage) + Send + 'static) {
        self.traffic().change = Some(Box::new(change));
    }

    /// Keeps trajectories that leave another one back, until they are let go.
    pub fn hold_joining(&self) {
        self.traffic().is_held = true;
    }

    /// Passes on what was kept back.
    pub fn let_go(&self) {
        let mut traffic = self.traffic();
        traffic.is_held = false;
        let held = std::mem::take(&mut traffic.held);
        traffic.outbox.extend(held);
    }

    /// The last trajectory that leaves another one, as the daemon sent it.
    #[must_use]
    pub fn joining(&self) -> Option<TrajectoryMessage> {
        self.traffic().joining
    }

    /// Sends these, in this order, one a look.
    pub fn send(&self, messages: &[TrajectoryMessage]) {
        self.traffic().outbox.extend_from_slice(messages);
    }

    /// Sends a trajectory as often as it can, each time under the next id, until told `None`.
    pub fn flood(&self, message: Option<TrajectoryMessage>) {
        self.traffic().flood = message;
    }

    /// Begins to write a trajectory into shared memory and leaves off in the middle, for as long as the bridge lives; returns when it has.
    pub fn tear(&self) {
        self.traffic().tears = true;
        while !self.traffic().is_torn {
            thread::sleep(EVERY);
        }
    }

    /// How many of a flood's trajectories were sent.
    #[must_use]
    pub fn flooded(&self) -> u64 {
        self.traffic().flooded
    }
}

/// The program `message-bridge`: a bridge that can be killed.
#[derive(Debug)]
pub struct BridgeProcess {
    child: Child,
    input: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
}

impl BridgeProcess {
    /// Starts it between a daemon's world and a controller's.
    #[must_use]
    pub fn start(daemon: &IpcOptions, controller: &IpcOptions) -> Self {
        let mut command = process::Command::new(program("message-bridge"));
        for options in [daemon, controller] {
            command.arg(&options.root).arg(&options.prefix);
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        Self {
            child,
            input,
            lines: BufReader::new(output).lines(),
        }
    }

    /// Has it leave off in the middle of writing a trajectory; returns when it has.
    pub fn tear(&mut self) {
        self.input.write_all(b"tear\n").unwrap();
        let said = self.lines.next().unwrap().unwrap();
        assert_eq!(said, "torn");
    }

    /// SIGKILL; it is gone when this returns.
    pub fn kill9(&mut self) {
        let _ = self.child.kill();
        self.child.wait().unwrap();
    }
}

impl Drop for BridgeProcess {
    fn drop(&mut self) {
        self.kill9();
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// An order on its way.
struct Order {
    of_daemon: CommandRequest,
    at_controller: PendingResponse<ipc::Service, Command, (), CommandReply, ()>,
}

struct Ports {
    // In the daemon's world.
    trajectories: Subscriber<TrajectoryMessage>,
    daemon_beats: Subscriber<Heartbeat>,
    states_out: Publisher<ControllerState>,
    commands: CommandServer,
    // In the controller's.
    trajectories_out: Publisher<TrajectoryMessage>,
    beats_out: Publisher<Heartbeat>,
    states: Subscriber<ControllerState>,
    commands_out: CommandClient,
    orders: Vec<Order>,
    nodes: [IpcNode; 2],
}

impl Ports {
    fn open([daemon, controller]: &[IpcOptions; 2]) -> Result<Self, IpcError> {
        let near = IpcNode::create(daemon, "bridge-daemon")?;
        let far = IpcNode::create(controller, "bridge-controller")?;
        Ok(Self {
            trajectories: subscriber(&near, &trajectory_service(&near)?)?,
            daemon_beats: subscriber(&near, &heartbeat_service(&near)?)?,
            states_out: publisher(&near, &controller_state_service(&near)?)?,
            commands: command_server(&near, &command_service(&near)?)?,
            trajectories_out: publisher(&far, &trajectory_service(&far)?)?,
            beats_out: publisher(&far, &heartbeat_service(&far)?)?,
            states: subscriber(&far, &controller_state_service(&far)?)?,
            commands_out: command_client(&far, &command_service(&far)?)?,
            orders: Vec::new(),
            nodes: [near, far],
        })
    }

    fn tidy(&self) {
        for node in &self.nodes {
            node.clean_dead_nodes();
        }
        let _ = self.states_out.update_connections();
        let _ = self.trajectories_out.update_connections();
        let _ = self.beats_out.update_connections();
    }

    fn carry_beats_and_states(&self) {
        while let Ok(Some(beat)) = self.daemon_beats.receive() {
            if beat.kind == ProcessKind::Daemon.code() {
                send(&self.beats_out, *beat);
            }
        }
        while let Ok(Some(state)) = self.states.receive() {
            send(&self.states_out, *state);
        }
    }

    fn carry_trajectories(&self, traffic: &mut Traffic) {
        while let Ok(Some(sample)) = self.trajectories.receive() {
            let mut message = *sample;
            if message.start == MotionStart::InMotion.code() {
                traffic.joining = Some(message);
                if let Some(change) = &traffic.change {
                    change(&mut message);
                }
                if traffic.is_held {
                    traffic.held.push(message);
                    continue;
                }
            }
            send(&self.trajectories_out, message);
        }
        if !traffic.outbox.is_empty() {
            send(&self.trajectories_out, traffic.outbox.remove(0));
        }
    }

    fn carry_orders(&mut self) {
        while let Ok(Some(of_daemon)) = self.commands.receive() {
            let Ok(at_controller) = self.commands_out.send_copy(*of_daemon) else {
                continue;
            };
            self.orders.push(Order {
                of_daemon,
                at_controller,
            });
        }
        self.orders.retain(|order| {
            let reply = order.at_controller.receive().ok().flatten();
            if let Some(reply) = &reply {
                let _ = order.of_daemon.send_copy(**reply);
            }
            reply.is_none() && order.of_daemon.is_connected()
        });
    }

    fn flood(&self, traffic: &mut Traffic) {
        let Some(message) = &mut traffic.flood else {
            return;
        };
        for _ in 0..FLOODED_A_LOOK {
            message.trajectory_id = message.trajectory_id.wrapping_add(1);
            send(&self.trajectories_out, *message);
        }
        traffic.flooded += FLOODED_A_LOOK;
    }
}

/// Waits in the middle of writing a trajectory.
fn tear(publisher: &Publisher<TrajectoryMessage>, traffic: &Mutex<Traffic>, quit: &AtomicBool) {
    let (Ok(mut loan), Some(message)) = (publisher.loan(), traffic.lock().unwrap().joining) else {
        return;
    };
    let half = message.knot_count as usize / 2;
    let torn = loan.payload_mut();
    *torn = TrajectoryMessage {
        knots: torn.knots,
        trajectory_id: message.trajectory_id + 1,
        ..message
    };
    torn.knots[..half].copy_from_slice(&message.knots[..half]);
    traffic.lock().unwrap().is_torn = true;
    while !quit.load(Ordering::Relaxed) {
        thread::sleep(EVERY);
    }
}

/// What cannot be sent now is lost, as on every way of this kind.
fn send<T: std::fmt::Debug + ZeroCopySend + Copy>(to: &Publisher<T>, message: T) {
    let _ = to.send_copy(message);
}

fn carry(
    options: &[IpcOptions; 2],
    traffic: &Mutex<Traffic>,
    quit: &AtomicBool,
) -> Result<(), IpcError> {
    let mut ports = Ports::open(options)?;
    let _ = use_fifo_priority(OF_A_WATCH);
    let mut looks: u32 = 0;
    while !quit.load(Ordering::Relaxed) {
        ports.carry_beats_and_states();
        ports.carry_orders();
        {
            let mut traffic = traffic.lock().unwrap();
            ports.carry_trajectories(&mut traffic);
            ports.flood(&mut traffic);
        }
        if traffic.lock().unwrap().tears {
            tear(&ports.trajectories_out, traffic, quit);
        }
        looks = looks.wrapping_add(1);
        if looks.is_multiple_of(TIDY_EVERY) {
            ports.tidy();
        }
        thread::sleep(EVERY);
    }
    Ok(())
}
