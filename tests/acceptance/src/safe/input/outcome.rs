//! What a program did with the words that it was given.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tests::programs::{program, repository};
use tests::usage::wait_with_usage;
use toml::Table;

use crate::machine::memory_mb;

/// Longer than anything here should take on a busy machine.
pub(super) const PATIENCE: Duration = Duration::from_secs(120);

/// From one look at a program to the next.
const LOOK: Duration = Duration::from_millis(1);

/// What a program did.
pub(super) struct Outcome {
    /// Its exit status; none where it went on until it was killed.
    pub(super) status: Option<i32>,
    /// What it wrote.
    pub(super) said: String,
    /// Its largest resident memory, 10^6 bytes: as the kernel counted it from its start to its end, where that is more than this process ever took, whose
    /// memory counts as a child's until it is another program; else as it was seen last before its end.
    pub(super) peak_mb: f64,
    /// Processor time of all its threads, s.
    pub(super) processor_s: f64,
    /// From its start to its end, s.
    pub(super) took_s: f64,
}

impl Outcome {
    /// Nothing, or why it is not a refusal that names all of this.
    pub(super) fn unless_refused(&self, what: &str, names: &[&str]) -> Option<String> {
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
pub(super) fn pcc(words: &[&str]) -> Outcome {
    pcc_within(words, PATIENCE)
}

pub(super) fn pcc_within(words: &[&str], patience: Duration) -> Outcome {
    let mut command = Command::new(program("pcc"));
    command.args(words);
    outcome(&mut command, patience)
}

/// Runs a program to its end, or until it is killed.
#[allow(clippy::zombie_processes, reason = "it is waited for")]
pub(super) fn outcome(command: &mut Command, patience: Duration) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let file = fs::File::create(&log).unwrap();
    let own_peak_mb = memory_mb(std::process::id(), "VmHWM:").unwrap();
    let mut child = command
        .current_dir(repository())
        .env_remove("RUST_BACKTRACE")
        .stdin(Stdio::null())
        .stdout(file.try_clone().unwrap())
        .stderr(file)
        .spawn()
        .unwrap();
    let begin = Instant::now();
    let (mut is_late, mut seen_peak_mb) = (false, None);
    let (status, usage) = loop {
        if let Some(ended) = wait_with_usage(&child).unwrap() {
            break ended;
        }
        if begin.elapsed() > patience && !is_late {
            child.kill().unwrap();
            is_late = true;
        }
        seen_peak_mb = memory_mb(child.id(), "VmHWM:").ok().or(seen_peak_mb);
        std::thread::sleep(LOOK);
    };
    Outcome {
        status: status.code(),
        said: String::from_utf8_lossy(&fs::read(&log).unwrap()).into_owned(),
        peak_mb: seen_peak_mb
            .filter(|_| usage.peak_mb <= own_peak_mb)
            .unwrap_or(usage.peak_mb),
        processor_s: usage.processor_s,
        took_s: begin.elapsed().as_secs_f64(),
    }
}

/// Changes a TOML file.
pub(super) fn edit(file: &Path, change: impl FnOnce(&mut Table)) {
    let mut table: Table = fs::read_to_string(file).unwrap().parse().unwrap();
    change(&mut table);
    fs::write(file, table.to_string()).unwrap();
}

/// A path as the words of a command have it.
pub(super) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
