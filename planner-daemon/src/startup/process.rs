//! What the daemon asks of the operating system about itself: its resident size, signals.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

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
    fn the_resident_size_is_read_from_its_line() {
        let status = "Name:\tx\nVmHWM:\t  9 kB\nVmRSS:\t   1234 kB\nRssAnon:\t 5 kB\n";
        assert_eq!(resident_in(status), Some(1234 * 1024));
        assert_eq!(resident_in("Name:\tx\n"), None);
        assert!(resident_bytes().unwrap() > 100_000);
    }
}
