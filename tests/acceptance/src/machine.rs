//! What the operating system says of the machine and of processes.

use std::fs;
use std::time::{Duration, Instant};

use anyhow::Context;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// `/proc/stat` counts in hundredths of a second.
const TICK: Duration = Duration::from_millis(10);
/// The numbers of its line `cpu`: what programs took, beginning with these three, and what the host gave to others.
const BUSY: [usize; 3] = [0, 1, 2];
const STEAL: usize = 7;
/// The same of `/proc/PID/stat`, counted from after the program's name.
const OF_PROCESS: [usize; 2] = [11, 12];

/// A sum of numbers of a line, as time.
fn ticks(line: &str, numbers: &[usize]) -> anyhow::Result<Duration> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let number = |&index: &usize| {
        Ok(words
            .get(index)
            .context("too few numbers")?
            .parse::<u32>()?)
    };
    let sum = numbers.iter().map(number).sum::<anyhow::Result<u32>>()?;
    Ok(TICK * sum)
}

fn of_all_processors(numbers: &[usize]) -> anyhow::Result<Duration> {
    let text = fs::read_to_string("/proc/stat")?;
    let line = text.lines().find_map(|line| line.strip_prefix("cpu "));
    ticks(line.context("/proc/stat has no line cpu")?, numbers)
}

/// Time that the machine's host gave to others since it was started, over all processors; zero where it has no host.
fn stolen() -> anyhow::Result<Duration> {
    of_all_processors(&[STEAL])
}

/// Time that a process took of all processors.
fn taken_by(pid: u32) -> anyhow::Result<Duration> {
    let text = fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let (_, numbers) = text.rsplit_once(')').context("no program's name")?;
    ticks(numbers, &OF_PROCESS)
}

/// What keeps a measurement from the processors, counted from its begin.
pub(crate) struct Disturbance {
    begin: Instant,
    stolen: Duration,
    others: Duration,
    daemon: u32,
}

impl Disturbance {
    /// Begins to count; this process and the daemon are not counted.
    pub(crate) fn count(daemon: u32) -> anyhow::Result<Self> {
        Ok(Self {
            begin: Instant::now(),
            stolen: stolen()?,
            others: Self::others(daemon)?,
            daemon,
        })
    }

    fn others(daemon: u32) -> anyhow::Result<Duration> {
        let ours = taken_by(daemon)? + taken_by(std::process::id())?;
        Ok(of_all_processors(&BUSY)?.saturating_sub(ours))
    }

    /// What was taken since the begin.
    pub(crate) fn text(&self) -> anyhow::Result<String> {
        let seconds = |now: Duration, before| now.saturating_sub(before).as_secs_f64();
        Ok(format!(
            "stolen {:.2} s, other programs {:.2} s of the processors' time, in {:.2} s",
            seconds(stolen()?, self.stolen),
            seconds(Self::others(self.daemon)?, self.others),
            self.begin.elapsed().as_secs_f64(),
        ))
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

/// This thread, and what it starts, on some processors; dropped, it may run where it could before.
pub(crate) struct Confined {
    before: CpuSet,
}

/// This thread on one processor.
pub(crate) struct Pinned {
    _confined: Confined,
    /// Its number.
    pub(crate) processor: usize,
}

/// Those that this thread may use.
pub(crate) fn processors() -> anyhow::Result<Vec<usize>> {
    let allowed = sched_getaffinity(None)?;
    Ok((0..CpuSet::MAX_CPU)
        .filter(|&cpu| allowed.is_set(cpu))
        .collect())
}

impl Pinned {
    /// Binds this thread to the last of the processors that it may use.
    pub(crate) fn to_the_last() -> anyhow::Result<Self> {
        let last = processors()?.pop();
        Self::to(last.context("no processor is allowed")?)
    }

    /// Binds this thread to a processor.
    pub(crate) fn to(processor: usize) -> anyhow::Result<Self> {
        Ok(Self {
            _confined: Confined::to(&[processor])?,
            processor,
        })
    }
}

impl Confined {
    /// Leaves this thread these processors.
    pub(crate) fn to(processors: &[usize]) -> anyhow::Result<Self> {
        let before = sched_getaffinity(None)?;
        let mut set = CpuSet::new();
        processors.iter().for_each(|processor| set.set(*processor));
        sched_setaffinity(None, &set)?;
        Ok(Self { before })
    }
}

impl Drop for Confined {
    fn drop(&mut self) {
        // What was allowed before still is.
        let _ = sched_setaffinity(None, &self.before);
    }
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn ticks_are_summed_from_the_numbers_named() {
        let line = " 10 20 30 40 0 0 0 5 0 0";
        assert_eq!(ticks(line, &BUSY).unwrap(), Duration::from_millis(600));
        assert_eq!(ticks(line, &[STEAL]).unwrap(), Duration::from_millis(50));
        assert!(ticks("10 20", &BUSY).is_err());
    }

    #[test]
    fn a_busy_program_takes_time_and_memory() {
        let begin = Instant::now();
        let id = std::process::id();
        let before = taken_by(id).unwrap();
        while taken_by(id).unwrap() < before + 2 * TICK {
            assert!(
                begin.elapsed() < Duration::from_secs(60),
                "nothing is counted"
            );
        }
        assert!(memory_mb(id, "VmRSS:").unwrap() > 1.0);
        assert!(memory_mb(id, "VmNone:").is_err());
    }

    #[test]
    fn a_pinned_thread_may_run_elsewhere_afterwards() {
        let allowed = || sched_getaffinity(None).unwrap();
        let before = allowed();
        let pinned = Pinned::to_the_last().unwrap();
        assert_eq!(allowed().count(), 1);
        assert!(allowed().is_set(pinned.processor));
        drop(pinned);
        assert_eq!(allowed(), before);
    }
}
