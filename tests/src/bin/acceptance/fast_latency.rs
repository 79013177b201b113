//! The time of a request through the daemon over shared memory, stage by stage, beside what else could plan it.

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;

use anyhow::{Context, ensure};
use client::PlanAnswer;
use datasets::scenes::Setting;
use denoiser::Manifest;
use serde_json::Value as Json;
use shared_types::codes::{Sampler, Stage};
use shared_types::valid::PlanRequest;
use tests::programs::repository;
use tests::world::shipped_number;
use toml::{Table, Value};

use crate::fast_crowded::crowded;
use crate::fast_scenes::{Served, requests_of};
use crate::machine::{Disturbance, Pinned};
use crate::report::Report;
use crate::runs::weights_folder;
use crate::scale::Scale;
use crate::spread::{Spread, median};

/// Asked in turns, each with every request.
const SAMPLERS: [Sampler; 6] = [
    Sampler::Default,
    Sampler::Fast,
    Sampler::RrtConnect,
    Sampler::RrtSmooth,
    Sampler::Straight,
    Sampler::StraightDrawn,
];
/// The temporal U-Net, asked afterwards: its requests take some hundred times as long.
const NETWORK: Sampler = Sampler::DiffusionPost;
/// Weights of the temporal U-Net.
const NETWORK_WEIGHTS: &str = "mixed";
const MEDIAN_AT_MOST_MS: f64 = 2.0;
const P99_AT_MOST_MS: f64 = 8.0;
/// Requests before the measured ones.
const WARM_UP: usize = 20;
/// An answer may be this much later than its deadline.
const LATE_AT_MOST_MS: f64 = 1.0;

/// A kind of scenes, and where the authors' Python was measured in something like it.
struct Scenes {
    name: &'static str,
    /// Of each index.
    setting: fn(u64) -> Setting,
    authors: &'static str,
}

const SCENES: [Scenes; 8] = [
    Scenes {
        name: "0 balls",
        setting: |_| Setting::General(Some(0)),
        authors: "post_0",
    },
    Scenes {
        name: "1 ball",
        setting: |_| Setting::General(Some(1)),
        authors: "post_0",
    },
    Scenes {
        name: "2 balls",
        setting: |_| Setting::General(Some(2)),
        authors: "post_4",
    },
    Scenes {
        name: "4 balls",
        setting: |_| Setting::General(Some(4)),
        authors: "post_4",
    },
    Scenes {
        name: "8 balls",
        setting: |_| Setting::General(Some(8)),
        authors: "post_4",
    },
    Scenes {
        name: "16 balls",
        setting: |_| Setting::General(Some(16)),
        authors: "post_4",
    },
    // By their definition only what rrt-connect solves and segments do not.
    Scenes {
        name: "hard (rrt-connect finds a path)",
        setting: |_| Setting::Hard,
        authors: "post_4",
    },
    Scenes {
        name: "8 to 16 balls, whoever solves them",
        setting: crowded,
        authors: "post_4",
    },
];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    for scenes in &SCENES {
        let name = format!("latency, {}", scenes.name);
        let command = "acceptance fast, requests to planner-daemon";
        report.group(&name, command, |report| latency(report, scale, scenes));
    }
}

/// What one sampler took, ms, one value a request.
#[derive(Default)]
struct Times {
    round_trip: Vec<f64>,
    stages: BTreeMap<&'static str, Vec<f64>>,
    /// Requests with at least one candidate, and candidates in all.
    answered: usize,
    candidates: usize,
}

