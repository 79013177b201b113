//! What a process used until it ended, as the kernel counted it.
#![allow(unsafe_code, reason = "no safe interface to wait4")]

use std::io;
use std::mem::MaybeUninit;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};

/// Memory and processor time of a process, and of those that it has waited for.
#[derive(Clone, Copy, Debug)]
pub struct Usage {
    /// Largest resident memory, 10^6 bytes; at least its parent's when it was started, as it runs in that memory until it is another program.
    pub peak_mb: f64,
    /// Processor time of all threads, the kernel's for them included, s.
    pub processor_s: f64,
}

/// How a child has ended and what it used, or none where it runs; afterwards nothing is left to wait for or to kill.
///
/// # Errors
/// What the system says.
pub fn wait_with_usage(child: &Child) -> io::Result<Option<(ExitStatus, Usage)>> {
    let mut status = 0;
    let mut usage = MaybeUninit::<libc::rusage>::zeroed();
    let pid = child.id().cast_signed();
    // SAFETY: `status` and `usage` outlive the call.
    match unsafe { libc::wait4(pid, &raw mut status, libc::WNOHANG, usage.as_mut_ptr()) } {
        -1 => Err(io::Error::last_os_error()),
        0 => Ok(None),
        _ => {
            // SAFETY: all bits zero are a value of this type, and the kernel has written a valid one over it.
            let usage = unsafe { usage.assume_init() };
            let seconds = |time: libc::timeval| time.tv_sec as f64 + time.tv_usec as f64 * 1e-6;
            let usage = Usage {
                peak_mb: usage.ru_maxrss as f64 * 1024.0 * 1e-6,
                processor_s: seconds(usage.ru_utime) + seconds(usage.ru_stime),
            };
            Ok(Some((ExitStatus::from_raw(status), usage)))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    use super::*;

    #[allow(clippy::zombie_processes, reason = "it is waited for")]
    fn run(script: &str) -> (ExitStatus, Usage) {
        let child = Command::new("sh").args(["-c", script]).spawn().unwrap();
        let begin = Instant::now();
        loop {
            if let Some(ended) = wait_with_usage(&child).unwrap() {
                return ended;
            }
            assert!(begin.elapsed() < Duration::from_secs(60));
            sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_program_that_counts_used_processor_time_and_memory() {
        let script = "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done; exit 3";
        let (status, usage) = run(script);
        assert_eq!(status.code(), Some(3));
        assert!(
            usage.processor_s > 0.001 && usage.peak_mb > 0.5,
            "{usage:?}"
        );
    }
}
