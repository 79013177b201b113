//! Publish–subscribe services: every side opens or creates them with the same settings.

use std::fmt::Debug;

use iceoryx2::port::publisher;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::subscriber;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::prelude::{
    AllocationStrategy, BackpressureStrategy, CallbackProgression, IceoryxSend, PortFactory as _,
    ZeroCopySend, ipc,
};
use iceoryx2::service::builder::Builder as ServiceBuilder;
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::opening::{NODES, open_service};
use super::{IpcError, IpcNode};
use crate::message::{
    ControllerState, Cycle, GoalStatus, Heartbeat, MotionResult, RobotState, SceneMessage,
    SceneStatus, Setpoint, StandingGoal, TrajectoryMessage,
};

/// Most cycles in one batch of the service `cycle`: 16 ms at 4 kHz.
pub const CYCLES_PER_BATCH: usize = 64;
/// Samples that a publisher may prepare at once, and that a subscriber may hold at once.
pub(super) const LOANS: usize = 2;

/// Places of a service that every guest leaves free for daemon, controller and robot.
const ROBOT_PLACES: usize = 2;

/// Sends `T`; create it in the thread that uses it.
pub type Publisher<T> = publisher::Publisher<ipc::Service, T, ()>;
/// Receives `T`; create it in the thread that uses it.
pub type Subscriber<T> = subscriber::Subscriber<ipc::Service, T, ()>;
/// Most samples that [`newest`] takes: more than can wait, so that an endless sender cannot hold the receiver.
const TAKEN_AT_ONCE: usize = 64;

/// A copy of the newest sample that waits, if any; the older ones are passed over.
#[must_use]
pub fn newest<T: Debug + ZeroCopySend + Copy>(subscriber: &Subscriber<T>) -> Option<T> {
    let mut newest = None;
    for _ in 0..TAKEN_AT_ONCE {
        let Ok(Some(sample)) = subscriber.receive() else {
            break;
        };
        newest = Some(*sample);
    }
    newest
}

/// Sends batches of cycles.
pub type CyclePublisher = Publisher<[Cycle]>;
/// Receives batches of cycles.
pub type CycleSubscriber = Subscriber<[Cycle]>;
/// The service of batches of cycles.
pub type CycleTopic = Topic<[Cycle]>;

/// The settings of a publish–subscribe service, equal in every program that opens it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TopicSettings {
    pub(super) name: &'static str,
    pub(super) publishers: usize,
    /// Places of publishers that [`guest_publisher`] leaves free.
    pub(super) reserved_publishers: usize,
    pub(super) subscribers: usize,
    /// Places of subscribers that [`observer_subscriber`] leaves free: programs that act get one however many watch.
    pub(super) reserved_subscribers: usize,
    pub(super) history: usize,
    pub(super) buffer: usize,
    pub(super) slice: usize,
}

/// One publisher; single samples without history.
const ONE_PUBLISHER: TopicSettings = TopicSettings {
    name: "",
    publishers: 1,
    reserved_publishers: 0,
    subscribers: 8,
    reserved_subscribers: 2,
    history: 0,
    buffer: 8,
    slice: 1,
};
/// `trajectory`: one publisher, a late controller gets the last one.
pub(super) const TRAJECTORY: TopicSettings = TopicSettings {
    name: "trajectory",
    history: 1,
    buffer: 4,
    ..ONE_PUBLISHER
};
/// `setpoint`: one publisher.
pub(super) const SETPOINT: TopicSettings = TopicSettings {
    name: "setpoint",
    ..ONE_PUBLISHER
};
/// `robot_state`: one publisher.
pub(super) const ROBOT_STATE: TopicSettings = TopicSettings {
    name: "robot_state",
    subscribers: 32,
    reserved_subscribers: 8,
    history: 1,
    ..ONE_PUBLISHER
};
/// `controller_state`: one publisher.
pub(super) const CONTROLLER_STATE: TopicSettings = TopicSettings {
    name: "controller_state",
    ..ROBOT_STATE
};
/// `motion_result`: one publisher; who comes late gets the last eight.
pub(super) const MOTION_RESULT: TopicSettings = TopicSettings {
    name: "motion_result",
    history: 8,
    buffer: 16,
    ..ROBOT_STATE
};
/// `cycle`: one publisher; the buffer holds 0.64 s of batches every 10 ms.
pub(super) const CYCLE: TopicSettings = TopicSettings {
    name: "cycle",
    subscribers: 4,
    reserved_subscribers: 0,
    buffer: 64,
    slice: CYCLES_PER_BATCH,
    ..ONE_PUBLISHER
};
/// `scene`: up to four sources, and a place for the program that signs off one of four that hang; a late daemon gets each
/// publisher's last scene.
pub(super) const SCENE: TopicSettings = TopicSettings {
    name: "scene",
    publishers: 5,
    reserved_publishers: 1,
    history: 1,
    buffer: 2,
    ..ONE_PUBLISHER
};
/// `scene_status`: one publisher.
pub(super) const SCENE_STATUS: TopicSettings = TopicSettings {
    name: "scene_status",
    buffer: 32,
    ..ONE_PUBLISHER
};
/// `goal`: up to eight senders. No history: a goal that was given to a daemon that ended does not move the robot of the next one.
pub(super) const GOAL: TopicSettings = TopicSettings {
    name: "goal",
    publishers: 8,
    buffer: 16,
    ..ONE_PUBLISHER
};
/// `goal_status`: one publisher; who comes late gets the last one.
pub(super) const GOAL_STATUS: TopicSettings = TopicSettings {
    name: "goal_status",
    history: 1,
    buffer: 32,
    ..ROBOT_STATE
};
/// `heartbeat`: one publisher a process.
pub(super) const HEARTBEAT: TopicSettings = TopicSettings {
    name: "heartbeat",
    publishers: 8,
    subscribers: 16,
    reserved_subscribers: 4,
    buffer: 16,
    ..ONE_PUBLISHER
};

