//! Checks as they come in: a line each, and a file that a later run resumes from.

use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::Command;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tests::programs::repository;
use tests::retries;

/// One measured figure beside its bar.
#[derive(Clone, Debug, Deserialize, Serialize)]
struct Check {
    group: String,
    name: String,
    figure: String,
    bar: String,
    passed: bool,
    command: String,
    commit: String,
}

/// The bar of a figure that is shown without one: it neither passes nor fails.
const NO_BAR: &str = "none";

/// Marks a commit from which tracked files differ.
const CHANGED: &str = "+changes";

/// What has been done for a commit and the weights in use.
#[derive(Debug, Default, Deserialize, Serialize)]
struct Record {
    commit: String,
    #[serde(default)]
    weights: String,
    finished_groups: Vec<String>,
    checks: Vec<Check>,
    /// What pieces of groups have given that have not come to their end.
    #[serde(default)]
    pieces: BTreeMap<String, serde_json::Value>,
}

/// Prints checks and, in full runs, keeps them.
pub(crate) struct Report {
    record: Record,
    file: Option<PathBuf>,
    /// Groups without this in their names are left out.
    only: String,
    /// The names of those that were.
    left_out: Vec<String>,
    /// Whether a group has it in its name.
    is_met: bool,
    group: String,
    command: String,
}

impl Report {
    /// With a file, checks that it holds for the same commit and weights are not repeated, unless files differ from it.
    pub(crate) fn new(file: Option<PathBuf>, weights: String) -> Self {
        Self::of(commit(), file, weights)
    }

    /// Of the groups that have this in their names alone.
    pub(crate) fn only(self, only: &str) -> Self {
        Self {
            only: only.to_owned(),
            ..self
        }
    }

    fn of(commit: String, file: Option<PathBuf>, weights: String) -> Self {
        let known = file.as_ref().and_then(|file| fs::read_to_string(file).ok());
        let known: Option<Record> = known.and_then(|text| serde_json::from_str(&text).ok());
        let record = known
            .filter(|record| !record.commit.ends_with(CHANGED))
            .filter(|record| record.commit == commit && record.weights == weights)
            .unwrap_or(Record {
                commit,
                weights,
                ..Record::default()
            });
        Self {
            record,
            file,
            only: String::new(),
            left_out: Vec::new(),
            is_met: false,
            group: String::new(),
            command: String::new(),
        }
    }

    /// Runs one group of checks if it is wanted, unless an earlier run for this commit has come to its end. A group that breaks has failed, and
    /// what failed in a run that broke or was killed stays failed for this commit.
    pub(crate) fn group(
        &mut self,
        name: &str,
        command: &str,
        run: impl FnOnce(&mut Self) -> anyhow::Result<()>,
    ) {
        if !name.contains(&self.only) {
            self.left_out.push(name.to_owned());
            return;
        }
        self.is_met = true;
        if self
            .record
            .finished_groups
            .iter()
            .any(|known| known == name)
        {
            let known = self.record.checks.iter();
            known.filter(|check| check.group == name).for_each(print);
            return;
        }
        let is_kept = |check: &Check| check.group != name || !check.passed;
        self.record.checks.retain(is_kept);
        let before = self.record.checks.iter();
        before.filter(|check| check.group == name).for_each(print);
        (self.group, self.command) = (name.to_owned(), command.to_owned());
        let _ = retries::take();
        let outcome = catch_unwind(AssertUnwindSafe(|| run(self)));
        match outcome {
            Ok(Ok(())) => {
                self.record.finished_groups.push(name.to_owned());
                self.record.pieces.clear();
            }
            Ok(Err(error)) => self.broke(name, &format!("{error:#}")),
            Err(panic) => self.broke(name, &panic_text(panic.as_ref())),
        }
        self.retried(name);
        self.save();
    }

    /// What a piece of the group gives; a full run that was ended before goes on after its last piece.
    pub(crate) fn piece<T: Serialize + DeserializeOwned>(
        &mut self,
        name: &str,
        make: impl FnOnce() -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let key = format!("{}: {name}", self.group);
        if let Some(known) = self.record.pieces.get(&key) {
            return Ok(serde_json::from_value(known.clone())?);
        }
        let made = make()?;
        if self.file.is_some() {
            let kept = serde_json::to_value(&made)?;
            self.record.pieces.insert(key, kept);
            self.save();
        }
        Ok(made)
    }

