//! Measures every line that the whole chain must show, beside its bar: see `scripts/acceptance`.
#![allow(
    clippy::unwrap_used,
    reason = "a broken environment panics, and that group of checks has failed"
)]

mod demo;
mod evaluation;
mod geometry;
mod processes;
mod real_time;
mod refusals;
mod report;

use std::process::ExitCode;

use report::Report;
use tests::programs::repository;

/// How much is done: the full run, or a quick form in which only counts and durations shrink.
#[derive(Clone, Copy)]
struct Scale {
    full: bool,
}

impl Scale {
    fn pick<T>(self, quick: T, full: T) -> T {
        if self.full { full } else { quick }
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let scale = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["chain"] => Scale { full: false },
        ["chain", "--full"] => Scale { full: true },
        _ => {
            eprintln!("usage: acceptance chain [--full]");
            return ExitCode::from(2);
        }
    };
    let file = repository().join("target/acceptance/chain.json");
    let mut report = Report::new(scale.full.then_some(file));
    geometry::run(&mut report, scale);
    refusals::run(&mut report);
    processes::run(&mut report, scale);
    real_time::run(&mut report, scale);
    evaluation::run(&mut report, scale);
    demo::run(&mut report, scale);
    if report.finish() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
