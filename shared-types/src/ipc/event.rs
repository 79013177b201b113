//! The events beside `plan`: a sender of a request or an answer notifies, a receiver sleeps until then.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use iceoryx2::port::listener::{Listener, ListenerCreateError, ListenerWaitError};
use iceoryx2::port::notifier::{Notifier, NotifierCreateError};
use iceoryx2::prelude::{EventId, FileDescriptorBased, ipc};
use iceoryx2::service::builder::Builder;
use iceoryx2::service::port_factory::event::PortFactory;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::opening::{NODES, open_service};
use super::{IpcError, IpcNode};

/// An open event service: what its ports are made from.
pub type EventService = PortFactory<ipc::Service>;

/// Notifies that a message was sent; create it in the thread that uses it.
pub type EventNotifier = Notifier<ipc::Service>;
/// Sleeps until a message was sent to any receiver; create it in the thread that uses it.
#[derive(Debug)]
pub struct EventListener(Listener<ipc::Service>);

/// The only kind of event.
const SENT: EventId = EventId::new(0);

/// An event service, as data. Its only event id is 0; a receiver looks for what was sent, whatever number of events came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EventDescription {
    /// Its name behind the prefix.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    /// Who notifies.
    pub from: &'static str,
    /// Who listens.
    pub to: &'static str,
    /// Notifiers at once.
    pub notifiers: usize,
    /// Listeners at once.
    pub listeners: usize,
}

const PLAN_ASKED: EventDescription = EventDescription {
    name: "plan_asked",
    purpose: "A request was sent: the daemon, which may sleep, looks for it.",
    from: "clients",
    to: "planner-daemon",
    notifiers: NODES,
    listeners: NODES,
};
const PLAN_ANSWERED: EventDescription = EventDescription {
    name: "plan_answered",
    purpose: "An answer was sent: clients that sleep look for theirs.",
    from: "planner-daemon",
    to: "clients",
    ..PLAN_ASKED
};
/// Every event service, as data.
pub const EVENTS: &[EventDescription] = &[PLAN_ASKED, PLAN_ANSWERED];

/// Opens the event `plan_asked`, by which a client tells the daemon that it has sent a request.
///
/// # Errors
/// Any [`IpcError`].
pub fn plan_asked_event(node: &IpcNode) -> Result<EventService, IpcError> {
    event(node, &PLAN_ASKED)
}

/// Opens the event `plan_answered`, by which the daemon tells clients that it has sent an answer.
///
/// # Errors
/// Any [`IpcError`].
pub fn plan_answered_event(node: &IpcNode) -> Result<EventService, IpcError> {
    event(node, &PLAN_ANSWERED)
}

fn event(node: &IpcNode, settings: &EventDescription) -> Result<EventService, IpcError> {
    let open = |builder: Builder<ipc::Service>| {
        builder
            .event()
            .event_id_max_value(SENT.as_value())
            .max_notifiers(settings.notifiers)
            .max_listeners(settings.listeners)
            .max_nodes(NODES)
            .open_or_create()
    };
    open_service(node, settings.name, &[], open)
}

/// Makes a notifier, after cleaning up dead ones.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold the places, or [`IpcError::Failed`].
pub fn event_notifier(node: &IpcNode, event: &EventService) -> Result<EventNotifier, IpcError> {
    let create = || event.notifier_builder().default_event_id(SENT).create();
    let full = NotifierCreateError::ExceedsMaxSupportedNotifiers;
    node.make_port(event, "notifier", create, &full)
}

/// Makes a listener, after cleaning up dead ones.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold all places, or [`IpcError::Failed`].
pub fn event_listener(node: &IpcNode, event: &EventService) -> Result<EventListener, IpcError> {
    let create = || event.listener_builder().create();
    let full = ListenerCreateError::ExceedsMaxSupportedListeners;
    node.make_port(event, "listener", create, &full)
        .map(EventListener)
}

impl EventListener {
    /// Sleeps until something was sent since the last call, or `other` can be read, if there is one, but no longer than `limit`;
    /// whether something was sent.
    ///
    /// The limit is kept to the thread's timer slack, 50 µs by default; iceoryx2's own waiting would round it up to the scheduler's
    /// ticks. An event may be lost where several are sent and received at the same instant, so choose a limit that is acceptable as a delay.
    ///
    /// # Errors
    /// The error of the system or of iceoryx2.
    pub fn wait(&self, other: Option<BorrowedFd>, limit: Duration) -> io::Result<bool> {
        // This also makes notifiers send again: they do not while one message waits.
        if self.drain()? {
            return Ok(true);
        }
        let limit = Timespec::try_from(limit).map_err(io::Error::other)?;
        // SAFETY: the socket is open as long as the listener, which is borrowed, and the handle neither closed nor kept.
        #[allow(unsafe_code)]
        let socket = unsafe { BorrowedFd::borrow_raw(self.0.file_descriptor().native_handle()) };
        let readable = |file| PollFd::from_borrowed_fd(file, PollFlags::IN);
        let polled = match other {
            Some(other) => poll(&mut [socket, other].map(readable), Some(&limit)),
            None => poll(&mut [readable(socket)], Some(&limit)),
        };
        match polled {
            Ok(_) => self.drain(),
            Err(Errno::INTR) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    fn drain(&self) -> io::Result<bool> {
        match self.0.try_wait(|_| ()) {
            Ok(count) => Ok(count > 0),
            Err(ListenerWaitError::InterruptSignal) => Ok(false),
            Err(reason) => Err(io::Error::other(format!("{reason:?}"))),
        }
    }
}
