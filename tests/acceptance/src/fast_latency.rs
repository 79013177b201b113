//! The time of a request through the daemon over shared memory, stage by stage, beside what else could plan it.

use std::fs;
use std::time::Duration;

use anyhow::{Context, ensure};
use datasets::scenes::Setting;
use denoiser::Manifest;
use serde_json::Value as Json;
use shared_types::codes::Sampler;
use shared_types::valid::PlanRequest;
use tests::programs::repository;
use toml::{Table, Value};

use crate::fast_crowded::crowded;
use crate::fast_kept::check;
use crate::fast_scenes::{Served, requests_of};
use crate::fast_turns::{SAMPLERS, Times, Turns, in_turns};
use crate::fast_unsolved::{infeasible, that_nobody_solves};
use crate::machine::{Disturbance, Pinned};
use crate::report::Report;
use crate::runs::weights_folder;
use crate::scale::Scale;
use crate::spread::{Spread, median};

/// The temporal U-Net, asked afterwards: its requests take some hundred times as long.
const NETWORK: Sampler = Sampler::DiffusionPost;
/// Weights of the temporal U-Net.
const NETWORK_WEIGHTS: &str = "mixed";
const MEDIAN_AT_MOST_MS: f64 = 2.0;
const P99_AT_MOST_MS: f64 = 8.0;
/// Requests before the measured ones.
const WARM_UP: usize = 20;
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
    let command = "acceptance fast, requests to planner-daemon";
    for scenes in &SCENES {
        let name = format!("latency, {}", scenes.name);
        report.group(&name, command, |report| latency(report, scale, scenes));
    }
    report.group("latency, infeasible", command, |report| {
        infeasible(report, scale)
    });
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
    let kept_every = scale.pick(5, 20);
    let turns = in_turns(&mut served, &all, kept_every)?;
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
    turns.show_missed(report, name);
    that_nobody_solves(report, name, &mut served, &turns.unsolved(&all))?;
    ratios(report, scenes, &turns)?;
    if network {
        network_ratio(report, name, &mut served, &all[..scale.pick(2, 10)], &turns)?;
    }
    // Judging takes all processors.
    drop(pinned);
    let line = format!("latency, {name}: all samplers, every {kept_every}th request");
    let robot = &served.world.robot;
    check(report, &line, robot, &turns.kept, scale.pick(1, 4));
    Ok(())
}

/// The temporal U-Net's time ÷ default's, of the first requests.
fn network_ratio(
    report: &mut Report,
    name: &str,
    served: &mut Served,
    first: &[PlanRequest],
    turns: &Turns,
) -> anyhow::Result<()> {
    let count = first.len();
    let network = network_ms(served, first)?;
    let line = format!(
        "latency, {name}: temporal U-Net ({NETWORK}, {network:.0} ms) ÷ default, medians of the same {count} requests"
    );
    let default = median(&turns.times(Sampler::Default).round_trip[..count]);
    report.shown(&line, format!("{:.0}", network / default));
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