impl Times {
    fn add(&mut self, answer: &PlanAnswer, seconds: f64) {
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

    fn median(&self) -> f64 {
        median(&self.round_trip)
    }

    fn text(&self) -> String {
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

fn latency(report: &mut Report, scale: Scale, scenes: &Scenes) -> anyhow::Result<()> {
    let name = scenes.name;
    let network = Manifest::open(&weights_folder())?
        .entry(NETWORK_WEIGHTS)
        .is_ok();
    let mut served = Served::start(if network { with_network() } else { Vec::new() })?;
    let wanted = scale.pick(30, 1000);
    eprintln!("  latency, {name}: drawing {wanted} requests");
    let robot = served.world.unit_robot();
    let all = requests_of(&robot, scenes.setting);
    let all: Vec<PlanRequest> = all.take(wanted).collect();
    for request in all.iter().cycle().take(WARM_UP) {
        served.ask(request)?;
    }
    let pinned = Pinned::to_the_last()?;
    let disturbance = Disturbance::count(served.daemon.pid())?;
    let turns = in_turns(&mut served, &all)?;
    let line = format!(
        "latency, {name}: client on processor {}, disturbed meanwhile",
        pinned.processor
    );
    report.shown(&line, disturbance.text()?);
    show(report, name, &turns);
    report.none_of(
        &format!("latency, {name}: default selects a motion slower than straight's fastest"),
        &turns.slower,
    );
    that_nobody_solves(report, name, &mut served, &turns.unsolved(&all))?;
    ratios(report, scenes, &turns)?;
    if network {
        let network = network_ms(&mut served, &all[..scale.pick(2, 10)])?;
        let line = format!(
            "latency, {name}: temporal U-Net ({NETWORK}, {network:.0} ms) ÷ default, medians"
        );
        let ratio = network / turns.times(Sampler::Default).median();
        report.shown(&line, format!("{ratio:.0}"));
    }
    Ok(())
}

/// What default takes for the requests that no sampler has a candidate for: without a deadline they are among all the others; with the
/// shipped one, their answers must be in time.
fn that_nobody_solves(
    report: &mut Report,
    name: &str,
    served: &mut Served,
    unsolved: &[&PlanRequest],
) -> anyhow::Result<()> {
    let deadline_ms = shipped_number("planner-daemon.toml", "default_deadline_ms");
    let mut times = Times::default();
    let mut late = Vec::new();
    for request in unsolved {
        let as_shipped = PlanRequest {
            deadline: None,
            ..(*request).clone()
        };
        let (answer, seconds) = served.ask(&as_shipped)?;
        times.add(&answer, seconds);
        let ms = 1e3 * seconds;
        if ms > deadline_ms + LATE_AT_MOST_MS {
            late.push(format!("seed {}: {ms:.2} ms", request.seed));
        }
    }
    let line = format!(
        "latency, {name}: {} requests that no sampler solves, answers of default later than the shipped {deadline_ms} ms by more than {LATE_AT_MOST_MS} ms",
        unsolved.len()
    );
    report.none_of(&line, &late);
    if !unsolved.is_empty() {
        let line =
            format!("latency, {name}: default, what no sampler solves, with the shipped deadline");
        report.shown(&line, times.text());
    }
    Ok(())
}

fn ratios(report: &mut Report, scenes: &Scenes, turns: &Turns) -> anyhow::Result<()> {
    let default = turns.times(Sampler::Default).median();
    let line = |other: &str| format!("latency, {}: {other} ÷ default, medians", scenes.name);
    for sampler in &SAMPLERS[2..] {
        let ratio = turns.times(*sampler).median() / default;
        report.shown(&line(sampler.text()), format!("{ratio:.2}"));
    }
    let python = authors_ms(scenes.authors)?;
    let text = format!(
        "the authors' Python ({}, sampling alone, {python} ms)",
        scenes.authors
    );
    report.shown(&line(&text), format!("{:.0}", python / default));
    Ok(())
}

fn show(report: &mut Report, name: &str, turns: &Turns) {
    for sampler in SAMPLERS {
        let line = format!("latency, {name}: {sampler}, end to end");
        report.shown(&line, turns.times(sampler).text());
    }
    let default = turns.times(Sampler::Default);
    for (stage, ms) in &default.stages {
        let line = format!("latency, {name}: default, {stage}");
        report.shown(&line, format!("{} ms", Spread::of(ms)));
    }
    let spread = Spread::of(&default.round_trip);
    let count = default.round_trip.len();
    let line = format!("latency, {name}: default, end to end, all {count} requests, median ms");
    report.at_most(&line, spread.median, MEDIAN_AT_MOST_MS);
    let line = format!("latency, {name}: default, end to end, all {count} requests, p99 ms");
    report.at_most(&line, spread.p99, P99_AT_MOST_MS);
}

/// What came of requests that every sampler was asked.
struct Turns {
    times: Vec<Times>,
    /// Requests for whose answer something faster was at hand.
    slower: Vec<String>,
    /// Whether some sampler had a candidate for each request.
    is_solved: Vec<bool>,
}

impl Turns {
    /// Those requests that no sampler had a candidate for.
    fn unsolved<'a>(&self, requests: &'a [PlanRequest]) -> Vec<&'a PlanRequest> {
        let pairs = requests.iter().zip(&self.is_solved);
        let unsolved = pairs.filter(|(_, is_solved)| !**is_solved);
        unsolved.map(|(request, _)| request).collect()
    }

    fn times(&self, sampler: Sampler) -> &Times {
        let index = SAMPLERS.iter().position(|other| *other == sampler);
        &self.times[index.expect("it takes its turn")]
    }
}

/// Every sampler with every request; who begins changes from one to the next.
fn in_turns(served: &mut Served, requests: &[PlanRequest]) -> anyhow::Result<Turns> {
    let mut turns = Turns {
        times: SAMPLERS.iter().map(|_| Times::default()).collect(),
        slower: Vec::new(),
        is_solved: Vec::new(),
    };
    for (index, request) in requests.iter().enumerate() {
        let mut durations = BTreeMap::new();
        for turn in 0..SAMPLERS.len() {
            let which = (index + turn) % SAMPLERS.len();
            let sampler = SAMPLERS[which];
            let request = PlanRequest {
                sampler,
                ..request.clone()
            };
            let (answer, seconds) = served.ask(&request)?;
            turns.times[which].add(&answer, seconds);
            durations.insert(sampler.text(), (selected_s(&answer), fastest_s(&answer)));
        }
        let is_solved = durations.values().any(|(_, fastest)| fastest.is_finite());
        turns.is_solved.push(is_solved);
        let selected = durations[Sampler::Default.text()].0;
        let straight = durations[Sampler::Straight.text()].1;
        if selected > straight + 1e-9 {
            let text = format!("request {index}: {selected:.6} s beside {straight:.6} s");
            turns.slower.push(text);
        }
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

/// The daemon's keys for the paper's sampler.
fn with_network() -> Vec<(&'static str, Value)> {
    let mut diffusion = Table::new();
    diffusion.insert("model".to_owned(), NETWORK_WEIGHTS.into());
    diffusion.insert("solver".to_owned(), "ddim".into());
    diffusion.insert("steps".to_owned(), 50.into());
    diffusion.insert("precision".to_owned(), "f32".into());
    vec![
        ("diffusion", Value::Table(diffusion)),
        ("resident_memory_budget_mb", Value::Float(500.0)),
    ]
}

fn network_ms(served: &mut Served, requests: &[PlanRequest]) -> anyhow::Result<f64> {
    let mut times = Times::default();
    for request in requests {
        let request = PlanRequest {
            sampler: NETWORK,
            deadline: Some(Duration::from_secs(60)),
            ..request.clone()
        };
        let (answer, seconds) = served.ask(&request)?;
        times.add(&answer, seconds);
    }
    ensure!(
        times.stages["sample"].iter().all(|ms| *ms > 0.0),
        "no samples"
    );
    Ok(times.median())
}

/// What the authors' program takes for ten candidates on two threads, ms.
fn authors_ms(scenes: &str) -> anyhow::Result<f64> {
    let file = repository().join("tests/data/reference-timings.json");
    let timings: Json = serde_json::from_str(&fs::read_to_string(file)?)?;
    let threads = &timings["ddim_50_steps_ten_candidates_ms_median"]["threads_2"];
    threads[scenes].as_f64().context("reference-timings.json")
}
