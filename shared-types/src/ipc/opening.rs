//! Opening and creating services, one process at a time, so that a creator that died half-way can be told from a slow one.

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

use super::{IpcError, IpcNode, root_folder};

/// Processes that may open one service at the same time, dead ones that nobody has cleaned up yet included.
pub(super) const NODES: usize = 80;
/// How long another process may take to open a service: milliseconds, or somewhat over a second where it meets a dead
/// creator's remains.
const PATIENCE: Duration = Duration::from_secs(4);
/// Pause between two looks at the lock.
const PAUSE: Duration = Duration::from_millis(1);

/// What opening needs to know of iceoryx2's errors.
pub(super) trait OpeningError {
    /// The messaging pattern of the services that are opened.
    const PATTERN: MessagingPattern;
    /// Whether opening again may succeed: the service is being made or removed, or dead processes hold its places.
    fn is_passing(&self) -> bool;
    /// Whether the service was begun and is not finished.
    fn is_half_made(&self) -> bool;
}

/// Opens the service `name` with `open`, again where it failed for a passing reason. No two of this project's processes
/// open at once; what is half-made then, and no live process says that it is making, is a dead process's and is removed.
///
/// # Errors
/// [`IpcError::Busy`] if another process is opening and does not come to an end, [`IpcError::Lock`], or what
/// `translate` makes of `open`'s error and the service's full name.
pub(super) fn open_service<T, E: OpeningError>(
    node: &IpcNode,
    name: &str,
    open: impl Fn(Builder<ipc::Service>) -> Result<T, E>,
    translate: impl FnOnce(String, E) -> IpcError,
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
            if error.is_half_made() {
                remove(node, &name, E::PATTERN);
            }
            Failure::Open(error)
        })
    };
    let passing =
        |failure: &Failure<E>| matches!(failure, Failure::Open(error) if error.is_passing());
    node.retry(open_alone, passing)
        .map_err(|failure| match failure {
            Failure::Lock(error) => error,
            Failure::Open(error) => translate(full, error),
        })
}

enum Failure<E> {
    Lock(IpcError),
    Open(E),
}

/// Removes what a dead process began. What cannot be removed, or is not a dead process's, shows when it is opened again.
fn remove(node: &IpcNode, name: &ServiceName, pattern: MessagingPattern) {
    let hash = ServiceHash::new::<<ipc::Service as Service>::ServiceNameHasher>(name, pattern);
    if is_in_living_hands(node, &hash) {
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
fn is_in_living_hands(node: &IpcNode, hash: &ServiceHash) -> bool {
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

/// The errors of one pattern's services: of opening, and of opening or creating.
macro_rules! opening_errors {
    ($pattern:ident: $either:ident { $open:ident, $create:ident $(:: $hangs:ident)? }) => {
        impl OpeningError for $open {
            const PATTERN: MessagingPattern = MessagingPattern::$pattern;

            fn is_passing(&self) -> bool {
                matches!(
                    self,
                    Self::ServiceInCorruptedState
                        | Self::IsMarkedForDestruction
                        | Self::HangsInCreation
                        | Self::ExceedsMaxNumberOfNodes
                )
            }

            fn is_half_made(&self) -> bool {
                *self == Self::HangsInCreation
            }
        }

        impl OpeningError for $either {
            const PATTERN: MessagingPattern = MessagingPattern::$pattern;

            fn is_passing(&self) -> bool {
                match self {
                    Self::SystemInFlux => true,
                    Self::$open(error) => *error == $open::DoesNotExist || error.is_passing(),
                    Self::$create(error) => matches!(
                        error,
                        $create::ServiceInCorruptedState
                            | $create::AlreadyExists
                            | $create::IsBeingCreatedByAnotherInstance
                            $(| $create::$hangs)?
                    ),
                }
            }

            fn is_half_made(&self) -> bool {
                matches!(
                    self,
                    Self::$open($open::HangsInCreation) $(| Self::$create($create::$hangs))?
                )
            }
        }
    };
}

opening_errors!(RequestResponse: RequestResponseOpenOrCreateError {
    RequestResponseOpenError, RequestResponseCreateError::HangsInCreation
});
opening_errors!(PublishSubscribe: PublishSubscribeOpenOrCreateError {
    PublishSubscribeOpenError, PublishSubscribeCreateError::HangsInCreation
});
opening_errors!(Event: EventOpenOrCreateError { EventOpenError, EventCreateError });
