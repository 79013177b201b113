//! All planners on unseen reference, general and hard cases.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::report::Report;
use crate::runs::{folder, number, run_pcc};
use crate::scale::Scale;

const COMMAND: &str = "pcc compare";
/// How `pcc compare` refuses to go on from records of other programs or weights, and from other cases.
const OTHER: [&str; 2] = ["is of another run", "was made with another recipe"];

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("comparison", COMMAND, |report| {
        for rival in ["straight-drawn", "rrt-smooth"] {
            let compared = compare(scale, rival)?;
            for set in compared["sets"].as_array().context("no sets")? {
                fast_beside(report, rival, set)?;
            }
        }
        let compared = compare(scale, "fast")?;
        for set in compared["sets"].as_array().context("no sets")? {
            show(report, scale, set)?;
        }
        Ok(())
    });
}

/// The comparison, on top of what the same programs made of it before, or anew where others did.
fn compare(scale: Scale, against: &str) -> anyhow::Result<Value> {
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

fn out(scale: Scale) -> PathBuf {
    folder().join(scale.pick("compare-quick", "compare"))
}

fn show(report: &mut Report, scale: Scale, set: &Value) -> anyhow::Result<()> {
    let name = set["set"].as_str().context("no name")?;
    let planners = set["planners"].as_array().context("no planners")?;
    let (cases, bar) = (number(set, "/cases")?, scale.pick(10.0, 250.0));
    let all = super::planners::planners().count();
    report.check(
        &format!("{name}: cases, and planners that answered them"),
        format!("{cases}, {}", planners.len()),
        &format!(">= {bar}, >= {all}"),
        cases >= bar && planners.len() >= all,
    );
    for planner in planners {
        let figure = |key: &str, scale: f64, digits: usize| {
            let of = |end: &str| {
                let value = planner.pointer(&format!("/all/{key}/{end}"));
                let value = value.and_then(Value::as_f64);
                value.map_or_else(|| "–".to_owned(), |it| format!("{:.digits$}", scale * it))
            };
            format!("{} [{}, {}]", of("value"), of("low"), of("high"))
        };
        report.shown(
            &format!("{name}: {}", planner["planner"].as_str().unwrap_or("?")),
            format!(
                "success {} %, certified {} %, {} ms a success, tip length ÷ distance {}, smoothness {}, {} s, {} modes",
                figure("success", 100.0, 1),
                figure("certified", 100.0, 1),
                figure("seconds_a_success", 1e3, 3),
                figure("tip_length_ratio", 1.0, 3),
                figure("tip_smoothness", 1.0, 1),
                figure("duration_s", 1.0, 2),
                figure("modes", 1.0, 1),
            ),
        );
    }
    Ok(())
}

/// The learned sampler beside a planner that has everything but the network, case by case.
fn fast_beside(report: &mut Report, rival: &str, set: &Value) -> anyhow::Result<()> {
    let name = set["set"].as_str().context("no name")?;
    let planners = set["planners"].as_array().context("no planners")?;
    let fast = planners.iter().find(|it| it["planner"] == "fast");
    let paired = &fast.context("no planner fast")?["paired"];
    let line = |what: &str| format!("{name}: fast beside {rival}: {what}");
    let percent = |key: &str| -> anyhow::Result<f64> {
        Ok(100.0 * number(paired, &format!("/{key}/value"))?)
    };
    let [shorter, smoother] = [percent("tip_shorter")?, percent("tip_smoother")?];
    let ahead = percent("certified_ahead")?;
    let (is_hard, is_drawn) = (name == "hard", rival == "straight-drawn");
    let mut share = |what: &str, percent: f64, has_bar: bool| {
        let (what, figure) = (line(what), format!("{percent:.1} %"));
        match has_bar {
            true => report.check(&what, figure, ">= 90 %", percent >= 90.0),
            false => report.shown(&what, figure),
        }
    };
    share(
        "tip shorter, of the cases that both solve",
        shorter,
        is_hard,
    );
    share(
        "tip smoother, of the cases that both solve",
        smoother,
        is_hard && is_drawn,
    );
    if !is_drawn {
        return Ok(());
    }
    let least = if is_hard { 8.0 } else { 0.0 };
    report.check(
        &line("certified"),
        format!("{ahead:+.2} points"),
        &format!(">= {least:+} points"),
        ahead >= least,
    );
    if !is_hard {
        let longest = number(paired, "/longest_tip")?;
        report.at_most(
            &line("tip length ÷ the other's, largest of all cases"),
            longest,
            1.01,
        );
        let mean = number(paired, "/tip_length_ratio/value")?;
        report.at_most(
            &line("tip length ÷ the other's, mean of all cases"),
            mean,
            1.0,
        );
    }
    Ok(())
}
