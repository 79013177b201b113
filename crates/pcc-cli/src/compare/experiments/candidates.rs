//! Time of a request against the number of its candidates.

use super::bench::Bench;
use super::figure::{Figure, Picture};
use crate::averages::median;
use crate::cases_hash::hash_of;
use crate::compare::case_sets::CaseSet;
use crate::compare::drawing::{Axis, COLOURS, Line, Lines};
use crate::compare::figure_name::FigureName;
use crate::evaluate::{Asked, answer};
use crate::sampler::{PlannerName, name_of};
use anyhow::Context;
use datasets::Case;
use planning::MOST_CORRECTIONS;
use serde_json::json;

const PLANNERS: [PlannerName; 7] = [
    PlannerName::Fast,
    PlannerName::Default,
    PlannerName::RrtConnect,
    PlannerName::DiffusionPost,
    PlannerName::CRrt,
    PlannerName::WRrtStar,
    PlannerName::Apf,
];
const COUNTS: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

pub(super) fn figure(bench: &Bench) -> anyhow::Result<Figure> {
    let cases = bench.scattered_cases(&CaseSet::REFERENCE, bench.scale(5, 40))?;
    let mut lines = Vec::new();
    for (planner, colour) in PLANNERS.into_iter().zip(COLOURS) {
        let points = medians(bench, planner, &cases)?;
        lines.push(Line::measured(&name_of(&planner), points, colour));
    }
    let chart = Lines {
        x: Axis::logarithmic("candidates, or attempts"),
        y: Axis::logarithmic("ms a request"),
        lines,
        marks: Vec::new(),
    };
    Ok(Figure {
        name: FigureName::Candidates,
        title: "Time against the number of candidates",
        pictures: vec![Picture::new(chart.svg()?, format!("medians over {} unseen mixed reference cases", cases.len()))],
        caption: "Whole requests, one at a time; of the rivals, until their attempts are made. Both axes are logarithmic.".to_owned(),
        made_by: None,
    })
}

/// Median time of a request for each number of candidates, ms.
fn medians(bench: &Bench, name: PlannerName, cases: &[Case]) -> anyhow::Result<Vec<(f64, f64)>> {
    let loaded = bench.planner(name)?;
    let settings = json!({
        "cases": cases.len(), "cases_hash": hash_of(cases), "counts": COUNTS
    });
    let file = format!("candidates-{}", name_of(&name));
    bench.keep(&file, &loaded.records, &settings, || {
        let mut points = Vec::new();
        for candidates in COUNTS {
            let asked = Asked {
                planner: name,
                candidates,
                corrections: MOST_CORRECTIONS,
            };
            let mut times_ms = Vec::new();
            for (index, case) in cases.iter().enumerate() {
                let seed = bench.arguments.seed.wrapping_add(index as u64);
                let answer = answer(&loaded.planner, asked, seed, case.clone(), None)?;
                times_ms.push(1e3 * answer.drawing_s);
            }
            let median_ms = median(times_ms.into_iter()).context("no cases")?;
            points.push((candidates as f64, median_ms));
        }
        Ok(points)
    })
}
