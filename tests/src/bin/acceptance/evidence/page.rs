//! The page of `pcc compare`: every figure of the paper has its counterpart, with the command under it, in minutes.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use tests::programs::{program, repository};

use crate::report::Report;
use crate::runs::{folder, run_pcc};
use crate::scale::Scale;

/// When the first run is killed.
const KILLED_AFTER: Duration = Duration::from_secs(30);
/// Bar of the whole quick page, s.
const QUICK_S: f64 = 600.0;
/// The paper's figures and their counterparts' anchors.
const COUNTERPARTS: &str = "docs/results/paper-figures.csv";
/// What only a page that needs others has.
const FOREIGN: [&str; 4] = ["<script", "<link rel=\"stylesheet", "src=\"http", "@import"];

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("the page", "pcc compare --quick", |report| {
        let out = folder().join("page");
        if out.exists() {
            fs::remove_dir_all(&out)?;
        }
        let clock = Instant::now();
        let quick = ["--quick"];
        killed(&quick, &out)?;
        let page = made(&quick, &out)?;
        let seconds = clock.elapsed().as_secs_f64();
        let cores = std::thread::available_parallelism()?;
        report.check(
            &format!(
                "the whole page on {cores} cores, killed after {KILLED_AFTER:?} and gone on with"
            ),
            format!("{seconds:.0} s"),
            &format!("< {QUICK_S} s"),
            seconds < QUICK_S,
        );
        judge(report, &quick, &out, &page)
    });
    if scale.full {
        report.group("the full page", "pcc compare", |report| {
            let out = folder().join("compare");
            killed(&[], &out)?;
            let page = made(&[], &out)?;
            let told = page
                .split("Made by")
                .nth(1)
                .and_then(|rest| rest.split('.').next());
            report.shown(
                "how long the full page takes, as it says",
                told.unwrap_or("?")
                    .replace("<code>", "")
                    .replace("</code>", ""),
            );
            judge(report, &[], &out, &page)
        });
    }
}

/// Whether a page is whole, needs nothing else, and comes out the same again.
fn judge(report: &mut Report, options: &[&str], out: &Path, page: &str) -> anyhow::Result<()> {
    counterparts(report, page)?;
    let figures: Vec<&str> = figures(page).collect();
    let complete = figures.iter().filter(|it| is_complete(it)).count();
    report.all_of(
        "figures with a picture and a command under it",
        complete,
        figures.len(),
    );
    let foreign = FOREIGN.iter().filter(|it| page.contains(**it));
    let foreign: Vec<String> = foreign.map(|it| (*it).to_owned()).collect();
    report.none_of("what the page needs from elsewhere", &foreign);
    let again = made(options, out)?;
    let is_same = again == page;
    report.check(
        "the page of a run that goes on from a finished one",
        if is_same {
            "the same, byte by byte"
        } else {
            "another one"
        }
        .to_owned(),
        "the same figures",
        is_same,
    );
    Ok(())
}

/// Begins a page and kills it.
fn killed(options: &[&str], out: &Path) -> anyhow::Result<()> {
    let mut child = Command::new(program("pcc"))
        .current_dir(repository())
        .arg("compare")
        .args(options)
        .arg("--out")
        .arg(out)
        .stdout(Stdio::null())
        .spawn()?;
    sleep(KILLED_AFTER);
    child.kill()?;
    child.wait()?;
    Ok(())
}

/// Makes the page, or goes on with it.
fn made(options: &[&str], out: &Path) -> anyhow::Result<String> {
    let out_text = out.to_str().context("path")?;
    run_pcc(&[&["compare"], options, &["--out", out_text]].concat())?;
    Ok(fs::read_to_string(out.join("index.html"))?)
}

/// Every figure and part of a figure of the paper, by the list in the repository.
fn counterparts(report: &mut Report, page: &str) -> anyhow::Result<()> {
    let list = fs::read_to_string(repository().join(COUNTERPARTS))?;
    let rows: Vec<&str> = list
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .collect();
    let is_there = |row: &&&str| {
        let anchor = row.split(',').nth(1).unwrap_or_default();
        let id = format!("id=\"{anchor}\"");
        let figure = figures(page).find(|it| it.contains(&id));
        figure.is_some_and(is_complete) && page.contains(&format!("href=\"#{anchor}\""))
    };
    let there = rows.iter().filter(is_there).count();
    report.all_of(
        "figures and parts of figures of the paper with their counterparts",
        there,
        rows.len(),
    );
    Ok(())
}

/// The figures of a page, each with its anchor.
fn figures(page: &str) -> impl Iterator<Item = &str> {
    let begun = page.split("<figure ").skip(1);
    begun.filter_map(|rest| rest.split("</figure>").next())
}

fn is_complete(figure: &str) -> bool {
    let command = figure
        .split("<pre>")
        .nth(1)
        .and_then(|rest| rest.split("</pre>").next());
    let has_picture = figure.contains("<svg") || figure.contains("<table");
    has_picture && command.is_some_and(|it| it.contains("pcc ") || it.contains("python"))
}
