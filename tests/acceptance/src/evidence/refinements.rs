//! What post correction and guided prediction change of time and tip error, from identical noise, beside the paper's figures.

use anyhow::Context;
use datasets::ArchiveReader;
use planning::WAYPOINTS;

use crate::paper_ablation::{
    GUIDED, PAPER_FREE, PAPER_MIXED, POST, PURE, time_of_refinements, tip_error_change,
};
use crate::paper_runs::{FREE, MIXED, evaluation};
use crate::report::Report;
use crate::runs::{folder, run_pcc};
use crate::scale::Scale;

/// Seeds of which the noise is compared.
const SEEDS: [&str; 3] = ["0", "1", "7"];
/// A target among balls, section lengths.
const TARGET: [&str; 3] = ["1.2", "0.4", "2.3"];

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "pcc trace; pcc evaluate --planner diffusion|diffusion-post|diffusion-guided";
    report.group("the refinements", command, |report| {
        same_noise(report)?;
        for (unseen, paper) in [(FREE, PAPER_FREE), (MIXED, PAPER_MIXED)] {
            let (cases, model) = (scale.pick(20, 250), unseen.model()?);
            let dataset = unseen.make(cases)?;
            let evaluated = |planner| {
                evaluation(unseen.name, &dataset, &model, planner, cases).run(report, scale)
            };
            let (pure, post, guided) = (evaluated(PURE)?, evaluated(POST)?, evaluated(GUIDED)?);
            for (planner, result, paper) in [
                (POST, &post, Some(paper.post_tip_error)),
                (GUIDED, &guided, None),
            ] {
                let change = tip_error_change(&pure, result, paper)?;
                let line = format!(
                    "{}: {planner}, mean tip error of successful paths against {PURE}, {cases} cases",
                    unseen.name
                );
                report.shown(&line, change);
            }
            time_of_refinements(report, scale, &unseen, &paper)?;
        }
        Ok(())
    });
}

/// The three begin with the same noise where the seed is the same, and with other noise where it is not.
fn same_noise(report: &mut Report) -> anyhow::Result<()> {
    let mut noises = Vec::new();
    for seed in SEEDS {
        let of_seed = [PURE, POST, GUIDED].map(|planner| noise(planner, seed));
        let [pure, post, guided] = of_seed;
        noises.push([pure?, post?, guided?]);
    }
    let same = noises
        .iter()
        .filter(|[pure, post, guided]| pure == post && pure == guided);
    report.all_of(
        "seeds with which all three begin with the same noise, bit for bit",
        same.count(),
        SEEDS.len(),
    );
    let is_other = noises[0][0] != noises[1][0] && noises[1][0] != noises[2][0];
    report.check(
        "the noise of other seeds",
        if is_other { "another one" } else { "the same" }.to_owned(),
        "another one",
        is_other,
    );
    Ok(())
}

/// The path before the first evaluation of the network, as bits.
fn noise(planner: &str, seed: &str) -> anyhow::Result<Vec<u64>> {
    let out = folder().join(format!("noise-{planner}-{seed}.npz"));
    let file = out.to_str().context("path")?;
    let mut arguments = vec!["trace", "--planner", planner, "--seed", seed, "--out", file];
    arguments.push("--tip");
    arguments.extend(TARGET);
    arguments.extend(["--ball", "0.9", "-0.9", "1.8", "0.3"]);
    run_pcc(&arguments)?;
    let (paths, _) = ArchiveReader::open(&out)?.read::<f64>("paths")?;
    let first = paths.iter().take(WAYPOINTS * 6);
    Ok(first.map(|it| it.to_bits()).collect())
}
