//! What figures are made with: cases, planners, and data that are kept.

use super::kept;
use crate::compare::arguments::Arguments;
use crate::compare::case_sets::CaseSet;
use crate::compare::records::{SetRecords, answer_set};
use crate::compare::subject::Subject;
use crate::planner::{Loaded, ModelArguments, ModelRecords, load};
use crate::robot::unit_robot;
use crate::sampler::{PlannerName, name_of};
use datasets::Case;
use pcc_model::UnitRobot;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

/// What figures are made with.
pub(crate) struct Bench<'a> {
    pub(super) arguments: &'a Arguments,
    pub(super) robot: UnitRobot,
    pub(in crate::compare) subject: Subject<'a>,
    /// Time that each part took which was used so far, in this run or before, s.
    spent_s: RefCell<BTreeMap<String, f64>>,
    /// Where these times were measured.
    machines: RefCell<BTreeSet<String>>,
}

impl<'a> Bench<'a> {
    pub(crate) fn new(arguments: &'a Arguments) -> anyhow::Result<Self> {
        Ok(Self {
            arguments,
            robot: unit_robot(&arguments.robot)?,
            subject: Subject::of(arguments)?,
            spent_s: RefCell::default(),
            machines: RefCell::default(),
        })
    }

    /// Time of everything that was used so far, s.
    pub(crate) fn spent_s(&self) -> f64 {
        // The sum of nothing is -0.
        0.0 + self.spent_s.borrow().values().sum::<f64>()
    }

    /// Where that was measured: processor and number of cores of each machine.
    pub(crate) fn machines(&self) -> Vec<String> {
        self.machines.borrow().iter().cloned().collect()
    }

    /// One of two numbers, of the quick page and of the full one.
    pub(super) fn scale<T>(&self, quick: T, full: T) -> T {
        if self.arguments.quick { quick } else { full }
    }

    /// Data of a figure, made where they are not kept already.
    pub(super) fn keep<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        models: &ModelRecords,
        settings: &Value,
        make: impl FnOnce() -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let folder = self.arguments.out.join("figures");
        let file = folder.join(format!("{name}.json"));
        if !file.exists() {
            say!("figure {name}");
        }
        let settings = self.subject.settings(models, settings);
        let kept = kept::keep(&file, &settings, &self.subject.machine, make)?;
        self.note(name, kept.seconds, [&kept.machine]);
        Ok(kept.data)
    }

    pub(super) fn planner(&self, name: PlannerName) -> anyhow::Result<Loaded> {
        self.planner_by(name, &self.arguments.models)
    }

    pub(super) fn planner_by(
        &self,
        name: PlannerName,
        models: &ModelArguments,
    ) -> anyhow::Result<Loaded> {
        load(name, self.robot.clone(), models, self.arguments.threads)
    }

    pub(super) fn models(&self) -> &ModelArguments {
        &self.arguments.models
    }

    /// The first so many cases of a set.
    pub(super) fn cases(&self, set: &CaseSet, count: usize) -> anyhow::Result<Vec<Case>> {
        let arguments = self.arguments;
        let made = count.max(arguments.cases());
        let mut cases = set.cases(made, &arguments.robot, &arguments.out)?;
        cases.truncate(count);
        Ok(cases)
    }

    /// At most so many cases from all over a set, each of another target.
    pub(super) fn scattered_cases(&self, set: &CaseSet, count: usize) -> anyhow::Result<Vec<Case>> {
        let mut cases = self.cases(set, self.arguments.cases())?;
        cases.dedup_by_key(|case| case.target_index);
        let count = count.min(cases.len());
        Ok((0..count)
            .map(|place| cases[place * cases.len() / count].clone())
            .collect())
    }

    /// The answers of some planners to the first so many cases of a set.
    pub(in crate::compare) fn answers(
        &self,
        set: &CaseSet,
        cases: usize,
        planners: &[PlannerName],
    ) -> anyhow::Result<SetRecords> {
        let records = answer_set(&self.subject, set, cases, planners)?;
        for it in &records.answered {
            let name = format!("{set}-{}", name_of(&it.planner));
            let machines = it.records.iter().map(|record| &record.machine);
            self.note(&name, it.seconds(), machines);
        }
        Ok(records)
    }

    /// Counts the time of a part, once.
    fn note<'b>(&self, part: &str, seconds: f64, on: impl IntoIterator<Item = &'b String>) {
        self.spent_s.borrow_mut().insert(part.to_owned(), seconds);
        self.machines.borrow_mut().extend(on.into_iter().cloned());
    }
}
