//! The paper's ablation over unseen scenes: success by its criterion, tip error, certified share, time, diversity.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use datasets::{ArchiveReader, Dataset, Row, Split};
use pcc_model::{Configuration, Robot};
use planning::modes;
use serde_json::Value;
use tests::programs::repository;

use crate::motions::Motions;
use crate::paper_runs::{FREE, GENERAL, HARD, MIXED, ablation_cases, evaluation};
use crate::report::Report;
use crate::runs::{Model, Unseen, figure, number, weights_folder};
use crate::scale::Scale;
use crate::spread::median;

const PLANNERS: [&str; 6] = [
    "diffusion",
    "diffusion-post",
    "diffusion-guided",
    "straight",
    "straight-drawn",
    "rrt-smooth",
];
pub(crate) const PURE: &str = PLANNERS[0];
pub(crate) const POST: &str = PLANNERS[1];
pub(crate) const GUIDED: &str = PLANNERS[2];
/// Those that sample nothing, the null arms.
const NULL_ARMS: [&str; 3] = [PLANNERS[3], PLANNERS[4], PLANNERS[5]];
const STEPS: [usize; 8] = [1, 2, 4, 8, 10, 15, 25, 50];
const SOLVERS: [&str; 2] = ["ddim", "dpm-solver"];
/// Times of the pure sampler that the guided one may take.
const GUIDED_AT_MOST: f64 = 1.6;
/// Percentage points that the paper's 50 DDIM steps may stay behind the best.
const STEPS_TOLERANCE: f64 = 2.0;

/// What a successful path takes in the paper, ms, on an NVIDIA RTX 5090.
const PAPER_MS: f64 = 34.0;

/// What the paper reports of a setting.
pub(crate) struct Paper {
    /// Success of a candidate with post correction, %.
    post_success: f64,
    /// Change of the mean terminal error by post correction, %.
    pub(crate) post_tip_error: f64,
    /// Change of the run time by post correction and by guidance, %.
    post_time: f64,
    guided_time: f64,
}

pub(crate) const PAPER_MIXED: Paper = Paper {
    post_success: 91.11,
    post_tip_error: -45.4,
    post_time: 56.8,
    guided_time: 102.2,
};
pub(crate) const PAPER_FREE: Paper = Paper {
    post_success: 99.62,
    post_tip_error: -55.6,
    post_time: 15.1,
    guided_time: 60.4,
};

pub(crate) fn run(report: &mut Report, scale: Scale) {
    for (unseen, paper) in [
        (MIXED, Some(PAPER_MIXED)),
        (FREE, Some(PAPER_FREE)),
        (GENERAL, None),
        (HARD, None),
    ] {
        let command = format!("{}; pcc evaluate --planner …", unseen.command());
        let name = format!("ablation, {}", unseen.name);
        report.group(&name, &command, |report| {
            ablation(report, scale, &unseen, paper.as_ref())
        });
    }
    let command = "pcc evaluate --dataset tests/data/reference-mixed-sample --planner …";
    report.group("the authors' cases", command, |report| {
        authors_cases(report, scale)
    });
    let command = "pcc evaluate --planner diffusion|diffusion-post|diffusion-guided, in turns";
    report.group("time of the refinements", command, |report| {
        for (unseen, paper) in [(MIXED, PAPER_MIXED), (FREE, PAPER_FREE)] {
            time_of_refinements(report, scale, &unseen, &paper)?;
        }
        Ok(())
    });
    let command = "pcc evaluate --planner diffusion-post --model mixed…";
    report.group("success against updates", command, |report| {
        success_against_updates(report, scale)
    });
    let command = "pcc evaluate --planner diffusion-post --solver … --steps …";
    report.group("success against steps", command, |report| {
        success_against_steps(report, scale)
    });
}