    /// A retry counts against the group in which it was.
    fn retried(&mut self, name: &str) {
        let again = retries::take();
        let name = format!("{name}: motions asked for again, and faults reset before the next");
        let line = |(cause, count): (&String, &usize)| format!("{count} × {cause}");
        let lines: Vec<String> = again.iter().map(line).collect();
        if !lines.is_empty() {
            self.check(&name, lines.join("; "), "0", false);
        }
    }

    fn broke(&mut self, name: &str, error: &str) {
        let name = format!("{name}: the checks run to their end");
        self.check(&name, error.trim().to_owned(), "no error", false);
    }

    /// One figure.
    pub(crate) fn check(&mut self, name: &str, figure: String, bar: &str, passed: bool) {
        let check = Check {
            group: self.group.clone(),
            name: name.to_owned(),
            figure,
            bar: bar.to_owned(),
            passed,
            command: self.command.clone(),
            commit: self.record.commit.clone(),
        };
        print(&check);
        self.record.checks.push(check);
        self.save();
    }

    /// A figure without a bar.
    pub(crate) fn shown(&mut self, name: &str, figure: String) {
        self.check(name, figure, NO_BAR, true);
    }

    /// Whether the figures are of a commit as it is, so that an earlier run can have measured the same.
    pub(crate) fn is_of_a_commit(&self) -> bool {
        !self.record.commit.ends_with(CHANGED)
    }

    /// The commit and the weights that the figures are of.
    pub(crate) fn subject(&self) -> String {
        format!("{} {}", self.record.commit, self.record.weights)
    }

    /// A figure that must not exceed its bar.
    pub(crate) fn at_most(&mut self, name: &str, figure: f64, bar: f64) {
        let text = format!("{figure:.6}");
        let text = if figure != 0.0 && figure.abs() < 1e-3 {
            format!("{figure:.2e}")
        } else {
            text
        };
        self.check(name, text, &format!("<= {bar}"), figure <= bar);
    }

    /// How many of how many; all are wanted.
    pub(crate) fn all_of(&mut self, name: &str, count: usize, total: usize) {
        let passed = count == total && total > 0;
        self.check(name, format!("{count} of {total}"), "all", passed);
    }

    /// A count that must be zero; the first offenders are shown.
    pub(crate) fn none_of(&mut self, name: &str, offenders: &[String]) {
        let shown: Vec<&str> = offenders.iter().take(3).map(String::as_str).collect();
        let figure = format!("{} {}", offenders.len(), shown.join("; "));
        self.check(name, figure.trim().to_owned(), "0", offenders.is_empty());
    }

    /// The names of all groups, where none has what is asked for.
    pub(crate) fn unless_met(&self) -> Option<&[String]> {
        (!self.is_met).then_some(&self.left_out)
    }

    /// The last line; whether all passed.
    pub(crate) fn finish(&self) -> bool {
        let barred = || self.record.checks.iter().filter(|c| c.bar != NO_BAR);
        let failed = barred().filter(|c| !c.passed).count();
        println!("{} passed, {failed} failed", barred().count() - failed);
        failed == 0
    }

    fn save(&self) {
        let Some(file) = &self.file else { return };
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        let text = serde_json::to_string_pretty(&self.record).unwrap();
        // Replaced as a whole: a run that is killed leaves the file before.
        let fresh = file.with_extension("json.new");
        fs::write(&fresh, text).unwrap();
        fs::rename(fresh, file).unwrap();
    }
}

fn print(check: &Check) {
    let verdict = match check.passed {
        _ if check.bar == NO_BAR => "    ",
        true => "ok  ",
        false => "FAIL",
    };
    println!(
        "{verdict}  {}: {} (bar: {})  [{}]",
        check.name, check.figure, check.bar, check.command
    );
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("panicked")
        .to_owned()
}

/// The commit checked out, marked where tracked files differ from it.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .current_dir(repository())
            .args(arguments)
            .output();
        output.map_or_else(
            |_| String::new(),
            |output| String::from_utf8_lossy(&output.stdout).trim().to_owned(),
        )
    };
    let head = git(&["rev-parse", "HEAD"]);
    if git(&["status", "--porcelain", "--untracked-files=no"]).is_empty() {
        head
    } else {
        head + CHANGED
    }
}

