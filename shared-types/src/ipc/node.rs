//! The node of a program: its access to the services.

use std::env;
use std::fmt::Debug;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder, NodeState, NodeView};
use iceoryx2::prelude::{
    CallbackProgression, FileName, LogLevel, MessagingPattern, NodeName, PortFactory,
    SemanticString, ServiceName, SignalHandlingMode, ipc, set_log_level,
};
use iceoryx2::service::builder::Builder;

use super::node_counter::{NodeCounter, protect_shared};
use super::sweeper::Sweeper;
use super::{IpcError, IpcOptions, shm_override};

/// Most attempts of an operation that fails for a transient reason.
const ATTEMPTS: usize = 40;
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(5);
/// Time between two looks for dead processes.
const CLEANUP_PERIOD: Duration = Duration::from_millis(100);

/// A program's node: make one, open services with it, keep it as long as them.
///
/// It may be moved to another thread but not shared between threads.
#[derive(Debug)]
pub struct IpcNode {
    node: Node<ipc::Service>,
    options: IpcOptions,
    _sweeper: Arc<Sweeper>,
}

impl IpcNode {
    /// Joins the services under `options`, and cleans up after dead processes.
    ///
    /// `name` appears in tools. Signals are left to the program. iceoryx2 logs errors only, or what `PCC_IPC_LOG` says
    /// (`trace`, `debug`, `info`, `warn`, `error`, `fatal`).
    ///
    /// # Errors
    /// What is wrong with the options, [`IpcError::SharedMemory`], [`IpcError::Sweeper`] or [`IpcError::Node`].
    pub fn create(options: &IpcOptions, name: &str) -> Result<Self, IpcError> {
        set_log_level(log_level(env::var("PCC_IPC_LOG").ok().as_deref()));
        options.prepare()?;
        let mut config = options.config()?;
        let failed = |reason| IpcError::Node {
            root: options.root.clone(),
            reason,
        };
        let name = NodeName::new(name)
            .map_err(|_| failed(iceoryx2::node::NodeCreationFailure::InternalError))?;
        let sweeper =
            Sweeper::of_process(options).map_err(|source| IpcError::Sweeper { source })?;
        let counter = node_counter(options, &mut config)?;
        let builder = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled);
        let node = builder
            .create::<ipc::Service>()
            .map_err(|reason| options.probe_root().err().unwrap_or_else(|| failed(reason)))?;
        drop(counter);
        Ok(Self {
            node,
            options: options.clone(),
            _sweeper: sweeper,
        })
    }

    /// The options it was created with.
    #[must_use]
    pub fn options(&self) -> &IpcOptions {
        &self.options
    }

    /// Removes what dead processes left behind; a killed peer looks connected until someone does. Returns how many were removed. It looks
    /// at every node, which takes milliseconds.
    pub fn clean_dead_nodes(&self) -> u64 {
        self.node.try_cleanup_dead_nodes().cleanups
    }

    /// Removes what dead processes left behind ten times a second, until `is_over`, which is asked at once where the thread is unparked;
    /// `report` hears how many were removed. For a thread that lets all others go first.
    pub fn keep_clean(&self, is_over: impl Fn() -> bool, report: impl Fn(u64)) {
        while !is_over() {
            let removed = self.clean_dead_nodes();
            if removed > 0 {
                report(removed);
            }
            thread::park_timeout(CLEANUP_PERIOD);
        }
    }

    /// Like [`IpcNode::clean_dead_nodes`], but where another process is cleaning already it waits for that, at most this
    /// long for each of the dead: afterwards what still looks alive is alive.
    pub fn finish_cleaning(&self, limit: Duration) {
        self.node.blocking_cleanup_dead_nodes(limit);
    }

    /// A builder for the service with this full name.
    pub(super) fn builder(&self, name: &ServiceName) -> Builder<ipc::Service> {
        self.node.service_builder(name)
    }

    /// Removes the service with this full name; whether there was one that iceoryx2 takes for one.
    ///
    /// # Safety
    /// No live process uses or makes it.
    #[allow(unsafe_code)]
    pub(super) unsafe fn force_remove(
        &self,
        name: &ServiceName,
        pattern: MessagingPattern,
    ) -> bool {
        // SAFETY: the caller's promise.
        unsafe { self.node.force_remove_service(name, pattern) }.unwrap_or(false)
    }

    /// The node's id in iceoryx2.
    #[cfg(test)]
    pub(super) fn id(&self) -> u128 {
        self.node.id().value()
    }

    /// The node's configuration of iceoryx2.
    pub(super) fn config(&self) -> &Config {
        self.node.config()
    }

    /// Tries until it succeeds or fails for a lasting reason, at most [`ATTEMPTS`] times; dead processes are cleaned up
    /// in between.
    pub(super) fn retry<T, E>(
        &self,
        mut operation: impl FnMut() -> Result<T, E>,
        is_transient: impl Fn(&E) -> bool,
    ) -> Result<T, E> {
        for _ in 1..ATTEMPTS {
            match operation() {
                Err(error) if is_transient(&error) => {
                    self.clean_dead_nodes();
                    thread::sleep(PAUSE);
                }
                result => return result,
            }
        }
        operation()
    }

    /// Makes a port of a service, after cleaning up dead processes that hold its place.
    ///
    /// # Errors
    /// [`IpcError::Full`] where creating one fails as if live processes hold all places, or [`IpcError::Failed`].
    pub(super) fn make_port<T, E: Debug + PartialEq>(
        &self,
        service: &impl PortFactory<Service = ipc::Service>,
        port: &'static str,
        create: impl FnMut() -> Result<T, E>,
        full: &E,
    ) -> Result<T, IpcError> {
        let made = self.retry(create, |error| error == full);
        made.map_err(|error| {
            let name = service.name().to_string();
            if error == *full {
                return IpcError::Full {
                    service: name,
                    port,
                    users: users_of(service),
                };
            }
            IpcError::Failed {
                service: name,
                what: port,
                reason: format!("{error:?}"),
            }
        })
    }
}