fn ablation(
    report: &mut Report,
    scale: Scale,
    unseen: &Unseen,
    paper: Option<&Paper>,
) -> anyhow::Result<()> {
    let (name, wanted, model) = (unseen.title(), ablation_cases(scale), unseen.model()?);
    let dataset = unseen.make(wanted)?;
    report.shown(&format!("{name}: weights"), model.text.clone());
    let population = Population {
        name,
        label: unseen.name,
        dataset: &dataset,
        model: &model,
        cases: wanted,
    };
    let results = all_planners(report, scale, &population)?;
    let evaluated = number(&results[PURE].0, "/cases")?;
    let bar = format!(">= {wanted}");
    let enough = evaluated >= wanted as f64;
    report.check(
        &format!("{name}: unseen cases"),
        evaluated.to_string(),
        &bar,
        enough,
    );
    let result = |planner: &str| &results[planner].0;
    by_balls(report, name, result(POST))?;
    if let Some(paper) = paper {
        let success = 100.0 * number(result(POST), "/sampled/success")?;
        let line = format!(
            "{name}: {POST}, success by the paper's criterion, {}",
            model.text
        );
        let bar = format!(">= {} %", paper.post_success);
        report.check(
            &line,
            format!("{success:.2} %"),
            &bar,
            success >= paper.post_success,
        );
    }
    for (planner, change) in [(POST, paper.map(|p| p.post_tip_error)), (GUIDED, None)] {
        let text = tip_error_change(result(PURE), result(planner), change)?;
        let line = format!("{name}: {planner}, mean tip error of successful paths against {PURE}");
        report.shown(&line, text);
    }
    let outs = PLANNERS.map(|planner| (planner, results[planner].1.as_path()));
    diversity(report, name, &dataset, wanted, &outs)
}

/// The other population of the paper's setting: cases that the authors' program made.
fn authors_cases(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let dataset = repository().join("tests/data/reference-mixed-sample");
    let population = Population {
        name: "authors' sample, 60 cases",
        label: "authors-sample",
        dataset: &dataset,
        model: &MIXED.model()?,
        cases: 60,
    };
    let results = all_planners(report, scale, &population)?;
    by_balls(report, population.name, &results[POST].0)
}

/// Cases that all planners are evaluated on.
struct Population<'a> {
    /// The name that the report's lines call it by.
    name: &'a str,
    /// The part of the folders' names that tells it from others.
    label: &'a str,
    dataset: &'a Path,
    model: &'a Model,
    cases: usize,
}

/// Each planner's figures, what it certified being judged again, its `result.json`, and the folder of its files.
fn all_planners<'a>(
    report: &mut Report,
    scale: Scale,
    population: &Population,
) -> anyhow::Result<BTreeMap<&'a str, (Value, PathBuf)>> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let Population {
        name,
        label,
        dataset,
        model,
        cases,
    } = *population;
    let mut results = BTreeMap::new();
    for planner in PLANNERS {
        let evaluation = evaluation(label, dataset, model, planner, cases);
        let result = evaluation.run(report, scale)?;
        let motions = Motions::read(&evaluation.out(), dataset)?;
        let row = if NULL_ARMS.contains(&planner) {
            corrected_row(&result, &motions)?
        } else {
            sampled_row(&result, &motions)?
        };
        let line = format!("{name}: {planner}");
        report.shown(&line, row);
        let judged = motions.judge(&robot, scale.pick(1, 4));
        judged.check(report, &line);
        results.insert(planner, (result, evaluation.out()));
    }
    Ok(results)
}

/// Success by the paper's criterion by the number of balls.
fn by_balls(report: &mut Report, name: &str, result: &Value) -> anyhow::Result<()> {
    let shares = result.pointer("/sampled/success_by_balls");
    let shares = shares.and_then(Value::as_object);
    let shares = shares.context("result.json has no success by number of balls")?;
    let mut shares: Vec<(usize, f64)> = shares
        .iter()
        .map(|(balls, share)| Ok((balls.parse()?, share.as_f64().context("no number")?)))
        .collect::<anyhow::Result<_>>()?;
    shares.sort_by_key(|(balls, _)| *balls);
    let shares = shares
        .iter()
        .map(|(balls, share)| format!("{balls}: {:.2} %", 100.0 * share));
    report.shown(
        &format!("{name}: {POST}, success by the paper's criterion, by number of balls"),
        shares.collect::<Vec<_>>().join(", "),
    );
    Ok(())
}

