//! What planners did with the cases of a set, each answered once and kept.

use super::case_log::{CaseLog, CaseRecord};
use super::case_sets::{CaseSet, file_name};
use super::subject::Subject;
use crate::cases_hash::hash_of;
use crate::evaluate::{Asked, answer};
use crate::planner::{Loaded, ModelRecords, load};
use crate::robot::unit_robot;
use crate::sampler::{PlannerName, name_of};
use anyhow::Context;
use datasets::Case;
use indicatif::{ProgressBar, ProgressStyle};
use planning::MOST_CORRECTIONS;
use serde_json::json;

/// Lines of progress of one planner on one set, where there is no terminal to draw a bar on.
const PROGRESS_LINES: usize = 5;

/// Cases, and every planner's records of them.
pub(super) struct SetRecords {
    pub(super) set: String,
    pub(super) cases: Vec<Case>,
    pub(super) answered: Vec<Answered>,
}

/// A planner's records of all cases of a set.
pub(super) struct Answered {
    pub(super) planner: PlannerName,
    pub(super) models: ModelRecords,
    pub(super) records: Vec<CaseRecord>,
}

impl SetRecords {
    /// A planner's records.
    ///
    /// # Errors
    /// Where the planner was not asked.
    pub(super) fn of(&self, planner: PlannerName) -> anyhow::Result<&[CaseRecord]> {
        let found = self.answered.iter().find(|it| it.planner == planner);
        let found = found.with_context(|| format!("{}: no {}", self.set, name_of(&planner)))?;
        Ok(&found.records)
    }
}

impl Answered {
    /// Time of all requests, s.
    pub(super) fn seconds(&self) -> f64 {
        self.records.iter().map(|record| record.seconds).sum()
    }
}

/// Lets planners answer the first so many cases of a set, but for those that they have answered before.
pub(super) fn answer_set(
    subject: &Subject,
    set: &CaseSet,
    count: usize,
    planners: &[PlannerName],
) -> anyhow::Result<SetRecords> {
    let arguments = subject.arguments;
    let cases = set.cases(count, &arguments.robot, &arguments.out)?;
    let name = set.to_string();
    let answered = planners
        .iter()
        .map(|planner| answer_all(subject, &name, &cases, *planner));
    let answered = answered.collect::<anyhow::Result<_>>()?;
    Ok(SetRecords {
        set: name,
        cases,
        answered,
    })
}

fn answer_all(
    subject: &Subject,
    set: &str,
    cases: &[Case],
    name: PlannerName,
) -> anyhow::Result<Answered> {
    let arguments = subject.arguments;
    let robot = unit_robot(&arguments.robot)?;
    let Loaded { planner, records } = load(name, robot, &arguments.models, arguments.threads)?;
    let asked = Asked {
        planner: name,
        candidates: arguments.candidates,
        corrections: MOST_CORRECTIONS,
    };
    let own = json!({
        "set": set, "cases": cases.len(), "cases_hash": hash_of(cases), "planner": name_of(&name),
        "candidates": arguments.candidates,
    });
    let settings = subject.settings(&records, &own);
    let file = format!("{}-{}.jsonl", file_name(set), name_of(&name));
    let mut log = CaseLog::open(&arguments.out.join("cases").join(file), &settings)?;
    let style = ProgressStyle::with_template("{msg:40} {bar:30} {pos}/{len} cases, {eta} left")?;
    let bar = ProgressBar::new(cases.len() as u64).with_style(style);
    bar.set_message(format!("{set}, {}", name_of(&name)));
    bar.set_position(log.records.len() as u64);
    for (index, case) in cases.iter().enumerate().skip(log.records.len()) {
        let seed = arguments.seed.wrapping_add(index as u64);
        let answer = answer(&planner, asked, seed, case.clone(), None)?;
        let record = CaseRecord::of(
            planner.robot(),
            &subject.machine,
            index,
            arguments.candidates,
            &answer,
        );
        log.add(&record)?;
        bar.inc(1);
        let lines = |done: usize| done * PROGRESS_LINES / cases.len();
        if bar.is_hidden() && lines(index + 1) > lines(index) {
            let (name, done) = (name_of(&name), index + 1);
            say!("{set}, {name}: {done} of {} cases", cases.len());
        }
    }
    bar.finish_and_clear();
    Ok(Answered {
        planner: name,
        models: records,
        records: log.records,
    })
}
