//! The log of a process that moves a robot, on standard error: no thread that logs ever waits for its reader.
//!
//! A full pipe, a stopped terminal or a busy disk blocks the writing thread. So only one thread writes; all others put
//! their lines into a bounded queue, from which a line is lost where there is no room. Lost lines are counted, and
//! told of in the log as soon as it goes on. iceoryx2's log, panics and the reason of an exit go through the same queue.
//!
//! A panic ends the whole process, whichever thread it is of: half of such a process is worse than none, since the others take it
//! for alive. A service manager can start it again.

mod queue;

use std::backtrace::{Backtrace, BacktraceStatus};
use std::cell::Cell;
use std::error::Error;
use std::fmt::Arguments;
use std::fs::File;
use std::io::{self, IsTerminal, stderr};
use std::iter::successors;
use std::os::fd::AsFd;
use std::panic;
use std::process::{ExitCode, abort};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::prelude::{LogLevel, set_logger};
use iceoryx2_log_types::Log;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::Directive;

use queue::{Line, Queue};

/// Longest time that a clean end waits for the log to be written.
const FLUSH_TIMEOUT: Duration = Duration::from_millis(500);
/// Longest time that an end with an error waits for the log, the reason in it, to be written: on a busy machine the thread that
/// writes gets its turn late.
const FLUSH_TIMEOUT_AFTER_ERROR: Duration = Duration::from_secs(2);
/// Longest time that a panic waits for its report to be written, before it ends the process.
const FLUSH_TIMEOUT_IN_PANIC: Duration = Duration::from_millis(100);

/// Target of iceoryx2's own lines.
const IPC: &str = "iceoryx2";

/// This process's queue, once [`start`] has made it.
static QUEUE: OnceLock<Arc<Queue>> = OnceLock::new();

thread_local! {
    /// Whether panics of this thread are caught by its caller and must not abort the process.
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Panics of the calling thread are logged and do not abort the process from now on; its caller must catch them.
pub fn do_not_abort_on_panic() {
    CAUGHT.set(true);
}

/// Begins to log to standard error: what `RUST_LOG` says, `info` without it, in colour on a terminal only; from iceoryx2
/// all that its own level lets through. From then on a panic of any thread is reported and ends the process, unless
/// [`do_not_abort_on_panic`]. To be called once, before the first service is opened.
///
/// # Errors
/// The system's, where it has no thread or no file descriptor left.
pub fn start() -> io::Result<()> {
    let queue = Arc::new(Queue::new());
    let out = File::from(stderr().as_fd().try_clone_to_owned()?);
    let writing = Arc::clone(&queue);
    let writer = thread::Builder::new()
        .name("log".to_owned())
        .spawn(move || writing.write_to(out))?;
    queue.wake(writer.thread().clone());
    let lines = Arc::clone(&queue);
    tracing_subscriber::fmt()
        .with_env_filter(filter())
        .with_ansi(stderr().is_terminal())
        .with_writer(move || Line(Arc::clone(&lines)))
        .init();
    // False where it logged before: then its lines go on as they did.
    let _ = set_logger(&IpcLog);
    panic::set_hook(Box::new(|panic| {
        report_panic(panic);
        if !CAUGHT.try_with(Cell::get).unwrap_or(false) {
            abort();
        }
    }));
    let _ = QUEUE.set(queue);
    Ok(())
}

fn filter() -> EnvFilter {
    let ipc = Directive::from(LevelFilter::TRACE);
    let filter = EnvFilter::builder()
        .with_default_directive(LevelFilter::INFO.into())
        .from_env_lossy();
    format!("{IPC}={ipc}")
        .parse()
        .map_or(EnvFilter::new("info"), |ipc| filter.add_directive(ipc))
}

/// An error and its causes in one line, without those that the text before has already said.
#[must_use]
pub fn with_causes(error: &(dyn Error + 'static)) -> String {
    let causes = successors(Some(error), |&cause| cause.source());
    causes.fold(String::new(), |text, cause| {
        let cause = cause.to_string();
        if text.is_empty() {
            cause
        } else if text.ends_with(&cause) {
            text
        } else {
            format!("{text}: {cause}")
        }
    })
}

/// The exit code of `program`: 0, or 1 after the reason on standard error. Waits for the log to be written, but not long.
pub fn exit_code<E: AsRef<dyn Error>>(program: &str, result: Result<(), E>) -> ExitCode {
    match result {
        Ok(()) => {
            if let Some(queue) = QUEUE.get() {
                queue.wait_until_written(FLUSH_TIMEOUT);
            }
            ExitCode::SUCCESS
        }
        Err(error) => {
            let reason = format!("{program}: {}", with_causes(error.as_ref()));
            say_last(&reason, FLUSH_TIMEOUT_AFTER_ERROR);
            ExitCode::FAILURE
        }
    }
}

/// Says a line without time and level, and waits until the log is written, both within a time.
fn say_last(text: &str, limit: Duration) {
    let Some(queue) = QUEUE.get() else {
        return eprintln!("{text}");
    };
    let begin = Instant::now();
    queue.push_within(format!("{text}\n").into_bytes(), limit);
    queue.wait_until_written(limit.saturating_sub(begin.elapsed()));
}

/// The standard library's own report would hold the thread on a full pipe.
fn report_panic(panic: &panic::PanicHookInfo<'_>) {
    let thread = thread::current();
    let name = thread.name().unwrap_or("<unnamed>");
    let mut text = format!("thread '{name}' {panic}");
    let trace = Backtrace::capture();
    if trace.status() == BacktraceStatus::Captured {
        text = format!("{text}\n{trace}");
    }
    say_last(&text, FLUSH_TIMEOUT_IN_PANIC);
}

/// iceoryx2's lines among the others.
struct IpcLog;

impl Log for IpcLog {
    fn log(&self, level: LogLevel, origin: Arguments, message: Arguments) {
        match level {
            LogLevel::Trace => tracing::trace!(target: IPC, %origin, "{message}"),
            LogLevel::Debug => tracing::debug!(target: IPC, %origin, "{message}"),
            LogLevel::Info => tracing::info!(target: IPC, %origin, "{message}"),
            LogLevel::Warn => tracing::warn!(target: IPC, %origin, "{message}"),
            LogLevel::Error | LogLevel::Fatal => tracing::error!(target: IPC, %origin, "{message}"),
        }
    }
}
