//! The system calls of a hard loop: locked memory, priority, processor, absolute sleeping.
//!
//! Everything here may be refused by the system (an ordinary user, a container). Each refusal is an error that names
//! the setting and what to do; the caller warns once and goes on without.

#![allow(unsafe_code, reason = "system calls without a safe wrapper")]

use std::io;

/// One privilege that the system refused.
#[derive(Debug, thiserror::Error)]
pub enum RealtimeError {
    /// `mlockall` failed.
    #[error(
        "memory is not locked, page faults can delay the loop ({0}): allow it with CAP_IPC_LOCK or `ulimit -l unlimited`"
    )]
    Memory(io::Error),
    /// `sched_setscheduler` failed.
    #[error(
        "no real-time priority {priority}, other programs can delay the loop ({error}): allow it with CAP_SYS_NICE or `ulimit -r {priority}`"
    )]
    Priority {
        /// The SCHED_FIFO priority asked for.
        priority: u8,
        /// The system's answer.
        error: io::Error,
    },
    /// `sched_setaffinity` failed.
    #[error(
        "the loop is not pinned to processor {cpu} ({error}): choose one of those in /proc/self/status, Cpus_allowed_list"
    )]
    Processor {
        /// The processor asked for.
        cpu: usize,
        /// The system's answer.
        error: io::Error,
    },
}

fn checked(result: libc::c_int) -> io::Result<()> {
    if result == 0 {
        Ok(())
    } else {
        Err(io::Error::last_os_error())
    }
}

/// Locks all present and future pages of the process in memory.
///
/// # Errors
/// [`RealtimeError::Memory`] where the limit on locked memory is finite and the process is not privileged.
pub fn lock_memory() -> Result<(), RealtimeError> {
    // SAFETY: takes flags only.
    checked(unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) })
        .map_err(RealtimeError::Memory)
}

/// Runs the current thread under SCHED_FIFO with `priority` (1..=99).
///
/// # Errors
/// [`RealtimeError::Priority`] where the system refuses.
pub fn use_fifo_priority(priority: u8) -> Result<(), RealtimeError> {
    let parameters = libc::sched_param {
        sched_priority: i32::from(priority),
    };
    // SAFETY: the pointer is valid for the call; 0 means the calling thread.
    checked(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) })
        .map_err(|error| RealtimeError::Priority { priority, error })
}

/// Binds the current thread to one processor.
///
/// # Errors
/// [`RealtimeError::Processor`] where there is no such processor or it is not ours.
pub fn pin_to_processor(cpu: usize) -> Result<(), RealtimeError> {
    if cpu >= libc::CPU_SETSIZE as usize {
        let error = io::Error::from(io::ErrorKind::InvalidInput);
        return Err(RealtimeError::Processor { cpu, error });
    }
    // SAFETY: an all-zero set is a valid value, and `cpu` is below its size.
    let result = unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut set);
        libc::sched_setaffinity(0, size_of_val(&set), &raw const set)
    };
    checked(result).map_err(|error| RealtimeError::Processor { cpu, error })
}

/// The kernel's id of the current thread, for counting its system calls from outside.
#[must_use]
pub fn thread_id() -> u32 {
    // SAFETY: takes nothing and cannot fail.
    let id = unsafe { libc::gettid() };
    id.unsigned_abs()
}

/// Sleeps until `deadline_mono_ns` on CLOCK_MONOTONIC; returns at once where it is past.
pub fn sleep_until(deadline_mono_ns: i64) {
    let deadline = libc::timespec {
        tv_sec: deadline_mono_ns.div_euclid(1_000_000_000),
        tv_nsec: deadline_mono_ns.rem_euclid(1_000_000_000),
    };
    // SAFETY: the pointer is valid for the call; no remainder is asked for. A signal ends the sleep early: go on.
    while unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &raw const deadline,
            std::ptr::null_mut(),
        )
    } == libc::EINTR
    {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mono_now_ns() -> i64 {
        let mut now = libc::timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        // SAFETY: the pointer is valid for the call.
        unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
        now.tv_sec * 1_000_000_000 + now.tv_nsec
    }

    #[test]
    fn sleeping_never_ends_before_the_deadline() {
        for wait_ns in [0, 1_000, 2_000_000] {
            let deadline = mono_now_ns() + wait_ns;
            sleep_until(deadline);
            assert!(mono_now_ns() >= deadline);
        }
    }

    #[test]
    fn a_processor_that_does_not_exist_is_named() {
        for cpu in [libc::CPU_SETSIZE as usize - 1, usize::MAX] {
            let error = pin_to_processor(cpu).unwrap_err();
            assert!(error.to_string().contains(&cpu.to_string()), "{error}");
        }
    }

    #[test]
    fn thread_ids_differ_between_threads() {
        let other = std::thread::spawn(thread_id).join().unwrap();
        assert_ne!(thread_id(), other);
    }
}
