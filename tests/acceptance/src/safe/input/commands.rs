//! What commands say when they end with nothing to show, and where they cannot write.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::ensure;
use tests::process::Process;
use tests::programs::{program, repository};
use tests::stack::{PATIENCE, Part};
use tests::world::{Settings, World};
use toml::{Table, Value};

use super::outcome::{Outcome, outcome, pcc_within, text};
use crate::report::Report;

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
    let name = "defect 11: pcc plan, truncated to no candidate";
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
        "defect 11: places that nothing can be recorded in: not refused at the begin",
        &wrong,
    );
    Ok(())
}

/// How a file system is full.
#[derive(Clone, Copy, Debug)]
enum Full {
    /// There is no place for a file.
    Files,
    /// There is no place for a second file.
    SecondFile,
    /// There is no place for a byte.
    Bytes,
}

/// All that writes files, on a full disk: each says which one has no place.
fn full_disk(report: &mut Report) -> anyhow::Result<()> {
    let sample = repository().join("tests/data/reference-mixed-sample");
    let mut wrong = Vec::new();
    let evaluate = [
        "evaluate",
        "--dataset",
        text(&sample),
        "--planner",
        "straight",
    ];
    let dataset = [
        "dataset",
        "--targets",
        "4",
        "--starts",
        "1",
        "--ends",
        "1",
        "--seed",
        "1",
    ];
    let evaluate = [&evaluate[..], &["--cases", "2", "--out"]].concat();
    let second = |file| (Full::SecondFile, evaluate.clone(), "", file);
    let mut cases = vec![second("result.json")];
    for full in [Full::Files, Full::Bytes] {
        cases.extend([
            (full, evaluate.clone(), "", ""),
            (full, evaluate.clone(), "/out", "out"),
            (
                full,
                vec!["features", "--dataset", text(&sample), "--out"],
                "/rows.npz",
                "rows.npz",
            ),
            (full, [&dataset[..], &["--out"]].concat(), "/set", "set"),
            (full, vec!["demo", "--record"], "/demo", "demo"),
        ]);
        wrong.extend(starts_on_full_disk(full)?);
    }
    for (full, words, last, file) in cases {
        let disk = tempfile::tempdir()?;
        let out = format!("{}{last}", text(disk.path()));
        let pcc = text(&program("pcc")).to_owned();
        let words = words.into_iter().chain([out.as_str()]).collect::<Vec<_>>();
        let what = format!("{full:?}: pcc {} {last}", words[0]);
        let outcome = on_full_disk(full, disk.path(), &[], &pcc, &words);
        let names = [text(disk.path()), file, "No space left"];
        wrong.extend(outcome.unless_refused(&what, &names));
    }
    let name = "defect 11: commands and starts on a full disk that do not name the file";
    report.none_of(name, &wrong);
    Ok(())
}

/// The three processes, with their root folder on such a disk.
fn starts_on_full_disk(full: Full) -> anyhow::Result<Vec<String>> {
    let mut wrong = Vec::new();
    for part in Part::ALL {
        let world = World::new(&Settings {
            without_weights: true,
            ..Settings::default()
        });
        let disk = tempfile::tempdir()?;
        let root = format!("{}/root", text(disk.path()));
        let variables = [
            ("PCC_ROOT", root.as_str()),
            ("PCC_PREFIX", &world.options.prefix),
        ];
        let config = world.config(&format!("{}.toml", part.program()));
        let words = ["--config", text(&config)];
        let process = program(part.program());
        let outcome = on_full_disk(full, disk.path(), &variables, text(&process), &words);
        let what = format!("{full:?}: {}", part.program());
        wrong.extend(outcome.unless_refused(&what, &[&root, "No space left"]));
    }
    Ok(wrong)
}

/// Runs a program in a name space of its own in which a folder is a disk that is full.
fn on_full_disk(
    full: Full,
    disk: &Path,
    variables: &[(&str, &str)],
    program: &str,
    words: &[&str],
) -> Outcome {
    let (options, fill) = match full {
        Full::Files => ("nr_inodes=1", "true"),
        Full::SecondFile => ("nr_inodes=2", "true"),
        Full::Bytes => ("size=16k", "! cat /dev/zero > $0/ballast 2>/dev/null"),
    };
    let script = format!("mount -t tmpfs -o mode=700,{options} none $0 && {fill} && exec \"$@\"");
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "bash", "-c", &script]);
    command.arg(disk).arg(program).args(words);
    command.envs(variables.iter().copied());
    outcome(&mut command, Duration::from_secs(30))
}
