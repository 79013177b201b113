//! A loop that is asked to end: it brings its motors to rest first.

use std::io;
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use shared_types::ipc::IpcError;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Whether a loop is to bring its motors to rest and end, as its program or signals ask.
#[derive(Debug, Default)]
pub struct Shutdown {
    is_asked: Arc<AtomicBool>,
    /// It was dropped: signals end the process again.
    is_gone: Arc<AtomicBool>,
}

impl Shutdown {
    /// One that is asked for by setting this as well.
    #[must_use]
    pub fn asked_by(is_asked: Arc<AtomicBool>) -> Self {
        Self {
            is_asked,
            is_gone: Arc::default(),
        }
    }

    /// Asks for it.
    pub fn ask(&self) {
        self.is_asked.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked for.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Relaxed)
    }

    /// Has Ctrl-C and SIGTERM ask for it, in place of ending the process, until it is dropped. `service` names the loop in errors.
    ///
    /// # Errors
    /// [`IpcError::Failed`] where the system refuses a handler.
    pub fn ask_at_signals(&self, service: &str) -> Result<(), IpcError> {
        for (name, signal) in [("SIGINT", SIGINT), ("SIGTERM", SIGTERM)] {
            let [is_gone, is_asked] = [&self.is_gone, &self.is_asked].map(Arc::clone);
            flag::register_conditional_default(signal, is_gone)
                .and_then(|_| flag::register(signal, is_asked))
                .map_err(|error| no_handler(service, name, &error))?;
        }
        Ok(())
    }
}

impl Drop for Shutdown {
    fn drop(&mut self) {
        self.is_gone.store(true, Ordering::Relaxed);
    }
}

/// The error of a signal whose handler the system refused.
#[must_use]
pub fn no_handler(service: &str, signal: &str, error: &io::Error) -> IpcError {
    IpcError::Failed {
        service: service.to_owned(),
        what: "a signal's handler",
        reason: format!("{signal}: {error}"),
    }
}
