//! Opening and creating services, one process at a time, so that a creator that died while creating can be distinguished from a slow one.

use std::fmt::Debug;
use std::fs::{self, File, TryLockError};
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::node::{Node, NodeState, NodeView};
use iceoryx2::prelude::{CallbackProgression, MessagingPattern, ServiceName, ipc};
use iceoryx2::service::Service;
use iceoryx2::service::builder::Builder;
use iceoryx2::service::builder::event::{EventCreateError, EventOpenError, EventOpenOrCreateError};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError, RequestResponseOpenError, RequestResponseOpenOrCreateError,
};
use iceoryx2::service::service_hash::ServiceHash;

use super::carried::CarriedTypes;
use super::{IpcError, IpcNode, root_folder};
use crate::message::Layout;

/// Processes that may open one service at the same time, dead ones that nobody has cleaned up yet included.
pub const NODES: usize = 80;
/// How long another process may take to open a service: milliseconds, or up to a second where it meets a dead
/// creator's remains.
const PATIENCE: Duration = Duration::from_secs(4);
/// Pause between two looks at the lock.
const PAUSE: Duration = Duration::from_millis(1);

/// What an error of iceoryx2 means for the opening of a service.
pub(super) trait OpeningError: Debug {
    /// The messaging pattern of the services that are opened.
    const PATTERN: MessagingPattern;
    /// The meaning of this error.
    fn cause(&self) -> Cause;
}

/// Why a service was not opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    /// The service was begun and is not finished.
    HalfMade,
    /// The service is being made or removed.
    InFlux,
    /// The service is damaged; it may also be about to be made or removed.
    Corrupted,
    /// Processes hold all of the service's places; some of them may be dead.
    Full,
    /// Another version of iceoryx2 made the service.
    OtherVersion,
    /// The service exists with other types or qualities.
    Incompatible,
    /// Any other cause.
    Other,
}

impl Cause {
    /// Whether opening again may succeed.
    fn is_transient(self) -> bool {
        matches!(
            self,
            Self::HalfMade | Self::InFlux | Self::Corrupted | Self::Full
        )
    }

    /// The error for the service with this full name, which carries these types where it is there.
    fn error(self, service: String, reason: String, types: Types) -> IpcError {
        match self {
            Self::Corrupted | Self::OtherVersion => {
                IpcError::OtherLibraryVersion { service, reason }
            }
            Self::Full => IpcError::Full {
                service,
                port: "process",
                users: Vec::new(),
            },
            Self::Incompatible => IpcError::Incompatible {
                service,
                expected: types.expected.to_string(),
                found: types
                    .found
                    .map_or("types that cannot be read".to_owned(), |it| it.to_string()),
                reason,
            },
            Self::HalfMade | Self::InFlux | Self::Other => IpcError::Failed {
                service,
                what: "as a whole",
                reason,
            },
        }
    }
}

/// Opens the service `name`, which carries these messages, with `open`, again where it failed for a passing reason. No two of this project's processes
/// open at once; what is half-made then, and no live process says that it is making, is a dead process's and is removed.
///
/// # Errors
/// [`IpcError::Busy`] if another process is opening and does not come to an end, [`IpcError::Lock`], or the error that
/// the [`Cause`] of `open`'s failure stands for.
pub(super) fn open_service<T, E: OpeningError>(
    node: &IpcNode,
    name: &str,
    carries: &[Layout],
    open: impl Fn(Builder<ipc::Service>) -> Result<T, E>,
) -> Result<T, IpcError> {
    let full = node.options().service_name(name);
    let name = ServiceName::new(&full).map_err(|reason| IpcError::Failed {
        service: full.clone(),
        what: "its name",
        reason: format!("{reason:?}"),
    })?;
    let open_alone = || {
        let _alone = lock(node).map_err(Failure::Lock)?;
        open(node.builder(&name)).map_err(|error| {
            if error.cause() == Cause::HalfMade {
                remove(node, &name, E::PATTERN);
            }
            Failure::Open(error)
        })
    };
    let transient = |failure: &Failure<E>| matches!(failure, Failure::Open(error) if error.cause().is_transient());
    node.retry(open_alone, transient)
        .map_err(|failure| match failure {
            Failure::Lock(error) => error,
            Failure::Open(error) => {
                let found = CarriedTypes::found(node, &name, E::PATTERN);
                let expected = CarriedTypes::expected(carries);
                let types = Types { expected, found };
                error.cause().error(full, format!("{error:?}"), types)
            }
        })
}

/// What a service should carry and what it does.
struct Types {
    expected: CarriedTypes,
    found: Option<CarriedTypes>,
}

enum Failure<E> {
    Lock(IpcError),
    Open(E),
}

/// Removes what a dead process began. What cannot be removed, or is not a dead process's, shows when it is opened again.
fn remove(node: &IpcNode, name: &ServiceName, pattern: MessagingPattern) {
    let hash = ServiceHash::new::<<ipc::Service as Service>::ServiceNameHasher>(name, pattern);
    if is_used_by_live_node(node, &hash) {
        return;
    }
    // SAFETY: nobody uses the service: it was never finished, so nobody can have opened it, and its creator is dead, for
    // no live node says that it has to do with it. None can have begun since, for the half-made one holds the name.
    #[allow(unsafe_code)]
    let removed = unsafe { node.force_remove(name, pattern) };
    if !removed {
        // iceoryx2 takes a description that was never finished for none.
        let _ = fs::remove_file(description_file(node, &hash));
    }
}

