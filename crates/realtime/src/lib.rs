//! Linux real-time settings of a thread: priority, CPU affinity, time slice, timer slack; locked memory, and files mapped into memory; and a queue
//! whose receiver wakes once.
//!
//! The system may refuse these settings to an ordinary user or in a container. A refusal is a [`RealtimeError`], which says what may
//! happen without the setting and how to allow it.

#![allow(unsafe_code, reason = "system calls without a safe wrapper")]

pub mod hand_over;
mod mapped_file;
mod shared_memory;

pub use mapped_file::{MappedFile, is_in_ram};
pub use shared_memory::prefault_shared_memory;

use std::ffi::c_int;
use std::io;
use std::num::NonZeroU64;
use std::time::Duration;

use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{
    ClockId, CpuSet, Pid, clock_nanosleep_absolute, sched_getaffinity, sched_setaffinity,
    set_current_timer_slack,
};
use rustix::time::Timespec;

/// Timer slack, by which a sleep may end late, ns; the default of Linux is 50 µs.
const SLACK_NS: u64 = 1_000;
/// Time slice of a thread that should run soon after it wakes.
const SHORT_TIME_SLICE: Duration = Duration::from_micros(200);

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
        "a thread is not bound to processors {processors:?} ({error}): choose of those in /proc/self/status, Cpus_allowed_list"
    )]
    Processors {
        /// The processors asked for.
        processors: Vec<usize>,
        /// The system's answer.
        #[source]
        error: io::Error,
    },
    /// `sched_setattr` (time slice), `sched_setscheduler` (idle policy) or `prctl` (timer slack) failed.
    #[error(
        "other programs can delay this thread by some ms: the kernel does not take {what} ({error})"
    )]
    Schedule {
        /// What the kernel was asked for.
        what: &'static str,
        /// The system's answer.
        #[source]
        error: io::Error,
    },
}

/// Which pages of a process stay in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pages {
    /// All pages that are mapped, and all that will be.
    All,
    /// Each page once it is touched: unused ends of the threads' stacks are not faulted in.
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
pub fn set_cpu_affinity(processors: &[usize]) -> Result<(), RealtimeError> {
    bind(None, processors)
}

/// Binds the thread with this [`thread_id`] to some processors; that it is one of this process is not checked.
///
/// # Errors
/// [`RealtimeError::Processors`] if there is no such thread, or none of the processors exists or is allowed.
pub fn set_cpu_affinity_of(thread: u32, processors: &[usize]) -> Result<(), RealtimeError> {
    bind(Some(thread), processors)
}

fn bind(thread: Option<u32>, processors: &[usize]) -> Result<(), RealtimeError> {
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
    let thread = thread.map(named).transpose().map_err(refused)?;
    sched_setaffinity(thread, &set).map_err(|error| refused(error.into()))
}

/// The processor that this thread runs on now, numbered from 0.
#[must_use]
pub fn current_processor() -> usize {
    rustix::thread::sched_getcpu()
}

/// The processors that this thread may run on, numbered from 0.
///
/// # Errors
/// What the system says.
pub fn allowed_processors() -> io::Result<Vec<usize>> {
    let allowed = sched_getaffinity(None)?;
    let processors = 0..CpuSet::MAX_CPU;
    Ok(processors.filter(|it| allowed.is_set(*it)).collect())
}

fn named(thread: u32) -> io::Result<Pid> {
    let id = i32::try_from(thread).ok().and_then(Pid::from_raw);
    id.ok_or_else(|| io::ErrorKind::NotFound.into())
}

/// Runs this thread under SCHED_FIFO with `priority` (1 to 99): no ordinary program keeps it from a processor.
///
/// # Errors
/// [`RealtimeError::Priority`] where the limit on real-time priorities is lower and the process is not privileged.
pub fn use_fifo_priority(priority: u8) -> Result<(), RealtimeError> {
    use_policy(libc::SCHED_FIFO, priority)
        .map_err(|error| RealtimeError::Priority { priority, error })
}

