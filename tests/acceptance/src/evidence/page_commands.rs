//! The commands under the figures of a page, carried out as they stand: they make the figures' numbers again.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::{program, repository};

use super::planners::BY_THE_CLOCK;
use crate::report::Report;
use crate::runs::folder;

/// Figures without times, whose pictures come out the same.
const SAME_PICTURES: [&str; 4] = ["network", "denoising", "solutions", "updates"];
/// Figures whose numbers come out the same, but for their times.
const SAME_NUMBERS: [&str; 7] = [
    "best",
    "denoising",
    "solutions",
    "ablation",
    "comparison",
    "steps",
    "tip-length",
];
/// Times among the numbers of records and of figures.
const TIMES: [&str; 5] = [
    "seconds",
    "drawing_s",
    "sampling_s",
    "a_candidate_ms",
    "request_ms",
];

/// A set whose comparison is made again, from nothing to its end: that in which the page's first run was killed.
const SET: &str = "reference";

/// Carries out the commands of all figures where pages are made, but in another folder.
pub(super) fn carry_out(report: &mut Report, page: &str, out: &Path) -> anyhow::Result<()> {
    let place = like_the_repository()?;
    for figure in figures(page) {
        let id = id_of(figure).context("no anchor")?;
        let command = of(figure).context("no command")?;
        let made = carried_out(&command, &place, id)?;
        let line = |what: &str| format!("{id}: {what} that the command under it makes again");
        let again = fs::read_to_string(made.join("index.html"))?;
        let (pictures, again) = (pictures(figure), pictures(find(&again, id)?));
        if SAME_PICTURES.contains(&id) {
            let pairs = pictures.iter().zip(&again);
            let same = pairs.filter(|(one, other)| one == other).count();
            report.all_of(&line("pictures"), same, pictures.len().max(again.len()));
        } else {
            report.check(
                &line("pictures, with other times"),
                again.len().to_string(),
                &pictures.len().to_string(),
                again.len() == pictures.len(),
            );
        }
        if SAME_NUMBERS.contains(&id) {
            let (same, all) = numbers_again(out, &made)?;
            report.all_of(&line("numbers but times"), same, all);
        }
    }
    let (_, section) = page
        .split_once(&format!("id=\"set-{SET}\""))
        .with_context(|| format!("the page has no set {SET}"))?;
    let command = of(section).context("no command")?;
    let made = carried_out(&command, &place, SET)?;
    let (same, all) = numbers_again(out, &made)?;
    let line = format!(
        "all planners in set {SET}: numbers but times that the command under them makes again, but for those that end by the clock"
    );
    report.all_of(&line, same, all);
    Ok(())
}

/// Carries out a command; the folder that it has made.
fn carried_out(command: &str, place: &Path, name: &str) -> anyhow::Result<PathBuf> {
    let done = Command::new("sh")
        .current_dir(place)
        .args(["-c", command])
        .output()?;
    let said = String::from_utf8_lossy(&done.stderr);
    ensure!(done.status.success(), "{command}: {said}");
    Ok(place.join("out").join(name))
}

/// The figures of a page, each with its anchor.
pub(super) fn figures(page: &str) -> impl Iterator<Item = &str> {
    let begun = page.split("<figure ").skip(1);
    begun.filter_map(|rest| rest.split("</figure>").next())
}

/// The command under a figure, as a reader copies it.
pub(super) fn of(figure: &str) -> Option<String> {
    let (_, rest) = figure.split_once("<pre>")?;
    let (command, _) = rest.split_once("</pre>")?;
    let marks = [("&quot;", "\""), ("&lt;", "<"), ("&amp;", "&")];
    let plain = |text: String, (mark, meant): (&str, &str)| text.replace(mark, meant);
    Some(marks.into_iter().fold(command.to_owned(), plain))
}

/// The anchor of a figure.
fn id_of(figure: &str) -> Option<&str> {
    figure.strip_prefix("id=\"")?.split('"').next()
}

fn find<'a>(page: &'a str, id: &str) -> anyhow::Result<&'a str> {
    let found = figures(page).find(|it| id_of(it) == Some(id));
    found.with_context(|| format!("the page has no figure {id}"))
}

fn pictures(figure: &str) -> Vec<&str> {
    let begun = figure.split("<svg").skip(1);
    begun
        .filter_map(|rest| rest.split("</svg>").next())
        .collect()
}

/// A folder with what the commands read of the repository, and nothing that they have written.
fn like_the_repository() -> anyhow::Result<PathBuf> {
    let place = folder().join("pasted");
    if place.exists() {
        fs::remove_dir_all(&place)?;
    }
    fs::create_dir_all(place.join("target"))?;
    for name in ["config", "weights"] {
        symlink(repository().join(name), place.join(name))?;
    }
    let programs = program("pcc");
    let programs = programs.parent().context("no folder")?;
    symlink(programs, place.join("target/release"))?;
    Ok(place)
}

/// How many of the numbers in the files that a command made are the same in the page's, and how many there are.
fn numbers_again(page: &Path, made: &Path) -> anyhow::Result<(usize, usize)> {
    let (mut same, mut all) = (0, 0);
    for kind in ["cases", "figures"] {
        for file in fs::read_dir(made.join(kind))? {
            let file = file?;
            let name = file.file_name().to_string_lossy().into_owned();
            let planner = name
                .strip_suffix(".jsonl")
                .and_then(|it| it.split_once('-'));
            if planner.is_some_and(|(_set, it)| BY_THE_CLOCK.contains(&it)) {
                continue;
            }
            let again = numbers_of(&file.path())?;
            let numbers = numbers_of(&page.join(kind).join(file.file_name()))?;
            let pairs = numbers.iter().zip(&again);
            same += pairs.filter(|(one, other)| one == other).count();
            all += numbers.len().max(again.len());
        }
    }
    Ok((same, all))
}

/// The numbers of a file that are no times: of records, whose first line says what they are of, or of a figure's data.
fn numbers_of(file: &Path) -> anyhow::Result<Vec<String>> {
    let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let mut numbers = Vec::new();
    if file.extension().is_some_and(|it| it == "json") {
        let kept: Value = serde_json::from_str(&text)?;
        collect(&kept["data"], &mut numbers);
    } else {
        for line in text.lines().skip(1) {
            collect(&serde_json::from_str(line)?, &mut numbers);
        }
    }
    Ok(numbers)
}

fn collect(value: &Value, numbers: &mut Vec<String>) {
    match value {
        Value::Number(number) => numbers.push(number.to_string()),
        Value::Array(values) => values.iter().for_each(|it| collect(it, numbers)),
        Value::Object(fields) => {
            let kept = fields.iter().filter(|it| !TIMES.contains(&it.0.as_str()));
            kept.for_each(|(_, it)| collect(it, numbers));
        }
        _ => {}
    }
}
