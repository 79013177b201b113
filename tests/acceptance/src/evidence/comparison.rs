//! All planners on unseen reference, general and hard cases.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::repository;

use super::planners::BY_THE_CLOCK;
use crate::report::Report;
use crate::runs::{Model, folder, number, run_pcc, title_of};
use crate::scale::Scale;

const COMMAND: &str = "pcc compare";
/// Candidates, or attempts, of every case.
const ATTEMPTS: f64 = 10.0;
/// Everything that `fast` has, but the network.
pub(super) const NULL_ARM: &str = "straight-drawn";
/// Planners beside which `fast` has bars.
pub(super) const RIVALS: [&str; 2] = [NULL_ARM, "rrt-smooth"];
/// Share of hard cases in which the tip of `fast` must be ahead, %.
pub(super) const LEAST_AHEAD: f64 = 90.0;
/// Tip length of `fast` ÷ that of the null arm outside hard scenes, at most: of any case, and on average.
pub(super) const LENGTH_AT_MOST: [f64; 2] = [1.01, 1.0];
const SECONDS: &str = "seconds_a_success";
/// The table of the page that is in the repository.
const COMMITTED: &str = "docs/results/compare.csv";
/// Figures of every planner, with their scales and digits.
const FIGURES: [(&str, f64, usize); 7] = [
    ("success", 100.0, 1),
    ("certified", 100.0, 1),
    (SECONDS, 1e3, 3),
    ("tip_length_ratio", 1.0, 3),
    ("tip_smoothness", 1.0, 1),
    ("duration_s", 1.0, 2),
    ("modes", 1.0, 1),
];
/// How `pcc compare` refuses to go on from records of other programs or weights, and from other cases.
const OTHER: [&str; 2] = ["is of another run", "was made with another recipe"];

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("comparison", COMMAND, |report| {
        for rival in RIVALS {
            let compared = compare(scale, rival)?;
            for set in compared["sets"].as_array().context("no sets")? {
                fast_beside(report, rival, set)?;
            }
        }
        let compared = compare(scale, "fast")?;
        if scale.full {
            as_committed(report, scale)?;
        }
        let attempts = number(&compared, "/candidates")?;
        report.check(
            "attempts a case",
            attempts.to_string(),
            &format!("{ATTEMPTS}"),
            attempts >= ATTEMPTS,
        );
        are_unseen(report, scale)?;
        says_who_is_ahead(report, scale, &compared)?;
        for set in compared["sets"].as_array().context("no sets")? {
            show(report, scale, set)?;
        }
        Ok(())
    });
}

/// The comparison, on top of what the same programs made of it before, or anew where others did.
pub(super) fn compare(scale: Scale, against: &str) -> anyhow::Result<Value> {
    let out = out(scale);
    let text = out.to_str().context("path")?;
    let mut arguments = vec!["compare", "--against", against, "--out", text];
    arguments.extend((!scale.full).then_some("--quick"));
    if let Err(refused) = run_pcc(&arguments) {
        let said = refused.to_string();
        ensure!(OTHER.iter().any(|it| said.contains(it)), refused);
        fs::remove_dir_all(&out)?;
        run_pcc(&arguments)?;
    }
    let text = fs::read_to_string(out.join("compare.json"))?;
    Ok(serde_json::from_str(&text)?)
}

/// Where the comparison's files are.
pub(super) fn out(scale: Scale) -> PathBuf {
    folder().join(scale.pick("compare-quick", "compare"))
}

/// Whether the cases are drawn with seeds that nothing was trained with.
fn are_unseen(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut seeds = Vec::new();
    for set in fs::read_dir(out(scale).join("sets"))? {
        let told = fs::read_to_string(set?.path().join("dataset_meta.json"))?;
        let told: Value = serde_json::from_str(&told)?;
        seeds.push(number(&told, "/config/seed")? as u64);
    }
    let mut trained = Model::wanted("fast")?.training_seeds()?;
    trained.extend(Model::wanted("mixed")?.training_seeds()?);
    report.check(
        "seeds of the sets, beside those of the training data of fast and mixed",
        format!("{seeds:?} beside {trained:?}"),
        "none of the training's",
        !seeds.is_empty() && seeds.iter().all(|it| !trained.contains(it)),
    );
    Ok(())
}

