//! Counting the system calls of one thread of another process, and holding one, from outside (`ptrace`).
#![allow(
    unsafe_code,
    reason = "no safe interface to ptrace without another crate"
)]

use std::collections::BTreeMap;
use std::io;
use std::mem::MaybeUninit;
use std::ptr::null_mut;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use libc::{c_int, c_void, pid_t};

use realtime::use_fifo_priority;

use crate::priority::OF_A_WATCH;

/// A stop at a system call is a SIGTRAP with this bit.
const SYSTEM_CALL_STOP: c_int = libc::SIGTRAP | 0x80;

/// How often each system call (its number) was entered.
pub type Counts = BTreeMap<u64, u64>;

/// The name of the calls that a loop may meet; else the number.
#[must_use]
pub fn name(number: u64) -> String {
    let known = [
        (libc::SYS_clock_nanosleep, "clock_nanosleep"),
        (libc::SYS_restart_syscall, "restart_syscall"),
        (libc::SYS_futex, "futex"),
        (libc::SYS_write, "write"),
        (libc::SYS_sendto, "sendto"),
        (libc::SYS_mmap, "mmap"),
        (libc::SYS_openat, "openat"),
        (libc::SYS_close, "close"),
        (libc::SYS_madvise, "madvise"),
        (libc::SYS_sched_yield, "sched_yield"),
    ];
    let found = known
        .iter()
        .find(|(known, _)| u64::try_from(*known).is_ok_and(|known| known == number));
    found.map_or_else(|| format!("call {number}"), |(_, name)| (*name).to_owned())
}

/// Why a thread cannot be followed or held.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The system does not permit it.
    #[error(
        "ptrace denied for thread {thread}: it must be another process's, of the same user; sysctl kernel.yama.ptrace_scope at \
         most 1, and in a container a seccomp profile with ptrace (--cap-add SYS_PTRACE)"
    )]
    Denied {
        /// The thread.
        thread: u32,
    },
    /// There is no such thread, or no longer.
    #[error("thread {thread} is gone")]
    Gone {
        /// The thread.
        thread: u32,
    },
    /// Anything else.
    #[error("cannot follow thread {thread}: {source}")]
    System {
        /// The thread.
        thread: u32,
        /// What the system says.
        source: io::Error,
    },
}

/// Follows a thread for a while and counts; the thread goes on afterwards as before.
///
/// # Errors
/// [`TraceError`].
pub fn count(thread_id: u32, duration: Duration) -> Result<Counts, TraceError> {
    // The thread that attaches has to make all calls.
    let follower = std::thread::spawn(move || Traced::stop(thread_id)?.follow(duration));
    follower.join().expect("counting does not panic")
}

/// A thread of another process that does not run until this is released or dropped. The other threads of its process go on.
#[derive(Debug)]
pub struct HeldThread {
    release: Option<mpsc::Sender<()>>,
    holder: Option<JoinHandle<Result<(), TraceError>>>,
}

impl HeldThread {
    /// Stops a thread; it stands still when this returns.
    ///
    /// # Errors
    /// [`TraceError`].
    pub fn hold(thread_id: u32) -> Result<Self, TraceError> {
        let held = Self::held(move || Ok((Traced::stop(thread_id)?, true)))?;
        held.ok_or(TraceError::Gone { thread: thread_id })
    }

    /// Stops a thread that waits, has `begin` end its waiting, and holds it once so many more of its system calls have returned;
    /// none, and the thread goes on, where it is about to write to standard output before that.
    ///
    /// # Errors
    /// [`TraceError`].
    pub fn hold_after(
        thread_id: u32,
        calls: usize,
        begin: impl FnOnce() + Send + 'static,
    ) -> Result<Option<Self>, TraceError> {
        Self::held(move || {
            let mut traced = Traced::stop(thread_id)?;
            begin();
            let is_there = traced.pass(calls)?;
            Ok((traced, is_there))
        })
    }

