//! The services' names and qualities, opened by one typed function each, so that any start order works.
//!
//! Everything lives under a private prefix and root path ([`IpcOptions`]). A program creates one [`IpcNode`], opens the
//! services it needs and makes its ports with [`publisher()`], [`subscriber()`], [`plan_server`] and so on; these clean up
//! after dead processes and try again before they give up. **Ports are not `Send`**: create them in the thread that
//! uses them; the node and the open services may be moved there.
//!
//! Another user of the machine can read nothing of it: the root path is checked ([`IpcError::OpenRoot`]), what is made is its
//! owner's alone, and shared memory that another user made does not exist for these processes. Another user can block it only by
//! filling `/dev/shm` or by winning a race for a name (decision 0023).
//!
//! A process that must be the only one of its kind holds a [`RoleLock`] for as long as it lives.

mod carried;
mod error;
mod event;
mod half_made_node;
mod heartbeats;
mod left_listener;
mod live;
mod memory;
mod node;
mod node_counter;
mod opening;
mod options;
mod port_thread;
mod request;
mod role;
mod root_folder;
mod shm_override;
mod sweeper;
mod topic;
mod write_lease;

pub use error::IpcError;
pub use event::{
    EVENTS, EventDescription, EventListener, EventNotifier, EventService, event_listener,
    event_notifier, plan_answered_event, plan_asked_event,
};
pub use heartbeats::Heartbeats;
pub use live::{LiveService, live_services};
pub use memory::{plan_bytes, shared_memory};
pub use node::IpcNode;
pub use opening::NODES;
pub use options::{IpcOptions, LONGEST_ROOT_AND_PREFIX};
pub use port_thread::{JoinOnDrop, spawn_with_ports};
pub use request::{
    COMMAND, CommandClient, CommandRequest, CommandServer, CommandService, PlanActiveRequest,
    PlanClient, PlanPending, PlanResponse, PlanServer, PlanService, PlanServiceCapacity,
    RequestSettings, command_client, command_server, command_service, guest_command_client,
    open_plan_service, plan_client, plan_server, plan_service, plan_settings,
};
pub use role::{Role, RoleHolder, RoleLock};
pub use topic::{
    CYCLES_PER_BATCH, CyclePublisher, CycleSubscriber, CycleTopic, LOANS, PresentPublisher,
    Publisher, Subscriber, TOPICS, Topic, TopicDescription, TopicSettings,
    controller_state_service, cycle_publisher, cycle_service, goal_service, goal_status_service,
    guest_publisher, guest_subscriber, heartbeat_service, motion_result_service, newest,
    observer_subscriber, plan_record_service, publisher, robot_description_service,
    robot_state_service, scene_service, scene_status_service, setpoint_service, subscriber,
    trajectory_service,
};
