//! What a real-time thread asks of Linux: priority, processors, turns, punctual sleep, locked memory, and memory that outlives the process.
//!
//! The system may refuse what concerns priority, processors, turns, sleep and locked memory to an ordinary user or in a container. A
//! refusal is a [`RealtimeError`], which says what may happen without it and how to allow it.

#![allow(unsafe_code, reason = "system calls without a safe wrapper")]

mod kept_memory;
mod shared_memory;

pub use kept_memory::{KeptMemory, is_in_memory};
pub use shared_memory::bring_in_shared_memory;

use std::ffi::c_int;
use std::io;
use std::num::NonZeroU64;
use std::time::Duration;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity, set_current_timer_slack};

/// How late a punctual sleep may end, ns; by default Linux allows itself 50 µs.
const SLACK_NS: u64 = 1_000;
/// Longest turn on a processor of a thread that wants to wake soon.
const SHORT_TURN: Duration = Duration::from_micros(200);

/// One privilege that the system refused.
#[derive(Debug, thiserror::Error)]
pub enum RealtimeError {
    /// `mlockall` failed.
    #[error(
        "memory is not locked, page faults can delay this process ({0}): allow it with CAP_IPC_LOCK or `ulimit -l unlimited`"
    )]
    Memory(#[source] io::Error),
    /// `sched_setscheduler` failed.
    #[error(
        "no real-time priority {priority}, other programs can delay this thread ({error}): allow it with CAP_SYS_NICE or \
         `ulimit -r {priority}`"
    )]
    Priority {
        /// The SCHED_FIFO priority asked for.
        priority: u8,
        /// The system's answer.
        #[source]
        error: io::Error,
    },
    /// `sched_setaffinity` failed.
    #[error(
        "not bound to processors {processors:?} ({error}): choose of those in /proc/self/status, Cpus_allowed_list"
    )]
    Processors {
        /// The processors asked for.
        processors: Vec<usize>,
        /// The system's answer.
        #[source]
        error: io::Error,
    },
    /// The kernel took no length of turns, no policy, or no punctual sleep.
    #[error(
        "other programs can delay this thread by some ms: the kernel does not take {what} ({error})"
    )]
    Schedule {
        /// What it was asked for.
        what: &'static str,
        /// The system's answer.
        #[source]
        error: io::Error,
    },
}

/// Which pages of a process stay in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pages {
    /// All that are mapped, and all that will be.
    All,
    /// Each from when it is touched first: the ends of the threads' stacks are not brought in.
    Touched,
}

/// Keeps pages of this process in memory from now on.
///
/// # Errors
/// [`RealtimeError::Memory`] where the limit on locked memory is finite and the process is not privileged.
pub fn lock_memory(pages: Pages) -> Result<(), RealtimeError> {
    let all = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE;
    let flags = match pages {
        Pages::All => all,
        Pages::Touched => all | MlockAllFlags::ONFAULT,
    };
    mlockall(flags).map_err(|error| RealtimeError::Memory(error.into()))
}

/// Binds this thread, and those that it starts from now on, to some processors, numbered from 0.
///
/// # Errors
/// [`RealtimeError::Processors`] if none of them exists or is allowed.
pub fn use_processors(processors: &[usize]) -> Result<(), RealtimeError> {
    let refused = |error| RealtimeError::Processors {
        processors: processors.to_vec(),
        error,
    };
    let mut set = CpuSet::new();
    for &processor in processors {
        if processor >= CpuSet::MAX_CPU {
            return Err(refused(io::ErrorKind::InvalidInput.into()));
        }
        set.set(processor);
    }
    sched_setaffinity(None, &set).map_err(|error| refused(error.into()))
}

/// Runs this thread under SCHED_FIFO with `priority` (1 to 99): no ordinary program keeps it from a processor.
///
/// # Errors
/// [`RealtimeError::Priority`] where the limit on real-time priorities is lower and the process is not privileged.
pub fn use_fifo_priority(priority: u8) -> Result<(), RealtimeError> {
    use_policy(libc::SCHED_FIFO, priority)
        .map_err(|error| RealtimeError::Priority { priority, error })
}

