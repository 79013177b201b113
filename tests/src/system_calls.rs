//! Counting the system calls of one thread of another process, from outside (`ptrace`).
#![allow(
    unsafe_code,
    reason = "no safe interface to ptrace without another crate"
)]

use std::collections::BTreeMap;
use std::io;
use std::mem::MaybeUninit;
use std::ptr::null_mut;
use std::time::{Duration, Instant};

use libc::{c_int, c_void, pid_t};

use crate::priority::{OF_A_WATCH, raise_priority};

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

/// Follows a thread for a while and counts; the thread goes on afterwards as before.
///
/// # Errors
/// What the system says, where following is not permitted or the thread ends.
pub fn count(thread_id: u32, duration: Duration) -> io::Result<Counts> {
    let follow = move || follow(pid_t::try_from(thread_id).unwrap_or(0), duration);
    // The thread that attaches has to make all calls.
    std::thread::spawn(follow)
        .join()
        .map_err(|_| io::Error::other("the counting thread died"))?
}

fn follow(thread: pid_t, duration: Duration) -> io::Result<Counts> {
    // A loop at a real-time priority should not wait for its counter; a refusal changes nothing.
    let _ = raise_priority(OF_A_WATCH);
    request(
        libc::PTRACE_SEIZE,
        thread,
        null_mut(),
        libc::PTRACE_O_TRACESYSGOOD as *mut c_void,
    )?;
    request(libc::PTRACE_INTERRUPT, thread, null_mut(), null_mut())?;
    let mut counts = Counts::new();
    let begin = Instant::now();
    loop {
        if wait_for_stop(thread)? == SYSTEM_CALL_STOP
            && let Some(number) = entered_call(thread)?
        {
            *counts.entry(number).or_insert(0) += 1;
        }
        if begin.elapsed() >= duration {
            request(libc::PTRACE_DETACH, thread, null_mut(), null_mut())?;
            return Ok(counts);
        }
        request(libc::PTRACE_SYSCALL, thread, null_mut(), null_mut())?;
    }
}

fn request(
    operation: libc::c_uint,
    thread: pid_t,
    address: *mut c_void,
    data: *mut c_void,
) -> io::Result<()> {
    // SAFETY: the operations used here take numbers, no pointers.
    match unsafe { libc::ptrace(operation, thread, address, data) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

/// The signal that the thread stopped with.
fn wait_for_stop(thread: pid_t) -> io::Result<c_int> {
    let mut status = 0;
    // SAFETY: `status` outlives the call.
    let waited = unsafe { libc::waitpid(thread, &raw mut status, libc::__WALL) };
    if waited != thread || !libc::WIFSTOPPED(status) {
        return Err(io::Error::other("the thread is gone"));
    }
    Ok(libc::WSTOPSIG(status))
}

/// The number of the call that the thread stopped at the entry of; none at its exit.
fn entered_call(thread: pid_t) -> io::Result<Option<u64>> {
    let mut information = MaybeUninit::<libc::ptrace_syscall_info>::zeroed();
    // SAFETY: `information` is as large as the address argument says, and outlives the call.
    let written = unsafe {
        libc::ptrace(
            libc::PTRACE_GET_SYSCALL_INFO,
            thread,
            size_of::<libc::ptrace_syscall_info>(),
            information.as_mut_ptr(),
        )
    };
    if written <= 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: all bits zero are a value of this type, and the kernel has written a valid one over it.
    let information = unsafe { information.assume_init() };
    Ok(match information.op {
        // SAFETY: at an entry, the kernel has written this member.
        libc::PTRACE_SYSCALL_INFO_ENTRY => Some(unsafe { information.u.entry.nr }),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Not this process: a thread cannot follow another one of its own process.
    #[test]
    fn the_calls_of_a_sleeping_program_are_counted() {
        let mut child = std::process::Command::new("sh")
            .args(["-c", "while :; do sleep 0.01; done"])
            .spawn()
            .unwrap();
        let counts = count(child.id(), Duration::from_millis(300));
        child.kill().unwrap();
        child.wait().unwrap();
        match counts {
            Ok(counts) => assert!(counts.values().sum::<u64>() > 10, "{counts:?}"),
            Err(error) => assert_eq!(error.kind(), io::ErrorKind::PermissionDenied, "{error}"),
        }
    }

    #[test]
    fn a_thread_that_is_not_there_is_an_error() {
        assert!(count(u32::MAX >> 1, Duration::ZERO).is_err());
    }
}
