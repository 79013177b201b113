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
    ControllerState, Cycle, GoalStatus, Heartbeat, Layout, MotionResult, Payload, PlanRecord,
    RobotDescription, RobotState, SceneMessage, SceneStatus, Setpoint, StandingGoal,
    TrajectoryMessage,
};

/// Most cycles in one batch of the service `cycle`: 16 ms at 4 kHz.
pub const CYCLES_PER_BATCH: usize = 64;
/// Samples that a publisher may prepare at once, and that a subscriber may hold at once.
pub const LOANS: usize = 2;

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

/// The settings of a publish–subscribe service, equal in every program that opens it. A full buffer loses its oldest sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopicSettings {
    /// Its name behind the prefix.
    pub name: &'static str,
    /// Who publishes.
    pub from: &'static str,
    /// Publishers at once.
    pub publishers: usize,
    /// Places of publishers that programs leave free which come and go ([`guest_publisher`]).
    pub reserved_publishers: usize,
    /// Subscribers at once.
    pub subscribers: usize,
    /// Places of subscribers that programs leave free which only watch ([`observer_subscriber`]): programs that act get one however many
    /// watch.
    pub reserved_subscribers: usize,
    /// Samples that a subscriber gets which comes late.
    pub history: usize,
    /// Samples that wait at a subscriber.
    pub buffer: usize,
    /// Messages of one sample at most.
    pub slice: usize,
}

/// One publisher; single samples without history.
const ONE_PUBLISHER: TopicSettings = TopicSettings {
    name: "",
    from: "",
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
    from: "planner-daemon",
    history: 1,
    buffer: 4,
    ..ONE_PUBLISHER
};
/// `setpoint`: one publisher; the buffer holds 32 ms at 1 kHz, so that who records misses none where it is kept from running.
pub(super) const SETPOINT: TopicSettings = TopicSettings {
    name: "setpoint",
    from: "controller's loop",
    buffer: 32,
    ..ONE_PUBLISHER
};
/// `robot_state`: one publisher; the buffer holds 32 ms at 1 kHz.
pub(super) const ROBOT_STATE: TopicSettings = TopicSettings {
    name: "robot_state",
    from: "robot",
    subscribers: 32,
    reserved_subscribers: 8,
    history: 1,
    buffer: 32,
    ..ONE_PUBLISHER
};
/// `controller_state`: one publisher.
pub(super) const CONTROLLER_STATE: TopicSettings = TopicSettings {
    name: "controller_state",
    from: "controller's relay",
    buffer: 8,
    ..ROBOT_STATE
};
/// `motion_result`: one publisher; who comes late gets the last eight.
pub(super) const MOTION_RESULT: TopicSettings = TopicSettings {
    name: "motion_result",
    from: "controller's relay",
    history: 8,
    buffer: 16,
    ..ROBOT_STATE
};
/// `cycle`: one publisher; the buffer holds 0.64 s of batches every 10 ms.
pub(super) const CYCLE: TopicSettings = TopicSettings {
    name: "cycle",
    from: "controller's relay",
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
    from: "sources of obstacles",
    publishers: 5,
    reserved_publishers: 1,
    history: 1,
    buffer: 2,
    ..ONE_PUBLISHER
};
/// `scene_status`: one publisher.
pub(super) const SCENE_STATUS: TopicSettings = TopicSettings {
    name: "scene_status",
    from: "planner-daemon",
    buffer: 32,
    ..ONE_PUBLISHER
};
/// `goal`: up to eight senders. No history: a goal that was given to a daemon that ended does not move the robot of the next one.
pub(super) const GOAL: TopicSettings = TopicSettings {
    name: "goal",
    from: "clients",
    publishers: 8,
    buffer: 16,
    ..ONE_PUBLISHER
};
/// `goal_status`: one publisher; who comes late gets the last one.
pub(super) const GOAL_STATUS: TopicSettings = TopicSettings {
    name: "goal_status",
    from: "planner-daemon",
    history: 1,
    buffer: 32,
    ..ROBOT_STATE
};
/// `plan_record`: one publisher; the buffer holds 64 ms of a thousand plans a second.
pub(super) const PLAN_RECORD: TopicSettings = TopicSettings {
    name: "plan_record",
    from: "planner-daemon",
    subscribers: 4,
    reserved_subscribers: 0,
    buffer: 64,
    ..ONE_PUBLISHER
};
/// `robot_description`: one publisher; who comes late gets the last one.
pub(super) const ROBOT_DESCRIPTION: TopicSettings = TopicSettings {
    name: "robot_description",
    from: "planner-daemon",
    history: 1,
    buffer: 2,
    ..ROBOT_STATE
};
/// `heartbeat`: one publisher a process.
pub(super) const HEARTBEAT: TopicSettings = TopicSettings {
    name: "heartbeat",
    from: "planner-daemon, controller, robot",
    publishers: 8,
    subscribers: 16,
    reserved_subscribers: 4,
    buffer: 16,
    ..ONE_PUBLISHER
};

