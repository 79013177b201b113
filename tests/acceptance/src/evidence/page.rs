//! The page of `pcc compare`: every figure of the paper has its counterpart, with the command under it, in minutes.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use tests::programs::repository;

use super::page_commands::{self, figures};
use super::page_killed::{Killed, made};
use crate::machine::{Confined, processors};
use crate::report::Report;
use crate::runs::folder;
use crate::scale::Scale;

/// Bar of the whole quick page, s.
const QUICK_S: f64 = 600.0;
/// Processors that it has.
const PROCESSORS: usize = 2;
/// The labels in the paper's source.
const LABELS: &str = "tests/data/paper-figures.txt";
/// The quick page that is in the repository.
const COMMITTED: &str = "docs/results/index.html";
/// Share of the time of all runs of a page that it may leave out: what a kill has cut off, and cases that are generated.
const NOT_MEASURED: f64 = 0.4;
/// Minutes are told with one decimal.
const ROUNDING: f64 = 0.05;
/// What only a page that needs others has.
const FOREIGN: [&str; 4] = ["<script", "<link rel=\"stylesheet", "src=\"http", "@import"];

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("the page", "pcc compare --quick", |report| {
        let all = processors()?;
        let _confined = Confined::to(&all[..all.len().min(PROCESSORS)])?;
        let clock = Instant::now();
        let page = whole(report, &["--quick"], "page")?;
        let took = clock.elapsed();
        let seconds = took.as_secs_f64();
        let cores = std::thread::available_parallelism()?;
        report.check(
            &format!("the whole page on {cores} cores, killed twice and gone on with"),
            format!("{seconds:.0} s"),
            &format!("< {QUICK_S} s"),
            seconds < QUICK_S,
        );
        judge(report, &["--quick"], "page", &page, took)?;
        let committed = fs::read_to_string(repository().join(COMMITTED))?;
        counterparts(report, "docs/results, ", &committed)
    });
    if scale.full {
        report.group("the full page", "pcc compare", |report| {
            let clock = Instant::now();
            let page = whole(report, &[], "compare")?;
            judge(report, &[], "compare", &page, clock.elapsed())
        });
    }
}

/// Makes a page from nothing, killed while it plans and again while it executes.
fn whole(report: &mut Report, options: &[&str], name: &str) -> anyhow::Result<String> {
    let out = folder().join(name);
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let killed = Killed::twice(report, options, &out)?;
    let page = made(options, &out)?;
    killed.judge(report, &out)?;
    Ok(page)
}

/// Whether a page is whole, needs nothing else, comes out the same again, and its commands make its numbers.
fn judge(
    report: &mut Report,
    options: &[&str],
    name: &str,
    page: &str,
    took: Duration,
) -> anyhow::Result<()> {
    let out = folder().join(name);
    let told = page
        .split("<p>")
        .nth(1)
        .and_then(|it| it.split(". ").next());
    let told = text_of(told.unwrap_or("?"));
    let minutes = told.split(" minutes of measuring").next();
    let minutes = minutes.and_then(|it| it.rsplit(' ').next()?.parse::<f64>().ok());
    let whole = took.as_secs_f64() / 60.0;
    report.check(
        "what the page says of its making",
        told,
        &format!(
            "how many minutes it took: {:.1} to {:.1}",
            (1.0 - NOT_MEASURED) * whole,
            whole
        ),
        minutes.is_some_and(|it| ((1.0 - NOT_MEASURED) * whole..=whole + ROUNDING).contains(&it)),
    );
    counterparts(report, "", page)?;
    let complete = figures(page).filter(|it| is_complete(it)).count();
    report.all_of(
        "figures with a picture and a command under it",
        complete,
        figures(page).count(),
    );
    let foreign = FOREIGN.iter().filter(|it| page.contains(**it));
    let foreign: Vec<String> = foreign.map(|it| (*it).to_owned()).collect();
    report.none_of("what the page needs from elsewhere", &foreign);
    same_again(report, options, &out, page)?;
    page_commands::carry_out(report, page, &out)
}

fn same_again(report: &mut Report, options: &[&str], out: &Path, page: &str) -> anyhow::Result<()> {
    let is_same = made(options, out)? == page;
    let figure = if is_same {
        "the same, byte by byte"
    } else {
        "another one"
    };
    report.check(
        "the page of a run that goes on from a finished one",
        figure.to_owned(),
        "the same figures",
        is_same,
    );
    Ok(())
}

/// Every figure and part of a figure, by its label in the paper's source.
fn counterparts(report: &mut Report, of: &str, page: &str) -> anyhow::Result<()> {
    let labels = fs::read_to_string(repository().join(LABELS))?;
    let is_there = |label: &&str| {
        anchor_of(page, label).is_some_and(|anchor| {
            let id = format!("id=\"{anchor}\"");
            let figure = figures(page).find(|it| it.contains(&id));
            figure.is_some_and(|it| is_complete(it) && has_part(it, &id))
        })
    };
    report.all_of(
        &format!("{of}figures and parts of figures in the paper's source with their counterparts"),
        labels.lines().filter(is_there).count(),
        labels.lines().count(),
    );
    Ok(())
}

/// Whether a figure is what has this anchor, or the part of it that has it has a picture.
fn has_part(figure: &str, id: &str) -> bool {
    if figure.starts_with(id) {
        return true;
    }
    let part = figure.split_once(id).map(|(_, rest)| rest);
    let part = part.and_then(|rest| rest.split("</div>").next());
    part.is_some_and(|it| it.contains("<svg"))
}

/// Where the page's own table leads from a label of the paper.
fn anchor_of<'a>(page: &'a str, label: &str) -> Option<&'a str> {
    let (_, row) = page.split_once(&format!("<td><code>{label}</code></td>"))?;
    let (row, _) = row.split_once("</tr>")?;
    let (_, anchor) = row.split_once("href=\"#")?;
    anchor.split('"').next()
}

fn is_complete(figure: &str) -> bool {
    let has_picture = figure.contains("<svg") || figure.contains("<table");
    has_picture && page_commands::of(figure).is_some_and(|it| it.contains("pcc compare "))
}

/// A line of HTML without its marks.
fn text_of(html: &str) -> String {
    let words = html.split('<').enumerate();
    let text = words.filter_map(|(index, it)| match index {
        0 => Some(it),
        _ => it.split_once('>').map(|(_, text)| text),
    });
    text.collect()
}