    /// Stops a thread; it is held where `stop` says so.
    fn held(
        stop: impl FnOnce() -> Result<(Traced, bool), TraceError> + Send + 'static,
    ) -> Result<Option<Self>, TraceError> {
        let (release, released) = mpsc::channel();
        let (stands, standing) = mpsc::channel();
        // The thread that attaches has to let go, too.
        let holder = std::thread::spawn(move || {
            let (traced, is_held) = stop()?;
            if is_held {
                let _ = stands.send(());
                // Either word or the end of the channel.
                let _ = released.recv();
            }
            drop(stands);
            traced.detach()
        });
        let mut held = Self {
            release: Some(release),
            holder: Some(holder),
        };
        match standing.recv() {
            Ok(()) => Ok(Some(held)),
            // Its holder let go before anybody asked.
            Err(_) => held.end().map(|()| None),
        }
    }

    /// Lets it go on.
    ///
    /// # Errors
    /// [`TraceError::Gone`] if it was killed meanwhile.
    pub fn release(mut self) -> Result<(), TraceError> {
        self.end()
    }

    fn end(&mut self) -> Result<(), TraceError> {
        drop(self.release.take());
        let ended = self.holder.take().map(JoinHandle::join);
        ended.map_or(Ok(()), |ended| ended.expect("holding does not panic"))
    }
}

impl Drop for HeldThread {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

/// A thread that this one has stopped; letting it go twice is an error of the system.
struct Traced {
    thread: u32,
    pid: pid_t,
    /// A signal that it stopped with, and must still get.
    signal: c_int,
}

impl Traced {
    fn stop(thread: u32) -> Result<Self, TraceError> {
        // A loop at a real-time priority should not wait for who holds it; a refusal changes nothing.
        let _ = use_fifo_priority(OF_A_WATCH);
        let pid = pid_t::try_from(thread).map_err(|_| TraceError::Gone { thread })?;
        let mut traced = Self {
            thread,
            pid,
            signal: 0,
        };
        traced.request(libc::PTRACE_SEIZE, libc::PTRACE_O_TRACESYSGOOD)?;
        traced.request(libc::PTRACE_INTERRUPT, 0)?;
        traced.wait()?;
        Ok(traced)
    }

    fn follow(mut self, duration: Duration) -> Result<Counts, TraceError> {
        let mut counts = Counts::new();
        let begin = Instant::now();
        while begin.elapsed() < duration {
            self.request(libc::PTRACE_SYSCALL, self.signal)?;
            if self.wait()?
                && let Some((number, _)) = self.entered_call()?
            {
                *counts.entry(number).or_insert(0) += 1;
            }
        }
        self.detach()?;
        Ok(counts)
    }

    /// Lets it go on until so many calls have returned; whether that was before it began to write to standard output.
    fn pass(&mut self, calls: usize) -> Result<bool, TraceError> {
        let mut returned = 0;
        while returned < calls {
            self.request(libc::PTRACE_SYSCALL, self.signal)?;
            if !self.wait()? {
                continue;
            }
            match self.entered_call()? {
                Some((number, first)) if is_output(number, first) => return Ok(false),
                Some(_) => {}
                None => returned += 1,
            }
        }
        Ok(true)
    }

    fn detach(self) -> Result<(), TraceError> {
        self.request(libc::PTRACE_DETACH, self.signal)
    }

    fn request(&self, operation: libc::c_uint, data: c_int) -> Result<(), TraceError> {
        // SAFETY: the operations used here take numbers, no pointers.
        match unsafe { libc::ptrace(operation, self.pid, null_mut::<c_void>(), i64::from(data)) } {
            -1 => Err(self.error()),
            _ => Ok(()),
        }
    }

    /// What the last call failed with.
    fn error(&self) -> TraceError {
        let (thread, source) = (self.thread, io::Error::last_os_error());
        match source.raw_os_error() {
            Some(libc::EPERM | libc::EACCES) => TraceError::Denied { thread },
            Some(libc::ESRCH | libc::ECHILD) => TraceError::Gone { thread },
            _ => TraceError::System { thread, source },
        }
    }

    /// Waits until it stops; whether it did so at a system call.
    fn wait(&mut self) -> Result<bool, TraceError> {
        let mut status = 0;
        // SAFETY: `status` outlives the call.
        let waited = unsafe { libc::waitpid(self.pid, &raw mut status, libc::__WALL) };
        if waited != self.pid {
            return Err(self.error());
        }
        if !libc::WIFSTOPPED(status) {
            return Err(TraceError::Gone {
                thread: self.thread,
            });
        }
        let at_call = libc::WSTOPSIG(status) == SYSTEM_CALL_STOP;
        let is_own = at_call || status >> 16 == libc::PTRACE_EVENT_STOP;
        self.signal = if is_own { 0 } else { libc::WSTOPSIG(status) };
        Ok(at_call)
    }