/// A publish–subscribe service, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopicDescription {
    /// What it is for.
    pub purpose: &'static str,
    /// Its settings.
    pub settings: TopicSettings,
    /// The message that it carries.
    pub layout: Layout,
    /// Whether a sample is a slice of these messages.
    pub is_slice: bool,
}

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

    /// Number of publishers, dead ones that were not cleaned up included.
    #[must_use]
    pub fn number_of_publishers(&self) -> usize {
        self.service.dynamic_config().number_of_publishers()
    }

    /// Number of subscribers, dead ones that were not cleaned up included.
    #[must_use]
    pub fn number_of_subscribers(&self) -> usize {
        self.service.dynamic_config().number_of_subscribers()
    }
}

macro_rules! topic_functions {
    ($($(#[$attribute:meta])* $function:ident: $message:ty = $settings:ident, $purpose:literal;)*) => { $(
        $(#[$attribute])*
        ///
        /// # Errors
        /// [`IpcError`]: the service cannot be opened and not be created.
        pub fn $function(node: &IpcNode) -> Result<Topic<$message>, IpcError> {
            let open = |builder: ServiceBuilder<ipc::Service>| {
                with_settings(builder.publish_subscribe::<$message>(), &$settings).open_or_create()
            };
            let carries = [<$message as Payload>::LAYOUT];
            let service = open_service(node, $settings.name, &carries, open)?;
            Ok(Topic { service, settings: $settings })
        }
    )*

        /// Every publish–subscribe service as data: what it is for, its settings, what it carries.
        pub const TOPICS: &[TopicDescription] = &[$(TopicDescription {
            purpose: $purpose,
            settings: $settings,
            layout: <$message as Payload>::LAYOUT,
            is_slice: <$message as Payload>::IS_SLICE,
        },)*];
    };
}

topic_functions! {
    /// Opens `trajectory`.
    trajectory_service: TrajectoryMessage = TRAJECTORY, "What the controller is to execute; a controller that starts later gets the newest one.";
    /// Opens `setpoint`.
    setpoint_service: Setpoint = SETPOINT, "What the motors are to do now, every cycle of the loop.";
    /// Opens `robot_state`.
    robot_state_service: RobotState = ROBOT_STATE, "What the motors do and what is measured, at 1 kHz.";
    /// Opens `controller_state`.
    controller_state_service: ControllerState = CONTROLLER_STATE, "What the controller does, about 50 times a second.";
    /// Opens `motion_result`.
    motion_result_service: MotionResult = MOTION_RESULT, "How each trajectory ended that the controller has received, once each.";
    /// Opens `cycle`: batches of at most [`CYCLES_PER_BATCH`].
    cycle_service: [Cycle] = CYCLE, "Every cycle of the loop exactly once, in batches every 10 ms.";
    /// Opens `scene`.
    scene_service: SceneMessage = SCENE, "All obstacles that a source knows of.";
    /// Opens `scene_status`.
    scene_status_service: SceneStatus = SCENE_STATUS, "What became of each scene.";
    /// Opens `goal`.
    goal_service: StandingGoal = GOAL, "Where the daemon is to keep the robot; the newest one counts.";
    /// Opens `goal_status`.
    goal_status_service: GoalStatus = GOAL_STATUS, "What becomes of that goal, at each change and every 100 ms.";
    /// Opens `plan_record`.
    plan_record_service: PlanRecord = PLAN_RECORD, "What the daemon was asked for and has answered, once each.";
    /// Opens `robot_description`.
    robot_description_service: RobotDescription = ROBOT_DESCRIPTION, "Which robot the daemon plans for, and by which weights, each second.";
    /// Opens `heartbeat`.
    heartbeat_service: Heartbeat = HEARTBEAT, "That a process lives and its work goes on, at least 50 times a second.";
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
