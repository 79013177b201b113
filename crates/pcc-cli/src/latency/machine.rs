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
#[derive(Clone)]
pub(super) struct Figures {
    processors: usize,
    stolen_share: Option<f64>,
    /// Of each processor, in their order.
    governors: Vec<String>,
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
            governors: (0..processors).map(governor).collect(),
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

/// The governor of a processor's frequency.
fn governor(processor: usize) -> String {
    text(&format!(
        "/sys/devices/system/cpu/cpu{processor}/cpufreq/scaling_governor"
    ))
}

/// The governor where all processors have the same one, else that of each.
fn in_words(governors: &[String]) -> String {
    match governors {
        [first, rest @ ..] if rest.iter().all(|it| it == first) => first.clone(),
        governors => {
            let of_one = governors.iter().enumerate();
            let of_one = of_one.map(|(processor, name)| format!("{name} of processor {processor}"));
            of_one.collect::<Vec<_>>().join(", ")
        }
    }
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
            in_words(&self.governors),
            self.isolated,
            self.kernel
        );
    }

    pub(super) fn json(&self) -> Value {
        json!({
            "processors": self.processors,
            "stolen_share": self.stolen_share,
            "governors": self.governors,
            "isolated_processors": self.isolated,
            "kernel": self.kernel,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn governors_are_told_one_by_one_where_they_differ() {
        let all = |names: &[&str]| {
            names
                .iter()
                .map(|name| (*name).to_owned())
                .collect::<Vec<_>>()
        };
        assert_eq!(in_words(&all(&["performance"; 2])), "performance");
        assert_eq!(
            in_words(&all(&["performance", "powersave"])),
            "performance of processor 0, powersave of processor 1"
        );
    }
}
