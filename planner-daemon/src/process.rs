//! What the daemon asks of the operating system: locked memory, processors, priorities and turns on them, its resident size,
//! signals.
#![allow(unsafe_code, reason = "a system call that no library offers")]

use std::ffi::{c_int, c_void};
use std::io;
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rustix::mm::{Advice, MlockAllFlags, madvise, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity, set_current_timer_slack};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Keeps every page that is ever touched in memory.
///
/// Pages that are mapped and never touched (the ends of the threads' stacks) are not brought in.
///
/// # Errors
/// The system's answer, where the limit on locked memory is finite and the process is not privileged.
pub(crate) fn lock_memory() -> io::Result<()> {
    let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
    Ok(mlockall(flags)?)
}

/// Binds this thread, and those that it starts, to some processors.
///
/// # Errors
/// The system's answer, if none of them exists or is allowed.
pub(crate) fn use_processors(processors: &[usize]) -> io::Result<()> {
    let mut set = CpuSet::new();
    for &processor in processors {
        set.set(processor);
    }
    Ok(sched_setaffinity(None, &set)?)
}

/// How late a sleep of the service may end, ns; by default Linux allows itself 50 µs.
const SLACK_NS: u64 = 1_000;
/// Longest turn of a planning thread, ns; by default Linux gives every thread 1.4 (two processors) to 3 ms.
const LONG_TURN_NS: u64 = 6_000_000;

/// Lets the sleeps of this thread end on time.
///
/// # Errors
/// The system's answer.
pub(crate) fn sleep_punctually() -> io::Result<()> {
    Ok(set_current_timer_slack(NonZeroU64::new(SLACK_NS))?)
}

/// Lets this thread's turns on a processor be long: who asks for shorter ones, as every other thread does, need not wait for
/// their end when it wakes (the scheduler of Linux from 6.12 on; before, nothing changes).
///
/// # Errors
/// The system's answer.
pub(crate) fn take_long_turns() -> io::Result<()> {
    take_turns(LONG_TURN_NS)
}

/// Lets this thread's turns on a processor be of this length, 0.1 to 100 ms, where it has no real-time priority: the shorter, the
/// sooner it gets one when it wakes.
///
/// # Errors
/// The system's answer.
pub(crate) fn take_turns(turn_ns: u64) -> io::Result<()> {
    // SAFETY: all zeros are a valid `sched_attr`, which is plain data.
    let mut turns: libc::sched_attr = unsafe { std::mem::zeroed() };
    let size = u32::try_from(size_of_val(&turns)).expect("it is small");
    // SAFETY: the kernel writes at most `size` bytes to `turns`, which has as many.
    if unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut turns, size, 0) } != 0 {
        return Err(io::Error::last_os_error());
    }
    if turns.sched_policy != libc::SCHED_OTHER.cast_unsigned() {
        return Ok(());
    }
    turns.sched_runtime = turn_ns;
    // SAFETY: the kernel reads the `size` bytes that it is told of in `turns`.
    if unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const turns, 0) } != 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(())
}

/// Runs this thread under SCHED_FIFO with `priority` (1 to 99): no ordinary program keeps it from a processor.
///
/// # Errors
/// The system's answer, where the limit on real-time priorities is lower and the process is not privileged.
pub(crate) fn use_fifo_priority(priority: u8) -> io::Result<()> {
    use_policy(libc::SCHED_FIFO, priority)
}

/// Lets all other threads go first (SCHED_IDLE): whoever wakes takes the processor from this one, which gets a three-hundredth of one
/// where others always want it.
///
/// # Errors
/// The system's answer.
pub(crate) fn let_others_go_first() -> io::Result<()> {
    use_policy(libc::SCHED_IDLE, 0)
}