/// The programs that have a service open, with their processes; empty where iceoryx2 does not say.
fn users_of(service: &impl PortFactory<Service = ipc::Service>) -> Vec<String> {
    let mut users = Vec::new();
    let listed = service.nodes(|node| {
        users.extend(user(&node));
        CallbackProgression::Continue
    });
    if listed.is_err() {
        return Vec::new();
    }
    users.sort_unstable();
    users
}

/// A program with its process; none where that is dead.
pub(super) fn user(node: &NodeState<ipc::Service>) -> Option<String> {
    let NodeState::Alive(node) = node else {
        return None;
    };
    let details = node.details().as_ref();
    let name = details.map(|details| details.name().to_string());
    let name = name.unwrap_or_else(|| "a program".to_owned());
    let process = node.id().pid::<ipc::Service>();
    let process = process.map_or(String::new(), |pid| format!(" (process {})", pid.value()));
    Some(name + &process)
}

/// Makes the memory that the node takes its number from, and tells iceoryx2 of it.
fn node_counter(options: &IpcOptions, config: &mut Config) -> Result<NodeCounter, IpcError> {
    let prefix = options.file_prefix();
    let counter = protect_shared(&prefix).and_then(|()| NodeCounter::make(&prefix));
    let counter = counter.map_err(|source| IpcError::SharedMemory {
        folder: shm_override::FOLDER.into(),
        source,
    })?;
    config.global.node.global_mgmt_suffix =
        FileName::new(counter.suffix().as_bytes()).expect("letters, digits and dots");
    Ok(counter)
}

fn log_level(text: Option<&str>) -> LogLevel {
    match text {
        Some("trace") => LogLevel::Trace,
        Some("debug") => LogLevel::Debug,
        Some("info") => LogLevel::Info,
        Some("warn") => LogLevel::Warn,
        Some("fatal") => LogLevel::Fatal,
        _ => LogLevel::Error,
    }
}
