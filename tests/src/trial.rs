//! One start of a program from outside, with a limit on time and memory: how it ended and what it said.

use std::ffi::OsString;
use std::fs::{self, File};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::programs::program;

/// Pause between two looks at a process.
const LOOK_PERIOD: Duration = Duration::from_millis(2);
/// Address space that a program may take, kB.
const MEMORY_KB: u64 = 1_500_000;
/// Time that a program which serves has to end after SIGTERM.
const TERMINATION: Duration = Duration::from_secs(20);
/// Runs a program as another user (util-linux).
pub const AS_USER: &str = "/usr/bin/setpriv";
/// Most of what a program says that is looked at, bytes.
const MOST_TEXT: u64 = 1 << 20;

/// A program and what it is started with.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// One of the four programs.
    pub program: &'static str,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// Environment variables on top of those that every start has.
    pub environment: Vec<(&'static str, OsString)>,
    /// The user that it runs as, by number; nothing for the one that starts it. Only root starts it as another.
    pub user: Option<u32>,
}

/// How a start came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It exited by itself with this status.
    Exited(i32),
    /// A signal ended it.
    Killed(i32),
    /// It said that it serves, and was ended by SIGTERM with status 0.
    Served,
    /// It said that it serves, and did not end with status 0 after SIGTERM.
    ServedBadly,
    /// It still ran at its time limit and did not serve.
    Hung,
}

/// What was seen of one start.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How it ended.
    pub ending: Ending,
    /// Standard output and error; at most the first megabyte.
    pub text: String,
    /// Until it ended or served.
    pub duration: Duration,
}

impl Start {
    /// A start of a program with arguments.
    #[must_use]
    pub fn new(program: &'static str, arguments: &[&str]) -> Self {
        Self {
            program,
            arguments: arguments.iter().map(OsString::from).collect(),
            environment: Vec::new(),
            user: None,
        }
    }

    /// What a program writes once it serves; nothing for one that does its work and ends.
    fn serving(&self) -> Option<&'static str> {
        match self.program {
            "planner-daemon" => Some("ready"),
            "controller" => Some("loop begins"),
            "simulated-robot" => Some("robot begins"),
            _ => None,
        }
    }

    /// Runs it in `folder`, under a service prefix of its own unless the environment names another.
    #[must_use]
    pub fn run(&self, folder: &Path, prefix: &str, limit: Duration) -> Outcome {
        let log = folder.join("said.txt");
        let file = File::create(&log).unwrap();
        let begin = Instant::now();
        let spawned = self.command(folder, prefix, &file).spawn();
        let mut child = match spawned {
            Ok(child) => child,
            // An argument that the system refuses (too long, a NUL) never reaches the program.
            Err(error) => {
                return Outcome {
                    ending: Ending::Exited(126),
                    text: format!("the system refuses to start it: {error}"),
                    duration: begin.elapsed(),
                };
            }
        };
        let ending = self.watch(&mut child, &log, begin + limit);
        let duration = begin.elapsed();
        if matches!(ending, Ending::Hung | Ending::ServedBadly) {
            let _ = child.kill();
            let _ = child.wait();
        }
        Outcome {
            ending,
            text: text_of(&log),
            duration,
        }
    }

    fn command(&self, folder: &Path, prefix: &str, log: &File) -> Command {
        let limited = format!("ulimit -v {MEMORY_KB}; exec \"$0\" \"$@\"");
        let mut command = Command::new("sh");
        command
            .arg("-c")
            .arg(limited)
            .args(self.user.into_iter().flat_map(as_user))
            .arg(program(self.program))
            .args(&self.arguments)
            .current_dir(folder)
            .env("PCC_PREFIX", prefix)
            .env("PCC_ROOT", folder.join("root"))
            .env("NO_COLOR", "1")
            .env_remove("RUST_BACKTRACE")
            .env_remove("RUST_LOG")
            .envs(self.environment.iter().cloned())
            .stdin(Stdio::null())
            .stdout(log.try_clone().unwrap())
            .stderr(log.try_clone().unwrap())
            .process_group(0);
        command
    }

    fn watch(&self, child: &mut Child, log: &Path, until: Instant) -> Ending {
        let serving = self.serving();
        loop {
            if let Some(status) = child.try_wait().unwrap() {
                return ending_of(status);
            }
            if serving.is_some_and(|text| text_of(log).contains(text)) {
                return terminate(child);
            }
            if Instant::now() > until {
                return Ending::Hung;
            }
            thread::sleep(LOOK_PERIOD);
        }
    }
}

/// What runs the program behind it as a user, in the same process.
fn as_user(user: u32) -> [String; 6] {
    let id = user.to_string();
    [AS_USER, "--reuid", &id, "--regid", &id, "--clear-groups"].map(str::to_owned)
}

fn ending_of(status: ExitStatus) -> Ending {
    match status.code() {
        Some(code) => Ending::Exited(code),
        None => Ending::Killed(status.signal().unwrap_or_default()),
    }
}

/// Ends a program that serves.
fn terminate(child: &mut Child) -> Ending {
    let pid = rustix::process::Pid::from_child(child);
    let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
    let until = Instant::now() + TERMINATION;
    while Instant::now() < until {
        match child.try_wait().unwrap() {
            Some(status) if status.success() => return Ending::Served,
            Some(_) => return Ending::ServedBadly,
            None => thread::sleep(LOOK_PERIOD),
        }
    }
    Ending::ServedBadly
}

fn text_of(log: &Path) -> String {
    let Ok(file) = File::open(log) else {
        return String::new();
    };
    let mut bytes = Vec::new();
    let _ = std::io::Read::read_to_end(&mut std::io::Read::take(file, MOST_TEXT), &mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Removes what killed processes have left of a prefix.
pub fn remove_shared_memory(prefix: &str) {
    for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        let name = entry.file_name();
        if name.to_string_lossy().starts_with(prefix) && entry.path().is_file() {
            let _ = fs::remove_file(entry.path());
        }
    }
}
