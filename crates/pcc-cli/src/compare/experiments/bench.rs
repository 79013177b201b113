//! What figures are made with: cases, planners, and data that are kept.

use super::kept;
use crate::compare::arguments::Arguments;
use crate::compare::case_sets::CaseSet;
use crate::compare::records::{SetRecords, answer_set};
use crate::planner::{Loaded, ModelArguments, ModelRecords, load};
use crate::robot::unit_robot;
use crate::sampler::PlannerName;
use datasets::Case;
use pcc_model::UnitRobot;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::cell::Cell;

/// What figures are made with.
pub(crate) struct Bench<'a> {
    pub(super) arguments: &'a Arguments,
    pub(super) robot: UnitRobot,
    /// Time that the parts made so far took, in this run or before, s.
    spent_s: Cell<f64>,
}

impl<'a> Bench<'a> {
    pub(crate) fn new(arguments: &'a Arguments) -> anyhow::Result<Self> {
        Ok(Self {
            arguments,
            robot: unit_robot(&arguments.robot)?,
            spent_s: Cell::new(0.0),
        })
    }

    pub(crate) fn spent_s(&self) -> f64 {
        self.spent_s.get()
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
        let file = self
            .arguments
            .out
            .join("figures")
            .join(format!("{name}.json"));
        if !file.exists() {
            say!("figure {name}");
        }
        let settings = json!({
            "models": models, "robot": self.robot.name, "seed": self.arguments.seed,
            "threads": self.arguments.threads, "of": settings,
        });
        let kept = kept::keep(&file, &settings, make)?;
        self.note(kept.seconds);
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

    /// Adds the time of answers that nothing else counts, s.
    pub(super) fn note(&self, seconds: f64) {
        self.spent_s.set(self.spent_s.get() + seconds);
    }

    /// The answers of some planners to the first so many cases of a set.
    pub(super) fn answers(
        &self,
        set: &CaseSet,
        cases: usize,
        planners: &[PlannerName],
    ) -> anyhow::Result<SetRecords> {
        answer_set(self.arguments, set, cases, planners)
    }
}
