//! Errors of the client.

use std::time::Duration;

use shared_types::codes::SceneRefusal;
use shared_types::ipc::IpcError;
use shared_types::valid::Invalid;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// A service or a port is not available.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The request was not sent.
    #[error("the request is not valid: {0}")]
    InvalidRequest(Invalid),
    /// Nobody serves under this prefix and root.
    #[error(
        "no {server} within {waited:?}: start it, or set PCC_PREFIX and PCC_ROOT to where it runs"
    )]
    NoServer {
        /// The missing process.
        server: &'static str,
        /// For how long the process was waited for.
        waited: Duration,
    },
    /// The server died, or dropped the request, before it answered.
    #[error(
        "the {server} went away before it answered request {id}; {}",
        if *.may_have_acted { "it may have acted on it: look at the controller's state before sending it again" }
        else { "it has no effect that lasts: send it again" }
    )]
    ServerLost {
        /// The process that went away.
        server: &'static str,
        /// The request's number.
        id: u64,
        /// Whether the request could have moved something.
        may_have_acted: bool,
    },
    /// The server is there but did not answer in time; the request was cancelled.
    #[error(
        "the {server} did not answer request {id} within {waited:?}{}",
        if *.may_have_acted { "; it may have acted on it: look at the controller's state before sending it again" } else { "" }
    )]
    TimedOut {
        /// The process that did not answer.
        server: &'static str,
        /// The request's number.
        id: u64,
        /// For how long the answer was waited for.
        waited: Duration,
        /// Whether the request could have moved something.
        may_have_acted: bool,
    },
    /// This client has as many unanswered requests as the daemon allows.
    #[error("too many requests of this client at once; wait for an answer or drop a pending one")]
    TooManyRequests,
    /// The daemon does not let a scene count; the one before of the same source does until its lifetime ends.
    #[error(
        "scene {sequence} of source {source_name:?} is refused: {refusal}{}",
        if reason.is_empty() || reason == refusal.text() { String::new() } else { format!(" ({reason})") }
    )]
    SceneRefused {
        /// Name of the scene's source.
        source_name: String,
        /// The publisher's number of the scene.
        sequence: u32,
        /// Why the scene does not count.
        refusal: SceneRefusal,
        /// What the daemon says is wrong with it; empty where it was not asked.
        reason: String,
    },
    /// What came is no message of this protocol's version.
    #[error("{sender} sent something this program does not understand: {invalid}")]
    BadMessage {
        /// Who sent the message.
        sender: &'static str,
        /// What is wrong with the message.
        invalid: Invalid,
    },
    /// iceoryx2 could not send or receive.
    #[error("cannot {what}: {reason}")]
    Transport {
        /// The operation that failed.
        what: &'static str,
        /// What iceoryx2 said.
        reason: String,
    },
}

impl From<std::io::Error> for ClientError {
    fn from(reason: std::io::Error) -> Self {
        Self::transport("start a thread", reason)
    }
}

impl ClientError {
    /// A failed operation of iceoryx2.
    pub(crate) fn transport(what: &'static str, reason: impl std::fmt::Debug) -> Self {
        Self::Transport {
            what,
            reason: format!("{reason:?}"),
        }
    }
}
