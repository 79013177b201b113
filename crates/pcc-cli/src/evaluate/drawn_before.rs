//! What a planner that ends by the clock drew in a comparison, which no other run draws again.

use super::given::Given;
use anyhow::{Context, ensure};
use pcc_model::{Configuration, DOF};
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// The first line of a file of records: what they are of.
#[derive(Deserialize)]
struct Header {
    of: Of,
}

#[derive(Deserialize)]
struct Of {
    planner: String,
    candidates: usize,
}

/// The record of a case.
#[derive(Deserialize)]
struct Record {
    /// Corners of certified edges of each attempt that found a path, rad.
    polylines: Vec<Vec<[f64; DOF]>>,
}

/// Reads the records that `pcc compare` keeps of this planner, case by case.
pub(super) fn read(file: &Path, planner: &str, candidates: usize) -> anyhow::Result<Vec<Given>> {
    let shown = file.display();
    let text = fs::read_to_string(file).with_context(|| format!("cannot read {shown}"))?;
    let mut lines = text.lines();
    let first = lines.next().unwrap_or_default();
    let Header { of } = serde_json::from_str(first)
        .with_context(|| format!("{shown} does not begin as records of pcc compare do"))?;
    ensure!(
        of.planner == planner && of.candidates == candidates,
        "{shown} is of {} × {}; records of {planner} × {candidates} are needed",
        of.planner,
        of.candidates
    );
    let given = lines.enumerate().map(|(case, line)| {
        let record: Record = serde_json::from_str(line)
            .with_context(|| format!("{shown}: the record of case {case} is damaged"))?;
        let polylines = record.polylines.into_iter();
        let polylines: Vec<Vec<_>> = polylines
            .map(|corners| corners.into_iter().map(Configuration::from).collect())
            .collect();
        ensure!(
            polylines.len() <= candidates && polylines.iter().all(|it| it.len() >= 2),
            "{shown}: case {case} has at most {candidates} paths, of two corners at least each"
        );
        Ok(Given::Polylines(polylines))
    });
    given.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = r#"{"of":{"planner":"bit-star","candidates":10,"set":"hard"}}"#;

    fn of(text: &str) -> anyhow::Result<Vec<Given>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(&file, text).unwrap();
        read(file.path(), "bit-star", 10)
    }

    #[test]
    fn records_of_another_planner_or_with_a_damaged_case_are_refused_by_name() {
        let line = r#"{"polylines":[[[0.1,0,0,0,0,0],[0.2,0,0,0,0,0.5]]],"case":0}"#;
        let given = of(&format!("{HEADER}\n{line}\n")).unwrap();
        let [Given::Polylines(polylines)] = &given[..] else {
            panic!("one case");
        };
        assert_eq!(polylines[0][1][5], 0.5);
        for (text, said) in [
            (
                HEADER.replace("bit", "rrt"),
                "of rrt-star × 10; records of bit-star",
            ),
            (format!("{HEADER}\n{{}}"), "the record of case 0 is damaged"),
            (format!("{HEADER}\n{{\"polylines\":[[]]}}"), "two corners"),
            (String::new(), "does not begin"),
        ] {
            let refused = of(&text).err().unwrap().to_string();
            assert!(refused.contains(said), "{refused}");
        }
    }
}
