//! The program `plain-client`: a client by iceoryx2's own rules, held or killed while it makes a service.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use crate::programs::program;
use crate::system_calls::{HeldThread, TraceError};
use crate::world::World;

/// What it makes: a service of each messaging pattern.
pub const KINDS: [&str; 3] = ["event", "topic", "requests"];

/// One that runs; killed when dropped.
#[derive(Debug)]
pub struct PlainClient {
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl PlainClient {
    /// Starts it beside the processes of a world; `kind` is one of [`KINDS`].
    #[must_use]
    pub fn start(world: &World, kind: &str) -> Self {
        let mut command = Command::new(program("plain-client"));
        command.arg(&world.options.root);
        command.args([&world.options.prefix, kind]);
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = piped.stderr(Stdio::piped()).spawn().unwrap();
        let (said, lines) = channel();
        let (out, errors) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        thread::spawn(move || {
            let out = BufReader::new(out).lines();
            let lines = out.chain(BufReader::new(errors).lines());
            // Ends with the pipes, or with who listens.
            let _ = lines
                .map_while(Result::ok)
                .try_for_each(|line| said.send(line));
        });
        Self {
            input: child.stdin.take(),
            child,
            lines,
        }
    }

    /// Has it make its service, and holds it after this many of the system calls that it makes for that. None where it was done
    /// before: then it goes on.
    ///
    /// # Errors
    /// [`TraceError`].
    pub fn hold_making(&mut self, calls: usize) -> Result<Option<HeldThread>, TraceError> {
        let mut input = self.input.take().expect("it makes one service");
        HeldThread::hold_after(self.child.id(), calls, move || {
            input.write_all(b"make\n").unwrap();
        })
    }

    /// Waits until it says `word`; else what it says instead.
    ///
    /// # Errors
    /// Why not.
    pub fn says(&self, word: &str, limit: Duration) -> Result<(), String> {
        match self.lines.recv_timeout(limit) {
            Ok(line) if line == word => Ok(()),
            Ok(line) => Err(format!("{line:?} instead of {word:?}")),
            Err(_) => Err(format!("not {word:?} within {limit:?}")),
        }
    }

    /// SIGKILL.
    pub fn kill9(&mut self) {
        let _ = self.child.kill();
    }
}

impl Drop for PlainClient {
    fn drop(&mut self) {
        self.kill9();
        let _ = self.child.wait();
    }
}
