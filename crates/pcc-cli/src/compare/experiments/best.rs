//! The best candidate by each selection rule, of equally many candidates and of as many as equal time gives.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::averages::median;
use crate::bootstrap::interval;
use crate::cases_hash::hash_of;
use crate::compare::case_sets::CaseSet;
use crate::compare::charts::named_rows;
use crate::compare::figure_name::FigureName;
use crate::evaluate::{Asked, answer};
use crate::planner::Loaded;
use crate::sampler::{PlannerName, name_of};
use anyhow::Context;
use datasets::Case;
use pcc_model::Configuration;
use planning::{Candidate, MOST_CORRECTIONS, Selection, select};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Planners that answer in milliseconds.
const PLANNERS: [PlannerName; 5] = [
    PlannerName::Default,
    PlannerName::Fast,
    PlannerName::StraightDrawn,
    PlannerName::RrtConnect,
    PlannerName::RrtSmooth,
];
/// Candidates that are asked for, the equal number first.
const COUNTS: [usize; 6] = [10, 16, 24, 32, 48, 64];
/// Rules, and what each makes best.
const RULES: [(Selection, &str); 5] = [
    (Selection::ShortestTime, "Shortest duration, s"),
    (Selection::ShortestTipPath, "Shortest tip path ÷ distance"),
    (Selection::LargestClearance, "Largest clearance, L"),
    (Selection::Smoothest, "Smoothest tip path, ∫‖p‴‖²"),
    (
        Selection::NearestGoalConfiguration,
        "Nearest goal configuration, rad",
    ),
];

/// What a planner did with all cases, asked for so many candidates.
#[derive(Deserialize, Serialize)]
struct Measured {
    candidates: usize,
    /// Median time of a request, ms.
    request_ms: f64,
    /// By case, where it has a motion.
    best: Vec<Option<Best>>,
}

/// The figure of the best motion of a case by each rule; none of the clearance where there are no obstacles.
type Best = [Option<f64>; RULES.len()];

/// A planner with as many candidates as one of the two comparisons gives it.
struct Arm {
    name: String,
    best: Vec<Option<Best>>,
}

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let mut pictures = Vec::new();
    let mut told = Vec::new();
    for set in [&CaseSet::GENERAL, &CaseSet::HARD] {
        let cases = bench.cases(set, bench.arguments.cases())?;
        let (budget_ms, arms) = arms(bench, set, &cases)?;
        let solved = solved_by_all(&arms);
        told.push(format!(
            "{set}: {budget_ms:.2} ms a request, {} of {} cases",
            solved.len(),
            cases.len()
        ));
        for (rule, (_, title)) in RULES.into_iter().enumerate() {
            let chart = chart(title, rule, &arms, &cases, &solved)?;
            let picture = Picture::new(chart, format!("{set} cases"));
            pictures.push(if rule == 0 {
                picture.in_new_row()
            } else {
                picture
            });
        }
    }
    Ok(Figure {
        name: FigureName::Best,
        title: "The best candidate by each selection rule, at equal number and at equal time",
        pictures,
        caption: format!(
            "Medians over the cases that all of these planners solve, with 95 % intervals by the bootstrap over targets. × 10: equal number. The other row of a \
             planner has the most candidates, up to the 64 that a request may have, whose median request takes no longer than that of the slowest planner takes for ten ({}). Of \
             clearance more is better, of all others less. Every motion that an answer holds counts, those of <code>fast</code>'s exploring too.",
            told.join("; ")
        ),
        made_by: None,
    })
}

