//! One running program, killed when dropped.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::programs::program;
use crate::world::World;

/// Pause between two looks at a process.
const LOOK_PERIOD: Duration = Duration::from_millis(5);

/// Something did not happen in time.
#[derive(Debug, thiserror::Error)]
#[error("not within {waited:?}: {what}\n{log}")]
pub struct TimedOut {
    /// What was waited for.
    pub what: String,
    /// For how long.
    pub waited: Duration,
    /// What the process concerned has logged.
    pub log: String,
}

/// Looks every few milliseconds until `done` has something.
///
/// # Errors
/// [`TimedOut`] after `limit`.
pub fn wait_for<T>(
    what: &str,
    limit: Duration,
    mut done: impl FnMut() -> Option<T>,
) -> Result<T, TimedOut> {
    let begin = Instant::now();
    loop {
        if let Some(value) = done() {
            return Ok(value);
        }
        if begin.elapsed() > limit {
            return Err(TimedOut {
                what: what.to_owned(),
                waited: limit,
                log: String::new(),
            });
        }
        thread::sleep(LOOK_PERIOD);
    }
}

/// A program of a [`World`] that does not outlive its owner.
#[derive(Debug)]
pub struct Process {
    child: Child,
    log: PathBuf,
}

impl Process {
    /// Runs `name` with arguments in the world's environment; its output goes to a log file.
    #[must_use]
    pub fn start(world: &World, name: &str, arguments: &[&str]) -> Self {
        Self::start_program(world, &program(name), arguments)
    }

    /// Runs the program that a file is, as [`Process::start`] runs those of this build.
    ///
    /// # Panics
    /// Where the path does not end in a name, or the program cannot be run.
    #[must_use]
    pub fn start_program(world: &World, program: &Path, arguments: &[&str]) -> Self {
        let log = world.new_log(&program.file_name().unwrap().to_string_lossy());
        let file = File::create(&log).unwrap();
        let (out, errors) = (file.try_clone().unwrap().into(), file.into());
        Self::spawn(world, program, arguments, log, [out, errors])
    }

    /// The same, but what it writes to standard error goes elsewhere.
    #[must_use]
    pub fn start_onto(world: &World, name: &str, arguments: &[&str], errors: Stdio) -> Self {
        let log = world.new_log(name);
        let out = File::create(&log).unwrap().into();
        Self::spawn(world, &program(name), arguments, log, [out, errors])
    }

    fn spawn(
        world: &World,
        program: &Path,
        arguments: &[&str],
        log: PathBuf,
        [out, errors]: [Stdio; 2],
    ) -> Self {
        let child = Command::new(program)
            .args(arguments)
            .env("PCC_PREFIX", &world.options.prefix)
            .env("PCC_ROOT", &world.options.root)
            .env("NO_COLOR", "1")
            .env_remove("RUST_BACKTRACE")
            .stdin(Stdio::null())
            .stdout(out)
            .stderr(errors)
            .spawn()
            .unwrap();
        Self { child, log }
    }

    /// The kernel's number for it.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Everything it has written.
    #[must_use]
    pub fn log(&self) -> String {
        read(&self.log)
    }

    /// Whether it still runs.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// SIGKILL; it is gone when this returns.
    pub fn kill9(&mut self) {
        let _ = self.child.kill();
        self.child.wait().unwrap();
    }

    /// Any other signal.
    pub fn signal(&self, signal: libc::c_int) {
        send_signal(self.pid(), signal);
    }

    /// SIGTERM, and waits for it to end.
    ///
    /// # Errors
    /// [`TimedOut`] if it does not.
    pub fn sigterm(&mut self, limit: Duration) -> Result<ExitStatus, TimedOut> {
        self.signal(libc::SIGTERM);
        self.wait(limit)
    }

    /// Waits for it to end by itself.
    ///
    /// # Errors
    /// [`TimedOut`] if it does not.
    pub fn wait(&mut self, limit: Duration) -> Result<ExitStatus, TimedOut> {
        let child = &mut self.child;
        wait_for("the process ends", limit, || child.try_wait().unwrap()).map_err(|timed_out| {
            TimedOut {
                log: read(&self.log),
                ..timed_out
            }
        })
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill9();
    }
}

fn read(log: &Path) -> String {
    fs::read_to_string(log).unwrap_or_default()
}

#[allow(unsafe_code, reason = "the standard library can only send SIGKILL")]
fn send_signal(pid: u32, signal: libc::c_int) {
    let pid = libc::pid_t::try_from(pid).unwrap();
    // SAFETY: plain numbers; `pid` is a child of ours that has not been waited for, so the number is not reused.
    let result = unsafe { libc::kill(pid, signal) };
    assert_eq!(result, 0, "cannot send signal {signal} to {pid}");
}
