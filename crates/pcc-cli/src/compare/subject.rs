//! What records are of: a run goes on from those alone that the same programs made of the same robot, weights, cases and options.

use super::arguments::Arguments;
use crate::hash_text::hexadecimal;
use crate::planner::ModelRecords;
use anyhow::Context;
use pcc_model::Robot;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// What all records of a run have in common, and where they are measured.
pub(super) struct Subject<'a> {
    pub(super) arguments: &'a Arguments,
    /// SHA-256 of this program.
    pub(super) program: String,
    /// Processor and number of cores.
    pub(super) machine: String,
    robot: String,
    robot_hash: u64,
}

impl<'a> Subject<'a> {
    /// # Errors
    /// Where the robot file is not as it must be, or this program cannot be read.
    pub(super) fn of(arguments: &'a Arguments) -> anyhow::Result<Self> {
        let robot = Robot::from_file(&arguments.robot)?;
        Ok(Self {
            arguments,
            program: sha256_of(&std::env::current_exe()?)?,
            machine: crate::evaluate::machine(),
            robot_hash: robot.hash(),
            robot: robot.name,
        })
    }

    /// What records are of that were made with these models, and with settings of their own.
    pub(super) fn settings(&self, models: &ModelRecords, own: &Value) -> Value {
        json!({
            "program": self.program, "robot": self.robot, "robot_hash": hexadecimal(self.robot_hash), "models": models,
            "seed": self.arguments.seed, "threads": self.arguments.threads, "of": own,
        })
    }
}

/// SHA-256 of a file.
pub(super) fn sha256_of(file: &Path) -> anyhow::Result<String> {
    let bytes = fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let hash = Sha256::digest(&bytes);
    Ok(hash.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Records that are there already are of something else.
#[derive(Debug, thiserror::Error)]
#[error(
    "{file} is of another run: {differences}. Only records of the same programs, robot, weights, cases and options are gone on from: choose another --out, or remove the folder"
)]
pub(super) struct OtherRun {
    file: String,
    /// What differs, by name, with both values.
    differences: String,
}

/// # Errors
/// [`OtherRun`] where what a file's records are of is not what is wanted.
pub(super) fn check(file: &Path, found: &Value, wanted: &Value) -> Result<(), OtherRun> {
    if found == wanted {
        return Ok(());
    }
    let [found, wanted] = [found, wanted].map(|value| {
        let mut leaves = BTreeMap::new();
        collect("", value, &mut leaves);
        leaves
    });
    let names: BTreeSet<_> = found.keys().chain(wanted.keys()).collect();
    let differing = names
        .iter()
        .filter(|it| found.get(**it) != wanted.get(**it));
    let said = differing.map(|name| {
        let value = |of: &BTreeMap<String, String>| of.get(*name).cloned();
        let [there, here] = [&found, &wanted].map(|it| value(it).unwrap_or("nothing".to_owned()));
        format!("{name} is {there} there and {here} here")
    });
    Err(OtherRun {
        file: file.display().to_string(),
        differences: said.collect::<Vec<_>>().join("; "),
    })
}

/// The values within a value, by their names.
fn collect(name: &str, value: &Value, leaves: &mut BTreeMap<String, String>) {
    let Some(fields) = value.as_object() else {
        if !name.is_empty() {
            leaves.insert(name.to_owned(), value.to_string());
        }
        return;
    };
    for (field, value) in fields {
        let dot = if name.is_empty() { "" } else { "." };
        collect(&format!("{name}{dot}{field}"), value, leaves);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_is_said_by_name() {
        let of = |hash: &str, seed: u64| json!({ "models": { "fast": { "sha256": hash } }, "seed": seed });
        let file = Path::new("out/cases/general-fast.jsonl");
        check(file, &of("a", 1), &of("a", 1)).unwrap();
        let said = check(file, &of("a", 1), &of("b", 1))
            .unwrap_err()
            .to_string();
        let expected = "models.fast.sha256 is \"a\" there and \"b\" here. ";
        assert!(said.contains(expected) && !said.contains("seed"), "{said}");
        let said = check(file, &Value::Null, &of("a", 1))
            .unwrap_err()
            .to_string();
        assert!(said.contains("seed is nothing there and 1 here"), "{said}");
    }
}
