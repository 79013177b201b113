//! A page of `pcc compare` that is killed, and gone on with.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context, ensure};
use tests::process::wait_for;
use tests::programs::{program, repository};

use crate::report::Report;
use crate::runs::run_pcc;

/// Records of planners after which the first run is killed.
const RECORDS: usize = 50;
/// Pause between two looks at a run.
const LOOK_PERIOD: Duration = Duration::from_millis(100);
/// Time for what a killed run has started to end.
const PATIENCE: Duration = Duration::from_secs(10);
const SHARED_MEMORY: &str = "/dev/shm";

/// What two runs had done when they were killed.
pub(super) struct Killed {
    /// The records that the first one had written, by file.
    records: BTreeMap<String, String>,
    /// The process of the second one, which was carrying out the experiments.
    process: u32,
}

impl Killed {
    /// Kills a run that has written records, and one that carries out the experiments, which must end with it.
    pub(super) fn twice(report: &mut Report, options: &[&str], out: &Path) -> anyhow::Result<Self> {
        killed(options, out, |_| count(&records(out)) >= RECORDS)?;
        let records = records(out);
        report.check(
            "records of planners that the first run had written when it was killed",
            count(&records).to_string(),
            &format!(">= {RECORDS}"),
            count(&records) >= RECORDS,
        );
        let process = killed(options, out, |process| {
            started_by(process)
                .iter()
                .any(|it| it.contains(" demo --record "))
        })?;
        let ended = wait_for("every process of the page ends", PATIENCE, || {
            started_by(process).is_empty().then_some(())
        });
        let left = started_by(process);
        report.none_of(
            "processes that outlive the second run, killed while it carries out the experiments",
            &left,
        );
        ended?;
        let left = left_by(process)?.len();
        report.check(
            "folders and files that the second run left in shared memory when it was killed",
            left.to_string(),
            ">= 1",
            left > 0,
        );
        Ok(Self { records, process })
    }

    /// Whether the run after those went on from the records, and left nothing of them in shared memory.
    pub(super) fn judge(&self, report: &mut Report, out: &Path) -> anyhow::Result<()> {
        let now = records(out);
        let is_kept = |(file, text): &(&String, &String)| {
            now.get(*file)
                .is_some_and(|it| it.starts_with(text.as_str()))
        };
        let kept = self.records.iter().filter(is_kept).count();
        report.all_of(
            "files of the first run's records that the page still begins with",
            kept,
            self.records.len(),
        );
        let left = left_by(self.process)?;
        report.none_of("what is left of that after the next run", &left);
        Ok(())
    }
}

/// Makes the page, or goes on with it.
pub(super) fn made(options: &[&str], out: &Path) -> anyhow::Result<String> {
    let out_text = out.to_str().context("path")?;
    run_pcc(&[&["compare"], options, &["--out", out_text]].concat())?;
    Ok(fs::read_to_string(out.join("index.html"))?)
}

/// Begins a page, or goes on with it, and kills it as soon as something holds of its process, which is returned.
fn killed(options: &[&str], out: &Path, holds: impl Fn(u32) -> bool) -> anyhow::Result<u32> {
    let mut child = Command::new(program("pcc"))
        .current_dir(repository())
        .arg("compare")
        .args(options)
        .arg("--out")
        .arg(out)
        .stdout(Stdio::null())
        .spawn()?;
    while !holds(child.id()) {
        let ended = child.try_wait()?;
        ensure!(
            ended.is_none(),
            "the page ended before it was killed: {ended:?}"
        );
        sleep(LOOK_PERIOD);
    }
    child.kill()?;
    child.wait()?;
    Ok(child.id())
}

/// The whole lines of every planner's records, by file.
fn records(out: &Path) -> BTreeMap<String, String> {
    let files = fs::read_dir(out.join("cases")).into_iter().flatten();
    let read = |file: fs::DirEntry| {
        let text = fs::read_to_string(file.path()).ok()?;
        let whole = text.rfind('\n').map_or(0, |last| last + 1);
        let name = file.file_name().to_string_lossy().into_owned();
        Some((name, text[..whole].to_owned()))
    };
    files.flatten().filter_map(read).collect()
}

/// Records in files whose first lines say what they are of.
fn count(records: &BTreeMap<String, String>) -> usize {
    let lines = records.values().map(|text| text.lines().count());
    lines.map(|lines| lines.saturating_sub(1)).sum()
}

/// What there is in shared memory of the services of a page's process.
fn left_by(page: u32) -> anyhow::Result<Vec<String>> {
    let name = format!("pcc-page-{page}");
    let there = fs::read_dir(SHARED_MEMORY)?.flatten();
    let names = there.map(|it| it.file_name().to_string_lossy().into_owned());
    let is_of_page = |it: &String| *it == name || it.starts_with(&format!("{name}_"));
    Ok(names.filter(is_of_page).collect())
}

/// The command lines of the processes that a page's process has started for its figures: they have the prefix of its services.
fn started_by(page: u32) -> Vec<String> {
    let prefix = format!("PCC_PREFIX=pcc-page-{page}");
    let all = fs::read_dir("/proc").into_iter().flatten().flatten();
    let command_line = |process: fs::DirEntry| {
        let is_number = process
            .file_name()
            .as_bytes()
            .iter()
            .all(u8::is_ascii_digit);
        let environment = is_number.then(|| fs::read(process.path().join("environ")).ok())??;
        let mut variables = environment.split(|byte| *byte == 0);
        let is_of_page = variables.any(|it| it == prefix.as_bytes());
        let line = is_of_page.then(|| fs::read(process.path().join("cmdline")).ok())??;
        Some(String::from_utf8_lossy(&line).replace('\0', " "))
    };
    all.filter_map(command_line).collect()
}
