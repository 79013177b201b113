//! Requests that every sampler is asked, in turns.

use std::collections::BTreeMap;

use client::PlanAnswer;
use shared_types::codes::{Sampler, Stage};
use shared_types::valid::PlanRequest;

use crate::fast_kept::Kept;
use crate::fast_scenes::Served;
use crate::report::Report;
use crate::spread::{Spread, median};

/// Asked in turns, each with every request.
pub(crate) const SAMPLERS: [Sampler; 6] = [
    Sampler::Default,
    Sampler::Fast,
    Sampler::RrtConnect,
    Sampler::RrtSmooth,
    Sampler::Straight,
    Sampler::StraightDrawn,
];

/// What one sampler took, ms, one value a request.
#[derive(Default)]
pub(crate) struct Times {
    pub(crate) round_trip: Vec<f64>,
    pub(crate) stages: BTreeMap<&'static str, Vec<f64>>,
    /// Requests with at least one candidate, and candidates in all.
    answered: usize,
    candidates: usize,
}

impl Times {
    pub(crate) fn add(&mut self, answer: &PlanAnswer, seconds: f64) {
        let report = answer.report();
        let round_trip = 1e3 * seconds;
        let mut rest = round_trip;
        for stage in Stage::ALL {
            let ms = 1e-6 * report.stage_ns(*stage) as f64;
            rest -= ms;
            self.stages.entry(stage.text()).or_default().push(ms);
        }
        self.stages.entry("wake").or_default().push(rest);
        self.round_trip.push(round_trip);
        self.answered += usize::from(!report.candidates.is_empty());
        self.candidates += report.candidates.len();
    }

    pub(crate) fn median(&self) -> f64 {
        median(&self.round_trip)
    }

    pub(crate) fn text(&self) -> String {
        let count = self.round_trip.len();
        let stages = self.stages.iter();
        let stages: Vec<String> = stages
            .map(|(stage, ms)| format!("{stage} {:.3}", median(ms)))
            .collect();
        format!(
            "{} ms; {} of {count} answered, {:.2} candidates each; medians of its stages: {}",
            Spread::of(&self.round_trip),
            self.answered,
            self.candidates as f64 / count as f64,
            stages.join(", ")
        )
    }
}

/// Durations of the selected and of the fastest motion of each sampler's answer to one request, s; infinite where there is none.
type Durations = BTreeMap<&'static str, (f64, f64)>;

/// What came of requests that every sampler was asked.
pub(crate) struct Turns {
    times: Vec<Times>,
    /// Requests for whose answer something faster was at hand.
    pub(crate) slower: Vec<String>,
    /// Whether some sampler had a candidate for each request.
    is_solved: Vec<bool>,
    /// Requests that default has no candidate for, and another sampler has.
    missed: Vec<String>,
    /// All samplers' answers to every `kept_every`-th request.
    pub(crate) kept: Vec<Kept>,
}

impl Turns {
    /// Those requests that no sampler had a candidate for.
    pub(crate) fn unsolved<'a>(&self, requests: &'a [PlanRequest]) -> Vec<&'a PlanRequest> {
        let pairs = requests.iter().zip(&self.is_solved);
        let unsolved = pairs.filter(|(_, is_solved)| !**is_solved);
        unsolved.map(|(request, _)| request).collect()
    }

    /// Shows which requests default does not answer though they can be.
    pub(crate) fn show_missed(&self, report: &mut Report, name: &str) {
        let line = format!(
            "latency, {name}: requests that default does not answer without a deadline and other samplers do, of {}",
            self.is_solved.len()
        );
        let figure = format!("{} {}", self.missed.len(), self.missed.join("; "));
        report.shown(&line, figure.trim().to_owned());
    }

    /// Asks every sampler one request.
    fn ask_all(
        &mut self,
        served: &mut Served,
        index: usize,
        request: &PlanRequest,
        is_kept: bool,
    ) -> anyhow::Result<Durations> {
        let mut durations = Durations::new();
        for turn in 0..SAMPLERS.len() {
            let which = (index + turn) % SAMPLERS.len();
            let sampler = SAMPLERS[which];
            let request = PlanRequest {
                sampler,
                ..request.clone()
            };
            let (answer, seconds) = served.ask(&request)?;
            self.times[which].add(&answer, seconds);
            durations.insert(sampler.text(), (selected_s(&answer), fastest_s(&answer)));
            if is_kept {
                self.kept.push(Kept::of(request, &answer));
            }
        }
        Ok(durations)
    }

    /// Notes who solved a request, and where others do better than default.
    fn compare(&mut self, index: usize, durations: &Durations) {
        let solvers = durations
            .iter()
            .filter(|(_, (_, fastest))| fastest.is_finite());
        let solvers: Vec<&str> = solvers.map(|(sampler, _)| *sampler).collect();
        self.is_solved.push(!solvers.is_empty());
        let (selected, fastest) = durations[Sampler::Default.text()];
        if fastest.is_infinite() && !solvers.is_empty() {
            let solvers = solvers.join(", ");
            self.missed.push(format!("request {index}: {solvers}"));
        }
        let straight = durations[Sampler::Straight.text()].1;
        if selected > straight + 1e-9 {
            let text = format!("request {index}: {selected:.6} s beside {straight:.6} s");
            self.slower.push(text);
        }
    }

    pub(crate) fn times(&self, sampler: Sampler) -> &Times {
        let index = SAMPLERS.iter().position(|other| *other == sampler);
        &self.times[index.expect("it takes its turn")]
    }
}

/// Asks every sampler every request; which of them begins changes from one request to the next. The answers to every `kept_every`-th
/// request are kept.
pub(crate) fn in_turns(
    served: &mut Served,
    requests: &[PlanRequest],
    kept_every: usize,
) -> anyhow::Result<Turns> {
    let mut turns = Turns {
        times: SAMPLERS.iter().map(|_| Times::default()).collect(),
        slower: Vec::new(),
        is_solved: Vec::new(),
        missed: Vec::new(),
        kept: Vec::new(),
    };
    for (index, request) in requests.iter().enumerate() {
        let is_kept = index.is_multiple_of(kept_every);
        let durations = turns.ask_all(served, index, request, is_kept)?;
        turns.compare(index, &durations);
    }
    Ok(turns)
}

/// Duration of the selected motion, s; infinite where there is none.
fn selected_s(answer: &PlanAnswer) -> f64 {
    let selected = answer.selected();
    selected.map_or(f64::INFINITY, |candidate| candidate.summary.duration_s)
}

fn fastest_s(answer: &PlanAnswer) -> f64 {
    let durations = answer.report().candidates.iter().map(|c| c.duration_s);
    durations.fold(f64::INFINITY, f64::min)
}
