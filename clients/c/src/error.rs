//! Why a call has failed, for the thread that made it.

use std::cell::RefCell;
use std::ffi::{CString, c_char};

use client::ClientError;
use shared_types::valid::Invalid;

/// What kind of error the last failed call of a thread met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum ErrorKind {
    /// None has failed.
    None = 0,
    /// A pointer is null, a text is no UTF-8, a number or a code is not allowed, there is no such candidate, or a file (of a robot, of settings)
    /// or a configuration is refused.
    Argument = 1,
    /// The request is not valid: the text names the field and what is allowed.
    InvalidRequest = 2,
    /// A service or a port is not available.
    Ipc = 3,
    /// Nobody serves under this prefix and root.
    NoServer = 4,
    /// The server ended before it answered.
    ServerLost = 5,
    /// The server did not answer in time.
    TimedOut = 6,
    /// This client has as many unanswered requests as the daemon allows.
    TooManyRequests = 7,
    /// The daemon does not let a scene count.
    SceneRefused = 8,
    /// What came is no message of this protocol's version.
    BadMessage = 9,
    /// iceoryx2 could not send or receive.
    Transport = 10,
}

/// An error as C sees it.
#[derive(Debug)]
pub(crate) struct Failure {
    kind: ErrorKind,
    text: String,
}

/// What a call comes to.
pub(crate) type Outcome<T> = Result<T, Failure>;

impl Failure {
    /// An argument that is not allowed.
    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self {
            kind: ErrorKind::Argument,
            text: text.into(),
        }
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        let kind = match &error {
            ClientError::Ipc(_) => ErrorKind::Ipc,
            ClientError::InvalidRequest(_) => ErrorKind::InvalidRequest,
            ClientError::NoServer { .. } => ErrorKind::NoServer,
            ClientError::ServerLost { .. } => ErrorKind::ServerLost,
            ClientError::TimedOut { .. } => ErrorKind::TimedOut,
            ClientError::TooManyRequests => ErrorKind::TooManyRequests,
            ClientError::SceneRefused { .. } => ErrorKind::SceneRefused,
            ClientError::BadMessage { .. } => ErrorKind::BadMessage,
            ClientError::Transport { .. } => ErrorKind::Transport,
        };
        let text = error.to_string();
        Self { kind, text }
    }
}

impl From<Invalid> for Failure {
    fn from(invalid: Invalid) -> Self {
        ClientError::InvalidRequest(invalid).into()
    }
}

struct LastError {
    kind: ErrorKind,
    text: CString,
}

thread_local! {
    static LAST: RefCell<LastError> = RefCell::new(LastError {
        kind: ErrorKind::None,
        text: CString::default(),
    });
}

/// The value of a call, or the value that says that it has failed, whose error is kept.
pub(crate) fn or_fail<T>(outcome: Outcome<T>, failed: T) -> T {
    outcome.unwrap_or_else(|failure| {
        let text = CString::new(failure.text.replace('\0', " ")).unwrap_or_default();
        let kind = failure.kind;
        LAST.with_borrow_mut(|last| *last = LastError { kind, text });
        failed
    })
}

/// Why the last failed call of this thread has failed, in words; valid until the thread's next call fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.text.as_ptr())
}

/// What kind of error the last failed call of this thread met.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_last_error_kind() -> ErrorKind {
    LAST.with_borrow(|last| last.kind)
}
