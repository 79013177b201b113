//! What the operating system says of the machine and of processes.

use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

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

/// Stolen time as it was counted from time to time; a thread looks until this is dropped.
pub(crate) struct StolenTimes {
    /// When a count was read, and the count.
    counts: Arc<Mutex<Vec<(Instant, Duration)>>>,
    quit: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl StolenTimes {
    /// Begins to look.
    pub(crate) fn watch() -> Self {
        let (counts, quit) = (
            Arc::<Mutex<Vec<_>>>::default(),
            Arc::<AtomicBool>::default(),
        );
        let (shared, stop) = (Arc::clone(&counts), Arc::clone(&quit));
        let watch = move || {
            while !stop.load(Ordering::Relaxed) {
                if let Ok(stolen) = stolen() {
                    shared.lock().unwrap().push((Instant::now(), stolen));
                }
                thread::sleep(TICK);
            }
        };
        Self {
            counts,
            quit,
            thread: Some(thread::spawn(watch)),
        }
    }

    /// Time stolen between two instants, to the full ticks around them.
    pub(crate) fn between(&self, begin: Instant, end: Instant) -> Duration {
        let counts = self.counts.lock().unwrap();
        let before = counts.iter().rev().find(|(at, _)| *at + TICK <= begin);
        let after = counts.iter().find(|(at, _)| *at >= end + TICK);
        let first = before.or(counts.first());
        let last = after.or(counts.last());
        let stolen = |count: Option<&(Instant, Duration)>| count.map_or(Duration::ZERO, |c| c.1);
        stolen(last).saturating_sub(stolen(first))
    }
}

impl Drop for StolenTimes {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
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
