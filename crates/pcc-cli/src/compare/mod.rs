//! `pcc compare`: planners over the same cases, with confidence intervals: `compare.json`, `compare.csv` and a page.

mod arguments;
mod bootstrap;
mod case_log;
mod case_sets;
mod charts;
mod comparison;
mod figures;
mod page;
mod table;

pub(crate) use arguments::Arguments;

use self::case_log::{CaseLog, CaseRecord};
use self::case_sets::CaseSet;
use self::comparison::{Comparison, PlannerResult, SetResult};
use self::figures::{ByBalls, Paired};
use crate::evaluate::{Asked, answer};
use crate::output_files::{make_writable, write_whole};
use crate::planner::{Loaded, ModelRecords, load};
use crate::robot::unit_robot;
use crate::sampler::{PlannerName, name_of};
use datasets::Case;
use indicatif::{ProgressBar, ProgressStyle};
use planning::MOST_CORRECTIONS;
use serde_json::json;
use std::path::Path;

/// Lines of progress of one planner on one set, where there is no terminal to draw a bar on.
const PROGRESS_LINES: usize = 5;

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    make_writable(&arguments.out.join("cases"))?;
    let mut sets = Vec::new();
    for set in arguments.sets() {
        let (robot, out) = (&arguments.robot, &arguments.out);
        let cases = set.cases(arguments.cases(), robot, out)?;
        sets.push(compare_on(arguments, &set, &cases)?);
    }
    let comparison = Comparison {
        against: name_of(&arguments.against),
        candidates: arguments.candidates,
        seed: arguments.seed,
        threads: arguments.threads,
        machine: crate::evaluate::machine(),
        sets,
    };
    let out = &arguments.out;
    write_whole(
        &out.join("compare.json"),
        &serde_json::to_string_pretty(&comparison)?,
    )?;
    write_whole(&out.join("compare.csv"), &table::csv(&comparison))?;
    write_whole(&out.join("index.html"), &page::html(&comparison)?)?;
    table::print(&comparison);
    Ok(())
}

/// Lets every planner answer the cases of a set that it has not answered before.
fn compare_on(arguments: &Arguments, set: &CaseSet, cases: &[Case]) -> anyhow::Result<SetResult> {
    let mut answered = Vec::new();
    for name in arguments.planners() {
        let (models, records) = answer_all(arguments, set, cases, name)?;
        answered.push((name, models, records));
    }
    let against = answered.iter().find(|it| it.0 == arguments.against);
    let against = against.map(|(_, _, records)| records.clone());
    let result = |(name, models, records): (PlannerName, ModelRecords, Vec<CaseRecord>)| {
        let other = against.as_ref().filter(|_| name != arguments.against);
        PlannerResult {
            planner: name_of(&name),
            models,
            figures: ByBalls::of(&records),
            paired: other.map(|other| Paired::of(&records, other)),
        }
    };
    Ok(SetResult {
        set: set.to_string(),
        cases: cases.len(),
        planners: answered.into_iter().map(result).collect(),
    })
}

/// A planner's records of all cases of a set; those that its log has are not made again.
fn answer_all(
    arguments: &Arguments,
    set: &CaseSet,
    cases: &[Case],
    name: PlannerName,
) -> anyhow::Result<(ModelRecords, Vec<CaseRecord>)> {
    let robot = unit_robot(&arguments.robot)?;
    let Loaded { planner, records } = load(name, robot, &arguments.models, arguments.threads)?;
    let asked = Asked {
        planner: name,
        candidates: arguments.candidates,
        corrections: MOST_CORRECTIONS,
    };
    let settings = json!({
        "set": set.to_string(), "cases": cases.len(), "planner": name_of(&name), "models": records,
        "candidates": arguments.candidates, "seed": arguments.seed, "threads": arguments.threads,
        "robot": planner.robot().name,
    });
    let file = format!("{}-{}.jsonl", file_name(&set.to_string()), name_of(&name));
    let mut log = CaseLog::open(&arguments.out.join("cases").join(file), &settings)?;
    let style = ProgressStyle::with_template("{msg:40} {bar:30} {pos}/{len} cases, {eta} left")?;
    let bar = ProgressBar::new(cases.len() as u64).with_style(style);
    bar.set_message(format!("{set}, {}", name_of(&name)));
    bar.set_position(log.records.len() as u64);
    for (index, case) in cases.iter().enumerate().skip(log.records.len()) {
        let seed = arguments.seed.wrapping_add(index as u64);
        let answer = answer(&planner, asked, seed, case.clone(), None)?;
        let record = CaseRecord::of(planner.robot(), index, arguments.candidates, &answer);
        log.add(record)?;
        bar.inc(1);
        let lines = |done: usize| done * PROGRESS_LINES / cases.len();
        if bar.is_hidden() && lines(index + 1) > lines(index) {
            say!(
                "{set}, {}: {} of {} cases",
                name_of(&name),
                index + 1,
                cases.len()
            );
        }
    }
    bar.finish_and_clear();
    Ok((records, log.records))
}

/// A set's name as a part of a file's name.
fn file_name(set: &str) -> String {
    let path = Path::new(set);
    let last = path.file_name().and_then(|name| name.to_str());
    last.unwrap_or(set).to_owned()
}