/// What a sampler drew, by the paper's criterion; times are of sampling alone.
fn sampled_row(result: &Value, motions: &Motions) -> anyhow::Result<String> {
    let success = number(result, "/sampled/success")?;
    let of_length = |figure_of: &str| {
        let path = format!("/sampled/tip_error_of_robot_length/{figure_of}");
        let error = figure(result, &path)?;
        Ok::<_, anyhow::Error>(error.map_or("-".to_owned(), |e| format!("{:.3}", 100.0 * e)))
    };
    let ms = 1e3 * number(result, "/sampled/seconds_per_candidate/median")?;
    Ok(format!(
        "success {:.2} % (any of ten {:.2} %), tip error where it succeeds {} % of the robot's length (p5 {}, p95 {}), {ms:.2} ms a candidate, {:.1} ms a success (paper {PAPER_MS} ms on an RTX 5090); {}",
        100.0 * success,
        100.0 * number(result, "/sampled/success_any")?,
        of_length("mean")?,
        of_length("p5")?,
        of_length("p95")?,
        ms / success,
        corrected_row(result, motions)?,
    ))
}

/// What is left of any planner's draws after the correction that all of them have.
fn corrected_row(result: &Value, motions: &Motions) -> anyhow::Result<String> {
    let (draws, share) = motions.of_those_drawn();
    Ok(format!(
        "corrected: success {:.2} %, certified {:.2} % ({:.2} % of the {draws} draws made), {:.2} ms a request in all",
        100.0 * number(result, "/sampled/success_corrected")?,
        100.0 * number(result, "/share_before_fallback")?,
        100.0 * share,
        1e3 * number(result, "/seconds/median")?,
    ))
}

/// What a planner changes of the pure sampler's mean tip error where paths succeed, beside what it changes in the paper.
pub(crate) fn tip_error_change(
    pure: &Value,
    other: &Value,
    paper: Option<f64>,
) -> anyhow::Result<String> {
    let path = "/sampled/tip_error_of_robot_length/mean";
    let [before, after] = [pure, other].map(|result| number(result, path));
    let change = percent_more(after?, before?);
    Ok(format!("{change:+.1} %{}", beside(paper)))
}

/// By how many percent `a` is larger than `b`.
fn percent_more(a: f64, b: f64) -> f64 {
    100.0 * (a / b - 1.0)
}

/// The paper's change, where it has one.
fn beside(paper: Option<f64>) -> String {
    paper.map_or(String::new(), |change| format!(" (paper {change:+.1} %)"))
}

/// Distinct end shapes among the ten certified candidates of a case, beside those of the case's paths in the data.
fn diversity(
    report: &mut Report,
    name: &str,
    dataset: &Path,
    cases: usize,
    outs: &[(&str, &Path)],
) -> anyhow::Result<()> {
    let data = mean(&modes_of_data(dataset, cases)?);
    // Cases without paths of their own have one row each.
    let beside = if data > 1.0 {
        format!(" (the data's: {data:.2})")
    } else {
        String::new()
    };
    for (planner, out) in outs {
        let found = modes_of_certified(out)?;
        ensure!(!found.is_empty(), "{} has no cases", out.display());
        let line = format!("{name}: {planner}, distinct certified terminal modes among ten");
        let figure = format!("{:.2} a case{beside}", mean(&found));
        report.shown(&line, figure);
    }
    Ok(())
}

fn mean(counts: &[usize]) -> f64 {
    counts.iter().sum::<usize>() as f64 / counts.len() as f64
}

fn modes_of_data(dataset: &Path, cases: usize) -> anyhow::Result<Vec<usize>> {
    let rows = Dataset::read(dataset)?.rows;
    let key = |row: &Row| (row.target_index, row.start_index);
    let mut groups: Vec<Vec<Configuration>> = Vec::new();
    let mut indices = BTreeMap::new();
    for row in rows.iter().filter(|row| row.split == Split::Test) {
        let index = *indices.entry(key(row)).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[index].extend(row.path.last());
    }
    groups.truncate(cases);
    Ok(groups.iter().map(|ends| modes(ends)).collect())
}

