//! A client that knows iceoryx2 and the byte layout of the messages, and nothing else of this project: what a program in another
//! language is.
//!
//! `plain-client ROOT PREFIX event|topic|requests` makes a node and says `node`; at a line of input it makes or opens a service with
//! its ports and says `made`; and once it hears the robot's processes there, it says `heard`.
#![allow(clippy::unwrap_used, reason = "whoever started it reads why it ended")]

use std::env;
use std::error::Error;
use std::io;
use std::thread::sleep;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::Node;
use iceoryx2::prelude::{
    FileName, NodeBuilder, Path, SemanticString, ServiceName, ZeroCopySend, ipc,
};

type Outcome = Result<(), Box<dyn Error>>;

/// How long its service may take to be made, its being held included: iceoryx2 gives up by itself afterwards.
const CREATION_TIMEOUT: Duration = Duration::from_secs(60);
/// Pause between two looks for what may have been heard.
const LOOK: Duration = Duration::from_millis(1);
/// Nodes of every service, as `shared-types/wire.json` has it for what follows.
const NODES: usize = 80;

/// `pcc.v7.Heartbeat`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("pcc.v7.Heartbeat")]
struct Heartbeat {
    stamp_mono_ns: i64,
    instance: u64,
    sequence: u64,
    kind: u32,
    pid: u32,
}

/// `pcc.v7.Command`.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("pcc.v7.Command")]
struct Command {
    protocol_version: u32,
    kind: u32,
    speed: f64,
    command_id: u64,
    sender: u32,
    sender_pid: u32,
    reason: ReasonText,
}

/// `pcc.v7.ReasonText`.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("pcc.v7.ReasonText")]
struct ReasonText {
    length: u32,
    utf8: [u8; 164],
}

/// `pcc.v7.CommandReply`.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("pcc.v7.CommandReply")]
struct CommandReply {
    command_id: u64,
    protocol_version: u32,
    accepted: u32,
    refusal: u32,
    state: u32,
    reason: ReasonText,
}

fn main() -> Outcome {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [root, prefix, kind] = &arguments[..] else {
        return Err("usage: plain-client ROOT PREFIX event|topic|requests".into());
    };
    let mut config = Config::default();
    let root = Path::new(root.as_bytes()).map_err(|error| format!("{root}: {error:?}"))?;
    config.global.set_root_path(&root);
    let files = FileName::new(format!("{prefix}_").as_bytes());
    config.global.prefix = files.map_err(|error| format!("{prefix}: {error:?}"))?;
    config.global.creation_timeout = CREATION_TIMEOUT;
    let node = NodeBuilder::new()
        .config(&config)
        .create::<ipc::Service>()?;
    println!("node");
    io::stdin().read_line(&mut String::new())?;
    let name = |service: &str| ServiceName::new(&format!("{prefix}/{service}"));
    match kind.as_str() {
        "event" => event(&node, &name("plan_asked")?),
        "topic" => topic(&node, &name("heartbeat")?),
        "requests" => requests(&node, &name("command")?),
        _ => Err(format!("{kind}: event, topic, and requests are allowed").into()),
    }
}

/// Looks until something was heard, and says so.
fn until_heard(mut hears: impl FnMut() -> Result<bool, Box<dyn Error>>) -> Outcome {
    println!("made");
    while !hears()? {
        sleep(LOOK);
    }
    println!("heard");
    Ok(())
}

fn event(node: &Node<ipc::Service>, name: &ServiceName) -> Outcome {
    let service = node
        .service_builder(name)
        .event()
        .event_id_max_value(0)
        .max_notifiers(NODES)
        .max_listeners(NODES)
        .max_nodes(NODES)
        .open_or_create()?;
    let listener = service.listener_builder().create()?;
    until_heard(|| {
        let count = listener.try_wait(|_| ());
        Ok(count.map_err(|error| format!("{error:?}"))? > 0)
    })
}

fn topic(node: &Node<ipc::Service>, name: &ServiceName) -> Outcome {
    let service = node
        .service_builder(name)
        .publish_subscribe::<Heartbeat>()
        .enable_safe_overflow(true)
        .max_publishers(8)
        .max_subscribers(16)
        .max_nodes(NODES)
        .history_size(0)
        .subscriber_max_buffer_size(16)
        .subscriber_max_borrowed_samples(2)
        .open_or_create()?;
    let subscriber = service.subscriber_builder().create()?;
    let _publisher = service.publisher_builder().create()?;
    until_heard(|| Ok(subscriber.receive()?.is_some()))
}

fn requests(node: &Node<ipc::Service>, name: &ServiceName) -> Outcome {
    let service = node
        .service_builder(name)
        .request_response::<Command, CommandReply>()
        .enable_safe_overflow_for_requests(true)
        .enable_safe_overflow_for_responses(true)
        .enable_fire_and_forget_requests(true)
        .max_active_requests_per_client(2)
        .max_loaned_requests(2)
        .max_response_buffer_size(1)
        .max_borrowed_responses_per_pending_response(1)
        .max_servers(2)
        .max_clients(32)
        .max_nodes(NODES)
        .open_or_create()?;
    let server = service.server_builder().create()?;
    until_heard(|| Ok(server.receive()?.is_some()))
}
