//! Threads that own ports.

use std::io;
use std::sync::mpsc::sync_channel;
use std::thread::{Builder, JoinHandle};

/// Starts a thread that makes its ports with `open` and then runs `work` with them; ports cannot be moved between threads. Returns once
/// `open` has returned in that thread, with its error where it has failed.
///
/// # Errors
/// The system's where it has no more threads.
pub fn spawn_with_ports<Ports, E: Send + 'static>(
    name: &str,
    open: impl FnOnce() -> Result<Ports, E> + Send + 'static,
    work: impl FnOnce(Ports) + Send + 'static,
) -> io::Result<Result<JoinHandle<()>, E>> {
    let (sender, opened) = sync_channel(1);
    let thread = Builder::new().name(name.to_owned()).spawn(move || {
        let (ports, result) = match open() {
            Ok(ports) => (Some(ports), Ok(())),
            Err(error) => (None, Err(error)),
        };
        // The receiver waits for it.
        let _ = sender.send(result);
        ports.map(work);
    })?;
    let opened = opened.recv().map_err(io::Error::other)?;
    Ok(opened.map(|()| thread))
}

/// Waits for the end of a thread when it is dropped: declared after what lets the thread end.
#[derive(Debug)]
pub struct JoinOnDrop(Option<JoinHandle<()>>);

impl From<JoinHandle<()>> for JoinOnDrop {
    fn from(thread: JoinHandle<()>) -> Self {
        Self(Some(thread))
    }
}

impl Drop for JoinOnDrop {
    fn drop(&mut self) {
        if let Some(thread) = self.0.take() {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
    }
}
