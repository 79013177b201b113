//! `pcc compare`: the paper's figures made again, and planners over the same cases with confidence intervals: one page, and
//! `compare.json` and `compare.csv`.

mod arguments;
mod case_log;
mod case_sets;
mod charts;
mod comparison;
mod counterparts;
mod drawing;
mod experiments;
mod figure_name;
mod figures;
mod given_options;
mod page;
mod records;
mod subject;
mod table;

pub(crate) use arguments::Arguments;

use self::comparison::{Comparison, PlannerResult, SetResult};
use self::experiments::{Bench, remove_what_killed_runs_left};
use self::figures::{ByBalls, Paired};
use self::given_options::GivenOptions;
use self::records::{Answered, SetRecords};
use crate::output_files::{make_writable, write_whole};
use crate::sampler::name_of;
use anyhow::{Context, bail};
use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::Instant;

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let (clock, out) = (Instant::now(), &arguments.out);
    arguments.check()?;
    let given = GivenOptions::of_this_process(out)?;
    remove_what_killed_runs_left();
    for folder in ["cases", "figures"] {
        make_writable(&out.join(folder))?;
    }
    let _alone = alone_in(out)?;
    if let Some(minutes) = arguments.expected_minutes() {
        say!(
            "about {minutes} minutes on two cores; what is in {} already is not made again",
            out.display()
        );
    }
    let bench = Bench::new(arguments)?;
    let (planners, count) = (arguments.planners(), arguments.cases());
    let sets = arguments.sets();
    let sets = sets.iter().map(|set| bench.answers(set, count, &planners));
    let sets = sets.collect::<anyhow::Result<Vec<SetRecords>>>()?;
    let figures = experiments::make(&bench, &arguments.figures())?;
    let comparison = Comparison {
        against: name_of(&arguments.against),
        candidates: arguments.candidates,
        seed: arguments.seed,
        threads: arguments.threads,
        program: bench.subject.program.clone(),
        machines: bench.machines(),
        measuring_s: bench.spent_s(),
        sets: sets.into_iter().map(|set| result(arguments, set)).collect(),
    };
    let json = serde_json::to_string_pretty(&comparison)?;
    write_whole(&out.join("compare.json"), &json)?;
    write_whole(&out.join("compare.csv"), &table::csv(&comparison))?;
    let page = page::html(&comparison, &figures, &given, arguments.is_whole_page())?;
    write_whole(&out.join("index.html"), &page)?;
    table::print(&comparison);
    say!(
        "{} in {:.1} minutes; what it shows took {:.1} minutes to measure, in this run and before",
        out.join("index.html").display(),
        clock.elapsed().as_secs_f64() / 60.0,
        comparison.measuring_s / 60.0
    );
    Ok(())
}

/// A lock on the folder of a run, which ends with the process.
fn alone_in(out: &Path) -> anyhow::Result<File> {
    let folder = File::open(out)?;
    match folder.try_lock() {
        Ok(()) => Ok(folder),
        Err(TryLockError::WouldBlock) => bail!("another pcc compare writes to {}", out.display()),
        Err(TryLockError::Error(error)) => {
            Err(error).with_context(|| format!("cannot lock {}", out.display()))
        }
    }
}

/// The figures of a set's records.
fn result(arguments: &Arguments, set: SetRecords) -> SetResult {
    let SetRecords {
        set,
        cases,
        answered,
    } = set;
    let against = answered.iter().find(|it| it.planner == arguments.against);
    let against = against.map(|it| it.records.clone());
    let result = |it: Answered| {
        let other = against.as_ref().filter(|_| it.planner != arguments.against);
        PlannerResult {
            planner: name_of(&it.planner),
            models: it.models,
            figures: ByBalls::of(&it.records),
            paired: other.map(|other| Paired::of(&it.records, other)),
        }
    };
    SetResult {
        set,
        cases: cases.len(),
        planners: answered.into_iter().map(result).collect(),
    }
}
