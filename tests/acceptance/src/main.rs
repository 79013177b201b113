//! Measures every line that a suite must show, beside its bar: see `scripts/acceptance`.
#![allow(
    clippy::unwrap_used,
    reason = "a broken environment panics, and that group of checks has failed"
)]

mod as_text;
mod demo;
mod evaluation;
mod evidence;
mod fast_ablation;
mod fast_candidates;
mod fast_cases;
mod fast_certified;
mod fast_crowded;
mod fast_equal_time;
mod fast_growth;
mod fast_kept;
mod fast_latency;
mod fast_picture;
mod fast_quality;
mod fast_random;
mod fast_scenes;
mod fast_soak;
mod fast_timing;
mod fast_turns;
mod fast_unsolved;
mod geometry;
mod join;
mod machine;
mod motion;
mod motions;
mod paper_ablation;
mod paper_data;
mod paper_parity;
mod paper_python;
mod paper_refusals;
mod paper_runs;
mod paper_scenes;
mod paper_speed;
mod processes;
mod real_time;
mod refusals;
mod report;
mod runs;
mod safe;
mod scale;
mod second_look;
mod spread;
mod stolen;
mod timer;

use std::process::ExitCode;

use report::Report;
use scale::Scale;
use tests::programs::repository;

/// A group of checks.
type Group = fn(&mut Report, Scale);

/// What can be measured as a whole: its groups of checks, in this order.
struct Suite {
    name: &'static str,
    /// The weights that the groups measure, where these are a matter of choice.
    weights: fn() -> String,
    groups: &'static [&'static [Group]],
}

const SUITES: [Suite; 7] = [
    Suite {
        name: "chain",
        weights: String::new,
        groups: &[&[
            geometry::run,
            |report, _| refusals::run(report),
            processes::run,
            real_time::run,
            evaluation::run,
            demo::run,
        ]],
    },
    Suite {
        name: "paper",
        weights: runs::weights_in_use,
        groups: &[&[
            paper_data::run,
            |report, _| paper_parity::run(report),
            |report, _| paper_refusals::run(report),
            paper_speed::run,
            paper_ablation::run,
        ]],
    },
    Suite {
        name: "fast",
        weights: runs::weights_in_use,
        groups: &[&[
            fast_latency::run,
            fast_certified::run,
            fast_timing::run,
            fast_quality::run,
            fast_ablation::run,
            fast_growth::run,
            fast_soak::run,
        ]],
    },
    Suite {
        name: "safe",
        weights: String::new,
        groups: &[safe::GROUPS],
    },
    Suite {
        name: "motion",
        weights: runs::weights_in_use,
        groups: &[motion::GROUPS, safe::GROUPS],
    },
    Suite {
        name: "evidence",
        weights: runs::weights_in_use,
        groups: &[evidence::GROUPS],
    },
    Suite {
        name: "join",
        weights: runs::weights_in_use,
        groups: &[join::GROUPS, safe::GROUPS],
    },
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (name, full, only) = match words[..] {
        [name] => (name, false, ""),
        [name, "--full"] => (name, true, ""),
        [name, "--only", only] => (name, false, only),
        [name, "--full", "--only", only] => (name, true, only),
        _ => ("", false, ""),
    };
    let Some(suite) = SUITES.iter().find(|suite| suite.name == name) else {
        let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
        eprintln!(
            "usage: acceptance {} [--full] [--only PART_OF_A_GROUP_S_NAME]",
            names.join("|")
        );
        return ExitCode::from(2);
    };
    let file = repository().join(format!("target/acceptance/{name}.json"));
    let mut report = Report::new(full.then_some(file), (suite.weights)()).only(only);
    for group in suite.groups.iter().copied().flatten() {
        group(&mut report, Scale { full });
    }
    if let Some(groups) = report.unless_met() {
        eprintln!(
            "no group of {name} has {only:?} in its name; the groups are:\n  {}",
            groups.join("\n  ")
        );
        return ExitCode::from(2);
    }
    if report.finish() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
