//! The figures of the page: the paper's, made again, and those that it does not have. Each file makes one kind: its data, its
//! pictures, and the command that makes it.

mod ablation;
mod candidates;
mod denoising;
mod hardware;
mod kept;
mod latency;
mod network;
mod processes;
mod rivals;
mod solutions;
mod steps;
mod tip_length;
mod updates;

use super::arguments::Arguments;
use super::case_sets::CaseSet;
use super::records::{SetRecords, answer_set};
use crate::planner::{Loaded, ModelArguments, ModelRecords, load};
use crate::robot::unit_robot;
use crate::sampler::PlannerName;
use datasets::Case;
use pcc_model::{Point, UnitRobot};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::cell::Cell;

/// A figure of the page.
pub(super) struct Figure {
    /// Its anchor.
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    pub(super) pictures: Vec<Picture>,
    /// What is seen, as HTML.
    pub(super) caption: String,
    /// What makes it.
    pub(super) command: String,
}

/// A part of a figure.
pub(super) struct Picture {
    /// Its anchor, where it has one of its own.
    pub(super) id: Option<&'static str>,
    /// Whether it begins a row of its own.
    pub(super) begins_row: bool,
    pub(super) svg: String,
    pub(super) caption: String,
}

impl Picture {
    fn new(svg: String, caption: impl Into<String>) -> Self {
        Self {
            id: None,
            begins_row: false,
            svg,
            caption: caption.into(),
        }
    }

    fn in_new_row(self) -> Self {
        Self {
            begins_row: true,
            ..self
        }
    }

    fn with_id(self, id: &'static str) -> Self {
        Self {
            id: Some(id),
            ..self
        }
    }
}

/// What figures are made with.
pub(super) struct Bench<'a> {
    arguments: &'a Arguments,
    robot: UnitRobot,
    /// Time that the parts made so far took, in this run or before, s.
    spent_s: Cell<f64>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(arguments: &'a Arguments) -> anyhow::Result<Self> {
        Ok(Self {
            arguments,
            robot: unit_robot(&arguments.robot)?,
            spent_s: Cell::new(0.0),
        })
    }

    pub(super) fn spent_s(&self) -> f64 {
        self.spent_s.get()
    }

    /// One of two numbers, of the quick page and of the full one.
    fn scale<T>(&self, quick: T, full: T) -> T {
        if self.arguments.quick { quick } else { full }
    }

    /// Data of a figure, made where they are not kept already.
    fn keep<T: Serialize + DeserializeOwned>(
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

    fn planner(&self, name: PlannerName) -> anyhow::Result<Loaded> {
        self.planner_by(name, &self.arguments.models)
    }

    fn planner_by(&self, name: PlannerName, models: &ModelArguments) -> anyhow::Result<Loaded> {
        load(name, self.robot.clone(), models, self.arguments.threads)
    }

    fn models(&self) -> &ModelArguments {
        &self.arguments.models
    }

    /// The first so many cases of a set.
    fn cases(&self, set: &CaseSet, count: usize) -> anyhow::Result<Vec<Case>> {
        let arguments = self.arguments;
        let made = count.max(arguments.cases());
        let mut cases = set.cases(made, &arguments.robot, &arguments.out)?;
        cases.truncate(count);
        Ok(cases)
    }

    /// Adds the time of answers that nothing else counts, s.
    fn note(&self, seconds: f64) {
        self.spent_s.set(self.spent_s.get() + seconds);
    }

    /// The answers of some planners to the first so many cases of a set.
    fn answers(
        &self,
        set: &CaseSet,
        cases: usize,
        planners: &[PlannerName],
    ) -> anyhow::Result<SetRecords> {
        answer_set(self.arguments, set, cases, planners)
    }
}

/// All figures, those of the paper first.
pub(super) fn all(bench: &Bench, sets: &[SetRecords]) -> anyhow::Result<Vec<Figure>> {
    let hardware = hardware::Hardware::read(bench)?;
    Ok(vec![
        denoising::around_a_ball(bench, &hardware)?,
        network::figure(bench)?,
        denoising::from_two_starts(bench)?,
        solutions::figure(bench)?,
        ablation::figure(bench)?,
        rivals::figure(bench)?,
        hardware.consecutive(bench)?,
        hardware.two_solutions(bench)?,
        hardware.obstacle(bench)?,
        candidates::figure(bench)?,
        steps::figure(bench)?,
        updates::figure()?,
        tip_length::figure(sets)?,
        latency::figure(bench)?,
    ])
}

/// Three numbers as an option of the command line takes them.
fn words(point: &Point) -> String {
    let words = point
        .iter()
        .map(|it| format!("{}", (it * 1e4).round() / 1e4));
    words.collect::<Vec<_>>().join(" ")
}
