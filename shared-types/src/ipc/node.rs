//! A program's membership in the services.

use std::env;
use std::fmt::Debug;
use std::thread;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{LogLevel, NodeName, ServiceName, SignalHandlingMode, ipc, set_log_level};
use iceoryx2::service::builder::Builder;

use super::sweeper::Sweeper;
use super::{IpcError, IpcOptions};

/// How often an operation that failed for a passing reason is tried again.
const ATTEMPTS: usize = 40;
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(5);

/// A program's node: make one, open services with it, keep it as long as them.
///
/// It may be moved to another thread but not shared between threads.
#[derive(Debug)]
pub struct IpcNode {
    node: Node<ipc::Service>,
    options: IpcOptions,
    _sweeper: Sweeper,
}

impl IpcNode {
    /// Joins the services under `options`, and cleans up after dead processes.
    ///
    /// `name` appears in tools. Signals are left to the program. iceoryx2 logs errors only, or what `PCC_IPC_LOG` says
    /// (`trace`, `debug`, `info`, `warn`, `error`, `fatal`).
    ///
    /// # Errors
    /// [`IpcError::InvalidPrefix`], [`IpcError::Root`], [`IpcError::ForeignRoot`], [`IpcError::Sweeper`] or
    /// [`IpcError::Node`].
    pub fn create(options: &IpcOptions, name: &str) -> Result<Self, IpcError> {
        set_log_level(log_level(env::var("PCC_IPC_LOG").ok().as_deref()));
        options.prepare()?;
        let config = options.config()?;
        let failed = |reason| IpcError::Node {
            root: options.root.clone(),
            reason,
        };
        let name = NodeName::new(name)
            .map_err(|_| failed(iceoryx2::node::NodeCreationFailure::InternalError))?;
        let sweeper = Sweeper::start(options).map_err(|source| IpcError::Sweeper { source })?;
        let builder = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled);
        let node = builder.create::<ipc::Service>().map_err(failed)?;
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

    /// Removes what dead processes left behind; a killed peer looks connected until someone does.
    ///
    /// Call it about 10 times a second, outside any real-time loop: it lists the nodes' directory. Returns how many
    /// were removed.
    pub fn clean_dead_nodes(&self) -> u64 {
        self.node.try_cleanup_dead_nodes().cleanups
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

    /// What iceoryx2 was told.
    pub(super) fn config(&self) -> &Config {
        self.node.config()
    }

    /// Tries until it succeeds or fails for a lasting reason, at most [`ATTEMPTS`] times; dead processes are cleaned up
    /// in between.
    pub(super) fn retry<T, E>(
        &self,
        mut operation: impl FnMut() -> Result<T, E>,
        passing: impl Fn(&E) -> bool,
    ) -> Result<T, E> {
        for _ in 1..ATTEMPTS {
            match operation() {
                Err(error) if passing(&error) => {
                    self.clean_dead_nodes();
                    thread::sleep(PAUSE);
                }
                result => return result,
            }
        }
        operation()
    }

    /// Makes a port of the service with this full name, after cleaning up dead processes that hold its place.
    ///
    /// # Errors
    /// [`IpcError::Full`] where creating one fails as if live processes hold all places, or [`IpcError::Failed`].
    pub(super) fn make_port<T, E: Debug + PartialEq>(
        &self,
        service: &str,
        port: &'static str,
        create: impl FnMut() -> Result<T, E>,
        full: &E,
    ) -> Result<T, IpcError> {
        let made = self.retry(create, |error| error == full);
        made.map_err(|error| {
            let service = service.to_owned();
            if error == *full {
                return IpcError::Full { service, port };
            }
            IpcError::Failed {
                service,
                what: port,
                reason: format!("{error:?}"),
            }
        })
    }
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