/// Whether the page in `docs/results` is of this comparison: its table has the same rows, and this run's figures, but for times, are within the
/// intervals there.
fn as_committed(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let committed = fs::read_to_string(repository().join(COMMITTED))?;
    let fresh = fs::read_to_string(out(scale).join("compare.csv"))?;
    let [committed, fresh] = [&committed, &fresh].map(|text| rows(text));
    let other: Vec<String> = committed
        .keys()
        .chain(fresh.keys())
        .filter(|row| !(committed.contains_key(*row) && fresh.contains_key(*row)))
        .map(|row| row.join(", "))
        .collect();
    report.none_of(
        "rows that only one of docs/results and this run has",
        &other,
    );
    let (mut within, mut all) = (0, 0);
    for (row, then) in committed.iter().filter(|(row, _)| row[2] == "all") {
        let Some(now) = fresh.get(row) else { continue };
        for (key, ..) in FIGURES {
            if key == SECONDS || BY_THE_CLOCK.contains(&row[1]) {
                continue;
            }
            let ends =
                [format!("{key}_low"), format!("{key}_high")].map(|it| then.get(it.as_str()));
            let is_within = match (now.get(key), ends) {
                (Some(now), [Some(low), Some(high)]) => (low..=high).contains(&now),
                (now, ends) => now.is_none() && ends == [None; 2],
            };
            all += 1;
            within += usize::from(is_within);
        }
    }
    report.all_of(
        "figures of all cases, but for times, within the intervals in docs/results",
        within,
        all,
    );
    Ok(())
}

/// The numbers of each row of a table by the names of its columns; a row by its set, planner and number of balls.
fn rows(text: &str) -> BTreeMap<[&str; 3], BTreeMap<&str, f64>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    lines.map(|line| row(&names, line)).collect()
}

fn row<'a>(names: &[&'a str], line: &'a str) -> ([&'a str; 3], BTreeMap<&'a str, f64>) {
    let cells: Vec<&str> = line.split(',').collect();
    let numbers = names.iter().zip(&cells);
    let numbers = numbers.filter_map(|(name, cell)| Some((*name, cell.parse().ok()?)));
    let [set, planner, balls] = [0, 1, 2].map(|cell| cells.get(cell).copied().unwrap_or("?"));
    ([set, planner, balls], numbers.collect())
}

fn show(report: &mut Report, scale: Scale, set: &Value) -> anyhow::Result<()> {
    let name = set["set"].as_str().context("no name")?;
    let planners = set["planners"].as_array().context("no planners")?;
    let (cases, bar) = (number(set, "/cases")?, scale.pick(10.0, 250.0));
    report.check(
        &format!("{}: cases", title_of(name)),
        cases.to_string(),
        &format!(">= {bar}"),
        cases >= bar,
    );
    let names: Vec<&str> = planners
        .iter()
        .filter_map(|it| it["planner"].as_str())
        .collect();
    let known: Vec<&str> = super::planners::planners().collect();
    let missing = known.iter().filter(|it| !names.contains(it));
    let others = names.iter().filter(|it| !known.contains(it));
    let differing: Vec<String> = missing.chain(others).map(|it| (*it).to_owned()).collect();
    report.none_of(
        &format!("{name}: planners that are missing, or not judged"),
        &differing,
    );
    for planner in planners {
        let texts = FIGURES.map(|figure| text_of(planner, figure));
        let has_motions = number(planner, "/all/certified/value")? > 0.0;
        let has_successes = number(planner, "/all/success/value")? > 0.0;
        let is_needed = |key: &str| match key {
            "success" | "certified" | "modes" => true,
            SECONDS => has_successes,
            _ => has_motions,
        };
        let is_broken = scale.full && !(has_motions && has_successes);
        let complete = FIGURES.iter().zip(&texts);
        let complete = complete.filter(|((key, ..), text)| !is_needed(key) || !text.contains('–'));
        let [success, certified, ms, tip, smoothness, duration, modes] = &texts;
        report.check(
            &format!("{name}: {}", planner["planner"].as_str().unwrap_or("?")),
            format!(
                "success {success} %, certified {certified} %, {ms} ms a success (of the paper's rivals until paths are drawn, of all others the \
                 whole request, on all cores), tip length ÷ distance {tip}, smoothness {smoothness}, {duration} s, \
                 {modes} modes"
            ),
            "each with its interval, none without success or certified motions in the full form",
            complete.count() == FIGURES.len() && !is_broken,
        );
    }
    Ok(())
}