/// Whether a live node makes or uses the service, in whatever language. iceoryx2 has each node leave a note in its folder
/// before it makes or opens a service; this process's own is gone once opening has failed.
fn is_used_by_live_node(node: &IpcNode, hash: &ServiceHash) -> bool {
    let global = &node.config().global;
    let folder = PathBuf::from(global.node_dir().to_string());
    let note = format!("{}{hash}{}", global.prefix, global.node.service_tag_suffix);
    let mut living = false;
    let listed = Node::<ipc::Service>::list(node.config(), |state| {
        if let NodeState::Alive(view) = &state {
            let own_folder = folder.join(view.id().value().to_string());
            living |= own_folder.join(&note).exists();
        }
        CallbackProgression::Continue
    });
    living || listed.is_err()
}

fn description_file(node: &IpcNode, hash: &ServiceHash) -> PathBuf {
    let global = &node.config().global;
    let suffix = &global.service.static_config_storage_suffix;
    let directory = PathBuf::from(global.service_dir().to_string());
    directory.join(format!("{}{hash}{suffix}", global.prefix))
}

/// The right to open services: a lock of the kernel's, gone with its holder.
fn lock(node: &IpcNode) -> Result<File, IpcError> {
    let lock_file = node.options().lock_file("services");
    let io = |source| IpcError::Lock {
        lock_file: lock_file.clone(),
        source,
    };
    let file = root_folder::open_lock_file(&lock_file).map_err(io)?;
    let begin = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::Error(source)) => return Err(io(source)),
            Err(TryLockError::WouldBlock) if begin.elapsed() < PATIENCE => thread::sleep(PAUSE),
            Err(TryLockError::WouldBlock) => return Err(IpcError::Busy { lock_file }),
        }
    }
}

/// The causes of the errors of one pattern's services; `$incompatible`: those of its own that say that types or qualities differ.
macro_rules! opening_errors {
    ($pattern:ident: $either:ident { $open:ident, $create:ident $(:: $hangs:ident)? } $($incompatible:ident)*) => {
        impl OpeningError for $either {
            const PATTERN: MessagingPattern = MessagingPattern::$pattern;

            fn cause(&self) -> Cause {
                match self {
                    Self::SystemInFlux
                    | Self::$open($open::DoesNotExist | $open::IsMarkedForDestruction)
                    | Self::$create(
                        $create::AlreadyExists | $create::IsBeingCreatedByAnotherInstance,
                    ) => Cause::InFlux,
                    Self::$open($open::HangsInCreation) $(| Self::$create($create::$hangs))? => {
                        Cause::HalfMade
                    }
                    Self::$open($open::ServiceInCorruptedState)
                    | Self::$create($create::ServiceInCorruptedState) => Cause::Corrupted,
                    Self::$open($open::ExceedsMaxNumberOfNodes) => Cause::Full,
                    Self::$open($open::VersionMismatch) => Cause::OtherVersion,
                    Self::$open(
                        $open::IncompatibleMessagingPattern
                        | $open::IncompatibleAttributes
                        | $open::DoesNotSupportRequestedAmountOfNodes
                        $(| $open::$incompatible)*,
                    ) => Cause::Incompatible,
                    _ => Cause::Other,
                }
            }
        }
    };
}

opening_errors!(RequestResponse: RequestResponseOpenOrCreateError {
    RequestResponseOpenError, RequestResponseCreateError::HangsInCreation
}
    IncompatibleRequestOrResponseType
    IncompatibleOverflowBehaviorForRequests
    IncompatibleOverflowBehaviorForResponses
    IncompatibleBehaviorForFireAndForgetRequests
    DoesNotSupportRequestedAmountOfClientRequestLoans
    DoesNotSupportRequestedAmountOfActiveRequestsPerClient
    DoesNotSupportRequestedResponseBufferSize
    DoesNotSupportRequestedAmountOfServers
    DoesNotSupportRequestedAmountOfClients
    DoesNotSupportRequestedAmountOfBorrowedResponsesPerPendingResponse
);
opening_errors!(PublishSubscribe: PublishSubscribeOpenOrCreateError {
    PublishSubscribeOpenError, PublishSubscribeCreateError::HangsInCreation
}
    IncompatibleTypes
    IncompatibleOverflowBehavior
    DoesNotSupportRequestedMinBufferSize
    DoesNotSupportRequestedMinHistorySize
    DoesNotSupportRequestedMinSubscriberBorrowedSamples
    DoesNotSupportRequestedAmountOfPublishers
    DoesNotSupportRequestedAmountOfSubscribers
);
opening_errors!(Event: EventOpenOrCreateError { EventOpenError, EventCreateError }
    IncompatibleDeadline
    IncompatibleNotifierCreatedEvent
    IncompatibleNotifierDroppedEvent
    IncompatibleNotifierDeadEvent
    DoesNotSupportRequestedAmountOfNotifiers
    DoesNotSupportRequestedAmountOfListeners
    DoesNotSupportRequestedMaxEventId
);