/// An open publish–subscribe service: what its ports are made from.
#[derive(Debug)]
pub struct Topic<T: Debug + IceoryxSend + ?Sized> {
    service: PortFactory<ipc::Service, T, ()>,
    settings: TopicSettings,
}

/// A publisher that was not dropped; where its process was killed, it is listed until it is cleaned up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PresentPublisher {
    /// What the publisher's samples name as their origin ([`iceoryx2::sample::Sample::origin`]).
    pub id: u128,
    /// The publisher's process id; 0 where iceoryx2 does not say.
    pub pid: u32,
}

impl<T: Debug + IceoryxSend + ?Sized> Topic<T> {
    /// Writes all listed publishers into `present`, those that have sent nothing included.
    pub fn list_publishers(&self, present: &mut Vec<PresentPublisher>) {
        present.clear();
        self.service.dynamic_config().list_publishers(|details| {
            let pid = details.node_id.pid::<ipc::Service>();
            let pid = pid.ok().and_then(|pid| u32::try_from(pid.value()).ok());
            present.push(PresentPublisher {
                id: details.publisher_id.value(),
                pid: pid.unwrap_or(0),
            });
            CallbackProgression::Continue
        });
    }

    /// Number of subscribers, dead ones that were not cleaned up included.
    #[must_use]
    pub fn number_of_subscribers(&self) -> usize {
        self.service.dynamic_config().number_of_subscribers()
    }
}