/// Lets all other threads go first (SCHED_IDLE): this one gets a three-hundredth of a processor that others always want.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn let_others_go_first() -> Result<(), RealtimeError> {
    use_policy(libc::SCHED_IDLE, 0).map_err(refused("SCHED_IDLE"))
}

fn use_policy(policy: c_int, priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: priority.into(),
    };
    // SAFETY: `parameters` outlives the call; 0 is the calling thread.
    let result = unsafe { libc::sched_setscheduler(0, policy, &raw const parameters) };
    checked(result.into())
}

/// Lets sleeps of this thread end within 1 µs, as far as its priority allows.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn sleep_punctually() -> Result<(), RealtimeError> {
    let slack = NonZeroU64::new(SLACK_NS);
    set_current_timer_slack(slack).map_err(|error| refused("a timer slack")(error.into()))
}

/// Sets the length of this thread's turns on a processor, 0.1 to 100 ms, where it has no real-time priority: the shorter, the sooner
/// it gets one when it wakes (the scheduler of Linux from 6.12 on; before, nothing changes). By default Linux gives every thread 1.4
/// (two processors) to 3 ms.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn take_turns(turn: Duration) -> Result<(), RealtimeError> {
    set_turns(turn.as_nanos() as u64).map_err(refused("a length of turns"))
}

/// Lets this thread wake as soon as one without a real-time priority can: punctual sleep, short turns.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn wake_soon() -> Result<(), RealtimeError> {
    sleep_punctually()?;
    take_turns(SHORT_TURN)
}

fn set_turns(turn_ns: u64) -> io::Result<()> {
    // SAFETY: all zeros are a valid `sched_attr`, which is plain data.
    let mut turns: libc::sched_attr = unsafe { std::mem::zeroed() };
    let size = u32::try_from(size_of_val(&turns)).expect("it is small");
    // SAFETY: the kernel writes at most `size` bytes to `turns`, which has as many.
    checked(unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut turns, size, 0) })?;
    if turns.sched_policy != libc::SCHED_OTHER.cast_unsigned() {
        return Ok(());
    }
    turns.sched_runtime = turn_ns;
    // SAFETY: the kernel reads the `size` bytes that it is told of in `turns`.
    checked(unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const turns, 0) })
}

/// The kernel's id of this thread.
#[must_use]
pub fn thread_id() -> u32 {
    rustix::thread::gettid()
        .as_raw_nonzero()
        .get()
        .unsigned_abs()
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

fn checked(result: libc::c_long) -> io::Result<()> {
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

fn refused(what: &'static str) -> impl Fn(io::Error) -> RealtimeError {
    move |error| RealtimeError::Schedule { what, error }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mono_now_ns() -> i64 {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
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
    fn sleeps_become_punctual_and_turns_have_their_length() {
        let thread = std::thread::spawn(|| {
            take_turns(Duration::from_millis(6)).unwrap();
            wake_soon().unwrap();
            rustix::thread::current_timer_slack().unwrap()
        });
        assert_eq!(thread.join().unwrap(), SLACK_NS);
    }

    #[test]
    fn processors_that_do_not_exist_are_named() {
        for processor in [CpuSet::MAX_CPU - 1, usize::MAX] {
            let error = use_processors(&[processor]).unwrap_err();
            assert!(
                error.to_string().contains(&processor.to_string()),
                "{error}"
            );
        }
    }

    #[test]
    fn a_priority_that_does_not_exist_is_refused() {
        let error = use_fifo_priority(100).unwrap_err();
        assert!(error.to_string().contains("priority 100"), "{error}");
    }

    #[test]
    fn thread_ids_differ_between_threads() {
        let other = std::thread::spawn(thread_id).join().unwrap();
        assert_ne!(thread_id(), other);
    }
}