/// Runs this thread under SCHED_IDLE, after all others: on a busy processor it gets about a three-hundredth of the time.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn use_idle_policy() -> Result<(), RealtimeError> {
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

/// Sets this thread's timer slack to 1 µs, so that its sleeps end on time as far as its priority allows.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn reduce_timer_slack() -> Result<(), RealtimeError> {
    let slack = NonZeroU64::new(SLACK_NS);
    set_current_timer_slack(slack).map_err(|error| refused("a timer slack")(error.into()))
}

/// Sets this thread's time slice (`sched_runtime` of the EEVDF scheduler, Linux 6.12 on; earlier kernels ignore it), 0.1 to 100 ms: the
/// shorter, the sooner it runs after waking. The default is 1.4 (two processors) to 3 ms. Under another policy than SCHED_OTHER nothing
/// changes.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn set_time_slice(slice: Duration) -> Result<(), RealtimeError> {
    // SAFETY: all zeros are a valid `sched_attr`, which is plain data.
    let mut attributes: libc::sched_attr = unsafe { std::mem::zeroed() };
    let size = u32::try_from(size_of_val(&attributes)).expect("it is small");
    // SAFETY: the kernel writes at most `size` bytes to `attributes`, which has as many.
    checked(unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut attributes, size, 0) })
        .map_err(refused("a time slice"))?;
    if attributes.sched_policy != libc::SCHED_OTHER.cast_unsigned() {
        return Ok(());
    }
    attributes.sched_runtime = slice.as_nanos() as u64;
    // SAFETY: the kernel reads the `size` bytes that `attributes` states.
    checked(unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) })
        .map_err(refused("a time slice"))
}

/// Lets this thread run as soon after waking as is possible without a real-time priority: small timer slack, short time slice.
///
/// # Errors
/// [`RealtimeError::Schedule`].
pub fn reduce_wakeup_latency() -> Result<(), RealtimeError> {
    reduce_timer_slack()?;
    set_time_slice(SHORT_TIME_SLICE)
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
    let deadline = Timespec {
        tv_sec: deadline_mono_ns.div_euclid(1_000_000_000),
        tv_nsec: deadline_mono_ns.rem_euclid(1_000_000_000),
    };
    // A signal ends the sleep early: go on.
    while clock_nanosleep_absolute(ClockId::Monotonic, &deadline) == Err(Errno::INTR) {}
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
            set_time_slice(Duration::from_millis(6)).unwrap();
            reduce_wakeup_latency().unwrap();
            rustix::thread::current_timer_slack().unwrap()
        });
        assert_eq!(thread.join().unwrap(), SLACK_NS);
    }

    #[test]
    fn a_thread_that_is_bound_runs_there_and_one_that_does_not_exist_is_refused() {
        let allowed = allowed_processors().unwrap();
        assert!(allowed.contains(&current_processor()));
        let [.., last] = allowed[..] else {
            panic!("no processor is allowed");
        };
        let (tell, told) = std::sync::mpsc::sync_channel(1);
        let (go_on, may_go_on) = std::sync::mpsc::sync_channel(1);
        let thread = std::thread::spawn(move || {
            tell.send(thread_id()).unwrap();
            may_go_on.recv().unwrap();
            (allowed_processors().unwrap(), current_processor())
        });
        set_cpu_affinity_of(told.recv().unwrap(), &[last]).unwrap();
        go_on.send(()).unwrap();
        assert_eq!(thread.join().unwrap(), (vec![last], last));
        for nobody in [0, i32::MAX.unsigned_abs(), u32::MAX] {
            assert!(set_cpu_affinity_of(nobody, &[last]).is_err());
        }
        // The test's own thread stays where it was.
        assert_eq!(allowed_processors().unwrap(), allowed);
    }

    #[test]
    fn processors_that_do_not_exist_are_named() {
        for processor in [CpuSet::MAX_CPU - 1, usize::MAX] {
            let error = set_cpu_affinity(&[processor]).unwrap_err();
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
