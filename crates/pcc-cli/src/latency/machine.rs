//! What the machine did meanwhile, which decides what latencies are worth.

use std::fs;
use std::time::Instant;

use serde_json::{Value, json};

/// Time that the host took, and when.
pub(super) struct Machine {
    begun: Instant,
    stolen_s: Option<f64>,
}

/// Figures of the machine.
pub(super) struct Figures {
    processors: usize,
    stolen_share: Option<f64>,
    governor: String,
    isolated: String,
    kernel: String,
}

impl Machine {
    pub(super) fn watch() -> Self {
        Self {
            begun: Instant::now(),
            stolen_s: stolen_s(),
        }
    }

    pub(super) fn figures(&self) -> Figures {
        let processors = processors();
        let stolen = stolen_s().zip(self.stolen_s).map(|(now, then)| now - then);
        let whole_s = self.begun.elapsed().as_secs_f64() * processors as f64;
        Figures {
            processors,
            stolen_share: stolen.map(|stolen_s| stolen_s / whole_s),
            governor: text("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
            isolated: text("/sys/devices/system/cpu/isolated"),
            kernel: text("/proc/sys/kernel/osrelease"),
        }
    }
}

/// Processors of the whole machine, of which the system tells the stolen time; at least one.
fn processors() -> usize {
    let stat = fs::read_to_string("/proc/stat").unwrap_or_default();
    let of_one = |line: &&str| line.starts_with("cpu") && !line.starts_with("cpu ");
    stat.lines().filter(of_one).count().max(1)
}

/// A line of the system's; `none` where it does not say.
fn text(file: &str) -> String {
    let text = fs::read_to_string(file).unwrap_or_default();
    match text.trim() {
        "" => "none".to_owned(),
        text => text.to_owned(),
    }
}

/// Time of all processors that the host has taken since the machine was booted, s; none where the system does not say.
fn stolen_s() -> Option<f64> {
    let stat = fs::read_to_string("/proc/stat").ok()?;
    let all = stat.lines().find(|line| line.starts_with("cpu "))?;
    let ticks: f64 = all.split_whitespace().nth(8)?.parse().ok()?;
    Some(ticks / rustix::param::clock_ticks_per_second() as f64)
}

impl Figures {
    /// Share of the processors' time that the host took, where the system says.
    pub(super) fn stolen_share(&self) -> Option<f64> {
        self.stolen_share
    }

    pub(super) fn show(&self) {
        let stolen = self.stolen_share.map_or("unknown".to_owned(), |share| {
            format!("{:.2} %", 100.0 * share)
        });
        say!(
            "machine: {} processors, {stolen} of their time taken by the host; governor {}, isolated processors {}, Linux {}",
            self.processors,
            self.governor,
            self.isolated,
            self.kernel
        );
    }

    pub(super) fn json(&self) -> Value {
        json!({
            "processors": self.processors,
            "stolen_share": self.stolen_share,
            "governor": self.governor,
            "isolated_processors": self.isolated,
            "kernel": self.kernel,
        })
    }
}