#[cfg(test)]
mod unit {
    use std::path::Path;

    use super::*;

    fn at(commit: &str, file: &Path, weights: &str) -> Report {
        Report::of(commit.to_owned(), Some(file.to_owned()), weights.to_owned())
    }

    #[test]
    fn a_finished_group_is_not_repeated_for_the_same_commit_and_weights() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("acceptance/chain.json");
        let mut first = at("1", &file, "a");
        first.group("good", "true", |report| {
            report.at_most("figure", 1.0, 2.0);
            Ok(())
        });
        assert!(first.finish());
        let mut second = at("1", &file, "a");
        second.group("good", "true", |_| panic!("it is repeated"));
        assert_eq!(second.record.checks.len(), 1);
        assert_eq!(at("1", &file, "b").record.checks.len(), 0);
        assert_eq!(at("2", &file, "a").record.checks.len(), 0);
    }

    #[test]
    fn a_group_that_is_not_asked_for_is_left_out() {
        let mut report = Report::of(String::new(), None, String::new()).only("latency");
        let good = |report: &mut Report| {
            report.at_most("figure", 1.0, 2.0);
            Ok(())
        };
        report.group("soak", "true", |_| panic!("it is not asked for"));
        report.group("latency, hard", "true", good);
        assert_eq!(report.record.checks.len(), 1);
        assert_eq!(report.unless_met(), None);
    }

    #[test]
    fn what_no_group_is_called_is_told_with_the_names_of_all() {
        let mut report = Report::of(String::new(), None, String::new()).only("latncy");
        report.group("soak", "true", |_| panic!("it is not asked for"));
        report.group("latency, hard", "true", |_| panic!("it is not asked for"));
        assert_eq!(
            report.unless_met(),
            Some(&["soak".to_owned(), "latency, hard".to_owned()][..])
        );
    }

    #[test]
    fn a_group_that_is_ended_goes_on_after_its_last_piece() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("motion.json");
        at("1", &file, "a").group("long", "false", |report| {
            assert_eq!(report.piece("0", || Ok([0.5, 1.0]))?, [0.5, 1.0]);
            report.piece("1", || anyhow::bail!("it is ended"))
        });
        let mut second = at("1", &file, "a");
        second.group("long", "true", |report| {
            let known: [f64; 2] = report.piece("0", || panic!("it is repeated"))?;
            assert_eq!(known, [0.5, 1.0]);
            assert_eq!(report.piece("1", || Ok(7))?, 7);
            Ok(())
        });
        assert!(second.record.pieces.is_empty());
        at("2", &file, "a").group("long", "true", |report| {
            assert_eq!(report.piece("0", || Ok(8))?, 8);
            Ok(())
        });
    }

    #[test]
    fn a_group_that_broke_is_repeated_and_has_failed_for_this_commit() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("chain.json");
        let mut first = at("1", &file, "a");
        first.group("broken", "false", |_| anyhow::bail!("it broke"));
        assert!(!first.finish());
        let mut second = at("1", &file, "a");
        assert!(!second.finish());
        second.group("broken", "true", |report| {
            report.at_most("figure", 1.0, 2.0);
            Ok(())
        });
        assert_eq!(second.record.checks.len(), 2);
        assert!(!second.finish());
        assert!(at("2", &file, "a").finish());
    }

    #[test]
    fn what_failed_in_a_run_that_was_killed_stays_failed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("chain.json");
        let mut killed = at("1", &file, "a");
        killed.group = "late".to_owned();
        killed.at_most("figure", 3.0, 2.0);
        let mut second = at("1", &file, "a");
        second.group("late", "true", |report| {
            report.at_most("figure", 1.0, 2.0);
            Ok(())
        });
        assert!(!second.finish());
    }

    #[test]
    fn nothing_is_resumed_where_files_differ_from_the_commit() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("chain.json");
        at("1+changes", &file, "a").group("good", "true", |report| {
            report.at_most("figure", 1.0, 2.0);
            Ok(())
        });
        assert_eq!(at("1+changes", &file, "a").record.checks.len(), 0);
        assert!(!at("1+changes", &file, "a").is_of_a_commit());
        assert!(at("1", &file, "a").is_of_a_commit());
    }
}
