//! Success against the network's evaluations, and what the canonical frame, correction, data and size are worth.

use pcc_model::Robot;
use tests::programs::repository;

use crate::fast_cases::{Cases, GENERAL, HARD, REFERENCE, count};
use crate::report::Report;
use crate::runs::{Evaluation, Model, ablation_folder, number, weights_folder};
use crate::scale::Scale;
use crate::second_look::Judged;

const EVALUATIONS: [usize; 4] = [1, 2, 4, 8];
/// Attempts to correct a path: none, one, and one more with a larger margin.
const CORRECTIONS: [usize; 3] = [0, 1, 2];
/// All weights of the few-step model have names that begin so.
const PREFIX: &str = "fast";
/// What other weights are to show, and what their names have in them.
const WANTED: [(&str, &[&str]); 3] = [
    ("without the canonical frame", &["base", "frame"]),
    ("size of the training set", &["data", "fraction", "part"]),
    ("size of the model", &["width", "small", "large"]),
];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    for (group, option, values, what) in [
        (
            "success against evaluations",
            "--evaluations",
            &EVALUATIONS[..],
            "evaluations of the network",
        ),
        (
            "ablation of correction",
            "--corrections",
            &CORRECTIONS,
            "corrections",
        ),
    ] {
        let command = format!("pcc evaluate --planner fast {option} …");
        report.group(group, &command, |report| {
            for value in values {
                let line = format!("ablation: {value} {what}");
                variant(report, scale, &line, "fast", |evaluation| {
                    evaluation.with(option, value)
                })?;
            }
            Ok(())
        });
    }
    let command = "pcc evaluate --planner fast --model fast…";
    report.group("ablation of the model", command, |report| {
        models(report, scale)
    });
}

/// One line: a planner with one thing changed in every kind of scenes; and what it certified there is judged again.
fn variant(
    report: &mut Report,
    scale: Scale,
    line: &str,
    planner: &'static str,
    change: impl for<'a> Fn(Evaluation<'a>) -> Evaluation<'a>,
) -> anyhow::Result<()> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let (mut texts, mut judged) = (Vec::new(), Judged::default());
    for unseen in [REFERENCE, GENERAL, HARD] {
        let cases = Cases::unseen(&unseen, count(scale))?.first(scale.pick(20, 300));
        let evaluation = change(cases.evaluation(planner));
        let (result, motions) = cases.run(report, scale, &evaluation)?;
        judged.merge(motions.judge(&robot, scale.pick(1, 4)));
        texts.push(format!(
            "{} {:.2} % certified, tip length ÷ distance {:.3}, {:.2} ms",
            cases.name,
            100.0 * number(&result, "/share_before_fallback")?,
            number(&result, "/tip_length_ratio/median")?,
            1e3 * number(&result, "/seconds/median")?,
        ));
    }
    report.shown(line, texts.join("; "));
    judged.check(report, line);
    Ok(())
}

fn models(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut models = Model::all(&weights_folder(), PREFIX)?;
    models.extend(Model::all(&ablation_folder(), PREFIX)?);
    for model in &models {
        let line = format!("ablation: {}", model.text);
        variant(report, scale, &line, "fast", |evaluation| {
            evaluation.model(model)
        })?;
    }
    let line = "ablation: without a network, straight-drawn";
    variant(report, scale, line, "straight-drawn", |evaluation| {
        evaluation
    })?;
    for (what, words) in WANTED {
        let is_of_it = |model: &Model| words.iter().any(|word| model.name.contains(word));
        if !models.iter().any(is_of_it) {
            let line = format!("ablation: {what}");
            let words = words.join(" or ");
            let figure = format!("no weights {PREFIX}… with {words} in their name in a manifest");
            report.shown(&line, figure);
        }
    }
    Ok(())
}
