//! Files and options that were once taken without a word.

mod commands;
mod configurations;
mod data;
mod proofs;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tests::programs::{program, repository};
use tests::usage::wait_with_usage;
use toml::Table;

use crate::{Report, Scale};

const COMMAND: &str = "acceptance safe, input";
/// Longer than anything here should take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

pub(crate) fn run(report: &mut Report, scale: Scale) {
    report.group("input: vectors need proof", COMMAND, proofs::run);
    report.group("input: robots and settings", COMMAND, configurations::run);
    report.group("input: data sets", COMMAND, |report| {
        data::run(report, scale)
    });
    report.group("input: commands", COMMAND, commands::run);
}

/// What a program did.
struct Outcome {
    /// Its exit status; none where it went on until it was killed.
    status: Option<i32>,
    /// What it wrote.
    said: String,
    /// Its largest resident memory, 10^6 bytes; as the kernel counted it, from its start to its end.
    peak_mb: f64,
    /// Processor time of all its threads, s.
    processor_s: f64,
    /// From its start to its end, s.
    took_s: f64,
}

impl Outcome {
    /// Nothing, or why it is not a refusal that names all of this.
    fn unless_refused(&self, what: &str, names: &[&str]) -> Option<String> {
        let failed = matches!(self.status, Some(1 | 2));
        let missing: Vec<_> = names.iter().filter(|n| !self.said.contains(**n)).collect();
        if failed && missing.is_empty() && !self.said.contains("panicked") {
            return None;
        }
        let said: String = self.said.trim().chars().take(300).collect();
        Some(format!(
            "{what}: status {:?}, does not name {missing:?}: {said}",
            self.status
        ))
    }
}

/// Runs `pcc` in the repository's root.
fn pcc(words: &[&str]) -> Outcome {
    pcc_within(words, PATIENCE)
}

fn pcc_within(words: &[&str], patience: Duration) -> Outcome {
    let mut command = Command::new(program("pcc"));
    command.args(words);
    outcome(&mut command, patience)
}

/// Runs a program to its end, or until it is killed.
#[allow(clippy::zombie_processes, reason = "it is waited for")]
fn outcome(command: &mut Command, patience: Duration) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let file = fs::File::create(&log).unwrap();
    let mut child = command
        .current_dir(repository())
        .env_remove("RUST_BACKTRACE")
        .stdin(Stdio::null())
        .stdout(file.try_clone().unwrap())
        .stderr(file)
        .spawn()
        .unwrap();
    let begin = Instant::now();
    let mut is_late = false;
    let (status, usage) = loop {
        if let Some(ended) = wait_with_usage(&child).unwrap() {
            break ended;
        }
        if begin.elapsed() > patience && !is_late {
            child.kill().unwrap();
            is_late = true;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    Outcome {
        status: status.code(),
        said: String::from_utf8_lossy(&fs::read(&log).unwrap()).into_owned(),
        peak_mb: usage.peak_mb,
        processor_s: usage.processor_s,
        took_s: begin.elapsed().as_secs_f64(),
    }
}

/// Changes a TOML file.
fn edit(file: &Path, change: impl FnOnce(&mut Table)) {
    let mut table: Table = fs::read_to_string(file).unwrap().parse().unwrap();
    change(&mut table);
    fs::write(file, table.to_string()).unwrap();
}

/// A path as the words of a command have it.
fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