    /// The number and the first argument of the call that it stopped at the entry of; none at its exit.
    fn entered_call(&self) -> Result<Option<(u64, u64)>, TraceError> {
        let mut information = MaybeUninit::<libc::ptrace_syscall_info>::zeroed();
        // SAFETY: `information` is as large as the address argument says, and outlives the call.
        let written = unsafe {
            libc::ptrace(
                libc::PTRACE_GET_SYSCALL_INFO,
                self.pid,
                size_of::<libc::ptrace_syscall_info>(),
                information.as_mut_ptr(),
            )
        };
        if written <= 0 {
            return Err(self.error());
        }
        // SAFETY: all bits zero are a value of this type, and the kernel has written a valid one over it.
        let information = unsafe { information.assume_init() };
        Ok(match information.op {
            // SAFETY: at an entry, the kernel has written this member.
            libc::PTRACE_SYSCALL_INFO_ENTRY => Some(unsafe {
                let entry = information.u.entry;
                (entry.nr, entry.args[0])
            }),
            _ => None,
        })
    }
}

fn is_output(call: u64, file: u64) -> bool {
    u64::try_from(libc::SYS_write) == Ok(call) && file == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::{Read, Write};
    use std::process::{Child, Command, Stdio};
    use std::thread::sleep;

    /// A program that writes a byte every 10 ms, until it is dropped. Not this process: a thread cannot follow another one of its
    /// own process.
    struct BusyProgram(Child);

    impl BusyProgram {
        fn start(output: Stdio) -> Self {
            let script = "while :; do printf x; sleep 0.01; done";
            let mut program = Command::new("sh");
            Self(program.args(["-c", script]).stdout(output).spawn().unwrap())
        }
    }

    impl Drop for BusyProgram {
        fn drop(&mut self) {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }

    #[test]
    fn the_calls_of_a_sleeping_program_are_counted() {
        let program = BusyProgram::start(Stdio::null());
        let counts = count(program.0.id(), Duration::from_millis(300));
        let counts = counts.unwrap_or_else(|error| panic!("nothing is counted: {error}"));
        assert!(counts.values().sum::<u64>() > 10, "{counts:?}");
    }

    #[test]
    fn a_held_thread_stands_still_and_goes_on_when_released() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let program = BusyProgram::start(file.reopen().unwrap().into());
        let written = || fs::metadata(file.path()).unwrap().len();
        let pause = Duration::from_millis(300);
        sleep(pause);
        let held = HeldThread::hold(program.0.id()).unwrap_or_else(|error| panic!("{error}"));
        let before = written();
        assert!(before > 0, "the premise: it writes");
        sleep(pause);
        assert_eq!(written(), before);
        held.release().unwrap();
        sleep(pause);
        assert!(written() > before);
    }

    #[test]
    fn a_thread_is_held_after_so_many_calls_or_goes_on_where_it_writes_before() {
        for (calls, is_held) in [(1, true), (10_000, false)] {
            let mut command = Command::new("cat");
            let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
            let mut cat = BusyProgram(piped.spawn().unwrap());
            sleep(Duration::from_millis(300));
            let mut input = cat.0.stdin.take().unwrap();
            let write = move || input.write_all(b"x").unwrap();
            let held = HeldThread::hold_after(cat.0.id(), calls, write);
            let held = held.unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(held.is_some(), is_held);
            drop(held);
            let mut output = String::new();
            cat.0
                .stdout
                .take()
                .unwrap()
                .read_to_string(&mut output)
                .unwrap();
            assert_eq!(output, "x");
        }
    }

    #[test]
    fn what_is_denied_and_what_is_gone_is_said() {
        let own = std::process::id();
        let denied = HeldThread::hold(own);
        assert!(matches!(denied, Err(TraceError::Denied { thread }) if thread == own));
        let gone = count(u32::MAX >> 1, Duration::ZERO);
        assert!(matches!(gone, Err(TraceError::Gone { .. })), "{gone:?}");
    }
}
