//! What commands say when they end with nothing to show, and where they cannot write.

use std::fs;
use std::process::Command;
use std::time::Duration;

use anyhow::ensure;
use tests::process::Process;
use tests::programs::{program, repository};
use tests::stack::{PATIENCE, Part};
use tests::world::{Settings, World};
use toml::{Table, Value};

use super::{outcome, pcc_within, text};
use crate::Report;

pub(super) fn run(report: &mut Report) -> anyhow::Result<()> {
    no_candidates(report)?;
    record(report)?;
    full_disk(report)
}

/// A diffusion sampler that has no time for a single candidate.
fn no_candidates(report: &mut Report) -> anyhow::Result<()> {
    let mut diffusion = Table::new();
    diffusion.insert("model".into(), "mixed".into());
    diffusion.insert("solver".into(), "ddim".into());
    diffusion.insert("steps".into(), Value::Integer(50));
    diffusion.insert("precision".into(), "f32".into());
    let world = World::new(&Settings {
        daemon: vec![("diffusion", Value::Table(diffusion))],
        ..Settings::default()
    });
    let _daemon = Part::Daemon.start(&world);
    let mut client = client::Client::connect(&world.options)?;
    client.wait_for_daemon(PATIENCE)?;
    let mut words = vec![
        "plan",
        "--tip",
        "1.2",
        "0.3",
        "2.2",
        "--sampler",
        "diffusion",
    ];
    words.extend(["--start", "0.1", "0.0", "0.0", "0.0", "0.0", "0.0"]);
    words.extend(["--deadline-ms", "5", "--candidates", "10"]);
    let mut asked = Process::start(&world, "pcc", &words);
    let status = asked.wait(PATIENCE)?;
    let said = asked.log();
    let is_cut = said.contains("truncated");
    ensure!(
        is_cut && !said.contains("straight"),
        "the premise: it is truncated: {said}"
    );
    let is_failure = status.code() == Some(1) && !said.contains("panicked");
    let name = "pcc plan, truncated to no candidate";
    let figure = format!("{status}: {}", said.lines().next().unwrap_or_default());
    report.check(name, figure, "exit status: 1", is_failure);
    Ok(())
}

/// A folder that cannot be recorded into is refused before anything moves.
fn record(report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("file");
    fs::write(&file, "")?;
    let taken = folder.path().join("taken");
    fs::create_dir(&taken)?;
    fs::write(taken.join("recording.npz"), "the one from yesterday")?;
    let mut wrong = Vec::new();
    for place in [file.join("inside"), file, taken] {
        // No process runs here: before, the daemon was missed first.
        let words = ["demo", "--record", text(&place)];
        let outcome = pcc_within(&words, Duration::from_secs(10));
        wrong.extend(outcome.unless_refused(text(&place), &[text(&place)]));
    }
    report.none_of(
        "places that nothing can be recorded in: not refused at the begin",
        &wrong,
    );
    Ok(())
}

/// A file system on which a second file has no place.
fn full_disk(report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("disk");
    fs::create_dir(&out)?;
    let sample = repository().join("tests/data/reference-mixed-sample");
    let script = format!(
        "mount -t tmpfs -o nr_inodes=2 none {out} && exec {pcc} evaluate --dataset {sample} --planner straight --cases 2 --out {out}",
        out = text(&out),
        pcc = text(&program("pcc")),
        sample = text(&sample),
    );
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "bash", "-c", &script]);
    let outcome = outcome(&mut command, PATIENCE);
    let has_begun = outcome.said.contains("No space left");
    ensure!(has_begun, "the premise, a full disk: {}", outcome.said);
    let wrong = outcome.unless_refused("evaluate", &["result.json", "No space left"]);
    report.none_of("a full disk: the file is not named", &Vec::from_iter(wrong));
    Ok(())
}
