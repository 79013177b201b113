//! A loop that is asked to end: it brings its motors to rest first.

use std::io;
use std::sync::{
    Arc, LazyLock, Mutex, PoisonError,
    atomic::{AtomicBool, Ordering},
};

use shared_types::ipc::IpcError;
use signal_hook::SigId;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};

/// Whether a loop is to bring its motors to rest and end, as its program or signals ask.
#[derive(Debug, Default)]
pub struct Shutdown {
    is_asked: Arc<AtomicBool>,
    handlers: Vec<SigId>,
}

/// What this process does at Ctrl-C and SIGTERM.
#[derive(Default)]
struct Signals {
    /// Handlers of loops that live.
    handlers: usize,
    /// Whether there are none, so that a signal ends the process.
    end_the_process: Arc<AtomicBool>,
    /// Signals that end the process then.
    known: Vec<i32>,
}

static SIGNALS: LazyLock<Mutex<Signals>> = LazyLock::new(Mutex::default);

impl Shutdown {
    /// A shutdown that a program asks for by setting this flag, or by [`Self::ask`].
    #[must_use]
    pub fn asked_by(is_asked: Arc<AtomicBool>) -> Self {
        Self {
            is_asked,
            handlers: Vec::new(),
        }
    }

    /// Asks the loop to bring its motors to rest and end.
    pub fn ask(&self) {
        self.is_asked.store(true, Ordering::Relaxed);
    }

    /// Whether the loop was asked to end.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Relaxed)
    }

    /// Has Ctrl-C and SIGTERM ask the loop to end, in place of ending the process, until this is dropped. `service` names the loop in errors.
    ///
    /// Each loop of a process is asked that has called this; once the last one was dropped the signals end the process again.
    ///
    /// # Errors
    /// [`IpcError::Failed`] where the system refuses a handler.
    pub fn ask_at_signals(&mut self, service: &str) -> Result<(), IpcError> {
        let mut signals = SIGNALS.lock().unwrap_or_else(PoisonError::into_inner);
        for (name, signal) in [("SIGINT", SIGINT), ("SIGTERM", SIGTERM)] {
            let handler = signals
                .end_the_process_at(signal)
                .and_then(|()| flag::register(signal, Arc::clone(&self.is_asked)))
                .map_err(|error| no_handler(service, name, &error))?;
            self.handlers.push(handler);
            signals.count(1);
        }
        Ok(())
    }
}

impl Signals {
    /// Has a signal end the process where no loop has a handler: from the first handler on, the system no longer does.
    fn end_the_process_at(&mut self, signal: i32) -> io::Result<()> {
        if !self.known.contains(&signal) {
            flag::register_conditional_default(signal, Arc::clone(&self.end_the_process))?;
            self.known.push(signal);
        }
        Ok(())
    }

    fn count(&mut self, change: isize) {
        self.handlers = self.handlers.saturating_add_signed(change);
        let are_none = self.handlers == 0;
        self.end_the_process.store(are_none, Ordering::Relaxed);
    }
}

impl Drop for Shutdown {
    fn drop(&mut self) {
        let mut signals = SIGNALS.lock().unwrap_or_else(PoisonError::into_inner);
        for handler in self.handlers.drain(..) {
            low_level::unregister(handler);
            signals.count(-1);
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn ends_the_process() -> bool {
        SIGNALS
            .lock()
            .unwrap()
            .end_the_process
            .load(Ordering::Relaxed)
    }

    #[test]
    fn a_signal_asks_each_loop_that_lives_and_ends_the_process_after_the_last_one() {
        let [mut first, mut second, unheeding] = [(); 3].map(|()| Shutdown::default());
        first.ask_at_signals("first").unwrap();
        second.ask_at_signals("second").unwrap();
        let asked = Arc::clone(&first.is_asked);
        drop(first);
        assert!(!ends_the_process());
        low_level::raise(SIGTERM).unwrap();
        assert!(second.is_asked() && !unheeding.is_asked());
        assert!(!asked.load(Ordering::Relaxed));
        drop(second);
        assert!(ends_the_process());
    }
}