macro_rules! topic_functions {
    ($($(#[$attribute:meta])* $function:ident: $message:ty = $settings:ident;)*) => { $(
        $(#[$attribute])*
        ///
        /// # Errors
        /// [`IpcError`]: the service cannot be opened and not be created.
        pub fn $function(node: &IpcNode) -> Result<Topic<$message>, IpcError> {
            let open = |builder: ServiceBuilder<ipc::Service>| {
                with_settings(builder.publish_subscribe::<$message>(), &$settings).open_or_create()
            };
            let service = open_service(node, $settings.name, open)?;
            Ok(Topic { service, settings: $settings })
        }
    )* };
}

topic_functions! {
    /// Opens `trajectory`: what the controller is to execute; publisher: the daemon.
    trajectory_service: TrajectoryMessage = TRAJECTORY;
    /// Opens `setpoint`: what the motors are to do now; publisher: the controller's loop.
    setpoint_service: Setpoint = SETPOINT;
    /// Opens `robot_state`; publisher: the robot.
    robot_state_service: RobotState = ROBOT_STATE;
    /// Opens `controller_state`; publisher: the controller's relay thread.
    controller_state_service: ControllerState = CONTROLLER_STATE;
    /// Opens `motion_result`: how each trajectory ended; publisher: the controller's relay thread.
    motion_result_service: MotionResult = MOTION_RESULT;
    /// Opens `cycle`: batches of at most [`CYCLES_PER_BATCH`]; publisher: the controller's relay thread.
    cycle_service: [Cycle] = CYCLE;
    /// Opens `scene`: all obstacles that a source knows of; publishers: the sources.
    scene_service: SceneMessage = SCENE;
    /// Opens `scene_status`: what became of each scene; publisher: the daemon.
    scene_status_service: SceneStatus = SCENE_STATUS;
    /// Opens `goal`: where the daemon is to keep the robot; publishers: programs.
    goal_service: StandingGoal = GOAL;
    /// Opens `goal_status`: what becomes of that goal; publisher: the daemon.
    goal_status_service: GoalStatus = GOAL_STATUS;
    /// Opens `heartbeat`; publishers: daemon, controller, robot.
    heartbeat_service: Heartbeat = HEARTBEAT;
}

fn with_settings<T: Debug + IceoryxSend + ?Sized>(
    builder: Builder<T, (), ipc::Service>,
    settings: &TopicSettings,
) -> Builder<T, (), ipc::Service> {
    builder
        .enable_safe_overflow(true)
        .max_publishers(settings.publishers)
        .max_subscribers(settings.subscribers)
        .max_nodes(NODES)
        .history_size(settings.history)
        .subscriber_max_buffer_size(settings.buffer)
        .subscriber_max_borrowed_samples(LOANS)
}

/// Makes a publisher, after cleaning up dead ones that hold all places.
///
/// A full receiver loses its oldest sample; sending never waits.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold all places (a second daemon or controller), or [`IpcError::Failed`].
pub fn publisher<T: Debug + ZeroCopySend>(
    node: &IpcNode,
    topic: &Topic<T>,
) -> Result<Publisher<T>, IpcError> {
    any_publisher(node, topic, 0)
}

/// Makes a publisher that takes none of the service's reserved places, for programs that come and go; the reserved ones stay free for
/// the program that signs off a hanging one.
///
/// # Errors
/// As [`publisher()`].
pub fn guest_publisher<T: Debug + ZeroCopySend>(
    node: &IpcNode,
    topic: &Topic<T>,
) -> Result<Publisher<T>, IpcError> {
    any_publisher(node, topic, topic.settings.reserved_publishers)
}

/// Makes a publisher that leaves `reserved` places free.
fn any_publisher<T: Debug + ZeroCopySend>(
    node: &IpcNode,
    topic: &Topic<T>,
    reserved: usize,
) -> Result<Publisher<T>, IpcError> {
    let full = PublisherCreateError::ExceedsMaxSupportedPublishers;
    let create = || {
        let taken = topic.service.dynamic_config().number_of_publishers();
        if taken + reserved >= topic.settings.publishers {
            return Err(full);
        }
        let builder = topic.service.publisher_builder().max_loaned_samples(LOANS);
        builder
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
    };
    node.make_port(&topic.service, "publisher", create, &full)
}

/// Makes the publisher of cycles, like [`publisher()`]; batches have at most [`CYCLES_PER_BATCH`].
///
/// # Errors
/// As [`publisher()`].
pub fn cycle_publisher(node: &IpcNode, topic: &CycleTopic) -> Result<CyclePublisher, IpcError> {
    let create = || {
        let builder = topic.service.publisher_builder().max_loaned_samples(LOANS);
        let builder = builder
            .initial_max_slice_len(CYCLES_PER_BATCH)
            .allocation_strategy(AllocationStrategy::Static);
        builder
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
    };
    let full = PublisherCreateError::ExceedsMaxSupportedPublishers;
    node.make_port(&topic.service, "publisher", create, &full)
}

/// Makes a subscriber, after cleaning up dead ones that hold its place; it receives the service's history.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold all places, or [`IpcError::Failed`].
pub fn subscriber<T: Debug + IceoryxSend + ?Sized>(
    node: &IpcNode,
    topic: &Topic<T>,
) -> Result<Subscriber<T>, IpcError> {
    any_subscriber(node, topic, 0)
}

/// Makes a subscriber for a program that comes and goes: it leaves two places free for daemon, controller and robot.
///
/// # Errors
/// As [`subscriber()`].
pub fn guest_subscriber<T: Debug + ZeroCopySend>(
    node: &IpcNode,
    topic: &Topic<T>,
) -> Result<Subscriber<T>, IpcError> {
    any_subscriber(node, topic, ROBOT_PLACES)
}

/// Makes a subscriber for a program that only watches: it leaves places free for programs that act as well.
///
/// # Errors
/// As [`subscriber()`].
pub fn observer_subscriber<T: Debug + ZeroCopySend>(
    node: &IpcNode,
    topic: &Topic<T>,
) -> Result<Subscriber<T>, IpcError> {
    any_subscriber(node, topic, topic.settings.reserved_subscribers)
}

/// Makes a subscriber that leaves `reserved` places free.
fn any_subscriber<T: Debug + IceoryxSend + ?Sized>(
    node: &IpcNode,
    topic: &Topic<T>,
    reserved: usize,
) -> Result<Subscriber<T>, IpcError> {
    let full = SubscriberCreateError::ExceedsMaxSupportedSubscribers;
    let create = || {
        let taken = topic.service.dynamic_config().number_of_subscribers();
        if taken + reserved >= topic.settings.subscribers {
            return Err(full);
        }
        let builder = topic.service.subscriber_builder();
        builder.buffer_size(topic.settings.buffer).create()
    };
    node.make_port(&topic.service, "subscriber", create, &full)
}