fn use_policy(policy: c_int, priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: priority.into(),
    };
    // SAFETY: `parameters` outlives the call; 0 is the calling thread.
    match unsafe { libc::sched_setscheduler(0, policy, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Memory of this process that is in RAM, bytes; shared memory included.
///
/// # Errors
/// If `/proc` is not there.
pub(crate) fn resident_bytes() -> io::Result<usize> {
    resident_in(&std::fs::read_to_string("/proc/self/status")?)
        .ok_or_else(|| io::Error::other("/proc/self/status has no VmRSS"))
}

fn resident_in(status: &str) -> Option<usize> {
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: usize = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes * 1024)
}

/// Brings shared memory of this process, whose names begin with `prefix`, into RAM; how many bytes it is.
///
/// # Errors
/// If `/proc` is not there, or the system's answer (before Linux 5.14: that it cannot).
pub(crate) fn bring_in_shared_memory(prefix: &str) -> io::Result<usize> {
    let mut total = 0;
    for [begin, end] in shared_ranges(&std::fs::read_to_string("/proc/self/maps")?, prefix) {
        // SAFETY: the range is a mapping of this process that stays while its ports do; its content does not change.
        unsafe {
            madvise(
                begin as *mut c_void,
                end - begin,
                Advice::LinuxPopulateWrite,
            )?;
        }
        total += end - begin;
    }
    Ok(total)
}

/// Begin and end of the writable mappings of shared memory whose names begin with `prefix`.
fn shared_ranges(maps: &str, prefix: &str) -> Vec<[usize; 2]> {
    let range = |line: &str| {
        let mut fields = line.split_whitespace();
        let (range, rights) = (fields.next()?, fields.next()?);
        let name = fields.nth(3)?.strip_prefix("/dev/shm/")?;
        let (begin, end) = range.split_once('-')?;
        let address = |text| usize::from_str_radix(text, 16).ok();
        let is_wanted = rights == "rw-s" && name.starts_with(prefix);
        is_wanted.then_some([address(begin)?, address(end)?])
    };
    maps.lines().filter_map(range).collect()
}

/// A flag that SIGTERM and SIGINT set.
///
/// # Errors
/// If the handlers cannot be installed.
pub fn termination_flag() -> io::Result<Arc<AtomicBool>> {
    let terminated = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT] {
        flag::register(signal, Arc::clone(&terminated))?;
    }
    Ok(terminated)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeps_become_punctual_and_long_turns_are_accepted() {
        let thread = std::thread::spawn(|| {
            take_long_turns().unwrap();
            sleep_punctually().unwrap();
            rustix::thread::current_timer_slack().unwrap()
        });
        assert_eq!(thread.join().unwrap(), SLACK_NS);
    }

    #[test]
    fn a_priority_that_does_not_exist_is_refused() {
        let error = use_fifo_priority(100).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
    }

    #[test]
    fn the_resident_size_is_read_from_its_line() {
        let status = "Name:\tx\nVmHWM:\t  9 kB\nVmRSS:\t   1234 kB\nRssAnon:\t 5 kB\n";
        assert_eq!(resident_in(status), Some(1234 * 1024));
        assert_eq!(resident_in("Name:\tx\n"), None);
        assert!(resident_bytes().unwrap() > 100_000);
    }

    #[test]
    fn shared_memory_is_found_by_its_name_and_rights() {
        let maps = "7f0000001000-7f0000003000 rw-s 00000000 00:1a 5  /dev/shm/pcc_answers\n\
            7f0000004000-7f0000005000 r--s 00000000 00:1a 6  /dev/shm/pcc_read\n\
            7f0000006000-7f0000007000 rw-s 00000000 00:1a 7  /dev/shm/other_answers\n\
            7f0000008000-7f0000009000 rw-p 00000000 00:00 0 \n";
        assert_eq!(
            shared_ranges(maps, "pcc_"),
            [[0x7f00_0000_1000, 0x7f00_0000_3000]]
        );
        assert_eq!(bring_in_shared_memory("no_such_name").unwrap(), 0);
    }

    #[test]
    fn processors_that_do_not_exist_are_refused() {
        assert!(use_processors(&[1023]).is_err());
    }
}