fn modes_of_certified(out: &Path) -> anyhow::Result<Vec<usize>> {
    let mut archive = ArchiveReader::open(&out.join("paths.npz"))?;
    let (certified, shape) = archive.read::<u8>("certified")?;
    let (paths, of_paths) = archive.read::<f64>("paths")?;
    let slots = usize::try_from(shape[1])?;
    let values = usize::try_from(of_paths[2] * of_paths[3])?;
    let case = |index: usize| {
        let known = (index * slots..(index + 1) * slots).filter(|slot| certified[*slot] == 1);
        let end =
            |slot: usize| Configuration::from_column_slice(&paths[(slot + 1) * values - 6..][..6]);
        modes(&known.map(end).collect::<Vec<_>>())
    };
    Ok((0..certified.len() / slots).map(case).collect())
}

/// Time of sampling alone, the mean over cases since it depends on the number of balls, of which the cases have all. The three samplers
/// run in turns, so that other load falls on all of them.
pub(crate) fn time_of_refinements(
    report: &mut Report,
    scale: Scale,
    unseen: &Unseen,
    paper: &Paper,
) -> anyhow::Result<()> {
    let (cases, rounds) = scale.pick((20, 2), (60, 3));
    let (name, model) = (unseen.name, unseen.model()?);
    let dataset = unseen.make(cases)?;
    let setting = format!("{name}-turns");
    let seconds = |planner| {
        let evaluation = evaluation(&setting, &dataset, &model, planner, cases);
        number(&evaluation.repeat()?, "/stage_seconds/sample/mean")
    };
    let [mut post, mut guided] = [Vec::new(), Vec::new()];
    for _ in 0..rounds {
        let pure = seconds(PURE)?;
        post.push(seconds(POST)? / pure);
        guided.push(seconds(GUIDED)? / pure);
    }
    let [post, guided] = [median(&post), median(&guided)];
    let line = |planner| {
        format!(
            "{name}: {planner}, mean time of sampling against {PURE}, {cases} cases, median of {rounds} turns"
        )
    };
    let text = |ratio, paper| format!("{:+.1} %{}", percent_more(ratio, 1.0), beside(Some(paper)));
    report.shown(&line(POST), text(post, paper.post_time));
    let bar = format!("<= {GUIDED_AT_MOST} times");
    let passed = guided <= GUIDED_AT_MOST;
    report.check(&line(GUIDED), text(guided, paper.guided_time), &bar, passed);
    Ok(())
}

fn success_against_updates(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let wanted = scale.pick(5, 250);
    let dataset = MIXED.make(wanted)?;
    let mut figures = Vec::new();
    for model in Model::all(&weights_folder(), "mixed")? {
        let setting = format!("updates-{}", model.updates);
        let evaluation = evaluation(&setting, &dataset, &model, POST, wanted);
        let result = evaluation.run(report, scale)?;
        let success = 100.0 * number(&result, "/sampled/success")?;
        figures.push(format!("{}: {success:.1} %", model.updates));
    }
    let line = format!("{POST}, {wanted} mixed cases: success by updates of all mixed weights");
    report.shown(&line, figures.join(", "));
    Ok(())
}

fn success_against_steps(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let (wanted, model) = (scale.pick(5, 250), MIXED.model()?);
    let dataset = MIXED.make(wanted)?;
    let mut best = 0.0_f64;
    let mut of_the_paper = 0.0;
    for solver in SOLVERS {
        let mut figures = Vec::new();
        for steps in STEPS {
            let evaluation = evaluation("steps", &dataset, &model, POST, wanted);
            let evaluation = evaluation.with("--steps", &steps).with("--solver", solver);
            let result = evaluation.run(report, scale)?;
            let success = 100.0 * number(&result, "/sampled/success")?;
            let ms = 1e3 * number(&result, "/sampled/seconds_per_candidate/median")?;
            figures.push(format!("{steps}: {success:.1} % in {ms:.1} ms"));
            best = best.max(success);
            if (solver, steps) == (SOLVERS[0], STEPS[STEPS.len() - 1]) {
                of_the_paper = success;
            }
        }
        let line = format!(
            "{POST}, {solver}, {wanted} mixed cases: success and time of a candidate by steps"
        );
        report.shown(&line, figures.join(", "));
    }
    let line = format!("{POST}, mixed: 50 DDIM steps, {}", model.text);
    let bar = format!(">= the best of all steps and solvers, {best:.1} %, - {STEPS_TOLERANCE}");
    let passed = of_the_paper >= best - STEPS_TOLERANCE;
    report.check(&line, format!("{of_the_paper:.1} %"), &bar, passed);
    Ok(())
}
