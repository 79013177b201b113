//! Percentiles of plans and their stages, and what became of them.

use std::collections::BTreeMap;

use hdrhistogram::Histogram;
use serde_json::{Map, Value, json};
use shared_types::codes::{Outcome, Stage};

use super::load::{Pace, Reply};

/// Digits that a histogram keeps.
const DIGITS: u8 = 3;
/// Times beyond this count as this, nanoseconds.
const LONGEST_NS: u64 = 600_000_000_000;
/// Percentiles, by their names.
pub(super) const PERCENTILES: [(&str, f64); 5] = [
    ("p50", 50.0),
    ("p90", 90.0),
    ("p99", 99.0),
    ("p99.9", 99.9),
    ("max", 100.0),
];
/// The time that a client sees.
const ROUND_TRIP: &str = "round trip";
/// What is none of the daemon's stages: both ways, waking up, checks.
const TRANSPORT: &str = "transport and waking up";
/// From when a request was due until it was sent.
const DELAY: &str = "late to be sent";

/// Distributions by name, in the order in which they are shown.
pub(super) struct Summary {
    times: Vec<(&'static str, Histogram<u64>)>,
    outcomes: BTreeMap<String, u64>,
    lasted_s: f64,
}

impl Summary {
    /// Times of all requests that had candidates, and what became of each; where they were sent at a fixed rate, round trips count from when they were due.
    pub(super) fn of(replies: &[Reply], pace: Pace) -> Self {
        let mut summary = Self {
            times: Vec::new(),
            outcomes: BTreeMap::new(),
            lasted_s: lasted_s(replies),
        };
        for reply in replies {
            let name = match &reply.outcome {
                Ok(outcome) => outcome.to_string(),
                Err(error) => error.clone(),
            };
            *summary.outcomes.entry(name).or_default() += 1;
            let is_planned = |outcome: &Outcome| outcome.has_candidates();
            if !reply.outcome.as_ref().is_ok_and(is_planned) {
                continue;
            }
            let since = |from_ns: i64| (reply.answered_ns - from_ns).max(0).unsigned_abs();
            summary.note(ROUND_TRIP, since(reply.due_ns));
            if pace != Pace::Closed {
                let late_ns = (reply.sent_ns - reply.due_ns).max(0).unsigned_abs();
                summary.note(DELAY, late_ns);
            }
            let staged: u64 = reply.stages_ns.iter().sum();
            summary.note(TRANSPORT, since(reply.sent_ns).saturating_sub(staged));
            for stage in Stage::ALL {
                summary.note(stage.text(), reply.stages_ns[stage.code() as usize]);
            }
        }
        summary
    }

    fn note(&mut self, name: &'static str, took_ns: u64) {
        let known = self.times.iter().position(|(known, _)| *known == name);
        let index = known.unwrap_or_else(|| {
            let histogram = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS);
            let histogram = histogram.expect("the bounds and 3 digits are allowed");
            self.times.push((name, histogram));
            self.times.len() - 1
        });
        self.times[index].1.saturating_record(took_ns);
    }

    /// Requests that had candidates.
    pub(super) fn planned(&self) -> u64 {
        self.times.first().map_or(0, |(_, times)| times.len())
    }

    /// The distributions with the largest means, at most so many, in the order in which they are shown.
    pub(super) fn longest(
        &self,
        count: usize,
    ) -> impl Iterator<Item = (&'static str, &Histogram<u64>)> {
        let mut means: Vec<f64> = self.times.iter().map(|(_, times)| times.mean()).collect();
        means.sort_by(f64::total_cmp);
        let least = means.get(means.len().saturating_sub(count)).copied();
        let least = least.unwrap_or(0.0);
        let longest = self.times.iter().filter(move |(_, it)| it.mean() >= least);
        longest.map(|(name, times)| (*name, times)).take(count)
    }

