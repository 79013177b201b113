//! What a planner that ends by the clock drew in a comparison, which no other run draws again.

use super::given::Given;
use crate::cases_hash::hash_of;
use crate::hash_text::hexadecimal;
use anyhow::{Context, ensure};
use datasets::Case;
use input_files::read_text;
use pcc_model::{Configuration, DOF};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Most bytes of a file of records: those of 250 cases have 3 million.
const MOST_BYTES: u64 = 1_000_000_000;
/// Largest difference of a path's first corner from its case's start, rad.
const SAME_START_RAD: f64 = 1e-6;

/// The record of a case.
#[derive(Deserialize)]
struct Record {
    case: usize,
    /// Corners of certified edges of each attempt that found a path, rad.
    polylines: Vec<Vec<[f64; DOF]>>,
}

/// What records must be of.
pub(super) struct Wanted {
    pub(super) planner: String,
    pub(super) candidates: usize,
    pub(super) seed: u64,
    pub(super) robot_hash: u64,
}

/// The records that `pcc compare` keeps of one planner on one set.
pub(super) struct Records {
    file: PathBuf,
    /// What they are of.
    header: Value,
    records: Vec<Record>,
}

impl Records {
    /// # Errors
    /// Where the file cannot be read, or is none that `pcc compare` writes.
    pub(super) fn read(file: &Path) -> anyhow::Result<Self> {
        let shown = file.display();
        let needed = "records of pcc compare are needed (DIR/cases/SET-PLANNER.jsonl)";
        let text = read_text(file, MOST_BYTES).context(needed)?;
        let mut lines = text.lines().zip(1..);
        let first = lines.next().map_or("", |(line, _)| line);
        let header: Value = serde_json::from_str(first).unwrap_or_default();
        ensure!(
            header["of"].is_object(),
            "{shown} says not what it is of; {needed}"
        );
        let record = |(line, number): (&str, usize)| {
            serde_json::from_str(line).with_context(|| {
                format!("line {number} of {shown} is damaged; {needed}, which the same pcc compare completes")
            })
        };
        Ok(Self {
            file: file.to_owned(),
            records: lines.map(record).collect::<Result<_, _>>()?,
            header,
        })
    }

    pub(super) fn count(&self) -> usize {
        self.records.len()
    }

    /// What was drawn for each case.
    ///
    /// # Errors
    /// Where the records are of anything else, not whole, or not in the order of the cases.
    pub(super) fn given(self, wanted: &Wanted, cases: &[Case]) -> anyhow::Result<Vec<Given>> {
        let shown = self.file.display();
        let of = &self.header["of"];
        for (name, there, here) in [
            ("planner", &of["planner"], json!(wanted.planner)),
            ("candidates", &of["candidates"], json!(wanted.candidates)),
            ("number of cases", &of["cases"], json!(cases.len())),
            (
                "hash of the cases",
                &of["cases_hash"],
                json!(hash_of(cases)),
            ),
            ("seed", &self.header["seed"], json!(wanted.seed)),
            (
                "hash of the robot",
                &self.header["robot_hash"],
                json!(hexadecimal(wanted.robot_hash)),
            ),
        ] {
            ensure!(
                *there == here,
                "{shown} is of another run: {name} is {there} there and {here} here"
            );
        }
        let records = self.records.into_iter().zip(cases).enumerate();
        let given = records.map(|(place, (record, case))| {
            ensure!(
                record.case == place,
                "{shown}: a record of case {} in the place of case {place}",
                record.case
            );
            let corners = |path: Vec<[f64; DOF]>| path.into_iter().map(Configuration::from);
            let polylines: Vec<Vec<_>> = record
                .polylines
                .into_iter()
                .map(|path| corners(path).collect())
                .collect();
            let begins = |path: &Vec<Configuration>| {
                path.len() >= 2 && (path[0] - case.start).amax() <= SAME_START_RAD
            };
            ensure!(
                polylines.len() <= wanted.candidates && polylines.iter().all(begins),
                "{shown}: case {place} has {} paths; at most {} are allowed, of at least two corners each, the first one the case's start",
                polylines.len(),
                wanted.candidates
            );
            Ok(Given::Polylines(polylines))
        });
        given.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use collision::Scene;
    use pcc_model::Point;
    use std::fs;

    const START: [f64; DOF] = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0];

    fn case(target_index: i32) -> Case {
        Case {
            target_index,
            start_index: 0,
            start: START.into(),
            target_tip: Point::new(1.0, 0.0, f64::from(target_index)),
            scene: Scene::default(),
        }
    }

    fn header(cases: &[Case]) -> Value {
        json!({
            "seed": 3, "robot_hash": hexadecimal(5),
            "of": { "planner": "bit-star", "candidates": 10, "cases": cases.len(), "cases_hash": hash_of(cases) },
        })
    }

    fn given(header: &Value, lines: &[Value], cases: &[Case]) -> anyhow::Result<Vec<Given>> {
        let lines = [header].into_iter().chain(lines).map(Value::to_string);
        let file = tempfile::NamedTempFile::new()?;
        fs::write(file.path(), lines.collect::<Vec<_>>().join("\n"))?;
        let wanted = Wanted {
            planner: "bit-star".to_owned(),
            candidates: 10,
            seed: 3,
            robot_hash: 5,
        };
        Records::read(file.path())?.given(&wanted, cases)
    }

    #[test]
    fn records_of_anything_else_and_damaged_ones_are_refused_by_name() {
        let cases = [case(0), case(1)];
        let end = [0.2, 0.0, 0.0, 0.0, 0.0, 0.5];
        let record = |case: usize| json!({ "case": case, "polylines": [[START, end]] });
        let (whole, lines) = (header(&cases), [record(0), record(1)]);
        let found = given(&whole, &lines, &cases).unwrap();
        let [Given::Polylines(polylines), _] = &found[..] else {
            panic!("two cases");
        };
        assert_eq!(polylines[0][1][5], 0.5);
        let others = [case(0), case(7)];
        let elsewhere = json!({ "case": 1, "polylines": [[end, START]] });
        let mut seeded = whole.clone();
        seeded["seed"] = json!(4);
        for (header, lines, cases, said) in [
            (&whole, &lines[..], &others, "hash of the cases"),
            (&seeded, &lines[..], &cases, "seed is 4 there and 3 here"),
            (
                &whole,
                &[record(0), record(0)][..],
                &cases,
                "case 0 in the place of case 1",
            ),
            (
                &whole,
                &[record(0), elsewhere][..],
                &cases,
                "the case's start",
            ),
            (&whole, &[record(0), json!({})][..], &cases, "line 3"),
            (&json!({}), &lines[..], &cases, "says not what it is of"),
        ] {
            let refused = given(header, lines, cases).err().unwrap().to_string();
            assert!(refused.contains(said), "{refused}");
        }
        let few = given(&whole, &lines[..1], &cases[..1]).err().unwrap();
        assert!(
            few.to_string()
                .contains("number of cases is 2 there and 1 here"),
            "{few}"
        );
    }
}