/// A figure with its interval.
fn text_of(planner: &Value, (key, scale, digits): (&str, f64, usize)) -> String {
    let of = |end: &str| {
        let value = planner.pointer(&format!("/all/{key}/{end}"));
        let value = value.and_then(Value::as_f64);
        value.map_or_else(|| "–".to_owned(), |it| format!("{:.digits$}", scale * it))
    };
    format!("{} [{}, {}]", of("value"), of("low"), of("high"))
}

/// Whether the page names, for each pair of planners, what `fast` is behind in and what it is ahead in by the intervals.
fn says_who_is_ahead(report: &mut Report, scale: Scale, compared: &Value) -> anyhow::Result<()> {
    let page = fs::read_to_string(out(scale).join("index.html"))?;
    let (mut said, mut all) = (0, 0);
    for set in compared["sets"].as_array().context("no sets")? {
        let name = set["set"].as_str().context("no name")?;
        let (_, section) = page
            .split_once(&format!("id=\"set-{name}\""))
            .context("no section")?;
        for planner in set["planners"].as_array().context("no planners")? {
            let paired = &planner["paired"];
            if paired.is_null() {
                continue;
            }
            let other = planner["planner"].as_str().context("no name")?;
            let (_, sentence) = section
                .split_once(&format!("and <code>{other}</code>: "))
                .with_context(|| format!("{name}: no sentence about {other}"))?;
            let sentence = sentence.split("</li>").next().unwrap_or_default();
            all += 1;
            said += usize::from(is_told(sentence, paired));
        }
    }
    report.all_of(
        "pairs of planners of which the page says in what fast is ahead and in what behind",
        said,
        all,
    );
    Ok(())
}

/// Whether a sentence names in its parts what the intervals show.
fn is_told(sentence: &str, paired: &Value) -> bool {
    let end = |key: &str, end: &str| paired.pointer(&format!("/{key}/{end}"))?.as_f64();
    let Some([ahead, behind, open]) = parts_of(sentence) else {
        return false;
    };
    // These are the other's less fast's.
    let of_differences = [
        ("certified share", "certified_ahead"),
        ("success", "success_ahead"),
        ("modes", "modes_ahead"),
    ]
    .map(|(name, key)| {
        let is_ahead = end(key, "high").is_some_and(|high| high < 0.0);
        let is_behind = end(key, "low").is_some_and(|low| low > 0.0);
        (name, is_ahead, is_behind)
    });
    let time = "request_longer_s";
    let of_time = (
        "time of a request",
        end(time, "low").is_some_and(|low| low > 0.0),
        end(time, "high").is_some_and(|high| high < 0.0),
    );
    let of_shares = [
        ("tip length", "tip_longer", "tip_shorter"),
        ("smoothness", "tip_rougher", "tip_smoother"),
        ("duration", "slower", "faster"),
    ]
    .map(|(name, own, other)| {
        let [is_ahead, is_behind] =
            [own, other].map(|it| end(it, "low").is_some_and(|it| it > 0.5));
        (name, is_ahead, is_behind)
    });
    of_differences
        .into_iter()
        .chain([of_time])
        .chain(of_shares)
        .all(|(name, is_ahead, is_behind)| {
            let is_open = !is_ahead && !is_behind;
            [(ahead, is_ahead), (behind, is_behind), (open, is_open)]
                .iter()
                .all(|(part, is_there)| part.contains(name) == *is_there)
        })
}