    /// Percentiles of each distribution, ms.
    pub(super) fn percentiles_ms(&self) -> impl Iterator<Item = (&'static str, [f64; 5])> {
        self.times.iter().map(|(name, times)| {
            let ms = |(_, percentile)| times.value_at_percentile(percentile) as f64 * 1e-6;
            (*name, PERCENTILES.map(ms))
        })
    }

    pub(super) fn show(&self) {
        let per_second = self.planned() as f64 / self.lasted_s;
        say!(
            "{} plans in {:.2} s, {per_second:.1} a second; ms:",
            self.planned(),
            self.lasted_s
        );
        let names = PERCENTILES.map(|(name, _)| format!("{name:>9}")).concat();
        say!("{:<26}{names}", "");
        for (name, percentiles) in self.percentiles_ms() {
            let row = percentiles.map(|ms| format!("{ms:>9.3}")).concat();
            say!("{name:<26}{row}");
        }
        for (outcome, count) in &self.outcomes {
            say!("{count} {outcome}");
        }
    }

    pub(super) fn json(&self) -> Value {
        let times: Map<String, Value> = self
            .percentiles_ms()
            .map(|(name, percentiles)| {
                let named = PERCENTILES.iter().zip(percentiles);
                let named: Map<String, Value> = named
                    .map(|((percentile, _), ms)| ((*percentile).to_owned(), json!(ms)))
                    .collect();
                (name.to_owned(), named.into())
            })
            .collect();
        json!({
            "planned": self.planned(),
            "lasted_s": self.lasted_s,
            "times_ms": times,
            "outcomes": self.outcomes,
        })
    }
}

/// From the first request to the last answer, s.
fn lasted_s(replies: &[Reply]) -> f64 {
    let begin_ns = replies.iter().map(|reply| reply.due_ns).min();
    let end_ns = replies.iter().map(|reply| reply.answered_ns).max();
    begin_ns.zip(end_ns).map_or(f64::NAN, |(begin_ns, end_ns)| {
        (end_ns - begin_ns) as f64 * 1e-9
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_types::capacity::STAGES;

    fn reply(index: i64, outcome: Result<Outcome, String>) -> Reply {
        let mut stages_ns = [0; STAGES];
        stages_ns[0] = 400_000;
        Reply {
            due_ns: index * 1_000_000,
            sent_ns: index * 1_000_000 + 100_000,
            answered_ns: index * 1_000_000 + 1_000_000,
            outcome,
            stages_ns,
        }
    }

    #[test]
    fn times_count_from_when_a_request_was_due_and_refusals_by_name() {
        let mut replies: Vec<Reply> = (0..99).map(|index| reply(index, Ok(Outcome::Ok))).collect();
        replies.push(reply(99, Err("no daemon".to_owned())));
        replies.push(reply(100, Ok(Outcome::Overloaded)));
        let summary = Summary::of(&replies, Pace::Open(1000.0));
        assert_eq!(summary.planned(), 99);
        let median = |wanted| {
            summary
                .percentiles_ms()
                .find(|(name, _)| *name == wanted)
                .unwrap()
                .1[0]
        };
        assert!((median(ROUND_TRIP) - 1.0).abs() < 1e-3);
        assert!((median(DELAY) - 0.1).abs() < 1e-4);
        assert!((median(TRANSPORT) - 0.5).abs() < 1e-3);
        let longest: Vec<_> = summary.longest(2).map(|(name, _)| name).collect();
        assert_eq!(longest, [ROUND_TRIP, TRANSPORT]);
        let picture = super::super::plot::svg(&summary, "plans").unwrap();
        assert!(picture.contains(ROUND_TRIP) && picture.contains("polyline"));
        assert_eq!(summary.outcomes["no daemon"], 1);
        assert_eq!(summary.outcomes[&Outcome::Overloaded.to_string()], 1);
        assert_eq!(summary.outcomes[&Outcome::Ok.to_string()], 99);
    }
}
