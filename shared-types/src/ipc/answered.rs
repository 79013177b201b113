//! The event `plan`: the daemon tells whoever waits for an answer that one was sent.

use iceoryx2::port::listener::{Listener, ListenerCreateError};
use iceoryx2::port::notifier::{Notifier, NotifierCreateError};
use iceoryx2::prelude::{EventId, ipc};
use iceoryx2::service::builder::Builder;
use iceoryx2::service::builder::event::{EventCreateError, EventOpenError, EventOpenOrCreateError};
use iceoryx2::service::port_factory::event::PortFactory;

use super::opening::{NODES, open_service};
use super::request::{PLAN, SERVERS};
use super::{IpcError, IpcNode};

/// The open event `plan`.
pub type AnsweredService = PortFactory<ipc::Service>;
/// Says that an answer was sent; create it in the thread that uses it.
pub type AnsweredNotifier = Notifier<ipc::Service>;
/// Sleeps until an answer was sent, to whomever; create it in the thread that uses it.
pub type AnsweredListener = Listener<ipc::Service>;

/// There is one kind of event.
const ANSWERED: EventId = EventId::new(0);

/// Opens the event `plan`: both sides.
///
/// # Errors
/// Any [`IpcError`].
pub fn answered_service(node: &IpcNode) -> Result<AnsweredService, IpcError> {
    let open = |builder: Builder<ipc::Service>| {
        builder
            .event()
            .event_id_max_value(ANSWERED.as_value())
            .max_notifiers(SERVERS)
            .max_listeners(NODES)
            .max_nodes(NODES)
            .open_or_create()
    };
    open_service(node, PLAN, open, translate)
}

/// Makes the daemon's notifier, after cleaning up dead ones.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold the places, or [`IpcError::Failed`].
pub fn answered_notifier(
    node: &IpcNode,
    service: &AnsweredService,
) -> Result<AnsweredNotifier, IpcError> {
    let create = || {
        service
            .notifier_builder()
            .default_event_id(ANSWERED)
            .create()
    };
    let full = NotifierCreateError::ExceedsMaxSupportedNotifiers;
    port(node, "notifier", create, &full)
}

/// Makes a client's listener, after cleaning up dead ones.
///
/// # Errors
/// [`IpcError::Full`] if live processes hold all places, or [`IpcError::Failed`] (the root's path is too long for a socket, for
/// example).
pub fn answered_listener(
    node: &IpcNode,
    service: &AnsweredService,
) -> Result<AnsweredListener, IpcError> {
    let create = || service.listener_builder().create();
    let full = ListenerCreateError::ExceedsMaxSupportedListeners;
    port(node, "listener", create, &full)
}

fn port<T, E: std::fmt::Debug + PartialEq>(
    node: &IpcNode,
    port: &'static str,
    create: impl FnMut() -> Result<T, E>,
    full: &E,
) -> Result<T, IpcError> {
    node.retry(create, |error| error == full).map_err(|error| {
        let service = node.options().service_name(PLAN);
        match error {
            error if error == *full => IpcError::Full { service, port },
            error => IpcError::Failed {
                service,
                what: port,
                reason: format!("{error:?}"),
            },
        }
    })
}

fn translate(service: String, error: EventOpenOrCreateError) -> IpcError {
    use EventOpenError as Open;
    use EventOpenOrCreateError as Either;
    let reason = format!("{error:?}");
    match error {
        Either::EventOpenError(Open::ServiceInCorruptedState | Open::VersionMismatch)
        | Either::EventCreateError(EventCreateError::ServiceInCorruptedState) => {
            IpcError::OtherLibraryVersion { service, reason }
        }
        Either::EventOpenError(Open::ExceedsMaxNumberOfNodes) => IpcError::Full {
            service,
            port: "process",
        },
        Either::EventOpenError(
            Open::IncompatibleMessagingPattern
            | Open::IncompatibleAttributes
            | Open::IncompatibleDeadline
            | Open::IncompatibleNotifierCreatedEvent
            | Open::IncompatibleNotifierDroppedEvent
            | Open::IncompatibleNotifierDeadEvent
            | Open::DoesNotSupportRequestedAmountOfNotifiers
            | Open::DoesNotSupportRequestedAmountOfListeners
            | Open::DoesNotSupportRequestedMaxEventId
            | Open::DoesNotSupportRequestedAmountOfNodes,
        ) => IpcError::Incompatible { service, reason },
        _ => IpcError::Failed {
            service,
            what: "the service",
            reason,
        },
    }
}