/// What a sentence says fast is ahead in, behind in, and not shown to differ in.
fn parts_of(sentence: &str) -> Option<[&str; 3]> {
    let (_, parts) = sentence.split_once("Ahead</b>")?;
    let (ahead, parts) = parts.split_once("behind</b>")?;
    let (behind, open) = parts.split_once("no difference")?;
    Some([ahead, behind, open])
}

/// The learned sampler beside a planner that has everything but the network, case by case.
fn fast_beside(report: &mut Report, rival: &str, set: &Value) -> anyhow::Result<()> {
    let name = set["set"].as_str().context("no name")?;
    let planners = set["planners"].as_array().context("no planners")?;
    let fast = planners.iter().find(|it| it["planner"] == "fast");
    let beside = Beside {
        name,
        rival,
        cases: number(set, "/cases")?,
        paired: &fast.context("no planner fast")?["paired"],
    };
    beside.tips(report)?;
    if rival == NULL_ARM {
        beside.certified(report)?;
        if name != "hard" {
            beside.lengths(report)?;
        }
    }
    Ok(())
}

/// `fast` beside a rival on the cases of a set.
struct Beside<'a> {
    name: &'a str,
    rival: &'a str,
    cases: f64,
    paired: &'a Value,
}

impl Beside<'_> {
    fn line(&self, what: &str) -> String {
        let Self { name, rival, .. } = self;
        format!("{name}: fast beside {rival}: {what}")
    }

    /// A figure and its interval, in percent.
    fn percent(&self, key: &str) -> anyhow::Result<[f64; 3]> {
        let end = |end: &str| number(self.paired, &format!("/{key}/{end}"));
        Ok([end("value")?, end("low")?, end("high")?].map(|it| 100.0 * it))
    }

    /// In how many of the cases that the rival solves the tip is shorter, and smoother.
    fn tips(&self, report: &mut Report) -> anyhow::Result<()> {
        let (cases, rival) = (self.cases, self.rival);
        let (is_hard, is_null_arm) = (self.name == "hard", rival == NULL_ARM);
        let both = number(self.paired, "/both")?;
        let solved = both + number(self.paired, "/only_other")?;
        let shares = [
            ("tip shorter", "tip_shorter", is_hard),
            ("tip smoother", "tip_smoother", is_hard && is_null_arm),
            (
                "tip shorter and smoother",
                "tip_shorter_and_smoother",
                is_hard && is_null_arm,
            ),
        ];
        for (what, key, has_bar) in shares {
            let what = self.line(&format!(
                "{what}, of the {solved} of {cases} cases that {rival} solves, {both} of which fast solves"
            ));
            let [of_both, low, high] = self.percent(key)?;
            let ahead = (0.01 * of_both * both).round();
            let share = 100.0 * ahead / solved;
            let figure = format!("{share:.1} % (of those {of_both:.1} [{low:.1}, {high:.1}] %)");
            match has_bar {
                true => report.check(
                    &what,
                    figure,
                    &format!(">= {LEAST_AHEAD} %"),
                    share >= LEAST_AHEAD,
                ),
                false => report.shown(&what, figure),
            }
        }
        Ok(())
    }

    fn certified(&self, report: &mut Report) -> anyhow::Result<()> {
        let least = if self.name == "hard" { 8.0 } else { 0.0 };
        let [ahead, low, high] = self.percent("certified_ahead")?;
        report.check(
            &self.line("certified"),
            format!("{ahead:+.2} [{low:+.2}, {high:+.2}] points"),
            &format!(">= {least:+} points"),
            ahead >= least,
        );
        Ok(())
    }

    /// The median tip lengths of the cases that both solve.
    fn lengths(&self, report: &mut Report) -> anyhow::Result<()> {
        let both = number(self.paired, "/both")?;
        let bars = [
            ("largest", "/longest_tip"),
            ("mean", "/tip_length_ratio/value"),
        ];
        for ((what, key), bar) in bars.into_iter().zip(LENGTH_AT_MOST) {
            let line = self.line(&format!(
                "tip length ÷ the other's, {what} of the {both} of {} cases that both solve",
                self.cases
            ));
            report.at_most(&line, number(self.paired, key)?, bar);
        }
        Ok(())
    }
}
