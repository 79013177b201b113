//! What the operating system says of the machine and of processes.

use std::fs;
use std::time::Duration;

use anyhow::Context;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// `/proc/stat` counts in hundredths of a second.
const TICK: Duration = Duration::from_millis(10);
/// The time that the machine's host gave to others, among the numbers of the line `cpu`.
const STEAL: usize = 7;

/// Time that the machine's host gave to others since it was started, over all processors; zero where it has no host.
pub(crate) fn stolen() -> anyhow::Result<Duration> {
    let text = fs::read_to_string("/proc/stat")?;
    let line = text.lines().find_map(|line| line.strip_prefix("cpu "));
    let ticks = line.and_then(|line| line.split_whitespace().nth(STEAL));
    let ticks: u32 = ticks.context("/proc/stat has no stolen time")?.parse()?;
    Ok(TICK * ticks)
}

/// What a line of `/proc/PID/status` says, MB (10^6 bytes): `VmRSS:` memory in RAM, `VmHWM:` its peak; shared memory
/// included.
pub(crate) fn memory_mb(pid: u32, field: &str) -> anyhow::Result<f64> {
    let status = fs::read_to_string(format!("/proc/{pid}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix(field));
    let kilobytes = line.and_then(|line| line.split_whitespace().next());
    let kilobytes: f64 = kilobytes.context("no such field")?.parse()?;
    Ok(kilobytes * 1024e-6)
}

/// This thread on one processor; dropped, it may run where it could before.
pub(crate) struct Pinned {
    before: CpuSet,
    /// Its number.
    pub(crate) processor: usize,
}

impl Pinned {
    /// Binds this thread to the last of the processors that it may use.
    pub(crate) fn to_the_last() -> anyhow::Result<Self> {
        let before = sched_getaffinity(None)?;
        let last = (0..CpuSet::MAX_CPU).rev().find(|&cpu| before.is_set(cpu));
        let processor = last.context("no processor is allowed")?;
        let mut set = CpuSet::new();
        set.set(processor);
        sched_setaffinity(None, &set)?;
        Ok(Self { before, processor })
    }
}

impl Drop for Pinned {
    fn drop(&mut self) {
        // What was allowed before still is.
        let _ = sched_setaffinity(None, &self.before);
    }
}