/// Every planner at equal number and at equal time, and what the time is, ms.
fn arms(bench: &Bench, set: &CaseSet, cases: &[Case]) -> anyhow::Result<(f64, Vec<Arm>)> {
    let measured = PLANNERS.map(|planner| measured(bench, planner, set, cases));
    let measured: Vec<Vec<Measured>> = measured.into_iter().collect::<anyhow::Result<_>>()?;
    let of_ten = measured.iter().filter_map(|it| it.first());
    let budget_ms = of_ten.map(|it| it.request_ms).fold(0.0, f64::max);
    let mut arms = Vec::new();
    for (planner, measured) in PLANNERS.into_iter().zip(measured) {
        let is_in_time = |it: &Measured| it.request_ms <= budget_ms;
        let most = measured.iter().rposition(is_in_time).unwrap_or(0);
        for (index, it) in measured.into_iter().enumerate() {
            if index == 0 || index == most {
                arms.push(Arm {
                    name: format!("{} × {}", name_of(&planner), it.candidates),
                    best: it.best,
                });
            }
        }
    }
    Ok((budget_ms, arms))
}

fn measured(
    bench: &Bench,
    name: PlannerName,
    set: &CaseSet,
    cases: &[Case],
) -> anyhow::Result<Vec<Measured>> {
    let loaded = bench.planner(name)?;
    let settings = json!({
        "cases": cases.len(), "cases_hash": hash_of(cases), "counts": COUNTS
    });
    let file = format!("best-{set}-{}", name_of(&name));
    bench.keep(&file, &loaded.records, &settings, || {
        let with = |candidates: &usize| of_all(bench, &loaded, name, *candidates, cases);
        COUNTS.iter().map(with).collect()
    })
}

fn of_all(
    bench: &Bench,
    loaded: &Loaded,
    planner: PlannerName,
    candidates: usize,
    cases: &[Case],
) -> anyhow::Result<Measured> {
    let asked = Asked {
        planner,
        candidates,
        corrections: MOST_CORRECTIONS,
    };
    let (mut best, mut times_ms) = (Vec::new(), Vec::new());
    for (index, case) in cases.iter().enumerate() {
        let seed = bench.arguments.seed.wrapping_add(index as u64);
        let answer = answer(&loaded.planner, asked, seed, case.clone(), None)?;
        times_ms.push(1e3 * answer.seconds);
        let plan = answer.plan.as_ref().ok();
        best.push(plan.and_then(|plan| best_of(&plan.candidates, &case.start)));
    }
    Ok(Measured {
        candidates,
        request_ms: median(times_ms.into_iter()).context("no cases")?,
        best,
    })
}

/// The best of some motions by each rule; none where there is no motion.
fn best_of(candidates: &[Candidate], start: &Configuration) -> Option<Best> {
    let mut best = [None; RULES.len()];
    for (figure, (rule, _)) in best.iter_mut().zip(RULES) {
        let candidate = &candidates[select(candidates, start, rule)?];
        let metrics = &candidate.metrics;
        let value = match rule {
            Selection::ShortestTipPath => metrics.tip_length / metrics.tip_distance,
            Selection::LargestClearance => metrics.clearance,
            Selection::Smoothest => metrics.tip_smoothness,
            Selection::NearestGoalConfiguration => (candidate.end() - start).norm(),
            Selection::ShortestTime | Selection::ByIndex => metrics.duration_s,
        };
        *figure = Some(value).filter(|it| it.is_finite());
    }
    Some(best)
}

/// Places of the cases in which every arm has a motion.
fn solved_by_all(arms: &[Arm]) -> Vec<usize> {
    let cases = arms.first().map_or(0, |arm| arm.best.len());
    let is_solved = |case: &usize| arms.iter().all(|arm| arm.best[*case].is_some());
    (0..cases).filter(is_solved).collect()
}

/// A rule's figure of every arm over the cases that all of them solve.
fn chart(
    title: &str,
    rule: usize,
    arms: &[Arm],
    cases: &[Case],
    solved: &[usize],
) -> anyhow::Result<String> {
    let row = |arm: &Arm| {
        let of_case = |case: &usize| Some((cases[*case].target_index, arm.best[*case]?[rule]?));
        let values: Vec<(i32, f64)> = solved.iter().filter_map(of_case).collect();
        let of_all = |values: &[&(i32, f64)]| median(values.iter().map(|it| it.1));
        interval(&values, |it| it.0, of_all)
    };
    let rows: Vec<_> = arms.iter().map(|it| (it.name.as_str(), row(it))).collect();
    named_rows(title, true, &rows)
}
